"""Plots of measurements, as PNG and SVG. Needs the extra ``plot`` (matplotlib)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

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
from .campaigns import Currents, peak_currents

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OURS_COLOR: Final = "#0b6ea8"
THEIRS: Final = "#d1731f"
COLOURS: Final = tuple(AXIS_COLORS.values())
"""Colours of the fingers A, B and C, and of the scissor."""
SHOWN_FORCES: Final = (0, 125, 250)  # force values whose currents are drawn over time, or the nearest to them


def plot_speed(path: Path, table: RunsTable, label: str) -> list[Path]:
    """Plot closing time against speed value beside the thesis's curve, and the difference between the two.

    The path has no suffix; the table has the label. Returns the files written, as all plots do.
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


def _shown(currents: Currents) -> list[int]:
    nearest = {min(currents, key=lambda force: abs(force - usual)) for usual in SHOWN_FORCES}
    return sorted(nearest)


@contextmanager
def _figure(
    path: Path, title: str, rows: int = 1, ratios: tuple[float, ...] | None = None
) -> Iterator[tuple[list[Axes], list[Path]]]:
    """A figure with stacked axes, written at the end; the same data give the same bytes."""
    height = 4.6 if rows == 1 else 6.4 + 1.0 * (rows > 2) + 1.6 * (rows > 3)
    figure = new_figure(8, height)
    grid = figure.subplots(rows, 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": ratios})
    axes: list[Axes] = list(grid[:, 0])
    figure.suptitle(printable(title), parse_math=False)
    for each in axes:
        each.grid(alpha=0.3)
    files: list[Path] = []
    yield axes, files
    files.extend(write_figure(figure, path))


def new_figure(width: float, height: float) -> Figure:
    """An empty figure that is laid out when it is drawn; in inches."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def write_figure(figure: Figure, path: Path) -> list[Path]:
    """Write a figure as PNG and SVG, and return these; the same data give the same bytes."""
    files: list[Path] = []
    for suffix, options in (("png", {"dpi": 120}), ("svg", {"metadata": {"Date": None}})):
        target = path.with_name(f"{path.name}.{suffix}")
        with mpl.rc_context({"svg.hashsalt": "robotiq_async"}):
            figure.savefig(target, **options)
        figure.set_layout_engine("none")  # the next one is laid out alike
        files.append(target)
    return files
