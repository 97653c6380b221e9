"""Plots of measurements and recordings, as PNG and SVG. Needs the extra ``plot`` (matplotlib)."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

try:
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
except ModuleNotFoundError as error:
    from ...runtime import install

    raise ImportError(f"pictures need matplotlib: {install('plot')}") from error

from ...calibration import ForceCalibration, RunsTable, SpeedCalibration, mean, newton
from ...runtime import printable
from ..description.palette import AXIS_COLORS
from ..recording.payloads import is_command
from ..recording.table import CURRENT_COLUMN
from ..wording import JAW_NAME
from .campaigns import Currents, peak_currents

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..recording.recordings import RecordedMessage

OURS_COLOR: Final = "#0b6ea8"
THEIRS: Final = "#d1731f"
COLOURS: Final = tuple(AXIS_COLORS.values())
"""Colours of the fingers A, B and C, and of the scissor."""
LINE_WIDTHS: Final = {"A": 4.2, "B": 2.6, "C": 1.1, "SCISSOR": 1.4}  # line widths in the plot of a recording
DRAWN: Final = ("position", "requested_position", CURRENT_COLUMN)
LABEL_SIZE: Final = 0.012  # width of a label, as a share of the picture's
LONGEST_LABEL: Final = 40  # characters of a label
LETTER_SIZE: Final = 0.0092  # width of a character of a label, as a share of the picture's
ROW: Final = 0.17  # height of a row of labels, where that of the positions is 3
PLOT_ROWS: Final = 6  # of labels, at most; where they do not suffice, labels are cut
SHOWN_FORCES: Final = (0, 125, 250)  # force values whose currents are drawn over time, or the nearest to them

Event = tuple[float, str, bool]  # time, text, and whether it is about a fault


def plot_speed(path: Path, table: RunsTable, label: str) -> list[Path]:
    """Plot closing time against speed value beside the thesis's curve, and the difference between the two.

    The path has no suffix; the label is that of the table. Returns the files written, as all plots do.
    """
    thesis = SpeedCalibration.thesis()
    values = sorted(table)
    means = [mean(table[value]) / 1000 for value in values]
    with _figure(path, "Full closing, 235 counts", rows=2, ratios=(3, 1)) as (axes, files):
        times, apart = axes
        times.plot(*zip(*thesis.points, strict=True), color=THEIRS, lw=4, alpha=0.45, label=thesis.source)
        low = [mean_ - min(table[v]) / 1000 for v, mean_ in zip(values, means, strict=True)]
        high = [max(table[v]) / 1000 - mean_ for v, mean_ in zip(values, means, strict=True)]
        spread: Any = {"yerr": (low, high), "fmt": ".", "ms": 4, "lw": 1}
        times.errorbar(values, means, color=OURS_COLOR, label=f"{label}: mean and spread", **spread)
        times.set_ylabel("closing time, s")
        times.set_ylim(bottom=0)
        times.legend()
        off = [100 * (m / thesis.closing_time(v) - 1) for v, m in zip(values, means, strict=True)]
        apart.axhline(0, color=THEIRS, lw=1)
        apart.plot(values, off, ".", ms=4, color=OURS_COLOR)
        apart.set_ylabel("apart, %")
        apart.set_xlabel("speed value")
        reach = max(2.0, 1.1 * max(map(abs, off)))
        apart.set_ylim(-reach, reach)
    return files


def plot_force(path: Path, table: RunsTable, surface: str, label: str) -> list[Path]:
    """Plot force against force value, one point per run, beside the thesis's and the nominal figures."""
    with _figure(path, f"Force of a grasp, {surface}") as ((axes,), files):
        nominal, thesis = ForceCalibration.nominal(), ForceCalibration.thesis(surface)
        axes.plot(*zip(*nominal.points, strict=True), color="0.6", ls="--", label=nominal.source)
        name = f"{thesis.source}: mean"
        axes.plot(*zip(*thesis.points, strict=True), color=THEIRS, lw=3, alpha=0.5, label=name)
        values = sorted(table)
        for number, runs in enumerate(zip(*(table[value] for value in values), strict=True)):
            forces = [newton(reading) for reading in runs]
            name = "" if number else f"{label}: runs"
            axes.plot(values, forces, "o", ms=4, mfc="none", color=OURS_COLOR, label=name)
        axes.plot(values, [newton(mean(table[v])) for v in values], color=OURS_COLOR, label=f"{label}: mean")
        axes.set_xlabel("force value")
        axes.set_ylabel("force, N (F = m g, g = 9.81 m/s²)")
        axes.set_ylim(bottom=0)
        axes.legend()
    return files


def plot_peak_currents(path: Path, currents: Currents, surface: str, label: str) -> list[Path]:
    """Plot the highest current of each finger against the force value."""
    with _figure(path, f"Highest current of a grasp, {surface} ({label})") as ((axes,), files):
        values = sorted(currents)
        peaks = [peak_currents(currents[value]) for value in values]
        for (name, of_fingers), colour, marker in zip(_curves(peaks), COLOURS, "o^s", strict=False):
            axes.plot(values, of_fingers, color=colour, marker=marker, ms=5, mfc="none", label=name)
        axes.set_xlabel("force value")
        axes.set_ylabel("highest current, mA")
        axes.set_ylim(bottom=0)
        axes.legend()
    return files


def _curves(peaks: Iterable[tuple[int, ...]]) -> list[tuple[str, tuple[int, ...]]]:
    """Names and values. Identical fingers, such as the simulator's, would overlap: they share one curve."""
    alike: dict[tuple[int, ...], str] = {}
    for finger, of_finger in zip("ABC", zip(*peaks, strict=True), strict=True):
        alike[of_finger] = alike.get(of_finger, "") + finger
    return [
        (f"finger {names}" if len(names) == 1 else f"fingers {', '.join(names)}: the same", of_fingers)
        for of_fingers, names in alike.items()
    ]


def plot_current_over_time(path: Path, by_surface: Mapping[str, Currents], label: str) -> list[Path]:
    """Plot the current of finger A during the first grasp at some force values, one panel per surface."""
    with _figure(path, f"Current of finger A during a grasp ({label})", rows=len(by_surface)) as (
        axes,
        files,
    ):
        for each, (surface, currents) in zip(axes, by_surface.items(), strict=True):
            for force, colour in zip(_shown(currents), COLOURS, strict=False):
                run = currents[force][0]
                seconds = [sample[0] / 1000 for sample in run]
                milliampere = [sample[1] for sample in run]
                each.plot(seconds, milliampere, color=colour, lw=1.2, label=f"force {force}")
            each.set_title(surface, loc="left", fontsize=10)
            each.set_ylabel("current, mA")
            each.set_ylim(bottom=0)
            each.legend()
        axes[-1].set_xlabel("time since the command, s")
    return files


def plot_recording(
    path: Path, entries: Iterable[RecordedMessage], *, begin: float = 0.0, end: float = math.inf
) -> list[Path]:
    """Plot positions, currents, events and marks of a recording, its JSON messages, over time.

    Only the plotted values are kept in memory. Writes no files when there is no status to draw.

    Args:
        path: of the pictures, without suffix.
        entries: of the recording.
        begin: seconds from the first message on; earlier ones are not drawn.
        end: in the same seconds.
    """
    seconds = array("d")
    first: int | None = None
    events: list[Event] = []
    drawn = {axis: {what: array("f") for what in DRAWN} for axis in LINE_WIDTHS}
    openings = array("d")  # of a jaw

    def take(status: dict[str, Any]) -> None:
        for axis, columns in drawn.items():
            if axis != "A" and axis not in status:
                continue  # of a sibling of the 3-Finger, which has the one
            for what, column in columns.items():
                column.append(
                    status[axis].get(what, math.nan) if what == CURRENT_COLUMN else status[axis][what]
                )
        if "B" not in status and "opening_mm" in status["A"]:
            openings.append(status["A"]["opening_mm"])

    for entry in entries:
        first = entry.nanoseconds if first is None else first
        at = (entry.nanoseconds - first) / 1e9
        if not begin <= at <= end:
            continue
        if entry.topic == "/gripper/event" and (event := entry.read(_event)):
            events.append((at, *event))
        if entry.topic == "/gripper/status":
            entry.read(take)
            seconds.append(at)
    if not seconds:
        return []
    labels = list(_labels(events, apart=LABEL_SIZE * (seconds[-1] - seconds[0])))
    placed = _placed(labels, seconds[0], seconds[-1])
    height = ROW * max((each.row for each in placed), default=0) + ROW
    panels = 3 if len(openings) == len(seconds) else 2
    with _figure(path, path.name, rows=1 + panels, ratios=(height, *[3] * panels)) as (axes, files):
        strip, positions, *others, currents = axes
        for panel in others:
            panel.plot(seconds, openings, color=COLOURS[0], lw=1.6)
            panel.set_ylabel("opening, mm")
            panel.set_ylim(bottom=0)
        is_jaw = not drawn["B"]["position"]
        # Fingers that move together overlap: the first curve is the widest and shows at the sides.
        for (name, width), colour in zip(LINE_WIDTHS.items(), COLOURS, strict=True):
            line: Any = {"color": colour, "lw": width}
            dotted: Any = {"color": colour, "lw": 0.8, "ls": ":", "drawstyle": "steps"}
            if not drawn[name]["position"]:
                continue
            positions.plot(seconds, drawn[name]["position"], label=JAW_NAME if is_jaw else name, **line)
            positions.plot(seconds, drawn[name]["requested_position"], **dotted)
            currents.plot(seconds, drawn[name]["current_ma"], **line)
        positions.set_ylabel("position, counts\n(dotted: requested)")
        positions.set_ylim(-5, 260)
        positions.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
        currents.set_ylabel("current, mA")
        currents.set_ylim(bottom=0)
        currents.set_xlabel("time, s")
        _write_labels(strip, placed, seconds[0], seconds[-1])
        for when, _, is_fault in labels:
            for each in (positions, *others, currents):
                each.axvline(when, color=_colour(is_fault), lw=0.8, zorder=0)
    return files


class Label(NamedTuple):
    """A label in the strip above the curves.

    Attributes:
        at: its time in seconds.
        left: the beginning of the words, as a share of the width.
        row: from the bottom, from 0.
    """

    at: float
    left: float
    row: int
    words: str
    is_fault: bool


def _placed(labels: Iterable[Event], begin: float, end: float) -> list[Label]:
    """Each label in the lowest row where it has room. Without any, the one before it in a row is cut."""
    placed: list[Label] = []
    last: dict[int, Label] = {}  # of each row
    for at, words, is_fault in labels:
        share = (at - begin) / (end - begin) if end > begin else 0.0
        left = max(0.0, min(share, 1 - LETTER_SIZE * len(words)))
        row = next((n for n in range(PLOT_ROWS) if n not in last or _right(last[n]) <= left), None)
        if row is None:
            row = min(last, key=lambda n: last[n].left)
            cut = last[row]
            room = max(1, int((left - cut.left) / LETTER_SIZE) - 1)
            placed[placed.index(cut)] = cut._replace(words=cut.words[:room].rstrip(", ") + "…")
        last[row] = Label(at, left, row, words, is_fault)
        placed.append(last[row])
    return placed


def _right(label: Label) -> float:
    return label.left + LETTER_SIZE * (len(label.words) + 1)


def _write_labels(strip: Axes, labels: Iterable[Label], begin: float, end: float) -> None:
    strip.set_axis_off()
    top = max((each.row for each in labels), default=0) + 1
    strip.set_ylim(0, top)
    style: Any = {"fontsize": 7, "va": "bottom", "ha": "left", "parse_math": False}
    style["in_layout"] = False  # labels do not make the curves smaller
    for each in labels:
        colour = _colour(each.is_fault)
        strip.plot([each.at, each.at], [0, each.row + 0.1], color=colour, lw=0.8)
        where = begin + each.left * (end - begin)
        strip.annotate(each.words, (where, each.row + 0.1), color=colour, **style)


def _colour(is_fault: bool) -> str:
    return "crimson" if is_fault else "0.4"


def _event(fields: dict[str, Any]) -> tuple[str, bool] | None:
    if is_command(fields):
        return None
    is_fault = fields["kind"] == "fault"
    if fields["kind"] == "mark":
        return (_short(printable(fields["label"])) or "end of mark"), False
    if fields["kind"] == "inhibit":
        return ("inhibited" if fields["inhibited"] else "permitted"), fields["inhibited"]
    name = _short(printable(fields["fault"] if is_fault else fields["target"]))
    return "fault cleared" if name == "NONE" else name, is_fault


def _labels(events: Iterable[Event], apart: float) -> Iterator[Event]:
    began, words, is_fault = 0.0, "", False
    for at, name, of_a_fault in events:
        if words and at - began > apart:
            yield began, _short(words), is_fault
            words, is_fault = "", False
        began = began if words else at
        words += (", " if words else "") + name
        is_fault = is_fault or of_a_fault
    if words:
        yield began, _short(words), is_fault


def _short(words: str) -> str:
    return words if len(words) <= LONGEST_LABEL else f"{words[: LONGEST_LABEL - 3]}..."


def _shown(currents: Currents) -> list[int]:
    nearest = {min(currents, key=lambda force: abs(force - usual)) for usual in SHOWN_FORCES}
    return sorted(nearest)


@contextmanager
def _figure(
    path: Path, title: str, rows: int = 1, ratios: tuple[float, ...] | None = None
) -> Iterator[tuple[list[Axes], list[Path]]]:
    """A figure with stacked axes, written at the end; the same data give the same bytes."""
    height = 4.6 if rows == 1 else 6.4 + 1.0 * (rows > 2) + 1.6 * (rows > 3)
    figure = Figure(figsize=(8, height), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(rows, 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": ratios})
    axes: list[Axes] = list(grid[:, 0])
    figure.suptitle(printable(title), parse_math=False)
    for each in axes:
        each.grid(alpha=0.3)
    files: list[Path] = []
    yield axes, files
    for suffix, options in (("png", {"dpi": 120}), ("svg", {"metadata": {"Date": None}})):
        target = path.with_name(f"{path.name}.{suffix}")
        with mpl.rc_context({"svg.hashsalt": "robotiq_async"}):
            figure.savefig(target, **options)
        figure.set_layout_engine("none")  # the next one is laid out alike
        files.append(target)
