"""What a configured node does with its hand, without ROS."""

from __future__ import annotations

import asyncio
import json
import logging
import subprocess
import sys

import pytest

from robotiq_async import Fault, Finger, RobotiqError, RobotiqHand, RobotiqStatus, State
from robotiq_async.ros2.gripper.connection import COMMANDS, MOST_CALLS, Connection, RefusedError
from robotiq_async.ros2.gripper.goals import Ending
from robotiq_async.ros2.translation.diagnosis import Level, diagnose, status_text
from robotiq_async.ros2.translation.joints import Targets
from robotiq_async.ros2.translation.settings import PARAMETERS, check_settings
from robotiq_async.runtime.clock import now
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.fake_hand import FakeHand

SETTINGS = check_settings({name: parameter.default for name, parameter in PARAMETERS.items()})
CLOSE = Targets(((240, Finger.ABC),))


def begin_goal(connection: Connection) -> asyncio.Task[object]:
    return asyncio.create_task(connection.run_goal(b"1", CLOSE, SETTINGS, lambda: None, connection.stops))


async def connected(server: SimulatorServer, *, active: bool = True) -> Connection:
    connection = Connection(RobotiqHand(server.address), SETTINGS)
    await connection.open()
    if active:
        await connection.permit()
        await connection.command("activate")
    return connection


async def test_opening_and_permitting_write_nothing(
    server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    connection = await connected(server, active=False)
    assert not connection.takes_commands
    await connection.permit()
    await connection.close("the end")
    assert connection.hand.state is State.SHUTDOWN
    assert all(not write.registers[0] >> 8 & 0x01 for write in gripper.writes), "no activation"


async def test_who_was_never_active_leaves_the_fingers_alone(
    server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    connection = await connected(server, active=False)
    await connection.close("the end")
    await connection.close("twice")
    assert not gripper.writes


@pytest.mark.parametrize("name", COMMANDS)
async def test_an_inactive_node_takes_a_halt_and_nothing_else(server: SimulatorServer, name: str) -> None:
    connection = await connected(server, active=False)
    if name == "halt":
        assert await connection.command(name)
    else:
        with pytest.raises(RefusedError, match="the node is not active"):
            await connection.command(name)
    with pytest.raises(RefusedError, match="the node is not active"):
        await begin_goal(connection)
    await connection.close("the end")


async def test_forbidding_aborts_the_goal_and_halts(
    server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    connection = await connected(server)
    goal = begin_goal(connection)
    await connection.hand.wait_for_state(State.RUNNING_CC)
    assert await connection.forbid("the node was deactivated")
    outcome = await goal
    assert getattr(outcome, "ending", None) is Ending.ABORTED
    assert not gripper.request_registers[0] >> 8 & 0x08, "rGTO"
    await connection.close("the end")


async def test_a_halt_that_does_not_arrive_is_an_error_in_the_log(
    server: SimulatorServer, caplog: pytest.LogCaptureFixture
) -> None:
    connection = await connected(server)
    server.refuse()
    server.cut()
    await connection.hand.wait_for_state(State.DISCONNECTED)
    with caplog.at_level(logging.ERROR, "robotiq_async"):
        assert not await connection.forbid("the node was deactivated")
    assert "no halt, the fingers MAY STILL MOVE" in caplog.text
    assert not connection.takes_commands
    await connection.close("the end")


async def test_a_halt_is_never_one_command_too_many(server: SimulatorServer) -> None:
    connection = await connected(server)
    await connection.command("reset")
    activations = [asyncio.create_task(connection.command("activate")) for _ in range(MOST_CALLS)]
    await connection.hand.wait_for_state(State.WF_ACTIVATION)
    with pytest.raises(RefusedError, match="16 commands are under way"):
        await connection.command("activate")
    assert "the gripper is reset" in await connection.command("halt")
    ended = await asyncio.gather(*activations, return_exceptions=True)
    assert all(isinstance(each, RobotiqError) for each in ended)
    await connection.close("the end")


async def test_any_hand_will_do() -> None:
    connection = Connection(FakeHand(), SETTINGS)
    await connection.open()
    await connection.permit()
    outcome = await connection.run_goal(b"1", CLOSE, SETTINGS, lambda: None, connection.stops)
    assert outcome.ending is Ending.SUCCEEDED
    await connection.close("the end")


# -- what is told -------------------------------------------------------------------------------------------


async def test_diagnoses_of_a_gripper_that_is_well(hand: RobotiqHand) -> None:
    link, gripper = diagnose(hand, now())
    assert (link.level, link.message) == (Level.OK, "connected")
    assert (gripper.level, gripper.message) == (Level.OK, "RUNNING_IDLE")
    assert int(link.values["polls"]) > 0
    assert gripper.values["A position"] == "6"


@pytest.mark.parametrize(
    ("fault", "level"), [(Fault.COMMUNICATION_NOT_READY, Level.WARN), (Fault.SCISSOR_BLOCKED, Level.ERROR)]
)
async def test_diagnoses_of_a_fault(
    hand: RobotiqHand, gripper: SimulatedGripper, fault: Fault, level: Level
) -> None:
    gripper.inject_fault(fault)
    await hand.wait_for_state(State.FAULT)
    _, told = diagnose(hand, now())
    assert (told.level, told.message) == (level, fault.description)
    text = json.loads(status_text(hand, takes_commands=True))
    node = {"state": "FAULT", "connected": True, "takes_commands": True}
    assert (
        text
        == node
        | RobotiqStatus.from_registers(
            text["registers"], timestamp=text["timestamp"], sequence=text["sequence"]
        ).as_dict()
    )
    assert text["fault"] == fault.name


async def test_without_a_link_nothing_is_known(hand: RobotiqHand, server: SimulatorServer) -> None:
    server.refuse()
    server.cut()
    await hand.wait_for_state(State.DISCONNECTED)
    link, gripper = diagnose(hand, now())
    assert link.level is Level.ERROR
    assert (gripper.level, gripper.message, gripper.values) == (Level.STALE, "unknown: the link is down", {})
    assert json.loads(status_text(hand, takes_commands=False)) == {
        "state": "DISCONNECTED",
        "connected": False,
        "takes_commands": False,
    }


def test_nothing_is_known_before_the_first_status() -> None:
    hand = RobotiqHand("tcp://192.0.2.1")
    assert diagnose(hand, 0.0)[1].level is Level.STALE
    assert "fault" not in json.loads(status_text(hand, takes_commands=False))


# -- without ROS --------------------------------------------------------------------------------------------


def test_without_ros_it_says_what_to_do() -> None:
    command = [sys.executable, "-m", "robotiq_async.ros2"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "the node needs rclpy, which comes with ROS 2 Jazzy or later: source /opt/ros/" in done.stderr
