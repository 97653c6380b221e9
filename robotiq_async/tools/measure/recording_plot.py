"""Plots of recordings, side by side, as PNG and SVG. Needs the extra ``plot`` (matplotlib)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ...values import Finger
from ..description.palette import AXIS_COLORS
from ..recording.curves import AxisCurves, Event, RecordingCurves, envelope, merged, outline, short
from ..wording import JAW_NAME
from .plots import new_figure, write_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..recording.curves import Values

MOST_BESIDE: Final = 6  # recordings in one picture
WIDTH_ALONE: Final = 8.0  # inches of a picture of one recording
WIDTH_BESIDE: Final = 4.2  # inches of each of several
PIXELS: Final = 110  # columns of an inch, in which no more than an outline is drawn
CURRENT_PIXELS: Final = 16
"""The same for currents. They change with every poll, so each of these has their range and their mean."""
CURVE_COLORS: Final = {str(axis.name): color for axis, color in AXIS_COLORS.items()}
LINE_WIDTHS: Final = {"A": 2.0, "B": 1.3, "C": 0.7, "SCISSOR": 1.0}
"""Fingers that move together overlap: the first curve is the widest, and shows at the sides."""
JAW_WIDTH: Final = 1.2
SCISSOR: Final = str(Finger.SCISSOR.name)
OPENING_LABEL: Final = "opening, mm"
FAULT_COLOR: Final = "crimson"
FAULT_STYLE: Final[dict[str, Any]] = {"color": FAULT_COLOR, "alpha": 0.1, "lw": 0, "zorder": 0.4}
CONTACT: Final[dict[str, Any]] = {"alpha": 0.16, "lw": 0, "zorder": 0.5}
LANE: Final[dict[str, Any]] = {"alpha": 0.6, "lw": 0, "zorder": 0.5}
GAP: Final[dict[str, Any]] = {
    "facecolor": "0.95",
    "edgecolor": "0.75",
    "hatch": "////",
    "lw": 0,
    "zorder": 0.3,
}
REQUEST_STYLE: Final[dict[str, Any]] = {"color": "0.25", "lw": 0.8, "ls": (0, (3, 1.5)), "zorder": 2.5}
COUNT_TICKS: Final = (0, 50, 100, 150, 200, 255)
BESIDE: Final = 1.15  # inches of a recording beside its panels
LABEL_SIZE: Final = 0.08  # inches between two labels
LETTER: Final = 0.064  # inches of a character of a label
ROW_HEIGHT: Final = 0.17  # height of a row of labels, where the positions have 3
PLOT_ROWS: Final = 6  # of labels, at most; where they do not suffice, labels are cut


def plot_recordings(path: Path, recordings: Sequence[RecordingCurves]) -> list[Path]:
    """Draw recordings side by side, over the same times and in the same scales; returns the files written.

    Args:
        path: of the pictures, without suffix.
        recordings: 1..6 of them.

    Raises:
        OSError: a file cannot be written.
    """
    return write_figure(draw(recordings), path)


def draw(recordings: Sequence[RecordingCurves]) -> Figure:
    """The figure: for each recording its events, and below them openings, a scissor and currents."""
    begin, end = _span(recordings)
    inches = WIDTH_ALONE if len(recordings) == 1 else WIDTH_BESIDE
    inside = inches - BESIDE
    labels = [list(joined(each.events, LABEL_SIZE / inside * (end - begin))) for each in recordings]
    placed = [placed_labels(each, begin, end, LETTER / inside) for each in labels]
    rows = max((each.row + 1 for column in placed for each in column), default=0)
    panels = [panel for panel in PANELS if any(panel.axes_of(each) for each in recordings)]
    heights = [ROW_HEIGHT * max(rows, 1), *(panel.height for panel in panels)]
    figure = new_figure(inches * len(recordings), 1.3 + 0.8 * sum(heights))
    grid = figure.subplots(
        len(heights),
        len(recordings),
        sharex="col",
        squeeze=False,
        gridspec_kw={"height_ratios": heights},
    )
    for number, curves in enumerate(recordings):
        strip, *below = grid[:, number]
        strip.set_title(curves.title, fontsize=9, parse_math=False)
        _write_labels(strip, placed[number], begin, end, rows)
        _draw_column(below, panels, curves, labels[number], inches)
        strip.set_xlim(begin, end)
    for panel, line in zip(panels, grid[1:], strict=True):
        _same_scale([axes for axes in line if axes.get_visible()], panel)
    return figure


def _span(recordings: Sequence[RecordingCurves]) -> tuple[float, float]:
    """The time that all of them take together; at least a second, if they are of one moment."""
    begin = min(float(each.seconds[0]) for each in recordings)
    end = max(float(each.seconds[-1]) for each in recordings)
    return begin, end if end > begin else begin + 1.0


def _draw_column(
    below: Sequence[Axes],
    panels: Sequence[Panel],
    curves: RecordingCurves,
    labels: Sequence[Event],
    inches: float,
) -> None:
    """Draw the panels of one recording, each with the lines of its events."""
    for panel, axes in zip(panels, below, strict=True):
        _draw_panel(panel, axes, curves, inches)
        for when, _, is_fault in labels:
            axes.axvline(when, color=_color(is_fault), lw=0.6, alpha=0.7, zorder=0.6)
    *_, last = (axes for axes in below if axes.get_visible())
    last.set_xlabel("time, s", fontsize=9)
    last.tick_params(labelbottom=True)


class Panel(NamedTuple):
    """One row of the picture.

    Attributes:
        what: the curve of an axis: "position" or "current".
        is_of_scissor: whether it is of the scissor alone, which has no opening; None for all axes.
        height: in the units of the other rows.
    """

    what: str
    is_of_scissor: bool | None
    height: float

    def axes_of(self, curves: RecordingCurves) -> dict[str, AxisCurves]:
        """The axes that it draws of a recording."""
        axes = {
            name: each for name, each in curves.axes.items() if self.is_of_scissor in (None, name == SCISSOR)
        }
        if self.what == "current":  # some links carry no currents
            axes = {name: each for name, each in axes.items() if not np.isnan(each.current).all()}
        return axes


PANELS: Final = (Panel("position", False, 3.0), Panel("position", True, 1.2), Panel("current", None, 2.0))


def _draw_panel(panel: Panel, axes: Axes, curves: RecordingCurves, inches: float) -> None:
    drawn = panel.axes_of(curves)
    if not drawn:
        axes.set_visible(False)
        return
    axes.grid(alpha=0.25, lw=0.5)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_ylabel(_unit(panel, drawn), fontsize=9)
    _shade(panel, axes, curves, inches)
    draw_axis = _draw_current if panel.what == "current" else _draw_position
    for name, each in drawn.items():
        width = LINE_WIDTHS[name] if len(curves.axes) > 1 else JAW_WIDTH
        draw_axis(axes, curves.seconds, each, {"color": CURVE_COLORS[name], "lw": width}, inches)
    if axes.get_ylabel() == OPENING_LABEL:
        _add_counts(axes, next(iter(drawn.values())))
    if panel.is_of_scissor is not True:
        _add_legend(panel, axes, curves)


def _draw_position(
    axes: Axes, seconds: Values, each: AxisCurves, line: dict[str, Any], inches: float
) -> None:
    columns = round(inches * PIXELS)
    axes.plot(*outline(seconds, _in_mm(each, each.position), columns), **line)
    wanted = outline(seconds, _in_mm(each, each.requested), columns)
    axes.plot(*wanted, drawstyle="steps-post", **REQUEST_STYLE)


def _draw_current(axes: Axes, seconds: Values, each: AxisCurves, line: dict[str, Any], inches: float) -> None:
    columns = round(inches * CURRENT_PIXELS)
    line = line | {"lw": min(line["lw"], 1.0)}
    if len(seconds) <= 2 * columns:
        axes.plot(seconds, each.current, **line)
        return
    middle, low, mean, high = envelope(seconds, each.current, columns)
    axes.fill_between(middle, low, high, color=line["color"], alpha=0.25, lw=0)
    axes.plot(middle, mean, **line)


def _in_mm(axis: AxisCurves, counts: Values) -> Values:
    """Positions as openings; as they are where these are not known."""
    if not len(axis.mm):
        return counts
    return np.where(np.isnan(counts), np.nan, axis.mm[np.nan_to_num(counts).astype(int)])


def _unit(panel: Panel, drawn: dict[str, AxisCurves]) -> str:
    if panel.what == "current":
        return "current, mA"
    if panel.is_of_scissor:
        return "scissor, counts"
    return OPENING_LABEL if all(len(each.mm) for each in drawn.values()) else "position, counts"


def _add_counts(axes: Axes, axis: AxisCurves) -> None:
    """The counts beside the openings."""
    low, high = np.nanmin(axis.mm), np.nanmax(axis.mm)
    right = axes.secondary_yaxis("right")
    ticks = [each for each in COUNT_TICKS if each in (0, 255) or low < axis.mm[each] < high]
    right.set_yticks([axis.mm[each] for each in ticks], labels=[str(each) for each in ticks])
    right.tick_params(labelsize=7, colors="0.4")
    right.spines["right"].set_color("0.8")
    right.set_ylabel("counts", fontsize=8, color="0.4")


def _shade(panel: Panel, axes: Axes, curves: RecordingCurves, inches: float) -> None:
    """Contacts, faults and lost links. Of several fingers each has a lane at the bottom for its contacts."""
    pixel = float(curves.seconds[-1] - curves.seconds[0]) / (inches * PIXELS)
    is_jaw = len(curves.axes) == 1
    shaded = curves.axes if is_jaw or panel.what == "position" else {}
    for number, (name, each) in enumerate(panel.axes_of(curves).items()):
        lane: Any = CONTACT if is_jaw else LANE | {"ymin": 0.03 * number, "ymax": 0.03 * number + 0.025}
        for begin, end in merged(each.contacts, pixel) if name in shaded else ():
            axes.axvspan(begin, end, color=CURVE_COLORS[name], **lane)
    for begin, end in curves.faults:
        axes.axvspan(begin, end, **FAULT_STYLE)
    for begin, end in curves.gaps:
        axes.axvspan(begin, end, **GAP)


def _add_legend(panel: Panel, axes: Axes, curves: RecordingCurves) -> None:
    """Names above a panel; each shading is named once."""
    is_jaw = len(curves.axes) == 1
    if panel.what == "current":
        if not axes.collections:
            return
        handles: dict[str, Any] = {"mean": Line2D([], [], color="0.3", lw=1)}
        handles["range"] = Patch(color="0.3", alpha=0.25, lw=0)
    else:
        names = [JAW_NAME] if is_jaw else list(panel.axes_of(curves))
        handles = dict(zip(names, axes.lines[::2], strict=False))
        handles["request"] = Line2D([], [], **REQUEST_STYLE)
        if any(each.contacts for each in curves.axes.values()):
            shade = CONTACT | {"color": CURVE_COLORS["A"]} if is_jaw else LANE | {"color": "0.5"}
            handles["contact"] = Patch(**shade)
        handles |= {"fault": Patch(**FAULT_STYLE)} if curves.faults else {}
        handles |= {"no status": Patch(**GAP)} if curves.gaps else {}
    place: Any = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.1, "frameon": False}
    space: Any = {"ncols": 8, "handlelength": 1.6, "columnspacing": 1, "fontsize": 7}
    axes.legend(handles.values(), handles, **place, **space)


def _same_scale(axes: Sequence[Axes], panel: Panel) -> None:
    """The same limits for all panels of a row that have the same unit."""
    for unit in {each.get_ylabel() for each in axes}:
        alike = [each for each in axes if each.get_ylabel() == unit]
        top = max(each.get_ylim()[1] for each in alike)
        if unit.endswith("counts"):
            limits = (-5.0, 260.0)
        else:
            limits = (-0.05 * top if panel.what == "position" else 0.0, top)
        for each in alike:
            each.set_ylim(limits)


# -- labels ------------------------------------------------------------------------------------------------


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


def joined(events: Iterable[Event], apart: float) -> Iterator[Event]:
    """The events, as one where they are closer than this in seconds."""
    began, words, is_fault = 0.0, "", False
    for at, name, of_a_fault in events:
        if words and at - began > apart:
            yield Event(began, short(words), is_fault)
            words, is_fault = "", False
        began = began if words else at
        words += (", " if words else "") + name
        is_fault = is_fault or of_a_fault
    if words:
        yield Event(began, short(words), is_fault)


def placed_labels(labels: Iterable[Event], begin: float, end: float, letter: float) -> list[Label]:
    """Each label in the lowest row where it has room. Without any, the one before it in a row is cut.

    A character is as wide as ``letter``, a share of the width.
    """

    def right(label: Label) -> float:
        return label.left + letter * (len(label.words) + 1)

    placed: list[Label] = []
    last: dict[int, Label] = {}  # of each row
    for at, words, is_fault in labels:
        share = (at - begin) / (end - begin)
        left = max(0.0, min(share, 1 - letter * len(words)))
        row = next((n for n in range(PLOT_ROWS) if n not in last or right(last[n]) <= left), None)
        if row is None:
            row = min(last, key=lambda n: last[n].left)
            cut = last[row]
            room = max(1, int((left - cut.left) / letter) - 1)
            placed[placed.index(cut)] = cut._replace(words=cut.words[:room].rstrip(", ") + "…")
        last[row] = Label(at, left, row, words, is_fault)
        placed.append(last[row])
    return placed


def _write_labels(strip: Axes, labels: Iterable[Label], begin: float, end: float, rows: int) -> None:
    strip.set_axis_off()
    strip.set_ylim(0, max(rows, 1))
    style: Any = {"fontsize": 7, "va": "bottom", "ha": "left", "parse_math": False}
    style["in_layout"] = False  # labels do not make the curves smaller
    style["bbox"] = {"facecolor": "white", "edgecolor": "none", "pad": 0.4}  # no line of another through them
    for each in labels:
        color = _color(each.is_fault)
        strip.plot([each.at, each.at], [0, each.row + 0.1], color=color, lw=0.6)
        where = begin + each.left * (end - begin)
        strip.annotate(each.words, (where, each.row + 0.1), color=color, **style)


def _color(is_fault: bool) -> str:
    return FAULT_COLOR if is_fault else "0.4"
