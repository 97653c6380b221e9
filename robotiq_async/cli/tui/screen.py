"""The screen of the monitor: shows a hand, and carries out keys. Needs the extra ``monitor`` (textual)."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Awaitable, Callable
from functools import partial
from typing import ClassVar, Final

from rich.text import Text
from textual import events
from textual.app import App, ComposeResult
from textual.binding import BindingType
from textual.widgets import RichLog, Static
from textual.worker import Worker

from ...runtime import now
from ...tools.actions import ACTIONS, Operator
from ...tools.recording.feed import Timeline
from ...tools.recording.payloads import title
from ...tools.wording import inhibit_shown, refusal_words
from ...values import Finger, RobotiqError, RobotiqStatus, State
from ..output.lines import clock, event_line
from .asking import Asking, Question, TargetQuestion
from .widgets import HINTS, KEYS, Axes, TextLine, link_text, state_text, transition_words

if sys.platform == "win32":
    DRIVER, NONBLOCKING = None, ()
else:
    from .nonblocking_driver import NonblockingDriver

    DRIVER, NONBLOCKING = NonblockingDriver, NonblockingDriver

FRAMES: Final = 12
"""Paints of the screen a second."""
FIGURES_S: Final = 0.5
"""Seconds between two updates of the polling statistics."""
SCREEN_BUFFER: Final = 400
"""Statuses kept for the next paint: two seconds."""
HALTING: Final = frozenset({"space", "h"})
"""Keys that halt, also during a question."""
KEY_STEP: Final = 16
"""Change of speed or force for one press of a key."""
LOG_LINES: Final = 2000


class Monitor(App[None]):
    """Shows the hand of an operator, who moves it by keys."""

    ENABLE_COMMAND_PALETTE = False
    ALLOW_SELECT = False  # Ctrl-C would copy the selection, and not quit.
    CSS = """
    #state, #link, #keys, #axes { padding: 0 1; text-wrap: nowrap; text-overflow: ellipsis; }
    #state, #link, #keys { height: 2; }
    #axes { height: 5; margin: 1 0; }
    #log { height: 1fr; border: round $surface-lighten-2; }
    /* A scroll bar that came later would lie on lines wrapped before. */
    #log { overflow-x: hidden; overflow-y: scroll; scrollbar-size-vertical: 1; }
    #keys { color: $text-muted; }
    Screen { layers: below above; }
    #question { layer: above; dock: bottom; width: 100%; height: auto; padding: 0 2; display: none; }
    #question { background: $surface; border: thick $warning; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        ("o", "act('open')", "open"),
        ("c", "act('close')", "close"),
        ("1", "act('wide')", "wide"),
        ("2", "act('normal')", "normal"),
        ("3", "act('pinch')", "pinch"),
        ("space,h", "act('halt')", "halt"),
        ("a", "act('activate')", "activate"),
        ("r", "act('reset')", "reset"),
        ("l", "act('release')", "release"),
        ("v", "act('recover')", "recover"),
        ("m", "permit", "permit"),
        ("p", "position", "position"),
        ("plus,equals_sign", f"speed({KEY_STEP})", "faster"),
        ("minus", f"speed(-{KEY_STEP})", "slower"),
        ("right_square_bracket", f"force({KEY_STEP})", "stronger"),
        ("left_square_bracket", f"force(-{KEY_STEP})", "weaker"),
        ("q,ctrl+c", "quit", "quit"),
    ]

    def __init__(self, operator: Operator) -> None:
        super().__init__(driver_class=DRIVER)
        self._operator = operator
        self._hand = operator.hand
        self._lines: deque[tuple[float, str, str]] = deque(maxlen=LOG_LINES)
        """Lines for the log at the next paint: time, text, style."""
        self._timeline = Timeline(operator.hand, SCREEN_BUFFER)
        self._newest = operator.hand.status
        # Kept here and not looked up: a paint may come while the screen is closing.
        self._top = TextLine(id="state")
        self._axes = Axes(operator.hand.model)
        self._figures = TextLine(id="link")
        self._question = Static(id="question")
        self.asking: Asking | None = None
        """The open question, which takes the keys."""
        self._history = RichLog(id="log", max_lines=LOG_LINES, min_width=1, wrap=True)
        self._overruns = 0
        self._polls = (now(), operator.hand.statistics.polls)

    def compose(self) -> ComposeResult:
        yield self._top
        yield self._axes
        yield self._figures
        self._history.can_focus = False  # It would take keys.
        yield self._history
        yield Static(KEYS, id="keys", markup=False)
        yield self._question

    def on_mount(self) -> None:
        self.write_log("Watching. Nothing has been written to the gripper.", "")
        self._look()
        self._paint_state()
        self._paint_figures()
        self.set_interval(1 / FRAMES, self._paint)
        self.set_interval(FIGURES_S, self._paint_figures)

    # -- painting -------------------------------------------------------------------------------------

    def write_log(self, text: str, style: str = "yellow", when: float | None = None) -> None:
        """Add a line to the log; ``when`` in seconds since 1970, None for now."""
        self._lines.append((time.time() if when is None else when, text, style))

    def _paint(self) -> None:
        driver = self._driver
        if isinstance(driver, NONBLOCKING) and driver.is_behind:
            if not driver.has_caught_up:
                return
            driver.paint_again()
            self.refresh(layout=True)
        self._look()
        for when, text, style in sorted(self._lines):
            self._history.write(Text(f"{clock(when)} {text}", style), expand=True)
        self._lines.clear()
        self._paint_state()

    def _look(self) -> None:
        peaks = dict.fromkeys(self._hand.model.axes, -1)
        for at, each in self._timeline.new():
            if isinstance(each, RobotiqStatus):
                self._newest = each
                peaks = {axis: max(peak, _milliampere(each, axis)) for axis, peak in peaks.items()}
            elif each["kind"] == "inhibit":
                self.write_log(event_line(each), "bold red" if each["inhibited"] else "bold", at)
            elif each["kind"] == "fault":
                self.write_log(event_line(each), "bold" if each["fault_code"] else "", at)
            elif words := transition_words(each):
                self.write_log(words, "", at)
        self._axes.show(self._newest, peaks)

    def _paint_state(self) -> None:
        state, age = self._hand.state, now() - self._newest.timestamp
        self._top.show(state_text(title(self._hand), state, self._newest, age, self._hand.inhibited))
        self._axes.show_stale(state is State.DISCONNECTED)

    def _paint_figures(self) -> None:
        figures, at = self._hand.statistics, now()
        before, polls = self._polls
        self._polls = (at, figures.polls)
        rate = (figures.polls - polls) / (at - before) if at > before else 0.0
        operator = self._operator
        held_up, self._overruns = figures.overruns > self._overruns, figures.overruns
        self._figures.show(link_text(figures, rate, held_up, operator.speed, operator.force))

    # -- keys -----------------------------------------------------------------------------------------

    async def on_event(self, event: events.Event) -> None:
        """Pass keys to the open question, except the keys that halt."""
        if isinstance(event, events.Key) and self.asking is not None and event.key not in HALTING:
            self.ask(None if self.asking.press(event.key) else self.asking)
        else:
            await super().on_event(event)

    def ask(self, asking: Asking | None) -> None:
        """Open a question above the log, or close it with None."""
        self.asking = asking
        if asking is not None:
            self._question.update(asking.text)
        self._question.display = asking is not None

    def action_act(self, name: str) -> None:
        """Carry out an action; a dangerous one only after a yes."""
        action = ACTIONS[name]
        begin = partial(self._begin, action.name, partial(self._operator.act, action))
        if action.warning:
            self.ask(Question(f"{action.name}: {action.what}?", action.warning, begin))
        else:
            begin()

    def action_permit(self) -> None:
        """Permit motion after a yes. It lifts the halt that the question shows, and no later halt."""
        action, seen = ACTIONS["permit"], self._hand.inhibited
        if seen is None:
            self.write_log("permit: motion is not inhibited", "bold")
            return
        begin = partial(self._begin, action.name, partial(self._operator.permit, seen))
        self.ask(Question(f"{action.name}: {action.what}?\n{inhibit_shown(seen)}", action.warning, begin))

    def action_position(self) -> None:
        """Ask for axes and a position, and move."""

        def begin(axes: Finger, position: int) -> None:
            self._begin(f"{axes} to {position}", partial(self._operator.move, position, axes))

        self.ask(TargetQuestion(self._hand.model, begin))

    def action_speed(self, by: int) -> None:
        self._begin("speed", partial(self._operator.change_speed, by))

    def action_force(self, by: int) -> None:
        self._begin("force", partial(self._operator.change_force, by))

    def _begin(self, name: str, work: Callable[[], Awaitable[str]]) -> None:
        # A function and not a coroutine: a coroutine that never runs causes a warning.
        async def carry_out() -> None:
            # Shown with the next paint: a held key would paint thirty times a second.
            try:
                self.write_log(f"{name}: {await work()}", "bold")
            except RobotiqError as error:
                self.write_log(f"{name}: {refusal_words(error, HINTS)}", "bold red")

        _: Worker[None] = self.run_worker(carry_out)


def _milliampere(status: RobotiqStatus, axis: Finger) -> int:
    """The current of an axis; -1 where the link does not carry it."""
    current = status.current_ma(axis)
    return -1 if current is None else current
