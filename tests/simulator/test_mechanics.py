"""A gripper whose axes bodies move: the same registers, contacts that come from parts.

The world is stepped by the clock of the test, so that every run is the same. Forces and widths are those of
the models' tables and of the parts; nothing was compared with a gripper.
"""

from __future__ import annotations

import re
import threading
import time
from collections import deque
from collections.abc import Callable

import pytest

pytest.importorskip("mujoco", reason="needs the extra physics")

from demo import grasp_loop
from robotiq_async import Finger, ObjectStatus, RobotiqHand, RobotiqStatus
from robotiq_async.calibration.scales import SpeedCalibration
from robotiq_async.simulator import Habits, Physics, SimulatedGripper
from robotiq_async.simulator.mechanics.stepper import OrderedDrive
from robotiq_async.simulator.physics.driven_axis import Way, mechanism_of
from robotiq_async.values.enums import JAW
from robotiq_async.values.model import HAND_E, MODELS, THREE_FINGER, TWO_FINGER_85, TWO_FINGER_140, Model
from tests.patience import patience

JAWS = pytest.mark.parametrize("model", [TWO_FINGER_85, TWO_FINGER_140, HAND_E], ids=str)
POLL_S = 0.005
BOX = "box:30x40x60,0.3"
FINGERS = ("finger_middle_link_0", "finger_2_link_0", "finger_1_link_0")
"""Links on which A, B and C hang (docs/decisions/finger-names.md)."""


class Bench:
    """A gripper, its world and the clock of both."""

    def __init__(self, scene: str, model: Model = TWO_FINGER_85, habits: Habits | None = None) -> None:
        self.now = 0.0
        self.physics = Physics(scene)
        self.gripper = SimulatedGripper(
            lambda: self.now, model=model, physics=self.physics, habits=habits or Habits()
        )

    @property
    def status(self) -> RobotiqStatus:
        return RobotiqStatus.from_registers(self.gripper.status_registers(), model=self.gripper.model)

    def run(self, seconds: float) -> None:
        """All steps that are due by then, for one look: how often somebody looks changes nothing."""
        self.now += seconds
        self.gripper.status_registers()

    def ask(self, position: int, *, speed: int = 255, force: int = 255, go: bool = True) -> None:
        self.gripper.write(0, [0x0900 if go else 0x0100, position, speed << 8 | force])

    def activate(self) -> None:
        began = self.now
        self.ask(0, go=False)
        while not self.status.is_activated:
            self.run(0.1)
            assert self.now - began < 6, "it ends"

    def move(self, position: int, *, speed: int = 255, force: int = 255) -> float:
        """Seconds until no finger moves."""
        began = self.now
        self.ask(position, speed=speed, force=force)
        self.run(0.02)
        while self.status.moving & Finger.ABC:
            self.run(0.02)
            assert self.now - began < 20, "it ends"
        return self.now - began


def active(scene: str, model: Model = TWO_FINGER_85) -> Bench:
    """A gripper whose activation takes no longer than its motor needs."""
    bench = Bench(scene, model, Habits(activation_time=0))
    bench.activate()
    return bench


# -- motion ----------------------------------------------------------------------------------------------


@JAWS
@pytest.mark.parametrize("speed", [0, 255])
def test_a_jaw_closes_in_the_time_of_its_profile_and_reads_what_it_should(model: Model, speed: int) -> None:
    bench = active("table", model)
    bench.move(0)
    took = bench.move(255, speed=speed)
    assert took == pytest.approx(SpeedCalibration.usual(model).closing_time(speed), rel=0.03)
    assert bench.status.finger_status(JAW) is ObjectStatus.AT_POSITION
    assert bench.status.position(JAW) == model.stroke.closed_reading
    assert bench.physics.opening_mm == pytest.approx(0, abs=0.3)
    bench.move(0)
    assert bench.status.position(JAW) == model.stroke.open_reading
    assert bench.physics.opening_mm == pytest.approx(model.stroke.mm, abs=0.3)


def test_every_place_between_is_reached_within_a_count() -> None:
    bench = active("table")
    for position in (20, 100, 101, 180, 60):
        bench.move(position, speed=128)
        assert bench.status.position(JAW) == pytest.approx(position, abs=1)
        assert bench.status.finger_status(JAW) is ObjectStatus.AT_POSITION


def test_a_halt_stops_it_and_a_go_takes_it_on() -> None:
    bench = active("table")
    bench.ask(255, speed=0)
    bench.run(1)
    bench.ask(255, speed=0, go=False)
    bench.run(0.1)
    at = bench.status.position(JAW)
    bench.run(1)
    assert bench.status.position(JAW) == at
    bench.move(255)
    assert bench.status.position(JAW) == 228


def test_the_same_clock_gives_the_same_bits() -> None:
    runs = []
    for _ in range(2):
        bench = active("cylinder:45x60,0.2")
        bench.move(255, force=100)
        runs.append((bench.physics.part, bench.physics.grip_force, bench.gripper.status_registers()))
    assert runs[0] == runs[1]


def test_a_rest_that_nobody_watches_is_no_other() -> None:
    """While nothing moves, all steps that are due are made at once."""
    watched, left = active("table"), active("table")
    for _ in range(1000):
        watched.run(POLL_S)
    left.now = watched.now
    for bench in (watched, left):
        bench.move(100, speed=40)
    assert left.now == watched.now
    assert left.gripper.status_registers() == watched.gripper.status_registers()
    assert left.physics.opening_mm == watched.physics.opening_mm


# -- contact ---------------------------------------------------------------------------------------------


@JAWS
@pytest.mark.parametrize("force", [0, 128, 255])
def test_pads_press_with_the_force_of_the_table(model: Model, force: int) -> None:
    bench = active(BOX, model)
    bench.move(255, force=force)
    assert bench.status.finger_status(JAW) is ObjectStatus.CONTACT_CLOSING
    bench.run(0.3)
    low, high = model.forces_n
    assert bench.physics.grip_force == pytest.approx(low + (high - low) * force / 255, rel=0.15)


@JAWS
def test_a_thin_part_is_pressed_with_all_of_the_force_and_let_go_at_the_target(model: Model) -> None:
    """Near the target the servo gave less: 56 N of 130 on 8 mm."""
    bench = active("box:8x40x50,0.05", model)
    bench.move(255)
    bench.run(0.5)
    assert bench.physics.grip_force == pytest.approx(model.forces_n[1], rel=0.15)
    met = bench.status.position(JAW)
    bench.move(0)
    bench.move(met + 4)
    assert bench.status.finger_status(JAW) is ObjectStatus.CONTACT_CLOSING
    bench.run(0.5)
    bench.physics.take_away()
    farthest = 0
    for _ in range(200):
        bench.run(POLL_S)
        farthest = max(farthest, bench.status.position(JAW))
    assert bench.status.finger_status(JAW) is ObjectStatus.AT_POSITION
    assert bench.status.position(JAW) == pytest.approx(met + 4, abs=1)
    assert farthest <= met + 24, "it does not go on"


@JAWS
@pytest.mark.parametrize(
    ("scene", "mm"), [(BOX, 30), ("cylinder:12x60,0.03", 12), ("box:8x40x50,0.05", 8), ("sphere:40,0.1", 40)]
)
def test_a_part_is_met_where_it_is(model: Model, scene: str, mm: float) -> None:
    """However light it is, and however few its points of contact: a pen of 12 mm had read 4."""
    bench = active(scene, model)
    bench.move(255, force=128)
    assert bench.physics.opening_mm == pytest.approx(mm, abs=0.7)
    assert bench.status.current_ma(JAW) == 0, "at rest it draws nothing"


@JAWS
def test_a_light_ball_is_held_still_with_full_force(model: Model) -> None:
    """One of 2 g trembled at 130 N, and the motion did not end."""
    bench = active("sphere:20,0.001", model)
    bench.move(255)
    bench.run(0.5)
    forces = []
    for _ in range(100):
        bench.run(POLL_S)
        forces.append(bench.physics.grip_force)
    assert bench.status.finger_status(JAW) is ObjectStatus.CONTACT_CLOSING
    assert forces == pytest.approx([model.forces_n[1]] * 100, rel=0.05)
    assert bench.physics.opening_mm == pytest.approx(20, abs=1)


@JAWS
def test_what_is_held_comes_along_and_what_is_too_heavy_slips(model: Model) -> None:
    held = active(BOX, model)
    held.move(255, force=255)
    before = held.physics.part
    held.physics.lift(80)
    held.run(1.1)
    assert before is not None
    assert held.physics.part is not None
    assert held.physics.part[2] - before[2] == pytest.approx(80, abs=4)
    assert held.status.finger_status(JAW) is ObjectStatus.CONTACT_CLOSING

    heavy = active("box:30x40x60,9", model)
    heavy.move(255, force=0)
    assert heavy.status.finger_status(JAW) is ObjectStatus.CONTACT_CLOSING
    heavy.physics.lift(80)
    heavy.run(1.1)
    assert heavy.physics.part is not None
    assert heavy.physics.part[2] == pytest.approx(30, abs=2), "it stands where it stood"
    assert heavy.status.finger_status(JAW) is ObjectStatus.AT_POSITION, "the part is lost"
    assert heavy.status.position(JAW) == model.stroke.closed_reading


def test_a_part_that_is_taken_away_is_lost_and_one_put_back_is_found() -> None:
    bench = active(BOX)
    bench.move(255, force=60)
    bench.physics.take_away()
    bench.run(1.5)
    assert bench.status.finger_status(JAW) is ObjectStatus.AT_POSITION
    assert bench.status.position(JAW) == 228
    bench.move(0)
    bench.physics.put_back()
    bench.move(255)
    assert bench.status.finger_status(JAW) is ObjectStatus.CONTACT_CLOSING


def test_a_small_ball_at_the_end_of_the_fingers_is_squeezed_out_and_is_no_contact() -> None:
    """The fingertips meet it below its middle, and close."""
    bench = active("sphere:10,0.01@135", HAND_E)
    bench.move(255, force=255)
    bench.run(1)
    assert bench.status.finger_status(JAW) is ObjectStatus.AT_POSITION
    assert bench.physics.opening_mm == pytest.approx(0, abs=0.5)


def test_a_loop_that_asks_for_a_little_more_each_time_finds_the_part() -> None:
    """New requests in the same direction do not restart the pressing."""
    bench = active(BOX)
    bench.move(0)
    for position in range(10, 255, 2):
        bench.ask(position, speed=128, force=20)
        bench.run(0.02)
        if bench.status.contacts:
            break
    assert bench.status.contacts == JAW
    assert bench.physics.opening_mm == pytest.approx(30, abs=0.7)


def test_no_contact_in_an_activation_for_parts_are_taken_out() -> None:
    bench = Bench(BOX)
    before = bench.physics.part
    bench.activate()
    assert bench.status.fault == 0
    assert bench.physics.part == pytest.approx(before, abs=0.5)


def test_a_halt_keeps_the_part_unless_the_gripper_has_that_habit() -> None:
    for lets_go, height in ((False, 110), (True, 30)):
        bench = Bench(BOX, habits=Habits(lets_go_on_halt=lets_go))
        bench.activate()
        bench.move(255, force=128)
        bench.ask(255, force=128, go=False)
        bench.run(0.5)
        bench.physics.lift(80)
        bench.run(1.1)
        assert bench.physics.part is not None
        assert bench.physics.part[2] == pytest.approx(height, abs=5)


@pytest.mark.parametrize("model", MODELS.values(), ids=str)
def test_a_request_for_more_force_does_not_let_go_of_the_part_first(model: Model) -> None:
    """The force began at nothing: a Hand-E dropped 5 kg, and finger A went back by 40 counts."""
    bench = active("box:60x80x60,3" if model is THREE_FINGER else "box:30x40x60,5", model)
    bench.move(255, force=240, speed=0)
    bench.physics.lift(40)
    bench.run(0.6)
    held_at, part = bench.status.position(Finger.A), bench.physics.part
    assert part is not None
    for force in (241, 242):
        bench.ask(255, force=force, speed=0)
        bench.run(0.5)
        bench.ask(255, force=force, speed=0, go=False)
        bench.run(0.1)
    bench.move(255, force=255)
    assert bench.physics.part == pytest.approx(part, abs=6)
    assert bench.status.position(Finger.A) == pytest.approx(held_at, abs=3)


def test_a_sheet_that_slips_out_of_closed_fingers_is_lost() -> None:
    """They move on by one count, and had kept their contact."""
    bench = active("box:2x40x90,0.02")
    bench.move(255, force=0)
    assert bench.status.finger_status(JAW) is ObjectStatus.CONTACT_CLOSING
    bench.physics.take_away()
    bench.run(1)
    assert bench.status.finger_status(JAW) is ObjectStatus.AT_POSITION
    assert bench.status.position(JAW) == 228


def test_parts_stay_away_until_an_activation_that_began_half_closed_has_ended() -> None:
    """Fingers close for half of its time, and wait when they began nearer: parts came back between them."""
    bench = active(BOX)
    bench.move(60)
    bench.gripper.power_cycle(0.1)
    bench.run(0.5)
    bench.activate()
    assert bench.physics.part == pytest.approx((0, 0, 30), abs=1)


def test_a_part_that_is_put_back_between_closed_fingers_is_met() -> None:
    bench = active(BOX)
    bench.physics.take_away()
    bench.move(255)
    assert bench.status.finger_status(JAW) is ObjectStatus.AT_POSITION
    bench.physics.put_back()
    bench.run(1)
    assert bench.status.finger_status(JAW) is ObjectStatus.CONTACT_CLOSING


# -- the 3-Finger ----------------------------------------------------------------------------------------


def test_fingers_wrap_around_a_rod_at_the_palm_and_pinch_one_at_the_tips() -> None:
    bent = {}
    for at in (105, 170):
        bench = active(f"rod:60x140,0.3@{at}", THREE_FINGER)
        bench.move(255, force=128)
        bench.run(0.3)
        assert bench.status.contacts & Finger.ABC == Finger.ABC
        before = bench.physics.part
        assert before is not None
        bench.physics.lift(40)
        bench.run(0.6)
        assert bench.physics.part is not None
        assert bench.physics.part[2] - before[2] == pytest.approx(40, abs=8), "it is held"
        bent[at] = bench.status.position(Finger.A)
    assert bent[105] > 140 > bent[170], "beyond 140 counts a finger that meets nothing bends its middle joint"


def test_a_finger_that_is_stopped_early_bends_earlier_than_a_free_one() -> None:
    bench = active("rod:70x140,0.3@110", THREE_FINGER)
    bench.move(255)
    world = bench.physics._mechanism.world
    base, middle = (
        float(world._data.joint(f"gripper/finger_middle_joint_{number}").qpos[0]) for number in (1, 2)
    )
    assert middle > 0.3, "the middle phalanx goes on"
    assert base < 1.15, "although the base has not reached its stop"


def test_each_finger_presses_with_the_force_of_the_table_on_what_does_not_give_way() -> None:
    """By the manual the register of a finger sets its force. A block of 90 kg stays; fast fingers hit it."""
    bench = active("box:60x80x90,90", THREE_FINGER)
    low, high = THREE_FINGER.forces_n
    for speed, within in ((255, 0.2), (0, 0.03)):
        for force in (0, 128, 255):
            bench.move(0)
            bench.physics.put_back()
            bench.move(255, force=force, speed=speed)
            bench.run(0.5)
            forces = bench.physics.forces
            assert forces.keys() == {*FINGERS}, "the palm touches nothing"
            assert list(forces.values()) == pytest.approx([low + (high - low) * force / 255] * 3, rel=within)


def test_what_b_and_c_press_a_holds() -> None:
    """The box can move: each of two fingers presses with its force, and the third has gears that lock."""
    bench = active("box:60x80x60,0.3", THREE_FINGER)
    assert bench.physics.opening_mm == pytest.approx(155, abs=4), "from A to the others: 155 by the manual"
    bench.move(255, force=255, speed=0)
    assert bench.physics.opening_mm == pytest.approx(60, abs=2)
    bench.run(0.5)
    forces = bench.physics.forces
    pressed = [forces[finger] for finger in FINGERS]
    assert pressed == pytest.approx([120, 60, 60], rel=0.1)
    assert bench.physics.grip_force == max(pressed)
    positions = [bench.status.position(finger) for finger in (Finger.A, Finger.B, Finger.C)]
    assert max(positions) - min(positions) < 30, "a stronger pair does not push a finger open"


def test_a_3_finger_keeps_its_contact_when_the_part_is_gone() -> None:
    """By its manual fingers that met something stay there; those of a jaw move on."""
    bench = active("box:60x60x60,0.3", THREE_FINGER)
    bench.move(255, force=60)
    at = bench.status.position(Finger.A)
    bench.physics.take_away()
    bench.run(1)
    assert bench.status.contacts & Finger.ABC == Finger.ABC
    assert bench.status.position(Finger.A) == pytest.approx(at, abs=8)


# -- behind the wire -------------------------------------------------------------------------------------


async def test_a_hand_grips_and_releases_a_part() -> None:
    """In real time, by an address: the contract on bodies has all models."""
    address = "sim://?speedup=4&physics=box:60x60x60,0.3&model=3f"
    async with RobotiqHand(address, poll_interval=0.02) as hand:
        await hand.activate()
        assert (await hand.close()).object_detected
        assert not (await hand.open()).object_detected


@pytest.mark.parametrize(
    ("address", "faster", "said"),
    [
        ("sim://?model=2f85&speedup=2&physics=box:60x40x60,0.3", 1, r"held at \d\d counts: about 60 mm"),
        ("sim://?model=2f85&speedup=8", 4, "nothing there"),
    ],
)
def test_the_example_runs_with_and_without_physics(
    address: str,
    faster: int,
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(grasp_loop, "PERIOD_S", grasp_loop.PERIOD_S / faster)
    grasp_loop.main(address)
    assert re.match(said, capsys.readouterr().out)


def test_an_address_has_one_part() -> None:
    with pytest.raises(ValueError, match="cannot be combined"):
        RobotiqHand("sim://?object=100&physics=table")
    with pytest.raises(ValueError, match="physics must be table"):
        RobotiqHand("sim://?physics=cone")


def test_a_gripper_does_not_wait_for_its_thread_and_moves_until_that_has_its_order() -> None:
    """It stands in an event loop. A step on a busy machine had held that for 12 ms."""
    physics = Physics(BOX, threaded=True)
    gripper = SimulatedGripper(model=TWO_FINGER_85, physics=physics, speedup=10)
    gripper.write(0, [0x0100, 0, 0])
    until(lambda: bool(gripper.status_registers()[0] & 0x3000 == 0x3000))
    physics._mechanism.lock.acquire()  # the thread stands still in a step
    try:
        asked = threading.Thread(target=lambda: gripper.write(0, [0x0900, 255, 0xFFFF]), daemon=True)
        asked.start()
        asked.join(patience(5))
        assert not asked.is_alive()
        until(lambda: gripper.is_moving)
        before = gripper.position(JAW)
        time.sleep(0.05)
        assert gripper.is_moving
        assert gripper.position(JAW) == before
        assert gripper.bodies is not None
    finally:
        physics._mechanism.lock.release()
    until(lambda: not gripper.is_moving)
    assert gripper.holds == JAW


def test_what_a_motor_tells_before_it_has_its_order_is_not_the_end_of_the_new_motion() -> None:
    """The thread may make a step between the order and its being taken up."""
    bench, orders = active("table"), deque[Callable[[], None]]()
    bench.move(0)
    motor = mechanism_of(bench.physics).drive(JAW)
    told = OrderedDrive(motor, orders)
    assert told.outcome is motor.outcome is ObjectStatus.AT_POSITION
    told.go(200.0, Way(100.0), 255, clears=False)
    assert motor.outcome is ObjectStatus.AT_POSITION
    assert told.outcome is ObjectStatus.IN_MOTION
    orders.popleft()()
    bench.run(5)
    assert told.outcome is ObjectStatus.AT_POSITION
    assert told.position == pytest.approx(200, abs=1)


def until(condition: Callable[[], bool]) -> None:
    ends = time.monotonic() + patience(10)
    while not condition():
        assert time.monotonic() < ends, "in vain"
        time.sleep(0.005)
