"""Millimetres, mm/s, seconds and newton labels, to and from what the gripper takes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async import Units
from robotiq_async.calibration import SpeedCalibration
from robotiq_async.calibration.scales import Figures

THESIS = Units()
NOMINAL = Units(SpeedCalibration.nominal())
VALUES = st.integers(0, 255)


@given(st.integers(6, 241))
def test_positions_and_openings_go_both_ways(position: int) -> None:
    assert THESIS.position(mm=THESIS.mm(position)) == position


@given(VALUES)
def test_speeds_and_force_labels_go_both_ways(value: int) -> None:
    for units in (THESIS, NOMINAL):
        assert units.speed(mm_per_s=units.mm_per_s(value)) == value
        assert units.speed(closing_s=units.closing_s(value)) == value
        assert units.force(label_n=units.label_n(value)) == value


@given(st.floats(0, 155), st.floats(15.46, 73.16), st.floats(15, 60))
def test_the_value_is_the_closest_one(mm: float, mm_per_s: float, label_n: float) -> None:
    assert THESIS.mm(THESIS.position(mm=mm)) == pytest.approx(mm, abs=155 / 235 / 2 + 0.01)
    speed, force = THESIS.speed(mm_per_s=mm_per_s), THESIS.force(label_n=label_n)
    assert all(
        abs(THESIS.mm_per_s(speed) - mm_per_s) <= abs(THESIS.mm_per_s(other) - mm_per_s)
        for other in range(max(speed - 1, 0), min(speed + 2, 256))
    )
    assert THESIS.label_n(force) == pytest.approx(label_n, abs=45 / 255 / 2 + 1e-9)


FIGURES = st.dictionaries(VALUES, st.integers(0, 40).map(float), min_size=1)


@given(FIGURES, st.integers(0, 80).map(lambda half: half / 2))
def test_the_lowest_of_the_closest_values_is_taken(figures: dict[int, float], wanted: float) -> None:
    """Measured figures need not rise: two speeds may take the same time."""
    least = min(abs(figure - wanted) for figure in figures.values())
    closest = [value for value, figure in figures.items() if abs(figure - wanted) == least]
    assert Figures(figures).nearest(wanted) == min(closest)


def test_the_figures() -> None:
    assert (THESIS.mm(0), THESIS.mm(6), THESIS.mm(241), THESIS.mm(255)) == (155, 155, 0, 0)
    assert (THESIS.closing_s(0), THESIS.closing_s(255)) == pytest.approx((10.021, 2.119), abs=0.001)
    assert (NOMINAL.mm_per_s(0), NOMINAL.mm_per_s(255)) == pytest.approx((22, 110))
    assert (THESIS.label_n(0), THESIS.label_n(255)) == (15, 60)


REFUSED: dict[str, tuple[str, str, tuple[float, ...]]] = {
    "mm": ("position", "millimetres in 0.0..155.0", (-0.01, 155.01)),
    "mm_per_s": ("speed", "millimetres a second in 15.46..73.16", (0, 15.45, 73.17)),
    "closing_s": ("speed", "seconds in 2.11..10.03", (0, 2.1, 10.04)),
    "label_n": ("force", "newton of a label (no measured force) in 15.0..60.0", (14.99, 60.01)),
}


@pytest.mark.parametrize("name", REFUSED)
def test_values_out_of_range_are_refused_in_the_unit(name: str) -> None:
    method, words, outside = REFUSED[name]
    for value in (*outside, float("nan"), "3", True):
        error = ValueError if isinstance(value, float | int) and value is not True else TypeError
        with pytest.raises(error, match=f"^{re.escape(f'{name} must be {words}, got {value!r}')}$"):
            getattr(THESIS, method)(**{name: value})


@pytest.mark.parametrize("units", [THESIS, NOMINAL])
def test_the_limits_in_the_error_are_accepted(units: Units) -> None:
    for name, (method, *_) in REFUSED.items():
        with pytest.raises(ValueError, match=f"{name} must be") as caught:
            getattr(units, method)(**{name: 1e6})
        limits = str(caught.value).rpartition(",")[0].split()[-1].split("..")
        ends = {6, 241} if name == "mm" else {0, 255}
        assert {getattr(units, method)(**{name: float(limit)}) for limit in limits} == ends


def test_a_speed_takes_one_of_two() -> None:
    speed: Any = THESIS.speed
    for both_or_none in ({}, {"mm_per_s": 40, "closing_s": 3}):
        with pytest.raises(TypeError, match="one of mm_per_s and closing_s"):
            speed(**both_or_none)


@pytest.mark.parametrize("call", [THESIS.mm, THESIS.mm_per_s, THESIS.closing_s, THESIS.label_n])
def test_counts_are_refused_as_counts(call: Any) -> None:
    with pytest.raises(ValueError, match=r"must be in 0\.\.255, got 256"):
        call(256)
    with pytest.raises(TypeError, match=r"must be an int in 0\.\.255, got 3\.0"):
        call(3.0)


def test_the_repr_names_the_source_of_the_figures() -> None:
    assert repr(THESIS) == (
        "<Units 0..155 mm (nominal), 15.46..73.16 mm/s (thesis, table A1.1), "
        "labels 15..60 N (nominal (manual))>"
    )


def test_the_table_of_the_page() -> None:
    """Each row: a call to counts, the call back from these counts, and the range."""
    page = (Path(__file__).parents[2] / "docs" / "how-to" / "grasp.md").read_text(encoding="utf-8")
    rows = re.findall(
        r"^\| `units\.(\w+)\((\w+)=(\d+)\)` \| `units\.(\w+)\((\d+)\)` \| ([^|]+) \|", page, re.MULTILINE
    )
    assert len(rows) == 4
    for there, unit, figure, back, counts, limits in rows:
        assert getattr(THESIS, there)(**{unit: int(figure)}) == int(counts)
        assert back == unit
        low, high = map(float, limits.split()[0].split(".."))
        assert REFUSED[unit][1].endswith(f" in {low}..{high}")


def test_objects_that_are_no_calibration_are_refused() -> None:
    with pytest.raises(TypeError, match="speeds must be a SpeedCalibration, got None"):
        Units(None)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="forces must be a ForceCalibration, got 30"):
        Units(forces=30)  # type: ignore[arg-type]
