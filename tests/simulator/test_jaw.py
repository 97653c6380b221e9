"""A jaw moves as one 2F-85 was recorded: times, readings, and the order of gOBJ and gPO."""

from __future__ import annotations

from typing import Any, NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robotiq_async.calibration import MotionProfile, SpeedCalibration
from robotiq_async.simulator import Physics, SimulatedGripper
from robotiq_async.values.enums import JAW, ObjectStatus
from robotiq_async.values.model import HAND_E, THREE_FINGER, TWO_FINGER_85, TWO_FINGER_140, Model
from robotiq_async.values.status import RobotiqStatus

LOOK_S = 0.001


class Motion(NamedTuple):
    """One motion: its seconds to the report and to the last change of gPO, its reading and its outcome."""

    reported_s: float
    stood_s: float
    reading: int
    outcome: ObjectStatus

    @property
    def seconds(self) -> float:
        """To the first of the statuses that stay as they are: what the recordings give."""
        return max(self.reported_s, self.stood_s)


class Jaw:
    """An active jaw with a clock that is turned by hand."""

    def __init__(self, model: Model = TWO_FINGER_85, **options: Any) -> None:
        self.now = 0.0
        self.gripper = SimulatedGripper(lambda: self.now, model=model, **options)
        self.write(0, 0, 0, go=False)
        self.now += 20

    def write(self, position: int, speed: int, force: int = 0, *, go: bool = True) -> None:
        self.gripper.write(0, [0x0900 if go else 0x0100, position, speed << 8 | force])

    @property
    def status(self) -> RobotiqStatus:
        return RobotiqStatus.from_registers(self.gripper.status_registers(), model=self.gripper.model)

    @property
    def reading(self) -> int:
        return self.status.position(JAW)

    def move(self, position: int, speed: int, force: int = 0) -> Motion:
        began, reported, stood = self.now, -1.0, 0.0
        last = self.reading
        self.write(position, speed, force)
        while self.now < began + 20:
            status, took = self.status, self.now - began
            if status.position(JAW) != last:
                last, stood = status.position(JAW), took
            if reported < 0 and status.finger_status(JAW) is not ObjectStatus.IN_MOTION:
                reported = took
            if reported >= 0 and took > max(reported, stood) + 0.1:
                return Motion(reported, stood, last, status.finger_status(JAW))
            self.now += LOOK_S
        raise AssertionError("it never ends")


def holding(reading: int, **options: Any) -> Jaw:
    """A jaw with a part that it reads at a count when it closes slowly."""
    for position in range(reading - 4, reading + 4):
        jaw = Jaw(**options)
        jaw.gripper.place_object(JAW, position)
        if jaw.move(255, 0).reading == reading:
            jaw.move(0, 0)
            return jaw
    raise AssertionError(f"no part is read at {reading}")


# Of one 2F-85 at force 0, seconds (docs/hardware.md); n is in the page.
CLOSING = {0: 4.317, 64: 1.85, 128: 1.284, 255: 0.828}
OPENING = {0: 4.2305, 64: 1.8, 128: 1.338, 255: 0.883}
TO_A_PART = {0: 1.850, 128: 0.555, 255: 0.360}
BACK_FROM_IT = {0: 1.754, 128: 0.640, 255: 0.479}


def within(seconds: float, speed: int) -> Any:
    return pytest.approx(seconds, rel=0.06 if speed == 64 else 0.05)


@pytest.mark.parametrize("speed", CLOSING)
def test_strokes_take_as_long_as_recorded(speed: int) -> None:
    jaw = Jaw()
    closed, opened = jaw.move(255, speed), jaw.move(0, speed)
    assert closed.seconds == within(CLOSING[speed], speed)
    assert opened.seconds == within(OPENING[speed], speed)
    assert closed.outcome is opened.outcome is ObjectStatus.AT_POSITION
    usual = SpeedCalibration.usual(TWO_FINGER_85)
    assert closed.seconds == pytest.approx(usual.closing_time(speed), rel=0.02), "as the driver expects"


@pytest.mark.parametrize("speed", TO_A_PART)
def test_ways_to_a_part_and_back_take_as_long_as_recorded(speed: int) -> None:
    jaw = holding(91, seed=1)
    for _ in range(3):
        assert jaw.move(255, speed).seconds == within(TO_A_PART[speed], speed)
        assert jaw.move(0, speed).seconds == within(BACK_FROM_IT[speed], speed)


@pytest.mark.parametrize(("speed", "readings"), [(0, {91}), (128, {91, 92, 93}), (255, {96, 97, 98, 99})])
def test_a_part_is_read_further_the_faster_it_is_met(speed: int, readings: set[int]) -> None:
    jaw = holding(91, seed=1)
    read = []
    for _ in range(20):
        motion = jaw.move(255, speed)
        assert motion.outcome is ObjectStatus.CONTACT_CLOSING
        read.append(motion.reading)
        jaw.move(0, 255)
    assert set(read) == readings, "no two grips alike, and none unlike the recorded ones"


@pytest.mark.parametrize(
    ("force", "readings"),
    [(0, {225, 226}), (1, {225, 226}), (30, {226}), (64, {228}), (80, {230}), (255, {230})],
)
def test_the_closed_stop_gives_with_the_force(force: int, readings: set[int]) -> None:
    assert {Jaw().move(255, speed, force).reading for speed in (0, 128, 255)} == readings


def test_a_stop_that_was_pressed_further_is_not_left_by_less_force() -> None:
    jaw = Jaw()
    assert jaw.move(255, 255, 255).reading == 230
    assert jaw.move(255, 255, 0).reading == 230


def test_open_it_reads_two_or_three() -> None:
    assert {Jaw(seed=seed).reading for seed in range(12)} == {2, 3}


def test_gobj_comes_before_the_last_count_in_a_third_of_contacts() -> None:
    jaw = holding(91, seed=1)
    early = 0
    for _ in range(60):
        motion = jaw.move(255, 255)
        early += motion.reported_s < motion.stood_s
        jaw.move(0, 255)
    assert 12 <= early <= 28
    exact = holding(91, spread=False)
    motions = [(exact.move(255, 255), exact.move(0, 255))[0] for _ in range(6)]
    assert all(motion.stood_s < motion.reported_s for motion in motions)


def test_the_echo_is_in_the_next_status() -> None:
    """A driver that reads at once, and returns when gOBJ shows no motion, must see its own request."""
    jaw = Jaw()
    jaw.write(255, 0)
    assert jaw.status.requested_position(JAW) == 255
    assert jaw.status.is_moving
    slow = Jaw(device_cycle=0.005)
    slow.write(255, 0)
    assert slow.status.requested_position(JAW) == 0


def test_requests_that_follow_one_another_do_not_begin_the_motion_again() -> None:
    """A loop of 100 Hz would otherwise never move."""
    jaw = Jaw()
    for count in range(100):
        jaw.write(100 + count, 255)
        jaw.now += 0.01
    assert 185 <= jaw.reading <= 201


@pytest.mark.parametrize("hz", [100, 50])
@pytest.mark.parametrize("physics", [None, "table"])
def test_a_stream_of_small_steps_lags_at_its_beginning_only(physics: str | None, hz: int) -> None:
    """It reached each step before the next came, began each anew, and lagged up to ten counts for ever."""
    if physics is not None:
        pytest.importorskip("mujoco", reason="needs the extra physics")
    jaw = Jaw(physics=physics and Physics(physics))
    jaw.move(50, 255)
    jaw.now += 1
    lags = []
    for count in range(51, 151):
        jaw.write(count, 255)
        jaw.now += 1 / hz
        lags.append(count - jaw.reading)
    assert max(lags[:10]) >= 0.07 * hz, "from a rest it begins late"
    assert max(lags[30:]) <= 4
    jaw.now += 0.1
    jaw.write(50, 255)
    jaw.now += 0.1
    assert jaw.reading >= 149, "and so it does when it turns"


def test_with_other_ends() -> None:
    jaw = Jaw(ends=(12, 228))
    assert jaw.reading == 12
    assert jaw.move(255, 0).reading == 228
    assert jaw.move(0, 255).reading == 12
    with pytest.raises(ValueError, match="the closed reading of ends"):
        SimulatedGripper(ends=(12, 12))


def test_with_another_motion() -> None:
    steady = MotionProfile.of_closings("mine", 1, 225, [2.25] * 256)
    jaw = Jaw(motion=steady, spread=False)
    assert jaw.move(203, 255).seconds == pytest.approx(2.0, abs=0.01)


@pytest.mark.parametrize("model", [TWO_FINGER_140, HAND_E])
def test_what_was_not_recorded_is_called_an_estimate(model: Model) -> None:
    usual = SpeedCalibration.usual(model)
    assert usual.profile is not None
    assert usual.source.startswith("estimate")
    assert usual.profile.runs == 0
    assert (usual.mm_per_s(0), usual.mm_per_s(255)) == pytest.approx(model.speeds_mm_s)
    assert Jaw(model).move(255, 255).seconds == pytest.approx(usual.closing_time(255), rel=0.02)


def test_the_fault_of_its_controller() -> None:
    jaw = Jaw()
    jaw.gripper.controller_fault = 0x0C
    assert jaw.status.controller_fault == 0x0C
    assert "emergency stop" in jaw.status.controller_fault_text
    assert "kFLT=0x0C" in str(jaw.status)
    assert jaw.status.as_dict()["controller_fault"] == 0x0C
    assert not jaw.status.fault
    jaw.gripper.controller_fault = 0
    assert jaw.status.controller_fault_text == ""
    with pytest.raises(ValueError, match="a 3-Finger has no controller fault"):
        SimulatedGripper(model=THREE_FINGER).controller_fault = 1


# -- exactness -----------------------------------------------------------------------------------------------

_BYTE = st.integers(0, 255)
_MOMENT = st.floats(0, 12, allow_nan=False)
_WRITES = st.tuples(
    st.just("write"), st.sampled_from([0x0900, 0x0900, 0x0900, 0x0100, 0]), _BYTE, _BYTE, _BYTE
)
_PARTS = st.tuples(st.sampled_from(["place_object", "remove_object"]), _BYTE)
_HISTORY = st.lists(st.tuples(_MOMENT, st.one_of(_WRITES, _WRITES, _PARTS)), max_size=25)


@settings(deadline=None, max_examples=150)
@given(history=_HISTORY, looks=st.lists(_MOMENT, max_size=40))
def test_looking_changes_nothing(history: list[Any], looks: list[float]) -> None:
    assert _end(history, looks) == _end(history, [])


def _end(history: list[Any], looks: list[float]) -> tuple[object, ...]:
    jaw, travelled = Jaw(), 0.0
    began = jaw.now
    for moment, what in sorted([*history, *((look, None) for look in looks)], key=lambda each: each[0]):
        jaw.now = began + moment
        match what:
            case None:
                jaw.gripper.status_registers()
                assert jaw.gripper.travel(JAW) >= travelled
                travelled = jaw.gripper.travel(JAW)
            case "write", first, position, speed, force:
                jaw.gripper.write(0, [first, position, speed << 8 | force])
            case "place_object", position:
                jaw.gripper.place_object(JAW, position)
            case _:
                jaw.gripper.remove_object()
    jaw.now = began + 30
    return jaw.gripper.status_registers(), pytest.approx(jaw.gripper.travel(JAW))
