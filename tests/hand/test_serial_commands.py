"""Commands on a serial line: written at once on a status of the last 6 ms, and shown by the next read."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager

import pytest

from robotiq_async import Finger, RobotiqHand
from robotiq_async.simulator import SerialSimulatorServer, SimulatedGripper, SimulatorServer
from robotiq_async.values.model import model_of
from tests.grippers import activate_beforehand
from tests.virtual import VirtualLoop
from tests.virtual_line import VirtualLine

pytestmark = pytest.mark.virtual_time

READ, WRITE = 3, 16
A = Finger.A


class Replies:
    """The function of each reply, in order, and when it left."""

    def __init__(self, server: SerialSimulatorServer) -> None:
        self.seen: list[tuple[float, int]] = []
        self._loop = asyncio.get_running_loop()
        server.policy = self._note

    def since(self, when: float) -> list[int]:
        return [function for at, function in self.seen if at >= when]

    def _note(self, frame: bytes) -> Iterable[tuple[float, bytes]]:
        self.seen.append((self._loop.time(), frame[1]))
        return [(0.0, frame)]


@pytest.fixture(params=["3f", "2f85"])
def model(request: pytest.FixtureRequest) -> str:
    name: str = request.param
    return name


@asynccontextmanager
async def at_a_line(
    monkeypatch: pytest.MonkeyPatch, model: str, poll_interval: float = 0.005
) -> AsyncIterator[tuple[RobotiqHand, Replies]]:
    cable = VirtualLine(monkeypatch)
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=model_of(model))
    async with SerialSimulatorServer(cable.FAR, gripper) as server:
        await activate_beforehand(gripper)
        address = f"rtu://{cable.NEAR}?model={model}"
        async with RobotiqHand(address, poll_interval=poll_interval) as hand:
            replies = Replies(server)
            await asyncio.sleep(0.1)
            yield hand, replies


async def between_polls(hand: RobotiqHand) -> float:
    """Wait until a status has just come; returns when that was."""
    async for _ in hand.statuses(buffer=1):
        break
    async for status in hand.statuses(buffer=1):
        if status.timestamp > 0:
            break
    return asyncio.get_running_loop().time()


async def test_a_command_is_written_before_the_next_read_which_shows_it(
    monkeypatch: pytest.MonkeyPatch, model: str
) -> None:
    async with at_a_line(monkeypatch, model) as (hand, replies):
        for position in (40, 90, 140):
            asked = await between_polls(hand)
            hand.command(A, position=position)
            async for status in hand.statuses(buffer=1):
                if status.requested_position(A) == position:
                    break
            assert replies.since(asked)[:2] == [WRITE, READ]
            written = next(at for at, function in replies.seen if at >= asked and function == WRITE)
            assert written - asked < 0.005, "the gripper has it: a read would take as long again"
            await asyncio.sleep(0.05)


async def test_an_old_status_is_read_anew_before_a_command(
    monkeypatch: pytest.MonkeyPatch, model: str
) -> None:
    async with at_a_line(monkeypatch, model, poll_interval=0.1) as (hand, replies):
        await between_polls(hand)
        await asyncio.sleep(0.05)
        asked = asyncio.get_running_loop().time()
        await hand.set_position(100)
        assert replies.since(asked) == [READ, WRITE]
        assert asyncio.get_running_loop().time() - asked < 0.01, "at once, and not with the next poll"
        assert hand.statistics.status_age_p99 < 0.006


async def test_a_status_from_before_the_loop_was_held_up_is_read_anew(
    monkeypatch: pytest.MonkeyPatch, model: str
) -> None:
    async with at_a_line(monkeypatch, model) as (hand, replies):
        await between_polls(hand)
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        loop.hold_up(0.05)
        asked = loop.time()
        await hand.set_position(100)
        assert replies.since(asked)[0] == READ


async def test_a_reset_begins_with_a_read_unless_it_is_a_stop(
    monkeypatch: pytest.MonkeyPatch, model: str
) -> None:
    async with at_a_line(monkeypatch, model) as (hand, replies):
        await hand.reset()
        asked = await between_polls(hand)
        await hand.activate()
        assert replies.since(asked)[0] == READ, "an activation is decided on a status read for it"
        asked = await between_polls(hand)
        await hand.halt()
        assert replies.since(asked)[0] == WRITE, "a stop waits for no status"


async def test_commands_made_together_are_one_write(monkeypatch: pytest.MonkeyPatch, model: str) -> None:
    async with at_a_line(monkeypatch, model) as (hand, replies):
        asked = await between_polls(hand)
        hand.command(A, position=77)
        hand.command(A, speed=9)
        await asyncio.sleep(0.03)
        assert replies.since(asked).count(WRITE) == 1


async def test_over_tcp_a_command_is_decided_on_the_next_read() -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time)
    await activate_beforehand(gripper)
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address) as hand:
        seen: list[int] = []

        def note(frame: bytes) -> Iterable[tuple[float, bytes]]:
            seen.append(frame[7])
            return [(0.0, frame)]

        await asyncio.sleep(0.1)
        server.policy = note
        await hand.set_position(100)
        assert seen[-2:] == [4, WRITE]
