"""Commands on a serial line: written at once on a status of the last 6 ms, and echoed in the next read."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import Any

import pytest

from robotiq_async import ConnectionLostError, Finger, MoveSupersededError, RobotiqHand
from robotiq_async.simulator import (
    SerialSimulatorServer,
    SimulatedGripper,
    SimulatorServer,
    Trouble,
    parse_troubles,
)
from robotiq_async.simulator.server.serial_server import RtuResponder
from robotiq_async.values.model import model_of
from robotiq_async.values.request import Request
from tests.grippers import activate_beforehand
from tests.virtual import VirtualLoop
from tests.virtual_line import VirtualLine

pytestmark = pytest.mark.virtual_time

READ, WRITE, BOTH = 3, 16, 23
WRITES = (WRITE, BOTH)
A = Finger.A


class Replies:
    """The function of each reply, in order, and when it left."""

    def __init__(self, server: SerialSimulatorServer) -> None:
        self.server = server
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
    monkeypatch: pytest.MonkeyPatch,
    model: str,
    *,
    poll_interval: float = 0.005,
    write_function: int | None = None,
    device: type[SerialSimulatorServer] = SerialSimulatorServer,
    speedup: float = 1.0,
) -> AsyncIterator[tuple[RobotiqHand, Replies]]:
    cable = VirtualLine(monkeypatch)
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=model_of(model), speedup=speedup)
    async with device(cable.FAR, gripper) as server:
        await activate_beforehand(gripper)
        address = f"rtu://{cable.near}?model={model}"
        if model == "2f85" and write_function is None:
            write_function = 23  # believed, and not tried
        async with RobotiqHand(address, poll_interval=poll_interval, write_function=write_function) as hand:
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
            assert replies.since(asked)[:2] == ([WRITE, READ] if model == "3f" else [BOTH])
            written = next(at for at, function in replies.seen if at >= asked and function in WRITES)
            assert written - asked < 0.005, "the gripper has it: a read would take as long again"
            await asyncio.sleep(0.05)


async def test_the_read_that_shows_a_command_does_not_wait_for_the_next_poll(
    monkeypatch: pytest.MonkeyPatch, model: str
) -> None:
    async with at_a_line(monkeypatch, model, poll_interval=0.1) as (hand, replies):
        asked = await between_polls(hand)
        await hand.set_position(100)
        await asyncio.sleep(0.01)
        assert replies.since(asked) == ([WRITE, READ] if model == "3f" else [BOTH])


async def test_an_old_status_is_read_anew_before_a_command(
    monkeypatch: pytest.MonkeyPatch, model: str
) -> None:
    async with at_a_line(monkeypatch, model, poll_interval=0.1) as (hand, replies):
        await between_polls(hand)
        await asyncio.sleep(0.05)
        asked = asyncio.get_running_loop().time()
        await hand.set_position(100)
        assert replies.since(asked) == [READ, WRITE if model == "3f" else BOTH]
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
    async with at_a_line(monkeypatch, model, speedup=20) as (hand, replies):
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
        assert sum(function in WRITES for function in replies.since(asked)) == 1


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


# -- function 23, which jaws are written with ----------------------------------------------------------------


@pytest.mark.parametrize("words", ["wrong-checksum once", "half once", "drop once"])
async def test_a_damaged_reply_costs_no_command_and_no_link(
    monkeypatch: pytest.MonkeyPatch, words: str
) -> None:
    """By the status that is read after it the write was carried out."""
    async with at_a_line(monkeypatch, "2f85") as (hand, replies):
        await hand.set_position(50)
        (trouble,) = parse_troubles(words)
        gripper = replies.server.gripper
        before = len(gripper.writes)
        await between_polls(hand)
        async with replies.server.fault_injector.making(replace(trouble, on="write")):
            await hand.set_position(200)
            assert len(gripper.writes) == before + 1
        await asyncio.sleep(2.0)
        assert gripper.position(A) == pytest.approx(200, abs=3)
        assert hand.statistics.reconnects == 0


@pytest.mark.parametrize("to", [90, 250])
async def test_a_hold_behind_a_read_that_is_repeated_stops_where_the_axis_is(
    monkeypatch: pytest.MonkeyPatch, model: str, to: int
) -> None:
    """The status counted from the read that was not heard: the axis was asked for a place far ahead."""
    async with at_a_line(monkeypatch, model) as (hand, replies):
        injector, gripper = replies.server.fault_injector, replies.server.gripper
        moving = asyncio.create_task(hand.move(to, A, speed=0))
        await asyncio.sleep(0.5)
        async with injector.making(Trouble("silence")):
            await asyncio.sleep(0.02)  # a read is not heard
            holding = asyncio.create_task(hand.hold(A))
            await asyncio.sleep(0.3)
        await holding
        assert hand.status.is_moving, "it is held on its way"
        held_at = gripper.position(A)
        await asyncio.sleep(1.0)
        assert gripper.position(A) == pytest.approx(held_at, abs=2)
        with pytest.raises(MoveSupersededError):
            await moving


async def test_a_write_that_was_not_heard_is_lost_and_not_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    async with at_a_line(monkeypatch, "2f85") as (hand, replies):
        await hand.move(50)
        gripper = replies.server.gripper
        before = len(gripper.writes)
        await between_polls(hand)
        async with replies.server.fault_injector.making(parse_troubles("silence once")[0]):
            with pytest.raises(ConnectionLostError):
                await hand.set_position(200)
        await asyncio.sleep(1.0)
        assert len(gripper.writes) == before
        assert gripper.position(A) < 60


async def test_a_write_of_speed_alone_stays_in_doubt_after_a_damaged_reply(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """No status has speeds and forces, so none reveals whether they were taken."""
    async with at_a_line(monkeypatch, "2f85") as (hand, replies):
        await hand.set_position(50)
        await between_polls(hand)
        (trouble,) = parse_troubles("wrong-checksum once")
        async with replies.server.fault_injector.making(replace(trouble, on="write")):
            with pytest.raises(ConnectionLostError):
                await hand.set_speed(17)


class Refusing(SerialSimulatorServer):
    """Does not serve function 23, and says so."""

    functions = SerialSimulatorServer.functions - {BOTH}

    class _responds(RtuResponder):  # noqa: N801  # as the server names it
        def deliver(self, reply: bytes) -> Iterable[tuple[float, bytes]] | None:
            return self.troubles.deliver(reply)


REFUSAL = 0x80 | BOTH
OVERTAKERS: dict[str, Callable[[RobotiqHand], Awaitable[Any]]] = {
    "halt": lambda hand: hand.halt(),
    "hold": lambda hand: hand.hold(),
    "reset": lambda hand: hand.reset(),
    "stop": lambda hand: hand.stop(),
    "stop with a grip": lambda hand: hand.stop(halt=False),
}


@pytest.mark.parametrize("what", OVERTAKERS)
async def test_a_motion_that_was_refused_is_not_written_after_what_ends_it(
    monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    """It came while the refusal of function 23 was on its way, and function 16 moved the jaw all the same."""
    async with at_a_line(monkeypatch, "2f85", device=Refusing) as (hand, replies):
        gripper, calls = replies.server.gripper, []

        def at_the_refusal(frame: bytes) -> Iterable[tuple[float, bytes]]:
            if frame[1] == REFUSAL:
                calls.append(asyncio.ensure_future(OVERTAKERS[what](hand)))
            return [(0.0, frame)]

        replies.server.policy = at_the_refusal
        begins = gripper.position(A)
        hand.command(A, position=200)
        await asyncio.sleep(0.1)
        (call,) = calls
        await call
        await asyncio.sleep(1.0)
        images = [Request.from_registers(write.registers, gripper.model) for write in gripper.writes]
        assert not [image for image in images if image.go and image.position(A) == 200]
        assert gripper.position(A) == begins


async def test_a_motion_that_was_refused_is_written_with_what_is_asked_meanwhile(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with at_a_line(monkeypatch, "2f85", device=Refusing) as (hand, replies):

        def at_the_refusal(frame: bytes) -> Iterable[tuple[float, bytes]]:
            if frame[1] == REFUSAL:
                hand.command(A, speed=17)
            return [(0.0, frame)]

        replies.server.policy = at_the_refusal
        await hand.set_position(200)
        await asyncio.sleep(3.0)
        assert replies.server.gripper.position(A) == pytest.approx(200, abs=3)
        assert hand.statistics.reconnects == 0


async def test_function_16_can_be_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    async with at_a_line(monkeypatch, "2f85", write_function=16) as (hand, replies):
        asked = await between_polls(hand)
        await hand.set_position(50)
        assert replies.since(asked)[0] == WRITE


async def test_function_23_can_be_chosen_for_a_3_finger(monkeypatch: pytest.MonkeyPatch) -> None:
    async with at_a_line(monkeypatch, "3f", write_function=23) as (hand, replies):
        asked = await between_polls(hand)
        await hand.set_position(50)
        assert replies.since(asked)[0] == BOTH


@pytest.mark.parametrize("wrong", [3, 17, 22, 0, "16", 16.5, True])
def test_only_two_functions_write(wrong: Any) -> None:
    with pytest.raises((TypeError, ValueError), match="write_function must be"):
        RobotiqHand("sim://", write_function=wrong)
