"""Pictures of the measurements, from the recording and the figures of a report. Needs the extra ``plot``."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Final

try:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
except ModuleNotFoundError as error:
    from ...runtime import install

    raise ImportError(f"pictures need matplotlib: {install('plot')}") from error

from ...values import CLOSED, THREE_FINGER, Finger, Model, ObjectStatus, Request, RobotiqStatus, model_of
from ..recording.feed import COMMAND, EVENT, STATUS
from ..recording.recordings import read_recording
from .catalogue import STAGE
from .report import Report

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FAR: Final = 10  # counts that make a motion: more than an axis ends beside its request
BEFORE_S: Final = 0.05
PICTURE_AFTER_S: Final = 0.4
"""Seconds drawn after the request of one axis: longer than a hand waits for an object status (0.25 s)."""


@dataclass
class Segment:
    """The recording of a stage, each entry with its time in seconds."""

    stage: int
    began: float
    statuses: list[tuple[float, RobotiqStatus]] = field(default_factory=list)
    commands: list[tuple[float, Request]] = field(default_factory=list)


def segments(path: Path, stages: tuple[int, ...]) -> list[Segment]:
    """Some stages of a recording, in their order."""
    found: list[Segment] = []
    model = THREE_FINGER
    for entry in read_recording(path):
        seconds = entry.nanoseconds / 1e9
        if entry.topic == EVENT.name:
            fields = json.loads(entry.data)
            target = str(fields.get("target", ""))
            if target.startswith(STAGE):
                model = model_of(fields.get("model"))
                found.append(Segment(int(target.removeprefix(STAGE)), seconds))
        elif found and found[-1].stage in stages:
            registers = tuple(json.loads(entry.data)["registers"])
            if entry.topic == STATUS.name:
                status = RobotiqStatus.from_registers(registers, timestamp=seconds, model=model)
                found[-1].statuses.append((seconds, status))
            elif entry.topic == COMMAND.name:
                found[-1].commands.append((seconds, Request.from_registers(registers, model)))
    return [segment for segment in found if segment.stage in stages]


Draw = Callable[[tuple["Axes", ...], Segment], bool]


def draw(folder: Path, recording: Path, report: Report) -> tuple[str, ...]:
    """Draw the measurements of the run; return the names of the files."""
    drawn: list[str] = []
    for segment in segments(recording, tuple(PICTURES)):
        name, title, rows, curve = PICTURES[segment.stage]
        figure, axes = _figure(title, rows)
        if segment.statuses and curve(axes, segment):
            axes[-1].set_xlabel("s")
            figure.savefig(folder / name, dpi=110)
            drawn.append(name)
    if "read.round_trip" in report.checks:
        figure, (axis,) = _figure("Round trips of reads (stage 1)", 1)
        if _round_trips(axis, report.checks["read.round_trip"].figures):
            figure.savefig(folder / "round_trips.png", dpi=110)
            drawn.append("round_trips.png")
    return tuple(sorted(set(drawn)))


def _figure(title: str, rows: int) -> tuple[Figure, tuple[Axes, ...]]:
    figure = Figure(figsize=(8, 2 + 2.2 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title)
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    for axis in axes:
        axis.grid(alpha=0.3)
    return figure, tuple(axes)


def _round_trips(axis: Axes, figures: Mapping[str, object]) -> bool:
    named = {name: value for name, value in figures.items() if name.endswith("_histogram")}
    for name, histogram in named.items():
        assert isinstance(histogram, list)
        label = name.removesuffix("_histogram").replace("_", " ")
        axis.step([each[0] for each in histogram], [each[1] for each in histogram], where="mid", label=label)
    axis.set_xlabel("ms")
    axis.set_ylabel("reads")
    axis.set_yscale("log")
    axis.legend(title="a read")
    return bool(named)


def _activation(axes: tuple[Axes, ...], segment: Segment) -> bool:
    states, positions = axes
    began = segment.began
    times = [seconds - began for seconds, _ in segment.statuses]
    shown = [status for _, status in segment.statuses]
    for name, values in {
        "gACT": [int(status.activation_echo) for status in shown],
        "gIMC": [int(status.initialization) for status in shown],
        "gFLT": [int(status.fault) for status in shown],
    }.items():
        states.step(times, values, where="post", label=name)
    states.legend()
    for axis in shown[0].model.axes:
        positions.plot(times, [status.position(axis) for status in shown], lw=1, label=axis.name)
    positions.set_ylabel("position, counts")
    positions.legend()
    return True


def _echo(axes: tuple[Axes, ...], segment: Segment) -> bool:
    found = _motion_from_rest(segment)
    if found is None:
        return False
    sent, finger = found
    near = [(s - sent, status) for s, status in segment.statuses if -BEFORE_S <= s - sent <= PICTURE_AFTER_S]
    times, shown = [seconds for seconds, _ in near], [status for _, status in near]
    name = "S" if finger is Finger.SCISSOR else finger.name
    echo, words = axes
    echo.step(
        times, [status.requested_position(finger) for status in shown], where="post", label=f"gPR{name}"
    )
    echo.plot(times, [status.position(finger) for status in shown], ".-", label=f"gPO{name}")
    echo.set_ylabel("counts")
    words.step(
        times, [int(status.finger_status(finger)) for status in shown], where="post", label=f"gDT{name}"
    )
    words.set_yticks([0, 1, 2, 3], ["0 moves", "1 opening", "2 closing", "3 at position"])
    for axis in axes:
        axis.axvline(0, color="0.5", lw=1, label="written")
        axis.legend()
    return True


def _motion_from_rest(segment: Segment) -> tuple[float, Finger] | None:
    """The time at which a motion was written, and its axis: the first with a gDT of rest before.

    Only in such a motion the lag of gDT is visible. After an activation every gDT is 0, as in a motion.
    """
    fallback = None
    for sent, request in segment.commands:
        before = [status for seconds, status in segment.statuses if seconds < sent][-1:]
        for status in before if request.go else []:
            for axis in status.model.axes:
                if abs(request.position(axis) - status.position(axis)) > FAR:
                    if status.go_echo and status.finger_status(axis) is ObjectStatus.AT_POSITION:
                        return sent, axis
                    fallback = fallback or (sent, axis)
    return fallback


def _fingers(model: Model) -> list[Finger]:
    return [axis for axis in model.axes if axis in Finger.ABC]


def _strokes(axes: tuple[Axes, ...], segment: Segment) -> bool:
    (axis,) = axes
    found = list(_closings(segment))
    if not found:
        return False
    for began, until, request in found:
        inside = [
            (seconds - began, status) for seconds, status in segment.statuses if began <= seconds < until
        ]
        means = [fmean(status.position(each) for each in _fingers(status.model)) for _, status in inside]
        axis.plot([seconds for seconds, _ in inside], means, label=f"speed {request.axes[0].speed}")
    axis.set_ylabel("mean position of the fingers")
    axis.legend()
    return True


def _closings(segment: Segment) -> Iterator[tuple[float, float, Request]]:
    ends = [seconds for seconds, _ in segment.commands[1:]] + [segment.statuses[-1][0]]
    for (seconds, request), end in zip(segment.commands, ends, strict=True):
        if request.go and all(request.position(each) == CLOSED for each in _fingers(request.model)):
            yield seconds, end, request


PICTURES: Final[dict[int, tuple[str, str, int, Draw]]] = {
    3: ("activation.png", "The activation, state by state (stage 3)", 2, _activation),
    4: ("echo.png", "Echo, position and object status of one motion (stage 4)", 2, _echo),
    6: ("strokes.png", "Closing at three speeds (stage 6)", 1, _strokes),
}
"""File, title, rows and drawing function by stage."""
