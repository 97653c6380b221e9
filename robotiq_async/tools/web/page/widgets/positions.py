"""Moves each axis to a position of its own. A slider alone moves nothing: the button beside it does."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from nicegui import events, ui

from .....values.enums import CLOSED, OPEN, Finger, names_of
from ..heartbeat import PRESS, PRESS_WITH_VALUE
from ..mirror import HandMirror
from .words import COLORS, NAMES

ROWS: Final = (
    ("fingers", Finger.ABC, "inherit"),
    *((name, axis, color) for name, axis, color in zip(NAMES, Finger.ALL, COLORS, strict=True)),
)
"""Name, axes and colour: all fingers together, and each axis alone."""


class Slider(ui.slider):
    """Keeps its value in the browser: an answer of the server would move it back during a drag."""

    LOOPBACK = False


class Positions:
    """A row for each axis: its target, and the button that moves it there.

    Args:
        hand: the hand; an untouched slider shows the position of its axis.
        pressed: called with name and arguments of the command, and the time that the browser sent back.
    """

    def __init__(self, hand: HandMirror, pressed: Callable[[str, dict[str, Any], object], None]) -> None:
        self._hand, self._pressed = hand, pressed
        self._sliders: dict[str, Slider] = {}
        self._rows: dict[str, tuple[ui.element, ...]] = {}
        self._targets: dict[str, object] = {}
        """The value at which each slider was released: the server knows its value a little later."""
        self._touched: set[str] = set()
        """Sliders that were moved and not sent yet."""
        self._is_placing = False
        with ui.grid(columns="auto 1fr 2rem auto").classes("w-full items-center gap-x-3 gap-y-1"):
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
        if status.is_moving:
            return
        self._is_placing = True
        for name, axes, _ in ROWS:
            axis = next(iter(axes))
            if name not in self._touched and axis in status.model.all_axes:
                self._targets[name] = place = status.position(axis)
                self._sliders[name].set_value(place)
        self._is_placing = False

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

        title = ui.label(name).classes("font-bold").style(f"color:{color}")
        slider = Slider(min=OPEN, max=CLOSED, value=OPEN).props(f"data-testid=position-{name}")
        slider.on_value_change(touch)
        slider.on("change", let_go, js_handler=PRESS_WITH_VALUE)
        number = ui.label().bind_text_from(slider, "value", lambda each: f"{each:.0f}").classes("text-right")
        button = ui.button("move").props(f"dense no-caps data-testid=move-{name}").classes("px-3")
        button.tooltip(f"{name} to this position: 0 is open, 255 closed")
        button.on("click", send, js_handler=PRESS)
        self._sliders[name] = slider
        self._rows[name] = title, slider, number, button
