"""The actions of a person, and whether this person has moved anything."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import numpy as np
import pytest

from robotiq_async import (
    WIDTH_NORMAL,
    WIDTH_PINCH,
    WIDTH_WIDE,
    Fault,
    Finger,
    GripperFaultError,
    MoveSupersededError,
    NotActivatedError,
    NotStartedError,
    RobotiqHand,
    State,
)
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.actions import ACTIONS, Operator
from robotiq_async.values.enums import DEFAULT_FORCE, DEFAULT_SPEED
from tests.grippers import lose_link, shows
from tests.virtual import until

pytestmark = pytest.mark.virtual_time
LEFT, STOPPED, MOVING = "left as they are", "were stopped", "may STILL MOVE"


@pytest.fixture
async def operator(server: SimulatorServer) -> AsyncIterator[Operator]:
    """The operator of a gripper that is reset."""
    operator = Operator(RobotiqHand(server.address))
    await operator.hand.start(activate=False)
    yield operator
    await operator.hand.stop()


@pytest.fixture
async def active(operator: Operator) -> Operator:
    """The operator of a gripper that was activated, and not by this operator."""
    await operator.hand.activate()
    return operator


async def fail(operator: Operator, gripper: SimulatedGripper) -> None:
    gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    await operator.hand.wait_for_state(State.FAULT)


async def test_open_close_and_widths(operator: Operator, gripper: SimulatedGripper) -> None:
    assert await operator.act(ACTIONS["activate"]) == "the gripper is active"
    gripper.place_object(Finger.B, 150)
    closed = await operator.act(ACTIONS["close"])
    assert "A at 241, B in contact at 150, C at 241; " in closed
    assert "SCISSOR" not in closed
    assert (await operator.act(ACTIONS["open"])).startswith("A at 6, B at 6, C at 6; ")
    for name, width in (("wide", WIDTH_WIDE), ("pinch", WIDTH_PINCH), ("normal", WIDTH_NORMAL)):
        assert (await operator.act(ACTIONS[name])).startswith("SCISSOR at ")
        assert operator.hand.status.requested_position(Finger.SCISSOR) == width


async def test_halt_reset_release_and_recover(operator: Operator, gripper: SimulatedGripper) -> None:
    await operator.act(ACTIONS["activate"])
    moving = asyncio.create_task(operator.act(ACTIONS["close"]))
    await operator.hand.wait_for_state(State.RUNNING_CC)
    assert await operator.act(ACTIONS["halt"]) == "every axis has stopped"
    assert not operator.hand.status.go_echo
    with pytest.raises(Exception, match="halt"):
        await moving
    await fail(operator, gripper)
    assert "only a reset" in await operator.act(ACTIONS["release"])
    assert await operator.act(ACTIONS["recover"]) == "the gripper is active"
    assert await operator.act(ACTIONS["reset"]) == "the gripper is reset"
    assert operator.hand.state is State.RESET


async def test_speed_and_force_stay_in_range(operator: Operator) -> None:
    with pytest.raises(NotActivatedError):
        await operator.change_speed(16)
    assert (operator.speed, operator.force) == (DEFAULT_SPEED, DEFAULT_FORCE), "a refusal changes nothing"
    await operator.act(ACTIONS["activate"])
    assert await operator.change_speed(1000) == "255"
    assert await operator.change_speed(-5) == "250"
    assert await operator.change_force(-1000) == "0"
    assert (operator.speed, operator.force) == (250, 0)


async def test_a_small_integer_of_numpy_does_not_wrap(operator: Operator) -> None:
    byte: Any = np.uint8(250)
    await operator.act(ACTIONS["activate"])
    await operator.set_speed(byte)
    assert await operator.change_speed(16) == "255"
    assert await Operator(operator.hand, force=byte).change_force(16) == "255"


# -- whether anything was moved ----------------------------------------------------------------------------


async def test_speed_alone_and_what_is_refused_move_nothing(
    active: Operator, gripper: SimulatedGripper
) -> None:
    await active.set_speed(10)
    assert not active.has_moved
    await fail(active, gripper)
    with pytest.raises(GripperFaultError):
        await active.move(30, Finger.A)
    assert not active.has_moved
    gripper.clear_faults()
    await active.hand.wait_for_state(State.RUNNING_IDLE)
    await active.move(30, Finger.A)
    assert active.has_moved


async def test_leaving_stops_what_was_moved(active: Operator, gripper: SimulatedGripper) -> None:
    await active.move(100, Finger.A)
    assert active.has_moved
    assert STOPPED in await active.leave()
    assert not gripper.request_registers[0] & 0x0800


async def test_leaving_leaves_alone_what_was_not(active: Operator, gripper: SimulatedGripper) -> None:
    await active.hand.move(100)
    await active.set_speed(9)
    assert LEFT in await active.leave()
    assert gripper.request_registers[0] & 0x0800


async def test_a_gripper_that_is_gone_was_not_stopped(active: Operator, server: SimulatorServer) -> None:
    await active.move(100, Finger.A)
    await lose_link(server, active.hand)
    assert MOVING in await active.leave()


async def test_leaving_stops_a_release_that_was_begun_here(
    active: Operator, gripper: SimulatedGripper
) -> None:
    await active.move(200, Finger.ABC)
    await fail(active, gripper)
    releasing = asyncio.create_task(active.act(ACTIONS["release"]))
    await active.hand.wait_for_state(State.WF_ATR)
    assert STOPPED in await active.leave()
    assert not gripper.request_registers[0] & 0x0100, "reset, which ends it"
    with pytest.raises(NotStartedError):
        await releasing


async def test_a_gripper_that_came_back_reset_stands_still(active: Operator, server: SimulatorServer) -> None:
    await active.move(100, Finger.A)
    await server.power_cycle()
    await active.hand.wait_for_state(State.RESET)
    assert STOPPED in await active.leave()


async def test_a_refused_move_does_not_count_as_moved(active: Operator, gripper: SimulatedGripper) -> None:
    with pytest.raises(ValueError, match="position"):
        await active.move(300, Finger.A)
    await active.set_force(3)
    assert not active.has_moved


async def test_it_keeps_nothing_of_what_others_write(active: Operator) -> None:
    """A control loop beside it writes for days."""
    for position in (10, 20, 30):
        await active.hand.set_position(position)
    assert len(list(active._requests.drain())) == 1


async def test_steps_of_the_speed_add_up(active: Operator) -> None:
    await asyncio.gather(*(active.change_speed(16) for _ in range(3)))
    assert active.speed == DEFAULT_SPEED + 48


async def test_a_cancelled_move_counts_as_moved(active: Operator) -> None:
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0):
            await active.move(200, Finger.A)
    assert active.has_moved


async def test_it_still_knows_after_the_hand_was_started_again(active: Operator) -> None:
    await active.hand.stop()
    await active.hand.start()
    assert not active.has_moved
    await active.move(200, Finger.A)
    assert active.has_moved
    assert STOPPED in await active.leave()


async def test_a_recovery_does_not_go_on_after_a_halt_or_a_reset(
    active: Operator, gripper: SimulatedGripper
) -> None:
    """It waits for a minor fault to clear; what comes after that would surprise the person who has halted."""
    for name in ("halt", "reset"):
        gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
        await active.hand.wait_for_state(State.FAULT)
        recovering = asyncio.create_task(active.act(ACTIONS["recover"]))
        await anext(active.hand.statuses())
        await active.act(ACTIONS[name])
        with pytest.raises(MoveSupersededError):
            await recovering
    for _ in range(20):
        await anext(active.hand.statuses())
    assert active.hand.state is State.RESET


async def test_a_halt_ends_an_activation_and_says_how(operator: Operator, gripper: SimulatedGripper) -> None:
    activating = asyncio.create_task(operator.act(ACTIONS["activate"]))
    await operator.hand.wait_for_state(State.WF_ACTIVATION)
    assert await operator.act(ACTIONS["halt"]) == "every axis has stopped: the gripper is reset"
    with pytest.raises(NotActivatedError):
        await activating
    assert not gripper.is_moving


@pytest.mark.parametrize("pause", [0.0, 0.1])
async def test_fingers_that_a_halt_has_stopped_stand_still(active: Operator, pause: float) -> None:
    """Nothing is left to write then, and nothing was read: that was taken for a gripper that is not seen."""
    moving = asyncio.create_task(active.move(255, Finger.ABC))
    await shows(active.hand, lambda status: status.is_moving)
    await active.hand.halt()
    with pytest.raises(MoveSupersededError):
        await moving
    await asyncio.sleep(pause)
    assert await active.leave() == "The fingers were stopped, because a command from here moved them."


async def test_an_old_halt_is_no_stop(
    active: Operator, server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    """Another client moves on after it, and the link is lost."""
    await active.move(50, Finger.A)
    await active.act(ACTIONS["halt"])
    image = list(gripper.request_registers)
    image[0] |= 0x0800
    gripper.write(0, image)
    await lose_link(server, active.hand)
    assert MOVING in await active.leave()


async def test_a_release_that_is_done_is_at_rest(active: Operator, gripper: SimulatedGripper) -> None:
    await fail(active, gripper)
    await active.act(ACTIONS["release"])
    assert STOPPED in await active.leave()


async def test_a_motion_that_is_on_its_way_counts(
    active: Operator, server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    """Its request has arrived, and its acknowledgement has not."""
    server.policy = lambda frame: [(0.05, frame)]
    closing = asyncio.create_task(active.act(ACTIONS["close"]))
    await until(lambda: bool(gripper.request_registers[0] & 0x0800))
    assert active.has_moved
    assert STOPPED in await active.leave()
    assert not gripper.is_moving
    with pytest.raises(NotStartedError):
        await closing
