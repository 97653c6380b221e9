"""The opening at a position: straight, on the arc of a linkage, or between measured points."""

from __future__ import annotations

import copy
import pickle
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async import (
    HAND_E,
    JAW,
    THREE_FINGER,
    TWO_FINGER_85,
    TWO_FINGER_140,
    Finger,
    Model,
    RobotiqHand,
    RobotiqStatus,
    Units,
)
from robotiq_async.calibration import SpeedCalibration
from robotiq_async.calibration.csv_tables import TableError, read_stroke, write_stroke
from robotiq_async.control.evidence import without_fault
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.model import MODELS
from robotiq_async.values.status import Part
from robotiq_async.values.stroke import LEAST_FALL_MM, Stroke, check_points

COUNTS = st.integers(0, 255)
models = pytest.mark.parametrize("model", MODELS.values(), ids=lambda model: model.name)
PADS = [
    (0.003, 85.2),
    (0.065, 79.3),
    (0.128, 73.1),
    (0.191, 66.8),
    (0.253, 60.1),
    (0.316, 53.3),
    (0.379, 46.4),
    (0.441, 39.2),
    (0.504, 32.0),
    (0.567, 24.7),
    (0.629, 17.2),
    (0.692, 9.8),
    (0.755, 2.3),
]
"""Radians of the driver joint and millimetres between the pads of the 2F-85 of MuJoCo Menagerie. An arc
through them ends at 0.775 rad."""


def straight(stroke: Stroke, position: int) -> float:
    return stroke.mm * (stroke.closed_reading - position) / stroke.counts


@pytest.mark.parametrize(("radians", "mm"), PADS)
def test_a_2f_85_opens_as_its_public_model(radians: float, mm: float) -> None:
    """Within half a count. By a straight line 53.3 mm would read 50.6."""
    stroke = TWO_FINGER_85.stroke
    position = round(stroke.open_reading + radians / 0.775 * stroke.counts)
    assert stroke.opening_mm(position) == pytest.approx(mm, abs=0.55)


@pytest.mark.parametrize(("model", "most"), [(TWO_FINGER_85, 2.81), (TWO_FINGER_140, 4.67)])
def test_the_opening_of_a_2f_is_above_a_straight_line(model: Model, most: float) -> None:
    stroke = model.stroke
    inside = range(stroke.open_reading, stroke.closed_reading + 1)
    above = [stroke.opening_mm(each) - straight(stroke, each) for each in inside]
    assert min(above) >= -0.01
    assert max(above) == pytest.approx(most, abs=0.01)
    assert 0.35 < above.index(max(above)) / stroke.counts < 0.5


@pytest.mark.parametrize("model", [HAND_E, THREE_FINGER])
def test_the_others_open_on_a_straight_line(model: Model) -> None:
    stroke = model.stroke
    for each in range(stroke.open_reading, stroke.closed_reading + 1):
        assert stroke.opening_mm(each) == pytest.approx(straight(stroke, each), abs=0.006)


@models
def test_beyond_the_ends_are_the_ends(model: Model) -> None:
    stroke = model.stroke
    assert {stroke.opening_mm(each) for each in range(stroke.open_reading + 1)} == {stroke.mm}
    assert {stroke.opening_mm(each) for each in range(stroke.closed_reading, 256)} == {0.0}
    assert (stroke.open_fraction(0), stroke.open_fraction(255)) == (1, 0)
    assert all(a > b for a, b in pairwise(stroke.openings[stroke.open_reading : stroke.closed_reading + 1]))


@models
def test_openings_and_fractions_go_both_ways(model: Model) -> None:
    stroke = model.stroke
    for each in range(stroke.open_reading, stroke.closed_reading + 1):
        assert stroke.position_of(stroke.opening_mm(each)) == each
        if stroke.open_reading < each < stroke.closed_reading:
            assert stroke.position_at(stroke.open_fraction(each)) == each


@given(st.sampled_from([*MODELS.values()]), st.floats(0, 1))
def test_the_position_is_the_closest_one(model: Model, share: float) -> None:
    stroke, mm = model.stroke, share * model.stroke.mm
    found = stroke.position_of(mm)
    assert abs(stroke.opening_mm(found) - mm) == min(abs(each - mm) for each in stroke.openings)


def test_the_ends_of_a_fraction_are_those_of_open_and_close() -> None:
    """A leader device that is closed requests a grip, and not a gap of nothing."""
    units = Units(stroke=TWO_FINGER_85.stroke)
    assert (units.position(open_fraction=1), units.position(open_fraction=0)) == (0, 255)
    assert (units.position(open_fraction=0.999), units.position(open_fraction=0.001)) == (3, 228)
    assert units.position(mm=0) == 228


# -- measured ----------------------------------------------------------------------------------------------


def test_two_points_stretch_the_nominal_shape() -> None:
    """Fingertips of one's own, which meet earlier and open wider."""
    stroke = TWO_FINGER_85.stroke.measured(check_points("stroke", [(13, 100), (213, 0.0)]))
    assert (stroke.open_reading, stroke.closed_reading, stroke.counts) == (13, 213, 200)
    assert (stroke.mm, stroke.closed_mm, stroke.source) == (100, 0, "measured")
    nominal = TWO_FINGER_85.stroke
    for share in (0.2, 0.4, 0.8):
        here, there = round(13 + share * 200), round(3 + share * 225)
        assert stroke.opening_mm(here) / 100 == pytest.approx(nominal.opening_mm(there) / 85, abs=2e-4)


def test_more_points_are_met_exactly() -> None:
    points = ((6, 84.1), (60, 66.0), (150, 31.5), (226, 1.5))
    stroke = TWO_FINGER_85.stroke.measured(points)
    assert [stroke.opening_mm(each) for each, _ in points] == pytest.approx([mm for _, mm in points])
    assert all(a > b for a, b in pairwise(stroke.openings[6:227]))
    assert (stroke.opening_mm(255), stroke.closed_mm) == (1.5, 1.5)
    with pytest.raises(ValueError, match=re.escape("mm must be millimetres in 1.5..84.1, got 1")):
        stroke.position_of(1)
    assert stroke.position_of(1.5) == 226


@st.composite
def tables(draw: st.DrawFn) -> tuple[tuple[int, float], ...]:
    """Any points that are a stroke: 2..256 positions, each with an opening below that of the one before."""
    closed, *others = sorted(draw(st.sets(COUNTS, min_size=2)), reverse=True)
    points = [(closed, draw(st.floats(0, 10)))]
    for position in others:
        further, mm = points[-1]
        points.append((position, mm + (further - position) * draw(st.floats(1.0001 * LEAST_FALL_MM, 3.8))))
    return tuple(reversed(points))


@given(st.sampled_from([*MODELS.values()]), tables(), st.floats(0, 1))
def test_any_measured_table_goes_both_ways(
    model: Model, table: tuple[tuple[int, float], ...], share: float
) -> None:
    """Counts come back as themselves, and millimetres within half a count."""
    stroke = model.stroke.measured(check_points("stroke", table))
    low, high = stroke.open_reading, stroke.closed_reading
    for each in range(low, high + 1):
        assert stroke.position_of(stroke.opening_mm(each)) == each
    mm = stroke.closed_mm + share * (stroke.mm - stroke.closed_mm)
    found = stroke.position_of(mm)
    wider, narrower = stroke.openings[max(found - 1, low)], stroke.openings[min(found + 1, high)]
    half = 0.005  # to which openings are rounded
    assert (stroke.openings[found] + narrower) / 2 - half <= mm <= (stroke.openings[found] + wider) / 2 + half


REFUSED: list[tuple[object, type[Exception], str]] = [
    (
        "left.csv",
        TypeError,
        "stroke must be two or more points (position in counts, opening in mm), got 'left.csv'",
    ),
    (85, TypeError, "stroke must be two or more points"),
    ([(3, 85)], ValueError, "stroke must be two or more points"),
    ([3, 228], ValueError, "stroke must be two or more points"),
    ([(3, 85, 1), (228, 0, 1)], ValueError, "stroke must be two or more points"),
    ([(3, 85), (256, 0)], ValueError, "a position of stroke must be in 0..255, got 256"),
    ([(3, 85), (2.5, 0)], TypeError, "a position of stroke must be an int in 0..255, got 2.5"),
    ([(3, 1001), (9, 0)], ValueError, "an opening of stroke must be millimetres in 0.0..1000.0, got 1001"),
    (
        [(3, 85), (9, float("nan"))],
        ValueError,
        "an opening of stroke must be millimetres in 0.0..1000.0, got nan",
    ),
    (
        [(3, 85), (9, float("inf"))],
        ValueError,
        "an opening of stroke must be millimetres in 0.0..1000.0, got inf",
    ),
    (
        [(3, 85), (203, 81.001)],
        ValueError,
        "stroke: an opening must fall by 0.02 mm a count or more, got 85 mm at 3 and then 81.001 mm at 203",
    ),
    (
        [(3, 85), (100, 85.0)],
        ValueError,
        "stroke: positions must rise and openings fall, got 85 mm at 3 and then 85 mm at 100",
    ),
    ([(228, 0), (3, 85)], ValueError, "stroke: positions must rise and openings fall"),
    ([(3, 85), (3, 80), (228, 0)], ValueError, "stroke: positions must rise and openings fall"),
]


@pytest.mark.parametrize(("points", "kind", "words"), REFUSED)
def test_what_is_no_stroke_is_refused(points: object, kind: type[Exception], words: str) -> None:
    with pytest.raises(kind, match=f"^{re.escape(words)}"):
        check_points("stroke", points)


def test_a_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    path, points = tmp_path / "left.csv", ((3, 85.25), (120, 44.1), (228, 0.0))
    write_stroke(path, points)
    assert path.read_text(encoding="utf-8").splitlines() == [
        "position_counts,opening_mm",
        "3,85.25",
        "120,44.1",
        "228,0",
    ]
    assert read_stroke(path) == points
    write_stroke(path, points, TWO_FINGER_85)
    assert path.read_text(encoding="utf-8").splitlines()[:2] == [
        "position_counts,opening_mm,model",
        "3,85.25,2f85",
    ]
    assert read_stroke(path) == read_stroke(path, TWO_FINGER_85) == points
    with pytest.raises(TableError, match="it was measured on a 2F-85, and the gripper is a Hand-E"):
        read_stroke(path, HAND_E)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "expected the columns position_counts,opening_mm, got none"),
        ("position,mm\n3,85\n", ", line 1: expected the columns position_counts,opening_mm, got position,mm"),
        ("position_counts,opening_mm\n", "left.csv: two or more points are needed, got 0"),
        ("position_counts,opening_mm\n3,85\n", "left.csv: two or more points are needed, got 1"),
        (
            "position_counts,opening_mm\n3,-1\n",
            ", line 2: expected counts and millimetres, such as 113,46.2, got '3,-1'",
        ),
        (
            "position_counts,opening_mm\n3,85,1\n",
            ", line 2: expected counts and millimetres, such as 113,46.2, got '3,85,1'",
        ),
        ("position_counts,opening_mm\n300,85\n", ", line 2: position_counts must be an integer in 0..255"),
        (
            "position_counts,opening_mm\n3,85\n9,85\n",
            ", line 3: positions must rise and openings fall, got 85 mm at 3 and then 85 mm at 9",
        ),
        (
            "position_counts,opening_mm\n\n3,85\n\n228,1\n99,60\n",
            ", line 6: positions must rise and openings fall, got 1 mm at 228 and then 60 mm at 99",
        ),
        ("position_counts,opening_mm\n3,85\n3,85\n", ", line 3: positions must rise and openings fall"),
        (
            "position_counts,opening_mm\n3,85\n128,84.5\n228,0\n",
            ", line 3: an opening must fall by 0.02 mm a count or more, got 85 mm at 3 and then 84.5 mm at",
        ),
        (
            "position_counts,opening_mm\n3,nan\n",
            ", line 2: expected counts and millimetres, such as 113,46.2,",
        ),
        ("position_counts,opening_mm\n3,1e2\n", ", line 2: expected counts and millimetres"),
        (
            "position_counts,opening_mm\n-3,85\n",
            ", line 2: position_counts must be an integer in 0..255, got '-3'",
        ),
        (
            "position_counts;opening_mm\n3;85,2\n",
            ", line 1: expected the columns position_counts,opening_mm, got",
        ),
        ('position_counts,opening_mm\n3,"85\n', ", line 2: unexpected end of data"),
        (
            '{"stroke": [[3, 85.0], [228, 0.0]]}',
            ", line 1: expected the columns position_counts,opening_mm, got",
        ),
        (f"position_counts,opening_mm\n3,{'8' * 10_001}\n", ", line 2: it has more than 10000 characters"),
        ("position_counts,opening_mm,model\n3,85,2f85\n9,5\n", ", line 3: expected 3 columns, got 2"),
        ("position_counts,opening_mm,model\n3,85,2f\n", ", line 2: model must be one of 3f, 2f85"),
        (
            "position_counts,opening_mm,model\n3,85,2f85\n9,5,2f140\n",
            ", line 3: model must be the same in each row, got '2f140'",
        ),
    ],
)
def test_a_file_that_is_no_stroke_is_refused(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "left.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(TableError, match=re.escape(words)):
        read_stroke(path)
    with pytest.raises(ValueError, match=re.escape(words)):
        RobotiqHand("sim://?model=2f85", stroke=path)


# -- of a hand ---------------------------------------------------------------------------------------------


OWN = ((13, 100.0), (213, 2.0))


def test_a_hand_has_the_points_it_was_made_with(tmp_path: Path) -> None:
    write_stroke(tmp_path / "left.csv", OWN)
    for own in (OWN, [[13, 100], [213, 2]], tmp_path / "left.csv", str(tmp_path / "left.csv")):
        units = RobotiqHand("sim://?model=2f85", stroke=own).units  # type: ignore[arg-type]  # a list will do
        assert (units.mm(0), units.mm(255), units.position(mm=100)) == (100, 2, 13)
        assert "2..100 mm (measured)" in repr(units)
    with pytest.raises(TypeError, match="stroke must be two or more points"):
        RobotiqHand(stroke=85)  # type: ignore[arg-type]


def test_the_address_can_name_the_file(tmp_path: Path) -> None:
    file = tmp_path / "left.csv"
    address = f"sim://?model=2f85&stroke={file}"
    with pytest.raises(ValueError, match=re.escape(f"stroke: {file}: cannot be read: No such file")):
        RobotiqHand(address)
    write_stroke(file, OWN, TWO_FINGER_85)
    assert RobotiqHand(address).units.stroke == TWO_FINGER_85.stroke.measured(OWN)
    with pytest.raises(ValueError, match=r"stroke is given twice: by the address .*, and beside it"):
        RobotiqHand(address, stroke=OWN)


def test_a_hand_of_another_model_refuses_the_file(tmp_path: Path) -> None:
    file = tmp_path / "left.csv"
    write_stroke(file, OWN, TWO_FINGER_85)
    words = re.escape(f"stroke: {file}: it was measured on a 2F-85, and the gripper is a 2F-140")
    with pytest.raises(ValueError, match=words):
        RobotiqHand("sim://?model=2f140", stroke=file)
    with pytest.raises(ValueError, match=words):
        RobotiqHand("tcp://host", model="2f140", stroke=str(file))
    with pytest.raises(ValueError, match=words):
        RobotiqHand(f"rtu:///dev/ttyUSB0?model=2f140&stroke={file}")
    write_stroke(file, OWN)
    assert RobotiqHand("sim://?model=2f140", stroke=file).units.mm(0) == 100, "an older file does not say"


def test_a_table_of_closing_times_takes_the_stroke_of_the_model() -> None:
    slow = SpeedCalibration("mine", ((0, 4.0), (255, 1.0)))
    assert RobotiqHand("sim://?model=2f85", calibration=slow).units.mm_per_s(255) == 85


def of_jaw(first: int, position: int, fault: int = 0, stroke: Stroke | None = None) -> RobotiqStatus:
    words = (first << 8, fault << 8 | 255, position << 8, 0, 0, 0, 0, 0)
    return RobotiqStatus(words, model=TWO_FINGER_85, stroke=stroke)


def test_a_status_has_the_opening_and_the_fraction_of_a_finger() -> None:
    nominal, own = of_jaw(0xF9, 113), of_jaw(0xF9, 113, stroke=TWO_FINGER_85.stroke.measured(OWN))
    assert nominal.opening_mm(JAW) == 46.18
    assert own.opening_mm(JAW) == pytest.approx(54.15, abs=0.1)
    assert (nominal.open_fraction(JAW), own.open_fraction(JAW)) == (0.5111, 0.5)
    assert nominal == own, "the gripper said the same"
    for status in (nominal, own):
        for again in (copy.copy(status), pickle.loads(pickle.dumps(status))):
            assert again.opening_mm(JAW) == status.opening_mm(JAW)
    three = RobotiqStatus((0xF900, 0, 0, 0, 0, 0, 0, 0))
    assert three.opening_mm(Finger.C) == 155
    for read in (three.opening_mm, three.open_fraction):
        with pytest.raises(ValueError, match="finger must be A, B or C, for the scissor has no opening"):
            read(Finger.SCISSOR)
        with pytest.raises(ValueError, match=r"finger must be one of"):
            read(Finger.ABC)


def test_a_status_whose_fault_is_passed_over_keeps_its_points() -> None:
    own = TWO_FINGER_85.stroke.measured(OWN)
    assert without_fault(of_jaw(0xF9, 113, fault=0x09, stroke=own)).stroke == own


def test_the_ends_of_a_gripper_are_those_that_were_measured() -> None:
    """Fingertips of one's own that meet at 213: closed is there, and a request of 210 is not."""
    own = TWO_FINGER_85.stroke.measured(OWN)
    for position, request, reached in (
        (213, 255, True),
        (211, 213, True),
        (211, 255, True),
        (210, 255, False),
        (213, 200, False),
        (14, 0, True),
        (16, 0, False),
        (14, 13, True),
        (10, 13, True),  # requests of the ends themselves, and fingers beyond them
        (216, 213, True),
    ):
        assert of_jaw(0xF9, position, stroke=own).has_reached(JAW, request) is reached, (position, request)
    assert not of_jaw(0xF9, 213).has_reached(JAW, 255)


async def test_a_move_to_a_measured_end_has_reached_it(caplog: pytest.LogCaptureFixture) -> None:
    model = replace(TWO_FINGER_85, stroke=replace(TWO_FINGER_85.stroke, open_reading=13, closed_reading=213))
    gripper = SimulatedGripper(speedup=20, model=model)
    async with (
        SimulatorServer(gripper) as server,
        RobotiqHand(server.address, model="2f85", stroke=OWN) as hand,
    ):
        assert hand.status.stroke == hand.units.stroke
        result = await hand.close()
        assert result.reached == JAW
        assert result.opening_mm(JAW) == pytest.approx(2, abs=1.5)
    assert "at position" not in caplog.text


def test_a_part_is_held_while_the_gripper_reports_a_closing_contact() -> None:
    """A request in force (gGTO), active (gIMC = 3), no serious fault: else gOBJ is not about a part."""
    assert of_jaw(0xB9, 0xBD).part == Part(JAW, of_jaw(0xB9, 0xBD).opening_mm(JAW))
    assert [of_jaw(first, 0xBD).part for first in (0xF9, 0x79, 0x39, 0xB1, 0x99)] == [None] * 5
    assert of_jaw(0xB9, 0xBD, fault=0x0E).part is None
    assert of_jaw(0xB9, 0xBD, fault=0x05).part is not None


def test_fingers_of_a_3_finger_hold_a_part_without_a_width() -> None:
    status = RobotiqStatus((0xF9BA, 0, 0, 0, 0, 0, 0, 0))  # a contact of A, B and the scissor; C has arrived
    assert status.part == Part(Finger.A | Finger.B, None)
