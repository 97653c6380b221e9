"""The class that labs copy as robotiq_gripper.py: its calls on every wire, bad lines, clients, its end."""

from __future__ import annotations

import inspect
import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from robotiq_async import (
    HAND_E,
    JAW,
    THREE_FINGER,
    TWO_FINGER_85,
    TWO_FINGER_140,
    ConnectionLostError,
    Finger,
    GripperFaultError,
    InvalidStateError,
    Model,
    MoveSupersededError,
    NotActivatedError,
)
from robotiq_async.dropins.ur import RobotiqGripper
from robotiq_async.simulator import SimulatedGripper, Trouble
from tests.dropins.lockstep import WIRES, Line, bad, inside, line, rest
from tests.dropins.race import PROGRAMS, TIME_OUT_S, Loop, Tally, Watched
from tests.sync.conftest import run_to_its_end

CONTACT = 15
"""Counts that a contact may read beside the part."""
DEST, INNER = RobotiqGripper.ObjectStatus.AT_DEST, RobotiqGripper.ObjectStatus.STOPPED_INNER_OBJECT


@contextmanager
def driver(here: Line, socket_timeout: float = TIME_OUT_S, **options: Any) -> Iterator[RobotiqGripper]:
    """It is connected."""
    gripper = RobotiqGripper(response_timeout=0.1, **options)
    gripper.connect(here.address, socket_timeout=socket_timeout)
    try:
        yield gripper
    finally:
        here.server.policy = bad(0, 0)
        gripper.disconnect()


def near(target: int) -> Any:
    """Where the fingers rest that were sent there: a count or two beside it."""
    return pytest.approx(target, abs=2)


def stopped(gripper: RobotiqGripper) -> int:
    """The values that the loop of programs gets that wait for the fingers."""
    while (status := gripper._get_var("OBJ")) == 0:
        rest(0.005)
    return status


# -- its calls ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wire", "model"),
    [
        ("urcap", TWO_FINGER_85),
        ("rtu", HAND_E),
        ("rtu+tcp", TWO_FINGER_140),
        ("tcp", TWO_FINGER_85),
        ("tcp", THREE_FINGER),
        ("rtu", THREE_FINGER),
    ],
)
def test_each_call_on_every_wire_and_model(wire: str, model: Model) -> None:
    with line(wire, active=False, model=model) as here, driver(here) as gripper:
        assert not gripper.is_active()
        gripper.activate()
        assert gripper.is_active()
        low, high = gripper.get_min_position(), gripper.get_max_position()
        assert low <= model.open_reading_max
        assert high >= model.closed_reading_min
        assert (gripper.get_open_position(), gripper.get_closed_position()) == (low, high)
        assert gripper.move_and_wait_for_pos(255, 64, 1) == (near(high), DEST)
        assert gripper.move(100, 200, 30) == (True, 100)
        names = ("PRE", "STA", "ACT", "GTO", "FLT", "SPE", "FOR")
        assert stopped(gripper) == DEST.value
        assert [gripper._get_var(name) for name in names] == [100, 3, 1, 1, 0, 200, 30]
        assert gripper._get_var("POS") == gripper.get_current_position() == near(100)
        here.gripper.place_object(Finger.ABC & model.all_axes, position=150)
        assert gripper.move_and_wait_for_pos(255, 0, 0) == (pytest.approx(150, abs=CONTACT), INNER)


def test_the_fingers_of_a_3_finger_go_together_and_its_scissor_stays() -> None:
    with line("tcp", model=THREE_FINGER) as here, driver(here) as gripper:
        scissor = here.gripper.position(Finger.SCISSOR)
        here.gripper.place_object(Finger.A, position=100)
        mean = pytest.approx((100 + 200 + 200) / 3, abs=CONTACT)
        assert gripper.move_and_wait_for_pos(200, 255, 0) == (mean, INNER)
        assert here.gripper.position(Finger.SCISSOR) == scissor


def test_connecting_writes_nothing_and_activating_an_active_gripper_either() -> None:
    with line("tcp") as here:
        before = len(here.gripper.writes)
        with driver(here) as gripper:
            gripper.activate(auto_calibrate=False)
            assert gripper.is_active()
            assert len(here.gripper.writes) == before


def test_positions_are_whole_counts_within_the_calibrated_range() -> None:
    with line("tcp") as here, driver(here) as gripper:
        assert gripper.move(0.4 * 255, 300, -1) == (True, 102)
        assert [gripper._get_var(name) for name in ("SPE", "FOR")] == [255, 0]
        gripper.auto_calibrate()
        assert gripper.move(255, 255, 0) == (True, gripper.get_max_position())
        assert gripper.move(-7, 255, 0) == (True, gripper.get_min_position())
        before = len(here.gripper.writes)
        for call in (gripper.move, gripper.move_and_wait_for_pos):
            with pytest.raises((ValueError, OverflowError)):
                call(math.nan, 255, 0)
            with pytest.raises((ValueError, OverflowError)):
                call(math.inf, 255, 0)
        rest(0.1)
        assert len(here.gripper.writes) <= before + 1, "the move before, at most"


def test_a_calibration_with_a_part_in_the_way_is_an_error() -> None:
    with line("tcp") as here, driver(here) as gripper:
        here.gripper.place_object(JAW, position=120)
        with pytest.raises(RuntimeError, match="because of an object"):
            gripper.activate()


def test_obj_is_0_until_the_gripper_shows_the_move() -> None:
    """Else a wait loop takes the arrival before for its own."""
    with line("tcp") as here, driver(here) as gripper:
        assert gripper._get_var("OBJ") == DEST.value
        for target in (200, 10, 11):
            gripper.move(target, 255, 0)
            assert gripper._get_var("OBJ") == 0
            assert stopped(gripper) == DEST.value
            assert gripper.get_current_position() == near(target)


def test_the_calls_are_those_of_the_copied_class() -> None:
    """The table of what programs use: names, arguments and defaults."""
    calls = {
        "connect": "(self, hostname, port=63352, socket_timeout=10.0)",
        "activate": "(self, auto_calibrate=True)",
        "auto_calibrate": "(self, log=True)",
        "move": "(self, position, speed, force)",
        "move_and_wait_for_pos": "(self, position, speed, force)",
        **dict.fromkeys(
            ("is_active", "get_current_position", "is_open", "is_closed", "disconnect"), "(self)"
        ),
        **{f"get_{end}_position": "(self)" for end in ("min", "max", "open", "closed")},
        "_get_var": "(self, variable)",
        "_set_var": "(self, variable, value)",
    }
    for name, signature in calls.items():
        found = inspect.signature(getattr(RobotiqGripper, name))
        bare = [each.replace(annotation=inspect.Parameter.empty) for each in found.parameters.values()]
        assert str(inspect.Signature(bare)).replace(" = ", "=") == signature, name
    assert [each.value for each in RobotiqGripper.ObjectStatus] == [0, 1, 2, 3]
    assert [each.value for each in RobotiqGripper.GripperStatus] == [0, 1, 3]
    for name in ("ACT", "GTO", "ATR", "ADR", "FOR", "SPE", "POS", "STA", "PRE", "OBJ", "FLT"):
        assert getattr(RobotiqGripper, name) == name


# -- a bad line --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("wire", WIRES)
@pytest.mark.parametrize("program", PROGRAMS.values(), ids=PROGRAMS)
def test_a_line_that_loses_replies_and_brings_them_late_costs_waits_alone(
    wire: str, program: Callable[[Loop], Tally]
) -> None:
    """One in a hundred, as `make race` has it in a hundred thousand exchanges."""
    with line(wire, kind=Watched) as here, driver(here) as gripper:
        here.server.policy = bad(0.01, 0.3)
        tally = program(Loop(gripper, here.gripper, 600, rest))
        assert not tally.exceptions
        assert tally.wrong == 0
        assert tally.longest < TIME_OUT_S + (2 if program is Loop.go else 0)


def test_a_dead_line_is_an_os_error_within_the_time_out_and_never_an_old_value() -> None:
    with line("tcp") as here, driver(here, socket_timeout=0.5) as gripper:
        here.server.policy = lambda _: ()
        rest(0.05)
        for call in (
            gripper.get_current_position,
            gripper.is_active,
            lambda: gripper.move(100, 255, 0),
            lambda: gripper.move_and_wait_for_pos(100, 255, 0),
            lambda: gripper._get_var("OBJ"),
        ):
            began = time.monotonic()
            with pytest.raises(OSError, match="no status for"):
                call()
            assert time.monotonic() - began <= 0.51
        here.server.policy = bad(0, 0)
        rest(2.1)  # the hand tries again every 2 s
        assert gripper.get_current_position() <= TWO_FINGER_85.open_reading_max
        assert gripper.move_and_wait_for_pos(100, 255, 0) == (near(100), DEST)


class Forgetful(SimulatedGripper):
    """It does not get the next request, or gets it; either way the reply is lost."""

    loses: str | None = None
    lost_reply = False

    def write(self, address_offset: int, registers: Any) -> None:
        what, self.loses = self.loses, None
        self.lost_reply = what is not None
        if what != "request":
            super().write(address_offset, registers)

    def policy(self, frame: bytes) -> tuple[tuple[float, bytes], ...]:
        lost, self.lost_reply = self.lost_reply, False
        return () if lost else ((0.0, frame),)


@pytest.mark.parametrize("lost", ["request", "reply"])
@pytest.mark.parametrize("wire", WIRES)
def test_after_a_lost_link_the_echo_decides_whether_a_move_is_sent_again(wire: str, lost: str) -> None:
    with line(wire, kind=Forgetful) as here, driver(here) as gripper:
        here.server.policy = here.gripper.policy
        calls: list[Callable[[], tuple[int, Any]]] = [
            lambda: gripper.move_and_wait_for_pos(180, 255, 0),
            lambda: waited_for(gripper, 90),
        ]
        for call in calls:
            travelled, before = here.gripper.travel(JAW), here.gripper.position(JAW)
            here.gripper.loses = lost
            position, status = call()
            assert status is DEST
            assert here.gripper.loses is None, "it was lost"
            assert here.gripper.travel(JAW) - travelled == pytest.approx(abs(position - before), abs=6), (
                "one way"
            )


def waited_for(gripper: RobotiqGripper, target: int) -> tuple[int, RobotiqGripper.ObjectStatus]:
    gripper.move(target, 255, 0)
    status = gripper.ObjectStatus(stopped(gripper))
    return gripper.get_current_position(), status


def test_a_move_that_was_lost_long_ago_is_not_sent_any_more() -> None:
    """A display that reads OBJ ten minutes later must not start a motion."""
    with line("tcp", kind=Forgetful) as here, driver(here) as gripper:
        here.server.policy = here.gripper.policy
        here.gripper.loses = "request"
        gripper.move(200, 255, 0)
        rest(TIME_OUT_S + 0.1)
        writes = len(here.gripper.writes)
        with pytest.raises(OSError, match="the move to 200 was lost with the link"):
            gripper._get_var("OBJ")
        assert gripper._get_var("PRE") == 0
        rest(0.5)
        assert len(here.gripper.writes) == writes
        assert waited_for(gripper, 100) == (near(100), DEST)


# -- other clients, faults -----------------------------------------------------------------------------------


def test_a_move_that_another_client_takes_over_is_not_called_done() -> None:
    with line("tcp") as here, driver(here) as gripper:
        other = Trouble("foreign", 40, at=0.2)
        running = inside(lambda: begun(here, other))
        with pytest.raises(MoveSupersededError):
            gripper.move_and_wait_for_pos(255, 64, 0)
        gripper.move(255, 64, 0)
        rest(0.1)
        inside(lambda: here.server.fault_injector.begin(Trouble("foreign", 40)))
        rest(1)
        with pytest.raises(MoveSupersededError, match="no longer to 255"):
            gripper._get_var("OBJ")
        assert gripper.move_and_wait_for_pos(200, 255, 0) == (near(200), DEST)
        assert running.done()


async def begun(here: Line, *troubles: Trouble) -> Any:
    import asyncio  # noqa: PLC0415  # here alone

    return asyncio.create_task(here.server.fault_injector.run(troubles))


def test_a_reset_gripper_and_a_fault_are_errors_and_activate_ends_them() -> None:
    with line("tcp", active=False) as here, driver(here) as gripper:
        with pytest.raises(NotActivatedError):
            gripper.move(100, 255, 0)
        gripper.activate(auto_calibrate=False)
        inside(lambda: here.server.fault_injector.begin(Trouble("fault", 0x0E)))
        rest(0.1)
        assert gripper._get_var("FLT") == 0x0E
        with pytest.raises(GripperFaultError):
            gripper.move_and_wait_for_pos(100, 255, 0)


def test_an_activation_survives_a_bad_line() -> None:
    with line("tcp", active=False) as here, driver(here) as gripper:
        here.server.policy = bad(0.03, 0.3)
        gripper.activate()
        assert gripper.get_max_position() >= TWO_FINGER_85.closed_reading_min


# -- its end -----------------------------------------------------------------------------------------------


def test_a_move_and_a_disconnect_at_once_as_gellos_own_program_has_it() -> None:
    with line("tcp") as here:
        with driver(here) as gripper:
            gripper.move(200, 255, 0)
        rest(2)
        assert here.gripper.position(JAW) == near(200)
        gripper.disconnect()
        with pytest.raises(OSError, match=r"call connect\(\) first"):
            gripper._connected  # noqa: B018


def test_it_connects_again() -> None:
    with line("tcp") as here, driver(here) as gripper:
        with pytest.raises(InvalidStateError):
            gripper.connect(here.address)
        where = gripper.get_current_position()
        gripper.disconnect()
        gripper.connect(here.address)
        assert gripper.get_current_position() == where


async def test_a_program_that_ends_without_a_disconnect_stops_the_fingers() -> None:
    gripper, _ = await run_to_its_end(
        "import sys\n"
        "from robotiq_async.dropins.ur import RobotiqGripper\n"
        "gripper = RobotiqGripper()\n"
        "gripper.connect(sys.argv[1])\n"
        "gripper.move(255, 0, 0)\n"
        "while gripper.get_current_position() < 10: pass\n"
    )
    assert gripper.position(Finger.A) < 200


# -- refusals ------------------------------------------------------------------------------------------------


def test_what_is_refused() -> None:
    with line("tcp") as here, driver(here) as gripper:
        before = len(here.gripper.writes)
        with pytest.raises(NotImplementedError, match="POS is not set to 100"):
            gripper._set_var("POS", 100)
        with pytest.raises(ValueError, match="'COU' is none of POS, OBJ"):
            gripper._get_var("COU")
        assert len(here.gripper.writes) == before


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"socket_timeout": 0}, "socket_timeout"),
        ({"socket_timeout": None}, "socket_timeout"),
        ({"port": 0}, "port"),
        ({"port": "63352"}, "port"),
    ],
)
def test_what_is_no_time_out_and_no_port_is_refused_before_connecting(
    arguments: dict[str, Any], name: str
) -> None:
    with pytest.raises((TypeError, ValueError), match=name):
        RobotiqGripper().connect("127.0.0.1", **arguments)


def test_nobody_listens() -> None:
    with pytest.raises(ConnectionError):
        RobotiqGripper().connect("tcp://127.0.0.1:1?model=2f85")
    with pytest.raises(ConnectionLostError, match=r"call connect\(\) first"):
        RobotiqGripper()._connected  # noqa: B018
