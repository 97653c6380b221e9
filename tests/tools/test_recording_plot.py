"""Plots of recordings: the data that are drawn, and words that hide nothing."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex, to_rgba
from matplotlib.figure import Figure

from robotiq_async import Finger
from robotiq_async.tools.description.palette import AXIS_COLORS
from robotiq_async.tools.description.transforms import encode_description
from robotiq_async.tools.measure.recording_plot import (
    FAULT_COLOR,
    GAP,
    PIXELS,
    PLOT_ROWS,
    ROW_HEIGHT,
    WIDTH_ALONE,
    draw,
    placed_labels,
    plot_recordings,
)
from robotiq_async.tools.recording.curves import (
    LONGEST_LABEL,
    Event,
    RecordingCurves,
    Span,
    envelope,
    merged,
    outline,
    read_curves,
)
from robotiq_async.tools.recording.recordings import RecordedMessage
from robotiq_async.values.model import HAND_E, THREE_FINGER, TWO_FINGER_85, TWO_FINGER_140, Model

BEGAN = 1_790_000_000 * 10**9
LONG = "X" * 2 * LONGEST_LABEL
JAW_COLOR = AXIS_COLORS[Finger.A]
LETTER = 0.01


def axis(position: int, requested: int, current: int | None, model: Model | None) -> dict[str, Any]:
    """One axis of a status; without a model it has no opening, as the scissor."""
    fields: dict[str, Any] = {"position": position, "requested_position": requested}
    if current is not None:
        fields["current_ma"] = current
    return fields if model is None else fields | {"opening_mm": model.stroke.openings[position]}


def jaw(
    position: int = 3,
    requested: int = 0,
    current: int | None = 0,
    *,
    contacts: tuple[str, ...] = (),
    fault: int = 0,
    model: Model | None = TWO_FINGER_85,
) -> dict[str, Any]:
    return {
        "A": axis(position, requested, current, model),
        "contacts": list(contacts),
        "fault_code": fault,
    }


def fingers(position: int = 6, contacts: tuple[str, ...] = (), current: int = 0) -> dict[str, Any]:
    each = {name: axis(position, 0, current, THREE_FINGER) for name in "ABC"}
    return {**each, "SCISSOR": axis(137, 140, current, None), "contacts": list(contacts)}


def message(at: float, fields: dict[str, Any], topic: str = "status") -> RecordedMessage:
    return RecordedMessage(
        f"/gripper/{topic}", BEGAN + round(at * 1e9), 0, json.dumps(fields).encode(), is_json=True
    )


def event(at: float, target: str) -> RecordedMessage:
    return message(at, {"kind": "state", "target": target}, "event")


def description(model: Model) -> RecordedMessage:
    return RecordedMessage("/robot_description", BEGAN, 0, encode_description(model), is_json=False)


def curves(entries: Iterable[RecordedMessage], name: str = "it.mcap", **part: float) -> RecordingCurves:
    found = read_curves(name, entries, **part)
    assert found is not None
    return found


def streaming(count: int = 6000, model: Model = TWO_FINGER_85) -> list[RecordedMessage]:
    """200 Hz of a jaw that streams: its current is shown in two polls of five."""
    wave = [round(110 - 100 * math.cos(n / 400)) for n in range(count)]
    return [
        message(n / 200, jaw(position, position + 2, 100 if n % 5 < 2 else 0, model=model))
        for n, position in enumerate(wave)
    ]


def panels(figure: Figure) -> dict[str, Axes]:
    """The panels that are shown, by what they show."""
    return {each.get_ylabel(): each for each in figure.axes if each.get_visible() and each.get_ylabel()}


def shades(axes: Axes, color: str) -> list[tuple[float, float]]:
    return [
        (round(patch.get_x(), 3), round(patch.get_x() + patch.get_width(), 3))  # type: ignore[attr-defined]
        for patch in axes.patches
        if to_hex(patch.get_facecolor()) == to_hex(color)
    ]


# -- what is read ------------------------------------------------------------------------------------------


def test_an_empty_recording_has_no_curves() -> None:
    assert read_curves("it", []) is None
    assert read_curves("it", [event(0, "READY"), description(HAND_E)]) is None
    assert read_curves("it", [message(0, jaw())], begin=1) is None


@pytest.mark.parametrize("model", [TWO_FINGER_85, TWO_FINGER_140, HAND_E])
def test_the_title_has_the_model_and_the_date(model: Model) -> None:
    """The description says the model; a recording without one shows it by its openings."""
    seen = message(0, jaw(100, model=model))
    for entries in ([description(model), seen], [seen]):
        assert curves(entries).title == f"it.mcap\n{model.title}, 2026-09-21 14:13:20 UTC"
    assert "3-Finger" in curves([message(0, fingers())]).title
    assert "gripper, 2026" in curves([message(0, jaw(model=None))]).title


def test_openings_that_were_measured_are_those_that_are_drawn() -> None:
    """Also at a position that was requested, and that the jaw never had."""
    status = jaw(50, 200)
    status["A"]["opening_mm"] += 2.5
    mm = curves([description(TWO_FINGER_85), message(0, status)]).axes["A"].mm
    nominal = TWO_FINGER_85.stroke.openings
    assert mm[50] == pytest.approx(nominal[50] + 2.5)
    assert mm[200] == pytest.approx(nominal[200] + 2.5)


def test_contacts_faults_and_gaps_are_spans() -> None:
    holds, stuck = jaw(contacts=("A",)), jaw(fault=9)
    statuses = [jaw(), holds, holds, jaw(), stuck, stuck, jaw(), holds]
    entries = [message(n / 10, each) for n, each in enumerate(statuses)]
    entries += [message(5 + n / 10, jaw()) for n in range(3)]
    found = curves(entries)
    assert found.axes["A"].contacts == [Span(0.1, 0.3), Span(0.7, 0.7)]
    assert found.faults == [Span(0.4, 0.6)]
    assert found.gaps == [Span(0.7, 5.0)]
    assert np.isnan(found.axes["A"].position).sum() == 1
    assert merged([Span(0, 1), Span(1.1, 2), Span(4, 5)], 0.2) == [Span(0, 2), Span(4, 5)]


def test_a_slow_recording_has_no_gaps_between_its_polls() -> None:
    assert curves([message(n, jaw()) for n in range(20)]).gaps == []


# -- fewer points than samples -----------------------------------------------------------------------------


def test_an_outline_keeps_each_peak_and_few_points() -> None:
    seconds = np.arange(100_000) / 200
    values = np.zeros(100_000)
    values[[1234, 70_007]] = 255, -3
    values[50_000] = np.nan
    times, kept = outline(seconds, values, 800)
    assert len(times) <= 5 * 800
    assert set(times[kept == 255]) == {seconds[1234]}
    assert set(times[kept == -3]) == {seconds[70_007]}
    assert np.isnan(kept).any(), "a gap stays one"
    assert list(times) == sorted(times)
    assert (times[0], times[-1]) == (seconds[0], seconds[-1])
    assert outline(seconds[:50], values[:50], 800)[1] is not kept


def test_an_envelope_has_the_least_mean_and_greatest_of_each_column() -> None:
    seconds = np.arange(1000) / 200
    values = np.where(np.arange(1000) % 5 < 2, 100.0, 0.0)
    values[500] = np.nan
    middle, low, mean, high = envelope(seconds, values, 20)
    assert len(middle) == 20
    whole = ~np.isnan(mean)
    assert whole.sum() == 19
    assert set(low[whole]) == {0}
    assert set(high[whole]) == {100}
    assert np.allclose(mean[whole], 40, atol=3)


# -- what is drawn -----------------------------------------------------------------------------------------


def test_a_jaw_that_streams_is_drawn_in_mm_and_its_current_as_an_envelope() -> None:
    figure = draw([curves(streaming())])
    shown = panels(figure)
    assert list(shown) == ["opening, mm", "current, mA"]
    moved, request = shown["opening, mm"].lines[:2]
    assert to_hex(moved.get_color()) == JAW_COLOR
    assert len(moved.get_xdata()) <= 5 * WIDTH_ALONE * PIXELS  # type: ignore[arg-type]
    widest = np.nanmax(np.asarray(moved.get_ydata()))
    assert widest == TWO_FINGER_85.stroke.openings[10]
    assert np.nanmax(np.asarray(request.get_ydata())) == TWO_FINGER_85.stroke.openings[12]
    assert request.get_linestyle() == "--"
    assert all(line.get_linewidth() < 1.5 for line in shown["opening, mm"].lines)
    (area,) = shown["current, mA"].collections
    assert isinstance(area, PolyCollection)
    assert np.asarray(area.get_paths()[0].vertices)[:, 1].max() == 100
    mean = np.asarray(shown["current, mA"].lines[0].get_ydata())
    assert len(mean) < 200
    assert np.allclose(mean, 40, atol=5)
    (counts,) = shown["opening, mm"].child_axes
    assert counts.get_ylabel() == "counts"
    names = [each.get_text() for each in counts.get_yticklabels()]
    assert dict(zip(names, counts.get_yticks(), strict=True))["100"] == TWO_FINGER_85.stroke.openings[100]


def test_a_few_polls_are_drawn_as_they_are() -> None:
    shown = panels(draw([curves(streaming(100))]))
    assert not shown["current, mA"].collections
    assert list(np.asarray(shown["current, mA"].lines[0].get_ydata())[:5]) == [100, 100, 0, 0, 0]
    assert draw([curves(streaming(1))]).axes, "one status is a picture, too"


def test_contacts_faults_and_lost_links_are_shaded() -> None:
    entries = [message(n / 10, jaw(contacts=("A",) if 5 <= n < 20 else ())) for n in range(30)]
    entries += [message(6 + n / 10, jaw(fault=9 if 5 <= n < 9 else 0)) for n in range(30)]
    for axes in panels(draw([curves(entries)])).values():
        assert shades(axes, JAW_COLOR) == [(0.5, 2.0)]
        assert shades(axes, FAULT_COLOR) == [(6.5, 6.9)]
        (gap,) = [patch for patch in axes.patches if patch.get_hatch()]
        assert to_rgba(gap.get_facecolor()) == to_rgba(GAP["facecolor"])
        assert (gap.get_x(), round(gap.get_width(), 3)) == (2.9, 3.1)  # type: ignore[attr-defined]


def test_fingers_have_their_colors_a_panel_of_the_scissor_and_lanes_of_contacts() -> None:
    entries = [message(n / 10, fingers(6 + n, ("B",) if n > 5 else ())) for n in range(10)]
    shown = panels(draw([curves(entries)]))
    assert list(shown) == ["opening, mm", "scissor, counts", "current, mA"]
    lines, scissor = shown["opening, mm"].lines, shown["scissor, counts"].lines
    colors = [to_hex(each.get_color()) for each in (*lines[:6:2], scissor[0])]
    assert colors == list(AXIS_COLORS.values())
    assert set(np.asarray(scissor[1].get_ydata())) == {140}
    widths = [each.get_linewidth() for each in lines[:6:2]]
    assert widths == sorted(widths, reverse=True), "those that overlap show at the sides"
    lane = shades(shown["opening, mm"], AXIS_COLORS[Finger.B])
    assert lane == [(0.6, 0.9)]
    assert not shades(shown["current, mA"], AXIS_COLORS[Finger.B])
    legend = shown["opening, mm"].get_legend()
    assert legend is not None
    assert [each.get_text() for each in legend.get_texts()] == ["A", "B", "C", "request", "contact"]


def test_without_openings_and_current_there_are_counts() -> None:
    """Over a URCap, or of an earlier version."""
    shown = panels(draw([curves([message(n, jaw(90, current=None, model=None)) for n in range(3)])]))
    assert list(shown) == ["position, counts"]
    assert set(np.asarray(shown["position, counts"].lines[0].get_ydata())) == {90}
    assert shown["position, counts"].get_xlabel() == "time, s"


def test_several_stand_side_by_side_in_the_same_scales() -> None:
    short, long = curves(streaming(400), "a.mcap"), curves(streaming(1000, HAND_E), "b.mcap")
    figure = draw([short, long, curves([message(0, fingers()), message(1, fingers())], "c.mcap")])
    titles = [each.get_title() for each in figure.axes if each.get_title()]
    assert [each.splitlines()[0] for each in titles] == ["a.mcap", "b.mcap", "c.mcap"]
    assert [each.splitlines()[1].partition(",")[0] for each in titles] == ["2F-85", "Hand-E", "3-Finger"]
    openings = [each for each in figure.axes if each.get_ylabel() == "opening, mm"]
    assert len(openings) == 3
    assert len({each.get_ylim() for each in openings}) == 1
    assert {each.get_xlim() for each in openings} == {(0.0, 999 / 200)}
    shown = [each for each in figure.axes if each.get_ylabel() == "scissor, counts"]
    assert len(shown) == 1, "a jaw has no scissor"
    assert openings[0].get_position().y0 == openings[2].get_position().y0


def test_the_same_recording_makes_the_same_files(tmp_path: Path) -> None:
    one, other = (plot_recordings(tmp_path / name, [curves(streaming(50))]) for name in ("one", "other"))
    assert [each.suffix for each in one] == [".png", ".svg"]
    for before, after in zip(one, other, strict=True):
        assert before.read_bytes() == after.read_bytes()


# -- words -------------------------------------------------------------------------------------------------


def words(picture: Path) -> list[str]:
    """The words in a picture; matplotlib draws glyphs, and puts the words into comments."""
    return re.findall(r"<!-- (.+?) -->", picture.read_text(encoding="utf-8"))


def test_events_are_written_above_the_curves(tmp_path: Path) -> None:
    entries = [message(0, fingers()), event(1, "FIRST"), event(3, LONG), message(4, fingers())]
    entries.insert(2, message(2, {"kind": "mark", "label": "SECOND", "values": {}}, "event"))
    _, picture = plot_recordings(tmp_path / "it", [curves(entries)])
    text = picture.read_text(encoding="utf-8")
    places = [text.index(f'id="{each}"') for each in ("axes_1", "axes_2", "axes_3")]
    for name in ("FIRST", "SECOND", LONG[: LONGEST_LABEL - 3] + "..."):
        assert places[0] < text.index(f"<!-- {name} -->") < places[1], "not above the positions"
    assert all(before < after for before, after in pairwise(places))


def test_a_part_is_drawn_with_the_times_of_the_whole(tmp_path: Path) -> None:
    entries = [message(0, jaw()), event(1, "FIRST"), event(2, "SECOND"), message(3, jaw()), message(4, jaw())]
    found = curves(entries, begin=1.5, end=4)
    assert list(found.seconds) == [3.0, 4.0]
    _, picture = plot_recordings(tmp_path / "it", [found])
    text = words(picture)
    assert "FIRST" not in text
    assert {"SECOND", "jaw", "opening, mm"} <= set(text)


def test_labels_take_as_many_rows_as_they_need_and_no_third_of_the_picture() -> None:
    events = [Event(0.0, "READY", False), Event(5.0, "FAULT", True), Event(10.0, "READY", False)]
    apart = placed_labels(events, 0.0, 10.0, LETTER)
    assert [each.row for each in apart] == [0, 0, 0]
    assert apart[-1].left < 1, "the last one ends with the picture"
    many = [Event(each / 10, "X" * LONGEST_LABEL, False) for each in range(20)]
    close = placed_labels(many, 0.0, 10.0, LETTER)
    assert {each.row for each in close} == set(range(PLOT_ROWS))
    assert ROW_HEIGHT * PLOT_ROWS / (ROW_HEIGHT * PLOT_ROWS + 5) < 0.2
    whole = [each for each in close if not each.words.endswith("…")]
    assert len(whole) == PLOT_ROWS, "the last one of each row"
    for row in range(PLOT_ROWS):
        inside = [each for each in close if each.row == row]
        ends = [each.left + LETTER * (len(each.words) + 1) for each in inside]
        assert all(end <= after.left + 0.03 for end, after in zip(ends, inside[1:], strict=False))
