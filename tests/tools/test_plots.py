"""Curves of measurements can be distinguished, and say whose they are."""

from __future__ import annotations

import re
from pathlib import Path

from robotiq_async.tools.measure.campaigns import force_values
from robotiq_async.tools.measure.plots import (
    _curves,
    _shown,
    plot_current_over_time,
    plot_force,
    plot_peak_currents,
)


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
