"""The controls of a hand: buttons, sliders and questions. The HALT button is in pages.py."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from time import monotonic
from typing import Any, Final

from nicegui import events, ui

from .....values import CLOSED, FORCE_MAX, OPEN, SPEED_MAX, Finger, names_of
from ....actions import ACTIONS, Action
from ....wording import JAW_NAME, inhibit_shown
from ..heartbeat import PRESS, PRESS_WITH_VALUE, Heartbeat
from ..mirror import HandMirror, PageMirror
from .allowed import why_not
from .words import COLORS, NAMES

ARMED_S: Final = 0.3
"""A yes counts only after this time: an earlier one was clicked before the question could be read."""
WIDTHS: Final = ("wide", "normal", "pinch")
"""Widths of the scissor."""
DIRECT: Final = ("open", "close", *WIDTHS)
ASKED: Final = tuple(name for name, action in ACTIONS.items() if action.warning)

ROWS: Final = (
    ("fingers", Finger.ABC, "inherit"),
    *((name, axis, color) for name, axis, color in zip(NAMES, Finger.ALL, COLORS, strict=True)),
)
"""Name, axes and colour: all fingers together, and each axis alone."""


class Slider(ui.slider):
    """Keeps its value in the browser: an answer of the server would move it back during a drag."""

    LOOPBACK = False


class Positions:
    """A row for each axis: its target, and the button that moves it there. A slider alone moves nothing.

    An untouched slider shows the position of its axis. ``pressed`` is called with name and arguments of the
    command, and the time that the browser sent back.
    """

    def __init__(self, hand: HandMirror, pressed: Callable[[str, dict[str, Any], object], None]) -> None:
        self._hand, self._pressed = hand, pressed
        self._sliders: dict[str, Slider] = {}
        self._titles: dict[str, ui.label] = {}
        self._rows: dict[str, tuple[ui.element, ...]] = {}
        self._targets: dict[str, object] = {}
        """The value at which each slider was released: the server knows its value a little later."""
        self._touched: set[str] = set()
        """Sliders that were moved and not sent yet."""
        self._is_placing = False
        self.buttons: list[ui.button] = []
        columns = "auto 1fr minmax(2rem, auto) auto"
        with ui.grid(columns=columns).classes("w-full items-center gap-x-3 gap-y-1"):
            for name, axes, color in ROWS:
                self._row(name, axes, color)
        self.show()

    def show(self) -> None:
        """Let untouched sliders follow their axes, so that sending them moves nothing."""
        status = self._hand.status
        if status is None:
            return
        for name, axes, _ in ROWS:
            is_there = axes in status.model.all_axes  # of a jaw the row of its one axis alone
            for element in self._rows[name]:
                if element.visible is not is_there:
                    element.set_visibility(is_there)
        if len(status.model.axes) == 1:
            self._titles[NAMES[0]].set_text(JAW_NAME)
        if status.is_moving:
            return
        self._is_placing = True
        for name, axes, _ in ROWS:
            axis = next(iter(axes))
            if name not in self._touched and axis in status.model.all_axes:
                self._targets[name] = place = status.position(axis)
                self._sliders[name].set_value(place)
        self._is_placing = False

    def _target_words(self, counts: float) -> str:
        status = self._hand.status
        if status is None or len(status.model.axes) > 1:
            return f"{counts:.0f}"
        return f"{counts:.0f} = {status.stroke.opening_mm(round(counts)):.0f} mm"

    def _row(self, name: str, axes: Finger, color: str) -> None:
        def touch() -> None:
            if not self._is_placing:
                self._touched.add(name)

        def let_go(event: events.GenericEventArguments) -> None:
            _, self._targets[name] = event.args
            self._touched.add(name)

        def send(event: events.GenericEventArguments) -> None:
            words = ",".join(names_of(axes))
            self._pressed("move", {"position": self._targets.get(name), "fingers": words}, event.args)
            self._touched.discard(name)

        title = ui.label(name).classes("font-bold rq-name").style(f"border-color:{color}")
        slider = Slider(min=OPEN, max=CLOSED, value=OPEN).props(f"data-testid=position-{name}")
        slider.on_value_change(touch)
        slider.on("change", let_go, js_handler=PRESS_WITH_VALUE)
        number = ui.label().bind_text_from(slider, "value", self._target_words)
        number.classes("text-right whitespace-nowrap")
        button = ui.button("move").props(f"dense no-caps data-testid=move-{name}").classes("px-3")
        self.buttons.append(button)
        button.props(f'title="{name} to this position: 0 is open, 255 closed"')
        button.on("click", send, js_handler=PRESS)
        self._sliders[name], self._titles[name] = slider, title
        self._rows[name] = title, slider, number, button


class Controls:
    """The controls; only a page that may command has them. ``report`` gets the outcome of each command."""

    def __init__(
        self,
        mirror: PageMirror,
        hand: HandMirror,
        page: str,
        heartbeat: Heartbeat,
        report: Callable[[str], None],
    ) -> None:
        self._mirror, self._hand, self._page = mirror, hand, page
        self._heartbeat, self._report = heartbeat, report
        self._dialogs: list[ui.dialog] = []
        self._asking: dict[str, Callable[[], None]] = {}
        self._pressable: dict[str, list[Slider | ui.button]] = {}
        self._why: dict[str, str] = {}
        with ui.row().classes("w-full gap-2"):
            buttons = {name: self._button(ACTIONS[name]) for name in DIRECT}
        self._widths = [buttons[name] for name in WIDTHS]
        self._reason = ui.label("").classes("text-sm").props("data-testid=why")
        self._positions = Positions(hand, self._pressed)
        self._pressable["move"] = [*self._positions.buttons]
        with ui.grid(columns="auto 1fr auto").classes("w-full items-center gap-x-3 gap-y-0"):
            self._slider("speed", SPEED_MAX, mirror.speed)
            self._slider("force", FORCE_MAX, mirror.force)
        with ui.row().classes("w-full gap-2"):
            for name in ASKED:
                self._question(ACTIONS[name])
        self._outcome = ui.label("").classes("text-sm").props("data-testid=outcome")

    def show(self) -> None:
        has_scissor = Finger.SCISSOR in self._hand.model.all_axes
        for button in self._widths:
            if button.visible is not has_scissor:
                button.set_visibility(has_scissor)
        self._positions.show()
        self._enable()

    def _enable(self) -> None:
        """Let the buttons follow the state, each with its reason."""
        is_quiet = self._mirror.is_quiet
        for name, elements in self._pressable.items():
            why = why_not(name, self._hand, is_quiet=is_quiet)
            if self._why.get(name) == why:
                continue
            self._why[name] = why
            for element in elements:
                element.set_enabled(not why)
                # A tip of the browser: a button that is disabled has no other.
                element.props(f'title="{escape(why)}"') if why else element.props(remove="title")
        self._reason.set_text(f"no motion: {self._why['open']}" if self._why["open"] else "")

    def ask(self, name: str) -> None:
        """Open the question of an action."""
        self._asking[name]()

    def halt(self) -> None:
        """Stop every axis, without a question and also after a late press. Closes open questions."""
        for dialog in self._dialogs:
            dialog.close()
        self._ask("halt", {}, at=monotonic())

    def _button(self, action: Action) -> ui.button:
        button = ui.button(action.name).props(f"data-testid={action.name} no-caps").classes("grow")
        self._pressable[action.name] = [button]
        button.on("click", lambda e: self._pressed(action.name, {}, e.args), js_handler=PRESS)
        return button

    def _question(self, action: Action) -> None:
        asked_at = 0.0
        confirmed: dict[str, Any] = {}

        def ask() -> None:
            nonlocal asked_at, confirmed
            asked_at, confirmed = monotonic(), {"confirm": True}
            if action.name == "permit":  # it lifts the halt that is shown, and no later halt
                if (seen := self._hand.inhibited) is None:
                    return
                confirmed["seen"] = seen.as_dict()
                about.set_text(inhibit_shown(seen))
            dialog.open()

        def yes(event: events.GenericEventArguments) -> None:
            if monotonic() - asked_at >= ARMED_S:
                dialog.close()
                self._pressed(action.name, confirmed, event.args)

        # At the top, as HALT stays above it at the foot of a small window.
        with ui.dialog().props("position=top") as dialog, ui.card():
            ui.label(f"{action.name.capitalize()}: {action.what}").classes("text-lg")
            about = ui.label("").props(f"data-testid=about-{action.name}")
            ui.label(action.warning).classes("rq-red")
            with ui.row().classes("w-full justify-end"):
                ui.button("no", on_click=dialog.close, color=None).props("flat no-caps")
                sure = ui.button(f"yes, {action.name}", color="negative").props("no-caps")
                sure.props(f"data-testid=yes-{action.name}").on("click", yes, js_handler=PRESS)
        self._dialogs.append(dialog)
        self._asking[action.name] = ask
        button = ui.button(f"{action.name}...", on_click=ask, color=None)
        self._pressable[action.name] = [button.props(f"outline no-caps data-testid={action.name}")]

    def _slider(self, what: str, highest: int, value: int) -> None:
        def change(event: events.GenericEventArguments) -> None:
            sent_back, value = event.args
            self._pressed(f"set_{what}", {"value": value}, sent_back)

        ui.label(what)
        slider = Slider(min=0, max=highest, value=value).props(f"data-testid={what}")
        self._pressable[what] = [slider]
        # Sent when the slider is released, and not for every value on the way.
        slider.on("change", change, js_handler=PRESS_WITH_VALUE)
        ui.label().bind_text_from(slider, "value", lambda each: f"{each:.0f}").classes("w-8 text-right")

    def _pressed(self, name: str, arguments: dict[str, Any], sent_back: object) -> None:
        self._ask(name, arguments, at=self._heartbeat.heard(sent_back))

    def _ask(self, name: str, arguments: dict[str, Any], *, at: float) -> None:
        self._outcome.set_text(f"{name} ...")

        def answered(ok: bool, words: str) -> None:
            if self._outcome.is_deleted:
                return
            self._outcome.set_text(f"{name}: {words}")
            self._outcome.classes(add="" if ok else "rq-red", remove="rq-red" if ok else "")
            self._report(f"{name}: {words}")

        self._mirror.ask(self._page, self._hand.index, name, arguments, answered, at=at)
