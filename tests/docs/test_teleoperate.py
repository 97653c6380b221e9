"""The loop of its page writes as often as the leader is read, on new statuses, and ends in a stall."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from robotiq_async import ConnectionLostError, RobotiqHand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.model import TWO_FINGER_85
from tests.conftest import Clock
from tests.docs.pages import DOCS, blocks, read

pytestmark = pytest.mark.virtual_time

(CODE,) = (each.text for each in blocks(read(DOCS / "how-to" / "teleoperate.md"), "python"))
LOOP, _, _ = CODE.partition("\nwith TemporaryDirectory()")
SECONDS = 2


def follow_at(rate: int) -> Callable[[RobotiqHand, float], Awaitable[float]]:
    names: dict[str, Any] = {}
    exec(LOOP, names)
    assert names["RATE_HZ"] == 60
    names["RATE_HZ"] = rate
    follow: Callable[[RobotiqHand, float], Awaitable[float]] = names["follow"]
    return follow


@pytest.mark.parametrize("rate", [30, 60, 100])
async def test_every_reading_of_the_leader_is_written(rate: int, clock: Clock) -> None:
    gripper = SimulatedGripper(clock, speedup=5, model=TWO_FINGER_85)
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address) as hand:
        before = hand.statistics.writes
        opening = await follow_at(rate)(hand, SECONDS)
        assert (hand.statistics.writes - before) / SECONDS == pytest.approx(rate, abs=1)
        assert opening == pytest.approx(0.5, abs=0.02)
        assert hand.statistics.overruns == 0


async def test_a_loop_that_commands_at_every_poll_sees_each_status_once_and_new(clock: Clock) -> None:
    gripper = SimulatedGripper(clock, model=TWO_FINGER_85)
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address) as hand:
        stream, sequences, began = hand.statuses(lost_after=0.4), list[int](), clock()
        async for status in stream:
            assert clock() - status.timestamp < 0.001
            sequences.append(status.sequence)
            hand.command(position=len(sequences) % 200)
            if len(sequences) == 400:
                break
        assert clock() - began == pytest.approx(2, abs=0.01)
        assert sequences == list(range(sequences[0], sequences[0] + 400))
        assert stream.missed == 0


async def test_a_stall_ends_it(clock: Clock) -> None:
    gripper = SimulatedGripper(clock, model=TWO_FINGER_85)
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address) as hand:
        following = asyncio.ensure_future(follow_at(60)(hand, SECONDS))
        await asyncio.sleep(1)
        server.refuse()
        server.cut()
        began = clock()
        with pytest.raises(ConnectionLostError):
            await following
        assert clock() - began < 0.45
