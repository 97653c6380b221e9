"""The curves of a recording that a plot draws; nothing else of it is kept.

Needs numpy, which comes with matplotlib (extra ``plot``).
"""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Final, NamedTuple

try:
    import numpy as np
except ModuleNotFoundError as error:
    from ...runtime import install

    raise ImportError(f"pictures need matplotlib: {install('plot')}") from error

from ...runtime import printable
from ...values import MODELS, THREE_FINGER, Finger, Model
from ..description import hand_model
from .payloads import is_command
from .table import CURRENT_COLUMN

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .recordings import RecordedMessage

    Values = NDArray[np.float64]

AXES: Final = tuple(str(axis.name) for axis in THREE_FINGER.axes)
JAW_AXIS: Final = str(Finger.A.name)
LEAST_GAP_S: Final = 0.25
"""Statuses have a gap between them that are further apart, and by so many times their usual interval:"""
GAP_INTERVALS: Final = 10
NEAR_MM: Final = 5.0
"""A jaw with openings as near to a model's is of that model, if the recording does not name it."""
LONGEST_LABEL: Final = 40  # characters of a label
_NAMED: Final = re.compile(rb'<robot name="([^"]+)"')


class Span(NamedTuple):
    """A part of a recording, in its seconds."""

    begin: float
    end: float


class Event(NamedTuple):
    """A time at which something happened, and its name.

    Attributes:
        at: in the seconds of the recording.
    """

    at: float
    words: str
    is_fault: bool


@dataclass
class AxisCurves:
    """The curves of one axis: a value for each of :attr:`RecordingCurves.seconds`, NaN where it is not known.

    Attributes:
        position: counts.
        requested: counts.
        current: milliampere.
        mm: the opening at each position 0..255, in millimetres; empty where it is not known.
        contacts: when the axis was in contact.
    """

    position: Values
    requested: Values
    current: Values
    mm: Values
    contacts: list[Span]


@dataclass
class RecordingCurves:
    """The curves of a recording.

    Attributes:
        name: of the recording, for people.
        model: of its gripper, for people.
        began: its first message, in nanoseconds since 1970, from which the seconds count.
        seconds: the times of the statuses, the last one before a gap twice.
        axes: by name, in the order of the model.
        events: changes of state, faults, inhibits and marks.
        faults: when the gripper reported one.
        gaps: when no status came, as the link was lost.
    """

    name: str
    model: str
    began: int
    seconds: Values
    axes: dict[str, AxisCurves]
    events: list[Event]
    faults: list[Span]
    gaps: list[Span]

    @property
    def title(self) -> str:
        """Name, model and date in two lines."""
        date = datetime.fromtimestamp(self.began / 1e9, UTC)
        return f"{short(printable(self.name))}\n{self.model}, {date:%Y-%m-%d %H:%M:%S} UTC"


def read_curves(
    name: str, entries: Iterable[RecordedMessage], *, begin: float = 0.0, end: float = math.inf
) -> RecordingCurves | None:
    """Read the curves of a recording; None where it has no status.

    Args:
        name: of the recording, for people.
        entries: its messages.
        begin: seconds from the first message on; earlier ones are left out.
        end: in the same seconds.

    Raises:
        RecordingError: a message does not have a recorder's format.
    """
    reading = _PartialCurves()
    first: int | None = None
    for entry in entries:
        first = entry.nanoseconds if first is None else first
        at = (entry.nanoseconds - first) / 1e9
        if entry.topic == "/robot_description" and (found := _NAMED.search(entry.data)):
            reading.note_description(found[1].decode(errors="replace"))
        if not entry.is_json or not begin <= at <= end:
            continue
        if entry.topic == "/gripper/event" and (event := entry.read(_event)):
            reading.events.append(Event(at, *event))
        if entry.topic == "/gripper/status":
            entry.read(lambda fields: reading.take(at, fields))  # noqa: B023  # at once
    if first is None or not reading.seconds:
        return None
    return reading.curves(name, first)


@dataclass
class _PartialCurves:
    """The part that has been read so far."""

    description: str = ""
    seconds: array[float] = field(default_factory=lambda: array("d"))
    columns: dict[tuple[str, str], array[float]] = field(default_factory=dict)
    openings: dict[str, dict[int, float]] = field(default_factory=dict)  # of an axis, by position
    events: list[Event] = field(default_factory=list)
    has_fault: array[int] = field(default_factory=lambda: array("b"))

    def note_description(self, name: str) -> None:
        """The recording describes a gripper of this name."""
        self.description = name

    def take(self, at: float, status: dict[str, Any]) -> None:
        for axis in AXES:
            if axis != JAW_AXIS and axis not in status:
                continue  # of a sibling of the 3-Finger, which has the one
            values = status[axis]
            position = values["position"]
            self._append(axis, "position", position)
            self._append(axis, "requested", values["requested_position"])
            self._append(axis, "current", values.get(CURRENT_COLUMN, math.nan))
            self._append(axis, "contact", axis in status.get("contacts", ()))
            if "opening_mm" in values:
                self.openings.setdefault(axis, {})[position] = values["opening_mm"]
        self.has_fault.append(bool(status.get("fault_code", 0)))
        self.seconds.append(at)

    def _append(self, axis: str, what: str, value: float) -> None:
        self.columns.setdefault((axis, what), array("f")).append(value)

    def curves(self, name: str, began: int) -> RecordingCurves:
        seconds = np.array(self.seconds)
        before = _gaps(seconds)  # the index of the status after each gap
        seconds_with = np.insert(seconds, before, seconds[before - 1])
        model = self._model()

        def column(axis: str, what: str) -> Values:
            return np.insert(np.array(self.columns[axis, what], float), before, math.nan)

        def spans(values: Values) -> list[Span]:
            return _spans(seconds_with, np.nan_to_num(values) > 0)

        axes = {
            axis: AxisCurves(
                column(axis, "position"),
                column(axis, "requested"),
                column(axis, "current"),
                _millimetres(model, self.openings.get(axis, {})),
                spans(column(axis, "contact")),
            )
            for axis in AXES
            if (axis, "position") in self.columns
        }
        faults = spans(np.insert(np.array(self.has_fault, float), before, math.nan))
        gaps = [Span(float(seconds[each - 1]), float(seconds[each])) for each in before]
        title = "gripper" if model is None else model.title
        return RecordingCurves(name, title, began, seconds_with, axes, self.events, faults, gaps)

    def _model(self) -> Model | None:
        """The model that the recording's description names, or to which its openings belong."""
        if "B" in self.openings or any(axis == "B" for axis, _ in self.columns):
            return THREE_FINGER
        named = {hand_model(each).name: each for each in MODELS.values()}
        if self.description in named:
            return named[self.description]
        seen = self.openings.get(JAW_AXIS)
        if not seen:
            return None

        def apart(model: Model) -> float:
            return max(abs(model.stroke.openings[position] - mm) for position, mm in seen.items())

        nearest = min((each for each in MODELS.values() if each is not THREE_FINGER), key=apart)
        return nearest if apart(nearest) < NEAR_MM else None


def _millimetres(model: Model | None, seen: dict[int, float]) -> Values:
    """The opening at each position: the model's, moved to the recorded ones, which may be measured."""
    if model is None or not seen:
        return np.empty(0)
    nominal: Values = np.array(model.stroke.openings)
    positions = np.array(sorted(seen))
    off = np.array([seen[each] for each in positions]) - nominal[positions]
    moved: Values = nominal + np.interp(np.arange(256), positions, off)
    return moved


def _gaps(seconds: Values) -> NDArray[np.intp]:
    """The numbers of the statuses before which there is a gap."""
    apart = np.diff(seconds)
    least = max(LEAST_GAP_S, GAP_INTERVALS * float(np.median(apart))) if len(apart) else LEAST_GAP_S
    return np.flatnonzero(apart > least) + 1


def _spans(seconds: Values, is_so: NDArray[np.bool_]) -> list[Span]:
    """From the first status of which it is so to the first of which it is not, or to a gap."""
    edges = np.diff(np.concatenate(([False], is_so, [False])).astype(int))
    begins, ends = np.flatnonzero(edges > 0), np.minimum(np.flatnonzero(edges < 0), len(seconds) - 1)
    return [Span(float(seconds[one]), float(seconds[other])) for one, other in zip(begins, ends, strict=True)]


def merged(spans: Sequence[Span], apart: float) -> list[Span]:
    """The spans, as one where they are closer than this in seconds: a contact may flicker."""
    whole: list[Span] = []
    for each in spans:
        if whole and each.begin - whole[-1].end < apart:
            whole[-1] = Span(whole[-1].begin, each.end)
        else:
            whole.append(each)
    return whole


def outline(seconds: Values, values: Values, columns: int) -> tuple[Values, Values]:
    """The same curve to the eye, with at most five points in each column of its width.

    These are the first, least, greatest and last value of a column, and one of a gap.
    """
    if len(seconds) <= 5 * columns:
        return seconds, values
    kept: set[int] = set()
    for chunk in _columns(seconds, columns):
        inside = values[chunk]
        known = np.flatnonzero(~np.isnan(inside))
        kept.update(chunk.start + np.flatnonzero(np.isnan(inside))[:1])
        if len(known):
            low, high = known[np.argmin(inside[known])], known[np.argmax(inside[known])]
            kept.update(chunk.start + np.array([known[0], low, high, known[-1]]))
    numbers = np.array(sorted(kept))
    return seconds[numbers], values[numbers]


def envelope(seconds: Values, values: Values, columns: int) -> tuple[Values, Values, Values, Values]:
    """The time, least, mean and greatest value of each column of its width; NaN where there is a gap."""
    rows = []
    for chunk in _columns(seconds, columns):
        inside = values[chunk]
        middle = (seconds[chunk.start] + seconds[chunk.stop - 1]) / 2
        if np.isnan(inside).any():
            rows.append((middle, math.nan, math.nan, math.nan))
        else:
            rows.append((middle, inside.min(), inside.mean(), inside.max()))
    middle, low, mean, high = np.array(rows).T
    return middle, low, mean, high


def _columns(seconds: Values, columns: int) -> list[slice]:
    """The numbers of the values in each column that has any."""
    whole = max(float(seconds[-1] - seconds[0]), 1e-9)
    numbers = np.minimum((seconds - seconds[0]) / whole * columns, columns - 1).astype(int)
    begins = np.flatnonzero(np.diff(numbers, prepend=-1))
    return [slice(int(a), int(b)) for a, b in zip(begins, [*begins[1:], len(seconds)], strict=True)]


def _event(fields: dict[str, Any]) -> tuple[str, bool] | None:
    if is_command(fields):
        return None
    is_fault = fields["kind"] == "fault"
    if fields["kind"] == "mark":
        return (short(printable(fields["label"])) or "end of mark"), False
    if fields["kind"] == "inhibit":
        return ("inhibited" if fields["inhibited"] else "permitted"), fields["inhibited"]
    name = short(printable(fields["fault"] if is_fault else fields["target"]))
    return "fault cleared" if name == "NONE" else name, is_fault


def short(words: str) -> str:
    """The words, cut where they are longer than a label."""
    return words if len(words) <= LONGEST_LABEL else f"{words[: LONGEST_LABEL - 3]}..."
