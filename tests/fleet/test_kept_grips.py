"""Grips that are kept when a client, a lease or an agent ends."""

from __future__ import annotations

import asyncio

from robotiq_async import Finger
from tests.fleet.lab import lab
from tests.grippers import Restless
from tests.virtual import virtual


@virtual
async def test_a_grip_is_kept_by_a_hand_that_was_made_for_it() -> None:
    async with lab() as here:
        here.gripper.place_object(Finger.B | Finger.C, 100)
        async with here.client(keep_grip=True) as hand:
            await hand.close(Finger.B | Finger.C)
            await hand.set_speed(0, Finger.A)
            await hand.set_position(255, Finger.A)
        await asyncio.sleep(5)
        assert here.gripper.grips == Finger.B | Finger.C
        assert here.gripper.position(Finger.A) < 40
        async with here.client("next") as hand:
            await hand.move(60, Finger.A)
            assert here.gripper.grips == Finger.B | Finger.C, "and by who comes next"
        assert not here.gripper.grips


@virtual
async def test_a_grip_is_kept_when_the_lease_is_given_back() -> None:
    async with lab() as here, here.client() as hand:
        here.gripper.place_object(Finger.ABC, 100)
        await hand.close()
        await hand.release(keep_grip=True)
        assert here.gripper.grips == Finger.ABC
        await hand.acquire()
        await hand.release()
        assert not here.gripper.grips


@virtual
async def test_what_does_not_come_to_rest_is_halted() -> None:
    async with lab(kind=Restless) as here, here.client() as hand:
        await hand.release(keep_grip=True)
        assert not here.local.status.go_echo


@virtual
async def test_what_does_not_come_to_rest_is_left_to_whoever_commands_it_by_then() -> None:
    async with lab(kind=Restless) as here, here.client() as hand:
        releasing = asyncio.create_task(hand.release(keep_grip=True))
        await asyncio.sleep(0.1)
        async with here.client("next"):
            await releasing
            assert here.local.status.go_echo


@virtual
async def test_an_agent_may_keep_a_grip_at_its_own_end() -> None:
    async with lab(keep_grip=True) as here:
        here.gripper.place_object(Finger.ABC, 100)
        async with here.client(keep_grip=True) as hand:
            await hand.close()
        await here.end_agent()
        assert here.gripper.grips == Finger.ABC
