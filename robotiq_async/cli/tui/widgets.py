"""The parts of the monitor's screen, and its texts. They have no access to a hand."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Final

from rich.text import Text
from textual.widget import Widget
from textual.widgets import Static

from ...hands import Statistics
from ...tools.description.palette import AXIS_COLORS
from ...tools.recording.payloads import Properties
from ...tools.wording import AXIS_WORDS, STATE_WORDS, TRIGGER_WORDS, axis_name
from ...values import (
    NO_REQUEST,
    Fault,
    Finger,
    Inhibit,
    Model,
    ObjectStatus,
    RobotiqStatus,
    Severity,
    State,
    Trigger,
)

KEYS: Final = """\
o open  c close  1 wide  2 normal  3 pinch  SPACE halt  + - speed  ] [ force
a activate  r reset  l release  v recover  p position  m permit       q quit"""

HINTS: Final = {
    State.FAULT: "v recovers it",
    State.ATR_DONE: "r resets it",
    State.RESET: "a activates it",
}
"""The key that helps in a state."""
HISTORY: Final = 60
"""Currents kept, one per paint: five seconds."""
FULL: Final = 255
SMALL_MA: Final = 500
"""Minimum full scale of the currents, so that the noise of a motor at rest stays small."""
STILL: Final = 4
"""Paints without a change until an axis counts as at rest."""
LEVELS: Final = "▁▂▃▄▅▆▇█"
FIXED: Final = 47
"""Columns of a line that are neither bar nor sparkline."""
OPENING_WIDTH: Final = 9
"""Columns of the opening of a jaw."""
_STYLES: Final = {
    NO_REQUEST: "dim",
    ObjectStatus.IN_MOTION.name: "cyan",
    ObjectStatus.CONTACT_OPENING.name: "bold yellow",
    ObjectStatus.CONTACT_CLOSING.name: "bold yellow",
    ObjectStatus.AT_POSITION.name: "green",
}
_CALM: Final = (State.RUNNING_IDLE, State.RUNNING_CC)


class TextLine(Static):
    """A text of a fixed size. It is painted only after a change, because painting is expensive."""

    _text = Text()

    def show(self, text: Text) -> None:
        if text != self._text:
            self._text = text
            self.update(text, layout=False)


class Axes(Widget):
    """A line for each axis: position and request, object status, current now and in the last seconds.

    It is one widget: many small ones take five times as long to paint, and the event loop that paints is the
    one that polls.
    """

    def __init__(self, model: Model) -> None:
        super().__init__(id="axes")
        self._status = RobotiqStatus((0,) * 8, model=model)
        self._currents = {axis: deque([0] * HISTORY, maxlen=HISTORY) for axis in model.axes}
        self._still = dict.fromkeys(model.axes, STILL)
        """Number of paints since the position of an axis changed."""
        self._stale = False

    def show(self, status: RobotiqStatus, peaks_ma: Mapping[Finger, int]) -> None:
        """Show a status, and the highest currents since the last paint; -1 without a status."""
        for axis in status.model.axes:
            self._currents[axis].append(peaks_ma[axis])
            same = status.position(axis) == self._status.position(axis)
            self._still[axis] = self._still[axis] + 1 if same else 0
        self._status = status
        self.refresh()

    def show_stale(self, stale: bool) -> None:
        """Dim the lines while they are out of date."""
        if stale != self._stale:
            self._stale = stale
            self.refresh()

    def render(self) -> Text:
        # Bar and sparkline share the rest of the width.
        fixed = FIXED + OPENING_WIDTH * self._is_jaw
        bar = max((self.size.width - fixed) // 2, 8)
        where, current = (f"{words:{bar}.{bar}}" for words in ("is █, asked ▼", "current, 5 s"))
        opening = f"{self._status.stroke.source:>8} " if self._is_jaw else " "
        head = Text(f"axis     {where}   counts  {opening}{'':15} {current}      now", "dim")
        lines = [head, *(self._line(axis, bar) for axis in self._status.model.axes)]
        text = Text("\n", no_wrap=True, overflow="crop").join(lines)
        if self._stale:
            text.stylize("dim")
        return text

    def _line(self, axis: Finger, bar: int) -> Text:
        status, currents = self._status, self._currents[axis]
        position, requested = status.position(axis), status.requested_position(axis)
        line = Text(f"{axis_name(axis, status.model):8} ", "bold")
        line.append_text(position_bar(position, requested, bar, AXIS_COLORS[axis]))
        line.append(f" {position:3} → {requested:<3} ", "not bold")
        if self._is_jaw:
            line.append(f"{status.opening_mm(axis):5.1f} mm ", "bold")
        line.append_text(self._does(axis))
        line.append(f" {sparkline(list(currents), bar)} ", "cyan not bold")
        line.append(f"{max(currents[-1], 0):5} mA" if status.has_current else f"{'-':>8}", "not bold")
        return line

    @property
    def _is_jaw(self) -> bool:
        return len(self._status.model.axes) == 1

    def _does(self, axis: Finger) -> Text:
        state = self._status.axis_state(axis)
        if state == NO_REQUEST and self._still[axis] < STILL:
            # The gripper does not report the motion of an activation or of a release.
            state = ObjectStatus.IN_MOTION.name
        words = AXIS_WORDS[state].replace("contact while", "CONTACT")  # the column is narrow
        return Text(f"{words:15}", _STYLES[state])


def position_bar(position: int, requested: int, width: int, color: str = "blue") -> Text:
    """The position of an axis (the bar) and its requested position (the mark), in counts."""
    filled, mark = round(position / FULL * width), round(requested / FULL * (width - 1))
    cells = ["█"] * filled + ["·"] * (width - filled)
    cells[mark] = "▼"
    bar = Text("".join(cells), f"{color} not bold")
    bar.stylize("dim", filled)
    bar.stylize("bold magenta not dim", mark, mark + 1)
    return bar


def sparkline(values: Sequence[int], width: int) -> str:
    """Currents in mA as a line of bars, each the peak of its column; full scale is 0.5 A or the highest.

    The column of a missing current (-1) is empty.
    """
    count, top = len(values), max(SMALL_MA, *values)
    columns = min(width, count)
    peaks = (max(values[n * count // columns : (n + 1) * count // columns]) for n in range(columns))
    bars = (LEVELS[peak * (len(LEVELS) - 1) // top] if peak >= 0 else " " for peak in peaks)
    return "".join(bars).rjust(width)


def state_text(
    address: str, state: State, status: RobotiqStatus, age: float, inhibit: Inhibit | None = None
) -> Text:
    """Two lines: the state of the hand, and the fault of the gripper; ``age`` is in seconds."""
    lost = state is State.DISCONNECTED
    colours = "white on red" if lost else "black on green" if state in _CALM else "black on yellow"
    text = Text.assemble((f" {_short(state)} ", f"bold {colours}"))
    if lost:
        text.append(f"  no gripper answers: what you see is {age:.1f} s old")
    else:
        text.append("; ".join(filter(None, (f"  {_doing(state, status)}", HINTS.get(state)))))
    text.append(f"  {address}\n", "dim")
    fault = status.fault
    if inhibit is not None:
        text.append(f" {str(inhibit).upper()} ", "bold white on red")
        text.append("  m permits it  ", "bold")
    if fault is Fault.NONE:
        text.append("no fault", "dim")
    else:
        severe = "dim" if lost else "bold red" if fault.severity is Severity.MAJOR else "yellow"
        text.append(f"{fault.severity.value} fault 0x{int(fault):02X}: {fault.description}", severe)
    if status.controller_fault:
        text.append(f"; {status.controller_fault_text}", "dim" if lost else "bold red")
    return text


def _short(state: State) -> str:
    return STATE_WORDS[state].partition(":")[0].upper()


def _doing(state: State, status: RobotiqStatus) -> str:
    if state in (State.DO_ATR, State.WF_ATR) or status.fault is Fault.AUTOMATIC_RELEASE:
        return "releasing: the fingers OPEN"
    if status.is_activated:
        return f"active, {'moving' if status.is_moving else 'not moving'}"
    if status.is_reset:
        return "not active"
    return "activating: the fingers MOVE"


def link_text(figures: Statistics, rate: float, held_up: bool, speed: int, force: int) -> Text:
    """Two lines: polling statistics, and the speed and force of the next motion.

    ``rate`` is in polls a second; ``held_up`` is true after overruns since the last update.
    """
    jitter = 1000 * (figures.period_p99 - figures.period_p50)
    text = Text(f"{rate:.1f} Hz  jitter {jitter:.2f} ms  ", "dim")
    p50, p99 = 1000 * figures.round_trip_p50, 1000 * figures.round_trip_p99
    text.append(f"round trip {p50:.2f}/{p99:.2f} ms  ", "dim")
    text.append(f"overruns {figures.overruns}  ", "yellow" if held_up else "dim")
    text.append(f"reconnects {figures.reconnects}", "yellow" if figures.reconnects else "dim")
    text.append(f"\nspeed {speed:<3}  force {force:<3}", "bold")
    if figures.foreign_commands:
        times = figures.foreign_commands
        text.append(f"  ANOTHER CLIENT commands this gripper ({times} times)", "bold yellow")
    return text


def transition_words(event: Properties) -> str | None:
    """The new state and its cause; None if both states have the same description.

    That drops the transitions between sending a request and its acknowledgement.
    """
    before, after = (STATE_WORDS[State[event[end]]] for end in ("source", "target"))
    return None if before == after else f"{after} ({TRIGGER_WORDS[Trigger[event['trigger']]]})"
