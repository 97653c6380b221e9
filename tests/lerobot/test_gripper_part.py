"""The part that a robot class of LeRobot embeds, at a gripper in memory; LeRobot is not needed."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest

import robotiq_async
from robotiq_async import (
    ConnectionLostError,
    Convention,
    Finger,
    GripperFaultError,
    InvalidStateError,
    NotActivatedError,
    NotStartedError,
    ReconnectPolicy,
    State,
)
from robotiq_async.dropins.lerobot import GripperPart
from robotiq_async.sync import RobotiqHand
from robotiq_async.values.request import Request
from tests.sync.conftest import PATIENCE, Wire, in_a_thread, no_thread_is_left, until, wire

__all__ = ["no_thread_is_left", "wire"]


@pytest.fixture
def part(wire: Wire) -> Iterator[GripperPart]:
    """It has connected to a gripper that is active."""
    part = GripperPart(RobotiqHand(wire, speed=255), Convention.LEROBOT)
    part.connect()
    yield part
    part.disconnect()


def request(wire: Wire) -> tuple[int, int]:
    """Position and force in the last request to the fingers."""
    (asked,) = {(axis.position, axis.force) for axis in decoded(wire).axes[:3]}
    return asked


def decoded(wire: Wire) -> Request:
    return Request.from_registers(wire.look(lambda gripper: gripper.request_registers))


# -- connecting ----------------------------------------------------------------------------------------


def test_an_active_gripper_is_adopted_and_nothing_is_written(wire: Wire) -> None:
    part = GripperPart(RobotiqHand(wire), Convention.LEROBOT)
    before = wire.writes()
    part.connect()
    assert part.is_connected
    assert part.observe() == {"gripper.pos": 100.0, "gripper.current": 0.0, "gripper.contact": 0.0}
    assert wire.writes() == before
    part.disconnect()
    part.disconnect()
    assert not part.is_connected


def test_a_gripper_that_is_reset_moves_only_when_that_was_asked_for(caplog: pytest.LogCaptureFixture) -> None:
    wire = Wire()
    hand = RobotiqHand(wire)
    part = GripperPart(hand, Convention.LEROBOT)
    with pytest.raises(NotActivatedError, match=r"activate=True .*, which MOVES the fingers"):
        part.connect()
    assert not part.is_connected
    assert hand.state is State.SHUTDOWN
    assert wire.writes() == -1, "a look writes nothing"
    assert "MOVE" not in caplog.text
    thread, _ = in_a_thread(lambda: part.connect(activate=True))
    until(lambda: wire.writes() >= 0)
    assert "its fingers MOVE" in caplog.text
    wire.ahead += 10
    thread.join(PATIENCE)
    assert part.is_connected
    part.disconnect()


def test_a_hand_for_asyncio_is_refused_before_it_connects() -> None:
    """Its start is a coroutine that nobody awaits, and "not started" explains nothing: both have one name."""
    with pytest.raises(TypeError, match=r"a blocking one, of robotiq_async\.sync, got <RobotiqHand"):
        GripperPart(robotiq_async.RobotiqHand("sim://"), Convention.LEROBOT)  # type: ignore[arg-type]


def test_connecting_twice_is_refused_and_ends_nothing(part: GripperPart) -> None:
    with pytest.raises(InvalidStateError):
        part.connect()
    assert part.is_connected
    part.observe()


def test_an_interrupted_start_leaves_nothing_running(wire: Wire) -> None:
    hand = StruckHand(wire)
    with pytest.raises(KeyboardInterrupt):
        GripperPart(hand, Convention.LEROBOT).connect()
    assert hand.state is State.SHUTDOWN


class StruckHand(RobotiqHand):
    """Ctrl-C comes when it has started, before the start has returned."""

    def start(self, activate: bool = True, *, wait: float = 0.0) -> None:
        super().start(activate, wait=wait)
        raise KeyboardInterrupt


def test_a_gripper_in_fault_is_refused(wire: Wire) -> None:
    wire.look(lambda gripper: gripper.inject_fault(0x0E))
    hand = RobotiqHand(wire)
    with pytest.raises(GripperFaultError):
        GripperPart(hand, Convention.LEROBOT).connect(activate=True)
    assert hand.state is State.SHUTDOWN


# -- the loop ------------------------------------------------------------------------------------------


def test_positions_are_0_closed_and_100_open(part: GripperPart, wire: Wire) -> None:
    part.act(0, 50)
    until(lambda: request(wire)[0] == 255)
    part.act(100)
    until(lambda: request(wire)[0] == 0)
    part.act(40.0)
    until(lambda: 0 < request(wire)[0] < 255)
    wire.ahead += 10
    until(lambda: part.observe()["gripper.pos"] == pytest.approx(40, abs=1))


def test_force_is_in_percent_and_stays_when_it_is_left_out(part: GripperPart, wire: Wire) -> None:
    for force, counts in ((100, 255), (0, 0), (20, 51), (None, 51)):
        part.act(counts / 3, force)
        until(lambda counts=counts: request(wire)[1] == counts)  # type: ignore[misc]


def test_what_is_held_is_seen(part: GripperPart, wire: Wire) -> None:
    wire.look(lambda gripper: gripper.place_object(Finger.A | Finger.B, position=150))
    part.act(0)
    until(lambda: request(wire)[0] == 255)
    wire.ahead += 10
    until(lambda: part.observe()["gripper.contact"] == pytest.approx(2 / 3))
    # A and B are at the part, 39 % open, and C is closed.
    assert part.observe()["gripper.pos"] == pytest.approx(100 * 2 / 3 * 0.39, abs=1)


def test_a_jaw_is_observed_as_its_only_axis(jaw: GripperPart) -> None:
    jaw.act(0)
    until(lambda: jaw.observe()["gripper.contact"] == 1)
    assert jaw.observe()["gripper.pos"] == pytest.approx(34.7, abs=2), "150 counts of 3..228"


@pytest.fixture
def jaw() -> Iterator[GripperPart]:
    part = GripperPart(RobotiqHand("sim://?model=2f85&speedup=100&object=150"), Convention.LEROBOT)
    part.connect(activate=True)
    yield part
    part.disconnect()


def test_numbers_of_numpy_and_arrays_of_one_value_are_numbers(part: GripperPart, wire: Wire) -> None:
    """So are tensors, of which lerobot-replay sends one for each value."""
    part.act(np.float32(0))
    until(lambda: request(wire)[0] == 255)
    part.act(np.array(100.0), np.array([20.0]))
    until(lambda: request(wire) == (0, 51))


@pytest.mark.parametrize("pos", [-0.1, 100.1, float("nan"), float("inf")])
def test_what_is_outside_the_scale_is_refused(part: GripperPart, wire: Wire, pos: float) -> None:
    before = wire.writes()
    with pytest.raises(ValueError, match=r"value must be a number of LEROBOT in 0\.0\.\.100\.0, got"):
        part.act(pos)
    with pytest.raises(ValueError, match=r"force must be percent in 0\.0\.\.100\.0, got"):
        part.act(50, pos)
    assert wire.writes() == before


def test_what_a_policy_overshoots_is_clamped_and_returned_as_sent(part: GripperPart, wire: Wire) -> None:
    assert part.act(-2, 130, clamp=True) == {"gripper.pos": 0.0, "gripper.force": 100.0}
    until(lambda: request(wire) == (255, 255))
    assert part.act(np.float32(103), clamp=True) == {"gripper.pos": 100.0}
    until(lambda: request(wire) == (0, 255))
    before = wire.writes()
    for value in (float("nan"), float("inf")):
        with pytest.raises(ValueError, match="must be"):
            part.act(value, clamp=True)
        with pytest.raises(ValueError, match="must be"):
            part.act(50, value, clamp=True)
    assert wire.writes() == before


def test_the_same_part_speaks_another_convention(wire: Wire) -> None:
    part = GripperPart(RobotiqHand(wire, speed=255), Convention.DROID)
    part.connect()
    assert part.observe()["gripper.pos"] == 0
    assert part.act(1) == {"gripper.pos": 1.0}
    until(lambda: request(wire)[0] == 255)
    wire.ahead += 10
    until(lambda: part.observe()["gripper.pos"] == 1)
    part.disconnect()


def test_a_part_without_a_convention_is_refused(wire: Wire) -> None:
    """The sign would be a guess, and the wrong one opens where it should grip."""
    for arguments in ((), (None,), ("DROID",)):
        with pytest.raises(TypeError, match="convention"):
            GripperPart(RobotiqHand(wire), *arguments)


def test_over_a_urcap_there_is_no_key_for_a_current_also_before_connecting() -> None:
    part = GripperPart(RobotiqHand("urcap://127.0.0.1?model=2f85"), Convention.LEROBOT)
    assert part.observations == ("gripper.pos", "gripper.contact")
    assert "gripper.current" in GripperPart(RobotiqHand("sim://"), Convention.LEROBOT).observations


def test_a_reset_gripper_is_activated_by_its_own_call(caplog: pytest.LogCaptureFixture) -> None:
    wire = Wire()
    part = GripperPart(RobotiqHand(wire), Convention.LEROBOT)
    assert not part.is_active
    part.connect(allow_reset=True)
    assert not part.is_active
    assert wire.writes() == -1, "nothing was written"
    assert "MOVE" not in caplog.text
    thread, _ = in_a_thread(part.activate)
    until(lambda: wire.writes() >= 0)
    wire.ahead += 10
    thread.join(PATIENCE)
    assert part.is_active
    assert "its fingers MOVE" in caplog.text
    before = wire.writes()
    part.activate()
    assert wire.writes() == before
    part.disconnect()
    assert not part.is_active


def test_what_is_no_number_is_refused(part: GripperPart) -> None:
    for value in (None, "50", True, [50.0], np.array([50.0, 60.0])):
        with pytest.raises(TypeError, match="value must be a number of LEROBOT"):
            part.act(value)


def test_before_connecting_and_afterwards_nothing_goes(wire: Wire) -> None:
    part = GripperPart(RobotiqHand(wire), Convention.LEROBOT)
    for _ in range(2):
        with pytest.raises(NotStartedError):
            part.observe()
        with pytest.raises(NotStartedError):
            part.act(50)
        part.connect()
        part.disconnect()


# -- what must not pass in silence ---------------------------------------------------------------------


def test_a_gripper_that_falls_silent_ends_the_loop(wire: Wire) -> None:
    """It ends while the hand still waits for an answer and takes the link for a good one."""
    hand = RobotiqHand(wire)
    part = GripperPart(hand, Convention.LEROBOT, lost_after=0.1)
    part.connect()
    wire.is_slow = True
    until(lambda: fails(part))
    assert hand.state is not State.DISCONNECTED
    with pytest.raises(ConnectionLostError, match=r"no status .*0\.1 s"):
        part.act(50)
    assert part.is_connected, "LeRobot disconnects only what is connected"
    wire.is_slow = False
    until(lambda: not fails(part))
    part.disconnect()


def fails(part: GripperPart) -> bool:
    try:
        part.observe()
    except ConnectionLostError:
        return True
    return False


def test_a_link_that_stays_down_ends_the_loop(wire: Wire) -> None:
    later = ReconnectPolicy(first_delay=10, max_delay=10)
    part = GripperPart(RobotiqHand(wire, reconnect=later), Convention.LEROBOT, lost_after=0.1)
    part.connect()
    wire.breaks = True
    until(lambda: fails(part))
    part.disconnect()


def test_a_link_that_breaks_and_comes_back_ends_nothing_and_the_wait_is_reported(
    part: GripperPart, wire: Wire, caplog: pytest.LogCaptureFixture
) -> None:
    """A frame is late, and what it has is not old: it was read after the break."""
    wire.breaks = True
    until(lambda: not wire.breaks)
    wire.look(lambda gripper: gripper.place_object(Finger.ABC, position=100))
    assert part.act(0) == {"gripper.pos": 0.0}
    until(lambda: request(wire)[0] == 255)
    wire.ahead += 10
    until(lambda: part.observe()["gripper.contact"] == 1)
    assert "link lost" in caplog.text


def test_a_gripper_that_loses_its_activation_takes_no_action(wire: Wire) -> None:
    hand = RobotiqHand(wire, speed=255)
    part = GripperPart(hand, Convention.LEROBOT)
    part.connect()
    wire.look(lambda gripper: gripper.power_cycle())
    until(lambda: hand.state is State.RESET)
    with pytest.raises(NotActivatedError):
        part.act(50)
    part.disconnect()


def test_disconnecting_stops_the_fingers(part: GripperPart, wire: Wire) -> None:
    part.act(0)
    until(wire.is_moving)
    part.disconnect()
    assert not wire.is_moving()


def test_the_limit_is_checked(wire: Wire) -> None:
    with pytest.raises(ValueError, match=r"lost_after must be seconds in 0\.05\.\.60\.0, got 0"):
        GripperPart(RobotiqHand(wire), Convention.LEROBOT, lost_after=0)


# -- without LeRobot -----------------------------------------------------------------------------------


def test_the_part_imports_nothing_of_lerobot_and_the_robot_says_that_it_is_missing() -> None:
    program = """
import sys
sys.modules["lerobot"] = None  # as if it were not installed
import robotiq_async.dropins.lerobot as ours
try:
    ours.RobotiqGripper
except ImportError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert "the robot needs LeRobot 0.6 and Python 3.12 or newer: pip install" in done.stdout
