"""Curves can be distinguished, and the words hide nothing."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from robotiq_async import Finger
from robotiq_async.tools.measure.campaigns import force_values
from robotiq_async.tools.measure.plots import (
    LONGEST_LABEL,
    PLOT_ROWS,
    ROW,
    _curves,
    _placed,
    _right,
    _shown,
    plot_current_over_time,
    plot_force,
    plot_peak_currents,
    plot_recording,
)
from robotiq_async.tools.recording.recordings import RecordedMessage
from robotiq_async.values.model import THREE_FINGER


def words(picture: Path) -> list[str]:
    """The words in a picture; matplotlib draws glyphs, and puts the words into comments."""
    return re.findall(r"<!-- (.+?) -->", picture.read_text(encoding="utf-8"))


def test_fingers_that_are_alike_are_one_curve_that_says_so(tmp_path: Path) -> None:
    assert _curves([(10, 10, 10), (20, 20, 20)]) == [("fingers A, B, C: the same", (10, 20))]
    assert _curves([(10, 20, 30), (20, 30, 40)]) == [
        ("finger A", (10, 20)),
        ("finger B", (20, 30)),
        ("finger C", (30, 40)),
    ]
    currents = {force: [[(0, *each)]] for force, each in enumerate([(10, 10, 10), (20, 30, 20)])}
    _, picture = plot_peak_currents(tmp_path / "peaks", currents, "foam", "simulated")
    names = [each for each in words(picture) if each.startswith("finger")]
    assert names == ["fingers A, C: the same", "finger B"]


def test_the_forces_of_each_run_stand_beside_their_mean_and_the_figures_of_others(tmp_path: Path) -> None:
    _, picture = plot_force(tmp_path / "it", {0: (900, 1100), 255: (5000, 6000)}, "foam", "mine")
    names = [each for each in words(picture) if each.endswith((": runs", ": mean"))]
    assert names[-2:] == ["mine: runs", "mine: mean"], "two runs have one name"
    assert len(names) == 3, "and the mean of the thesis"
    assert "Force of a grasp, foam" in words(picture)


def test_currents_over_time_are_drawn_near_the_usual_force_values(tmp_path: Path) -> None:
    by_step = {
        step: {force: [[(0, 1, 1, 1), (9, 2, 2, 2)]] for force in force_values(step)}
        for step in (25, 85, 128)
    }
    drawn = [_shown(currents) for currents in by_step.values()]
    assert drawn == [[0, 125, 250], [0, 85, 255], [0, 128]]
    _, picture = plot_current_over_time(tmp_path / "it", {"foam": by_step[85]}, "simulated")
    names = [each for each in words(picture) if each.startswith("force ")]
    assert names == ["force 0", "force 85", "force 255"]


LONG = "X" * 2 * LONGEST_LABEL


def recorded() -> list[RecordedMessage]:
    """A status, three events and a status, each a second after the other."""
    axis = {"position": 6, "requested_position": 0, "current_ma": 0}
    status = {str(each.name): axis for each in THREE_FINGER.axes}
    events: list[dict[str, object]] = [
        {"kind": "state", "target": "FIRST"},
        {"kind": "mark", "label": "SECOND", "values": {}},
        {"kind": "state", "target": LONG},
    ]
    messages = [("/gripper/status", status), *(("/gripper/event", each) for each in events)]
    messages.append(("/gripper/status", status))
    return [
        RecordedMessage(topic, second * 10**9, 0, json.dumps(fields).encode(), is_json=True)
        for second, (topic, fields) in enumerate(messages)
    ]


def test_events_are_written_above_the_curves(tmp_path: Path) -> None:
    _, picture = plot_recording(tmp_path / "it", recorded())
    text = picture.read_text(encoding="utf-8")
    places = [text.index(f'id="{each}"') for each in ("axes_1", "axes_2", "axes_3")]
    for name in ("FIRST", "SECOND", LONG[: LONGEST_LABEL - 3] + "..."):
        assert places[0] < text.index(f"<!-- {name} -->") < places[1], "not above the positions"
    assert all(before < after for before, after in pairwise(places))
    assert Finger.A.name in words(picture)
    assert "opening, mm" not in words(picture), "three fingers have none"


def test_a_part_of_a_jaw_is_drawn_with_the_times_of_the_whole_and_its_opening(tmp_path: Path) -> None:
    jaw = {"A": {"position": 6, "requested_position": 0, "current_ma": 0, "opening_mm": 84.2}}
    entries = [
        replace(each, data=json.dumps(jaw).encode()) if each.topic == "/gripper/status" else each
        for each in recorded()
    ]
    _, picture = plot_recording(tmp_path / "it", entries, begin=1.5, end=4)
    text = words(picture)
    assert "FIRST" not in text
    assert {"SECOND", "jaw", "opening, mm"} <= set(text)
    assert "A" not in text
    assert plot_recording(tmp_path / "none", entries, begin=1.5, end=3) == []


def test_labels_take_as_many_rows_as_they_need_and_no_third_of_the_picture() -> None:
    apart = _placed([(0.0, "READY", False), (5.0, "FAULT", True), (10.0, "READY", False)], 0.0, 10.0)
    assert [each.row for each in apart] == [0, 0, 0]
    assert apart[-1].left < 1, "the last one ends with the picture"
    close = _placed([(each / 10, "X" * LONGEST_LABEL, False) for each in range(20)], 0.0, 10.0)
    assert {each.row for each in close} == set(range(PLOT_ROWS))
    assert ROW * PLOT_ROWS / (ROW * PLOT_ROWS + 6) < 0.15
    whole = [each for each in close if not each.words.endswith("…")]
    assert len(whole) == PLOT_ROWS, "the last one of each row"
    for row in range(PLOT_ROWS):
        inside = [each for each in close if each.row == row]
        assert all(_right(one) <= other.left + 0.03 for one, other in pairwise(inside))
