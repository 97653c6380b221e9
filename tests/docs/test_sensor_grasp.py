"""The loop of its page ends, and not in silence, whatever ends the closing."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from robotiq_async import ConnectionLostError, Finger, RobotiqHand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.docs.pages import DOCS, blocks, read
from tests.grippers import until
from tests.patience import patience

(CODE,) = (each.text for each in blocks(read(DOCS / "how-to" / "sensor-grasp.md"), "python"))
LOOP, _, _ = CODE.partition("\ngripper = ")
Trouble = Callable[[SimulatorServer, RobotiqHand], Awaitable[object]]


async def fault(server: SimulatorServer, _: RobotiqHand) -> None:
    server.gripper.inject_fault(0x0E)


async def minor_fault(server: SimulatorServer, _: RobotiqHand) -> None:
    server.gripper.inject_fault(0x09, 2.0)


async def emergency_stop(server: SimulatorServer, _: RobotiqHand) -> None:
    server.gripper.emergency_stop(2)


async def power_cut(server: SimulatorServer, _: RobotiqHand) -> None:
    await server.power_cycle(0.1)


async def halt(_: SimulatorServer, hand: RobotiqHand) -> None:
    await hand.halt()


async def lost_link(server: SimulatorServer, _: RobotiqHand) -> None:
    server.refuse()
    server.cut()


def close_each(hand: RobotiqHand) -> Awaitable[dict[Finger, int]]:
    names: dict[str, Any] = {}
    exec(LOOP, names)
    closing: Awaitable[dict[Finger, int]] = names["close_each"](hand)
    return closing


@pytest.mark.parametrize(
    ("trouble", "words"),
    [
        (fault, "fault 0x0E: "),
        (minor_fault, "fault 0x09: "),
        (emergency_stop, "the hand is in WF_ACTIVATION, fault 0x05: "),
        (power_cut, "the hand is in RESET"),
        (halt, "nothing moves any more"),
        (lost_link, "no status for "),
    ],
)
async def test_a_closing_that_ends_early_ends_the_loop(trouble: Trouble, words: str) -> None:
    async with (
        SimulatorServer(SimulatedGripper(speedup=5)) as server,
        RobotiqHand(server.address, speed=30) as hand,
        asyncio.timeout(patience(20)),
    ):
        closing = asyncio.ensure_future(close_each(hand))
        await until(lambda: server.gripper.position(Finger.A) > 30)
        await trouble(server, hand)
        with pytest.raises((ConnectionLostError, RuntimeError), match=words):
            await closing


async def test_a_link_that_is_back_at_once_does_not_end_it() -> None:
    gripper = SimulatedGripper(speedup=5)
    gripper.place_object(Finger.ABC, position=120)
    async with (
        SimulatorServer(gripper) as server,
        RobotiqHand(server.address) as hand,
        asyncio.timeout(patience(20)),
    ):
        closing = asyncio.ensure_future(close_each(hand))
        await until(lambda: gripper.position(Finger.A) > 30)
        server.cut()
        assert (await closing).keys() == {Finger.A, Finger.B, Finger.C}
