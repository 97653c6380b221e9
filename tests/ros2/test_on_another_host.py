"""The node's side of a hand that an agent on another host serves: what is done with a hand is the same."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import pytest

from robotiq_async import Finger, State
from robotiq_async.ros2.gripper.connection import Connection, RefusedError
from robotiq_async.ros2.gripper.goals import Ending
from robotiq_async.ros2.translation.diagnosis import Level, diagnose
from robotiq_async.ros2.translation.joints import Targets
from robotiq_async.ros2.translation.settings import PARAMETERS, check_settings
from robotiq_async.runtime.clock import now
from tests.fleet.lab import lab
from tests.virtual import virtual

SETTINGS = check_settings({name: parameter.default for name, parameter in PARAMETERS.items()})
CLOSE = Targets(((240, Finger.ABC),))


@virtual
async def test_a_goal_and_its_cancellation() -> None:
    async with lab() as here:
        hand = here.client(control=None)
        connection = Connection(hand, SETTINGS)
        await connection.open()
        assert not hand.is_in_control, "connecting only reads"
        await connection.permit()
        assert [each.level for each in diagnose(hand, now())] == [Level.OK, Level.OK]
        outcome = await connection.run_goal(
            b"1", Targets(((60, Finger.A), (80, Finger.B))), SETTINGS, lambda: None, 0
        )
        assert outcome.ending is Ending.SUCCEEDED
        assert [here.gripper.position(axis) for axis in (Finger.A, Finger.B)] == pytest.approx(
            [60, 80], abs=2
        )
        goal = asyncio.create_task(connection.run_goal(b"2", CLOSE, SETTINGS, lambda: None, 0))
        async for status in hand.statuses():
            if status.position(Finger.A) > 90:
                break
        await connection.cancel_goal(b"2")
        assert (await goal).ending is Ending.CANCELED
        there = here.gripper.position(Finger.A)
        assert there < 200
        await asyncio.sleep(0.5)
        assert abs(here.gripper.position(Finger.A) - there) <= 3
        await connection.close("the end")
        assert not hand.is_in_control


@virtual
async def test_a_new_goal_holds_the_other_axes() -> None:
    async with lab() as here:
        hand = here.client(control=None)
        connection = Connection(hand, SETTINGS)
        await connection.open()
        await connection.permit()
        first = asyncio.create_task(connection.run_goal(b"1", CLOSE, SETTINGS, lambda: None, 0))
        async for status in hand.statuses():
            if status.position(Finger.A) > 40:
                break
        second = await connection.run_goal(b"2", Targets(((20, Finger.A),)), SETTINGS, lambda: None, 0)
        assert (await first).ending is Ending.ABORTED
        assert second.ending is Ending.SUCCEEDED
        assert here.gripper.position(Finger.B) < 200
        assert not here.gripper.is_moving
        await connection.close("the end")


@virtual
async def test_a_silent_agent_is_a_link_that_is_down() -> None:
    async with lab() as here:
        hand = here.client(control=None)
        connection = Connection(hand, SETTINGS)
        await connection.open()
        await connection.permit()
        await here.end_agent()
        await hand.wait_for_state(State.DISCONNECTED, timeout=10)
        assert diagnose(hand, now())[0].level is Level.ERROR
        with pytest.raises(RefusedError, match="the link to the gripper is down"):
            await connection.check_goal()
        await connection.close("the end")


@virtual
async def test_what_a_goal_moved_is_held_when_the_agent_has_its_gripper_back() -> None:
    async with lab() as here:
        connection = Connection(here.client(control=None), SETTINGS)
        await connection.open()
        await connection.permit()
        slow = replace(SETTINGS, speed=0)
        goal = asyncio.create_task(connection.run_goal(b"1", CLOSE, slow, lambda: None, 0))
        async for status in connection.hand.statuses():
            if status.position(Finger.A) > 40:
                break
        here.server.refuse()
        here.server.cut()
        assert (await goal).ending is Ending.ABORTED
        assert here.gripper.is_moving
        await here.server.accept()
        await connection.hand.wait_for_state(State.RUNNING_IDLE)
        await asyncio.sleep(0.3)
        assert not here.gripper.is_moving
        assert here.gripper.position(Finger.A) < 200
        await connection.close("the end")


@virtual
async def test_after_a_halt_from_elsewhere_the_node_has_to_be_configured_anew() -> None:
    async with lab() as here:
        connection = Connection(here.client(control=None), SETTINGS)
        await connection.open()
        await connection.permit()
        goal = asyncio.create_task(connection.run_goal(b"1", CLOSE, SETTINGS, lambda: None, 0))
        async for status in connection.hand.statuses():
            if status.position(Finger.A) > 40:
                break
        other = here.client("other", control=False)
        await other.start(activate=False)
        await other.halt()
        assert (await goal).ending is Ending.ABORTED
        again = await connection.run_goal(b"2", CLOSE, SETTINGS, lambda: None, 0)
        assert again.ending is Ending.ABORTED
        assert "lost control of" in again.reason
        assert not here.gripper.is_moving
        await connection.close("the node was cleaned up")
        anew = Connection(here.client("anew", control=None), SETTINGS)
        await anew.open()
        await anew.permit()
        assert (await anew.run_goal(b"3", CLOSE, SETTINGS, lambda: None, 0)).ending is Ending.SUCCEEDED
        await anew.close("the end")
        await other.stop()
