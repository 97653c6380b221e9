"""A configured node and its hand, without ROS: its commands, the end of them by a stop, its reports."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import AsyncIterator, Awaitable
from dataclasses import replace

import pytest

from robotiq_async import (
    TWO_FINGER_85,
    Fault,
    Finger,
    RobotiqError,
    RobotiqHand,
    RobotiqStatus,
    State,
    StateTimeoutError,
)
from robotiq_async.ros2.gripper.connection import (
    MOST_CALLS,
    NODE_COMMANDS,
    PENDING_S,
    GripperConnection,
    HandMaker,
    PendingStop,
    RefusedError,
)
from robotiq_async.ros2.gripper.goals import GoalEnding, GoalOutcome
from robotiq_async.ros2.translation.diagnosis import DiagnosticLevel, diagnose, status_text
from robotiq_async.ros2.translation.joints import Targets
from robotiq_async.ros2.translation.settings import PARAMETERS, check_settings
from robotiq_async.runtime.clock import now
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.fake_hand import FakeBackend, FakeHand
from tests.fleet.lab import lab
from tests.grippers import activate_beforehand, lose_link, shows
from tests.virtual import LATENCY_S

pytestmark = pytest.mark.virtual_time

SETTINGS = check_settings({name: parameter.default for name, parameter in PARAMETERS.items()})
CLOSE = Targets(((240, Finger.ABC),))
POLL_S = 0.02
FAR = 200
"""Fingers that were stopped on their way are not there."""


@pytest.fixture
async def gripper() -> SimulatedGripper:
    """One that takes some three seconds to close."""
    return SimulatedGripper(asyncio.get_running_loop().time, spread=False)


@pytest.fixture
async def inactive(server: SimulatorServer) -> AsyncIterator[GripperConnection]:
    """The connection of a node that was configured."""
    connection = GripperConnection(RobotiqHand(server.address, poll_interval=POLL_S), SETTINGS)
    await connection.open()
    yield connection
    await connection.close("the end")


@pytest.fixture
async def connection(inactive: GripperConnection) -> GripperConnection:
    """The connection of an active node, at an active gripper."""
    await inactive.permit()
    await inactive.command("activate")
    return inactive


def begin(connection: GripperConnection, key: bytes = b"1") -> asyncio.Task[GoalOutcome]:
    return asyncio.create_task(connection.run_goal(key, CLOSE, SETTINGS, lambda: None, connection.stops))


async def moving(connection: GripperConnection) -> asyncio.Task[GoalOutcome]:
    """A goal whose fingers have begun to move."""
    goal = begin(connection)
    await shows(connection.hand, lambda status: status.position(Finger.A) > 40)
    return goal


async def refuses(words: str, *requests: Awaitable[object]) -> None:
    for request in requests:
        with pytest.raises(RefusedError, match=words):
            await request


async def settled(gripper: SimulatedGripper) -> int:
    """The position of finger A, after all that was to come has come."""
    await asyncio.sleep(4)
    return gripper.position(Finger.A)


async def test_an_inactive_node_takes_a_halt_and_nothing_else(
    inactive: GripperConnection, gripper: SimulatedGripper
) -> None:
    others = set(NODE_COMMANDS) - {"halt", "inhibit", "permit"}
    await refuses("the node is not active", *map(inactive.command, others), begin(inactive))
    assert not gripper.writes
    assert await inactive.command("halt")


async def test_an_inhibit_stays_until_a_person_permits(
    connection: GripperConnection, gripper: SimulatedGripper
) -> None:
    goal = await moving(connection)
    assert "motion is refused" in await connection.command("inhibit")
    await goal
    at = await settled(gripper)
    await refuses("HALT was pressed.*call ~/permit", begin(connection))
    shown = json.loads(status_text(connection.hand, takes_commands=True))
    assert shown["inhibited"]["reason"] == "HALT was pressed"
    assert diagnose(connection.hand, now())[1].level is DiagnosticLevel.WARN
    assert await settled(gripper) == at
    assert await connection.command("permit")
    assert (await begin(connection)).ending is GoalEnding.SUCCEEDED


async def test_an_inhibit_stays_over_a_cleanup_and_the_next_configure(
    server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    """Also where the node had the hand of an agent in between: it was dropped then."""
    pytest.importorskip("zenoh")
    settings, hands = replace(SETTINGS, address=server.address), HandMaker()
    connection = GripperConnection(hands.make(settings), settings)
    await connection.open()
    await connection.command("inhibit")
    await connection.close("the node was cleaned up")
    assert hands.make(replace(SETTINGS, address="zenoh://lab/cell/left")).inhibited is None
    other = GripperConnection(hands.make(settings), settings)
    await other.open()
    await other.permit()
    at = await settled(gripper)
    await refuses("HALT was pressed.*call ~/permit", begin(other))
    assert await settled(gripper) == at
    assert await other.command("permit")
    await other.close("the node was cleaned up")
    assert hands.make(settings).inhibited is None


async def test_opening_permitting_and_closing_activate_nothing(
    inactive: GripperConnection, gripper: SimulatedGripper
) -> None:
    await inactive.permit()
    await inactive.close("the end")
    assert inactive.hand.state is State.SHUTDOWN
    assert not any(write.registers[0] >> 8 & 0x01 for write in gripper.writes), "rACT"


@pytest.mark.parametrize("opened", [True, False])
async def test_a_node_that_was_never_active_leaves_the_fingers_alone(
    server: SimulatorServer, gripper: SimulatedGripper, opened: bool
) -> None:
    connection = GripperConnection(RobotiqHand(server.address), SETTINGS)
    if opened:
        await connection.open()
    await connection.close("the end")
    await connection.close("twice")
    assert not gripper.writes
    await refuses("the connection has been closed", connection.open(), connection.permit())
    assert not connection.takes_commands


async def test_a_node_that_was_never_active_does_not_halt_what_another_client_has_activated(
    server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    await activate_beforehand(gripper)
    writes = len(gripper.writes)
    connection = GripperConnection(RobotiqHand(server.address), SETTINGS)
    await connection.open()
    await connection.close("the end")
    assert len(gripper.writes) == writes


async def test_any_hand_will_do() -> None:
    connection = GripperConnection(FakeHand(), SETTINGS)
    await connection.open()
    await connection.permit()
    assert (await begin(connection)).ending is GoalEnding.SUCCEEDED
    await connection.close("the end")


# -- stops -------------------------------------------------------------------------------------------------


async def test_forbidding_aborts_the_goal_and_halts(
    connection: GripperConnection, gripper: SimulatedGripper
) -> None:
    goal = await moving(connection)
    assert await connection.forbid("the node was deactivated")
    assert ((await goal).ending, (await goal).reason) == (GoalEnding.ABORTED, "the node was deactivated")
    assert not gripper.request_registers[0] >> 8 & 0x08, "rGTO"
    assert not connection.takes_commands


async def test_a_halt_is_never_one_command_too_many(connection: GripperConnection) -> None:
    await connection.command("reset")
    activations = [asyncio.create_task(connection.command("activate")) for _ in range(MOST_CALLS)]
    await connection.hand.wait_for_state(State.WF_ACTIVATION)
    await refuses("16 commands are under way", connection.command("activate"))
    assert "the gripper is reset" in await connection.command("halt")
    ended = await asyncio.gather(*activations, return_exceptions=True)
    assert all(isinstance(each, RobotiqError) for each in ended)


@pytest.mark.parametrize("turns", [1, 2, 3, 4])
async def test_a_goal_that_begins_beside_a_halt_moves_nothing_after_it(
    connection: GripperConnection, gripper: SimulatedGripper, turns: int
) -> None:
    goal = begin(connection)
    for _ in range(turns):
        await asyncio.sleep(0)
    await connection.command("halt")
    assert (await goal).ending is GoalEnding.ABORTED
    assert await settled(gripper) < 20


async def test_a_goal_that_was_accepted_before_a_halt_is_not_begun_after_it(
    connection: GripperConnection, gripper: SimulatedGripper
) -> None:
    accepted_at = connection.stops
    await connection.command("halt")
    writes = len(gripper.writes)
    goal = connection.run_goal(b"1", CLOSE, SETTINGS, lambda: None, accepted_at)
    await refuses("a stop took over before it began", goal)
    assert len(gripper.writes) == writes


async def test_while_a_halt_is_under_way_nothing_else_is_taken(
    connection: GripperConnection, gripper: SimulatedGripper
) -> None:
    goal = await moving(connection)
    halting = asyncio.create_task(connection.command("halt"))
    await asyncio.sleep(0)
    calls = map(connection.command, ("activate", "recover", "reset"))
    await refuses("a halt is under way", *calls, begin(connection, b"2"))
    await halting
    assert (await goal).reason == "a halt took over"
    assert connection.hand.state is State.RUNNING_IDLE
    assert await settled(gripper) < FAR


@pytest.mark.parametrize("name", ["activate", "recover"])
async def test_a_halt_ends_what_a_service_has_begun(connection: GripperConnection, name: str) -> None:
    await connection.command("reset")
    call = asyncio.create_task(connection.command(name))
    await connection.hand.wait_for_state(State.WF_ACTIVATION)
    assert "the gripper is reset" in await connection.command("halt")
    await refuses(f"a stop took over: {name} was aborted", call)


@pytest.mark.parametrize("turns", [1, 2])
async def test_an_activation_that_waits_for_its_lease_does_not_begin_after_a_stop(turns: int) -> None:
    async with lab(active=False) as here:
        connection = GripperConnection(here.client(control=None), SETTINGS)
        await connection.open()
        await connection.permit()
        call = asyncio.create_task(connection.command("activate"))
        for _ in range(turns):
            await asyncio.sleep(0)
        await connection.forbid("the node was deactivated")
        await refuses("a stop took over", call)
        await asyncio.sleep(1)
        assert connection.hand.state is State.RESET
        await connection.close("the end")


@pytest.mark.parametrize("offset", [0.0, 0.006, 0.012, 0.018])
async def test_a_cancel_is_acknowledged_with_the_next_poll(
    connection: GripperConnection, offset: float
) -> None:
    goal = await moving(connection)
    await asyncio.sleep(offset)
    asked = asyncio.get_running_loop().time()
    await connection.cancel_goal(b"1")
    assert (await goal).ending is GoalEnding.CANCELED
    assert asyncio.get_running_loop().time() - asked <= POLL_S + 5 * LATENCY_S


async def test_a_connection_that_is_ending_takes_no_command_while_the_rest_ends(
    connection: GripperConnection, gripper: SimulatedGripper
) -> None:
    """The publishers were stopped first, and commands were taken until that was done."""
    goal = await moving(connection)
    connection.refuse("the node is shutting down")
    calls = map(connection.command, ("activate", "reset", "recover", "release"))
    await refuses("not active|been closed", *calls, begin(connection, b"2"), connection.permit())
    await connection.close("the node is shutting down")
    assert (await goal).ending is GoalEnding.ABORTED
    assert await settled(gripper) < FAR


# -- what a lost link keeps back ---------------------------------------------------------------------------


async def test_the_fingers_of_a_goal_that_a_lost_link_ended_are_held_when_it_is_back(
    connection: GripperConnection, gripper: SimulatedGripper, server: SimulatorServer
) -> None:
    goal = await moving(connection)
    await lose_link(server, connection.hand)
    assert (await goal).ending is GoalEnding.ABORTED
    await refuses("the link to the gripper is down", begin(connection, b"2"))
    await asyncio.sleep(0.2)
    assert gripper.is_moving, "nothing can stop them meanwhile"
    await server.accept()
    await connection.hand.wait_for_state(State.RUNNING_IDLE)
    await refuses("the fingers are not stopped yet", begin(connection, b"2"))
    assert await settled(gripper) < FAR
    assert (await begin(connection, b"2")).ending is GoalEnding.SUCCEEDED


async def test_a_deactivation_without_a_link_halts_when_it_is_back(
    connection: GripperConnection, server: SimulatorServer, caplog: pytest.LogCaptureFixture
) -> None:
    await connection.command("reset")
    call = asyncio.create_task(connection.command("activate"))
    await connection.hand.wait_for_state(State.WF_ACTIVATION)
    await lose_link(server, connection.hand)
    with caplog.at_level(logging.WARNING, "robotiq_async"):
        assert not await connection.forbid("the node was deactivated")
        await asyncio.gather(call, return_exceptions=True)
        assert not connection.takes_commands
        await server.accept()
        await connection.hand.wait_for_state(State.RESET, timeout=5)
        await asyncio.sleep(1)
    levels = {record.getMessage(): record.levelno for record in caplog.records}
    (failed,) = (level for text, level in levels.items() if "no halt, the fingers MAY STILL MOVE" in text)
    assert failed == logging.ERROR
    assert "the link is back, and axes that still moved were stopped" in caplog.text


async def test_a_stop_that_would_come_too_late_for_anything_is_not_sent(
    connection: GripperConnection, gripper: SimulatedGripper, server: SimulatorServer
) -> None:
    await lose_link(server, connection.hand)
    await connection.forbid("the node was deactivated")
    await asyncio.sleep(PENDING_S + 1)
    writes = len(gripper.writes)
    await server.accept()
    await connection.hand.wait_for_state(State.RUNNING_IDLE)
    await settled(gripper)
    assert len(gripper.writes) == writes


async def test_the_end_of_the_node_owes_nothing(
    connection: GripperConnection, server: SimulatorServer
) -> None:
    goal = await moving(connection)
    await lose_link(server, connection.hand)
    await goal
    await connection.close("the end")  # no task is left: the fixtures look


# -- what is reported --------------------------------------------------------------------------------------


async def test_diagnoses_of_a_gripper_that_is_well(connection: GripperConnection) -> None:
    link, gripper = diagnose(connection.hand, now())
    assert (link.level, link.message) == (DiagnosticLevel.OK, "connected")
    assert (gripper.level, gripper.message) == (DiagnosticLevel.OK, "RUNNING_IDLE")
    assert int(link.values["polls"]) > 0
    assert gripper.values["A position"] == "6"


@pytest.mark.parametrize(
    ("fault", "level"),
    [(Fault.COMMUNICATION_NOT_READY, DiagnosticLevel.WARN), (Fault.SCISSOR_BLOCKED, DiagnosticLevel.ERROR)],
)
async def test_diagnoses_of_a_fault(
    connection: GripperConnection, gripper: SimulatedGripper, fault: Fault, level: DiagnosticLevel
) -> None:
    gripper.inject_fault(fault)
    await connection.hand.wait_for_state(State.FAULT)
    _, shown = diagnose(connection.hand, now())
    assert (shown.level, shown.message) == (level, fault.description)
    text = json.loads(status_text(connection.hand, takes_commands=True))
    status = RobotiqStatus.from_registers(
        text["registers"], timestamp=text["timestamp"], sequence=text["sequence"]
    )
    assert (
        text
        == {"state": "FAULT", "connected": True, "takes_commands": True, "inhibited": None} | status.as_dict()
    )
    assert text["fault"] == fault.name


async def test_the_diagnosis_of_a_controller_with_a_fault() -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=TWO_FINGER_85)
    gripper.controller_fault = 0x0C
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address, poll_interval=POLL_S) as hand:
        _, shown = diagnose(hand, now())
    assert (shown.level, shown.values["controller fault"]) == (DiagnosticLevel.ERROR, "0x0C")
    assert shown.message == "RUNNING_IDLE; its controller reports: emergency stop (kFLT 0x0C)"


async def test_without_a_link_nothing_is_known(
    connection: GripperConnection, server: SimulatorServer
) -> None:
    await lose_link(server, connection.hand)
    link, gripper = diagnose(connection.hand, now())
    assert link.level is DiagnosticLevel.ERROR
    assert (gripper.level, gripper.message, gripper.values) == (
        DiagnosticLevel.STALE,
        "unknown: the link is down",
        {},
    )
    shown = json.loads(status_text(connection.hand, takes_commands=False))
    assert shown == {"state": "DISCONNECTED", "connected": False, "takes_commands": False, "inhibited": None}
    fresh = RobotiqHand("tcp://192.0.2.1")
    assert diagnose(fresh, 0.0)[1].level is DiagnosticLevel.STALE
    assert "fault" not in json.loads(status_text(fresh, takes_commands=False))


class Disobedient(FakeBackend):
    """A gripper that does not show a halt."""

    async def halt(self) -> None:
        raise StateTimeoutError("the fingers may still move")


async def test_a_late_halt_that_does_not_show_is_an_error_in_the_log(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """It was taken for one that came too late, and nothing said that the fingers may move."""
    async with FakeHand(kind=Disobedient) as hand:
        pending = PendingStop(hand)
        pending.schedule(hand.halt)
        while pending.is_pending:  # noqa: ASYNC110  # there is no event to wait for
            await asyncio.sleep(POLL_S)
    assert "the link is back, and the fingers MAY STILL MOVE" in caplog.text
