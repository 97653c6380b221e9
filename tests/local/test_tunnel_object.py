"""A tunnel object in place of an address, and what a hand makes of one that fails."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

import pytest

from robotiq_async import (
    ConnectFailedError,
    ConnectionLostError,
    Finger,
    RobotiqConnectionError,
    RobotiqHand,
    State,
    Tunnel,
)
from robotiq_async.link.dialogue import REPEAT_S
from robotiq_async.link.line import HUSH_S
from robotiq_async.runtime.clock import now
from robotiq_async.values.registers import Registers
from robotiq_async.values.request import Request
from tests.fake_transport import WRITE, Wire
from tests.virtual import VirtualLoop, until

pytestmark = pytest.mark.virtual_time


async def test_a_tunnel_is_as_good_as_an_address_and_a_start_on_it_can_be_repeated() -> None:
    wire = Wire(speedup=20)
    assert isinstance(wire, Tunnel)
    hand = RobotiqHand(wire)
    wire.pull()
    with pytest.raises(ConnectFailedError):
        await hand.start()
    wire.plug()
    async with hand:
        result = await hand.move(100, Finger.A)
        assert result.positions[Finger.A] == pytest.approx(100, abs=2)
    assert not wire.is_open


async def test_missed_ticks_are_skipped_and_not_caught_up() -> None:
    """A poll every 10 ms; the answer to one takes as long as ten, and only the next ones follow."""
    wire = Slow()
    async with RobotiqHand(wire, poll_interval=0.01) as hand:
        statuses = hand.statuses(buffer=100)
        wire.answers_after = 0.1
        await anext(statuses)
        wire.answers_after = 0.0
        timestamps = [(await anext(statuses)).timestamp for _ in range(6)]
        assert hand.statistics.overruns >= 8
        assert statuses.missed == 0
        assert timestamps[-1] - timestamps[0] > 0.03, "a burst of polls"


# -- a tunnel that does not keep to the rules ---------------------------------------------------------------


class Rogue(Wire):
    """Does something that a tunnel must not do, in the given call; an exchange is a read or a write."""

    exchange_s = 0.0

    def __init__(self, call: str, what: str) -> None:
        super().__init__(speedup=100)
        self.call, self.what = call, what
        self.is_rogue = False
        self.released = asyncio.Event()
        """Set to let go of a call that does not end when it is cancelled."""
        self.inside = self.most_inside = 0
        """Calls at once: now, and ever."""

    # Plain functions: a tunnel need not be written with async def.

    def open(self) -> Any:
        return self._misbehave("open") or self._carried_out("open", super().open)

    def exchange(self, pdu: bytes) -> Any:
        call = "write" if pdu[0] == WRITE else "read"
        return self._misbehave(call) or self._carried_out(call, super().exchange, pdu)

    def close(self) -> Any:
        return self._misbehave("close") or self._carried_out("close", super().close)

    def _is_rogue_in(self, call: str) -> str:
        return self.what if self.is_rogue and call == self.call else ""

    def _misbehave(self, call: str) -> object:
        match self._is_rogue_in(call):
            case "raise at once":
                raise OSError(5, "input/output error")
            case "stop iterating":
                raise StopIteration
            case "return at once":
                return bytes(18)
        return None

    async def _carried_out(
        self, call: str, what: Callable[..., Awaitable[Any]], *arguments: object
    ) -> object:
        self.inside += 1
        self.most_inside = max(self.most_inside, self.inside)
        try:
            return await self._or_not(call, what, *arguments)
        finally:
            self.inside -= 1

    async def _or_not(self, call: str, what: Callable[..., Awaitable[Any]], *arguments: object) -> object:
        match self._is_rogue_in(call):
            case "never":
                await asyncio.Event().wait()
            case "never, and does not end":
                while not self.released.is_set():
                    with contextlib.suppress(asyncio.CancelledError):
                        await self.released.wait()
            case "raise":
                raise OSError(5, "input/output error")
            case "raise ours":
                raise ConnectionLostError("unplugged")
            case "cancel itself":
                raise asyncio.CancelledError
            case "say that time is over":
                raise TimeoutError
            case "half":
                return (await what(*arguments))[:7]
            case "more":
                return (await what(*arguments)) + b"0"
            case "another function":
                return b"\x04" + (await what(*arguments))[1:]
            case "text":
                return "text"
            case "nothing":
                return None
        return await what(*arguments)


IN_ANY_CALL = [
    "never",
    "never, and does not end",
    "raise",
    "raise ours",
    "raise at once",
    "return at once",
    "stop iterating",
    "cancel itself",
]
REPLIES = ("half", "more", "another function", "text", "nothing")
WAYS = [
    *((call, what) for call in ("open", "read") for what in IN_ANY_CALL),
    *(("read", what) for what in ("say that time is over", *REPLIES)),
]
WAYS.remove(("open", "return at once"))


@pytest.mark.parametrize(("call", "what"), WAYS)
async def test_a_rogue_tunnel_fails_the_start(call: str, what: str) -> None:
    wire = Rogue(call, what)
    wire.is_rogue = True
    hand = RobotiqHand(wire, connect_timeout=0.2, response_timeout=0.1)
    async with asyncio.timeout(5):
        with pytest.raises(RobotiqConnectionError):
            await hand.start()
    assert hand.state is State.SHUTDOWN
    wire.is_rogue = False
    wire.released.set()
    async with hand:
        await hand.move(30, Finger.A)
    assert wire.most_inside == 1


@pytest.mark.parametrize(
    ("call", "what"),
    [
        *(way for way in WAYS if way[0] == "read"),
        *(("write", what) for what in IN_ANY_CALL if not what.startswith("return")),
    ],
)
async def test_a_rogue_tunnel_is_a_lost_link(call: str, what: str) -> None:
    wire = Rogue(call, what)
    async with RobotiqHand(wire, connect_timeout=0.2, response_timeout=0.1) as hand:
        wire.is_rogue = True
        hand.command(Finger.A, position=100)
        await hand.wait_for_state(State.DISCONNECTED, timeout=5)
        wire.is_rogue = False
        wire.released.set()
        await hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
        await hand.move(30, Finger.B)
    assert wire.most_inside == 1


@pytest.mark.parametrize("call", ["read", "write", "close"])
@pytest.mark.parametrize("what", IN_ANY_CALL)
async def test_stop_ends_on_a_rogue_tunnel(call: str, what: str) -> None:
    before = asyncio.all_tasks()
    wire = Rogue(call, what)
    hand = RobotiqHand(wire, response_timeout=0.5)
    await hand.start()
    await hand.set_position(255, Finger.A)
    wire.is_rogue = True
    began = now()
    await hand.stop()
    assert now() - began < 2.0
    assert hand.state is State.SHUTDOWN
    wire.released.set()
    await asyncio.gather(*asyncio.all_tasks() - before, return_exceptions=True)
    assert wire.most_inside == 1


async def test_an_answer_that_comes_after_its_time_is_not_believed() -> None:
    """A call that swallows its cancellation answers two seconds late."""
    wire = Rogue("read", "never, and does not end")
    async with RobotiqHand(wire, response_timeout=0.1) as hand:
        statuses = hand.statuses(1000)
        wire.is_rogue = True
        asked = now()
        await hand.wait_for_state(State.DISCONNECTED)
        assert now() - asked < 0.1 + HUSH_S + REPEAT_S + 0.01
        known = hand.status
        with pytest.raises(ConnectionLostError):
            await hand.set_position(255)
        await asyncio.sleep(2)
        assert hand.state is State.DISCONNECTED
        wire.gripper.write(0, Request(activate=True, go=True).registers)
        wire.is_rogue = False
        wire.released.set()
        await hand.wait_for_state(State.RUNNING_IDLE, timeout=2.5)
        seen = [each for each in statuses.drain() if each.sequence > known.sequence]
        assert all(each.timestamp > asked + 2 for each in seen)
        assert wire.most_inside == 1


class HeldUp(Wire):
    """Its reply takes a millisecond, in which the loop is held up for much longer."""

    async def read(self) -> Registers:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        loop.call_soon(loop.hold_up, 0.2)
        await asyncio.sleep(0.001)
        return await super().read()


async def test_a_reply_that_waits_while_the_loop_is_held_up_is_in_time() -> None:
    async with RobotiqHand(HeldUp(speedup=20), response_timeout=0.05) as hand:
        statuses = hand.statuses()
        for _ in range(10):
            await anext(statuses)
        assert hand.statistics.reconnects == 0


class Slow(Wire):
    """Its answers come in order, and closing it takes a moment; or all takes for ever."""

    def __init__(self) -> None:
        super().__init__(speedup=20)
        self.answers: asyncio.Queue[Registers] = asyncio.Queue()
        self.answers_after = 0.0
        self.hangs = False

    async def open(self) -> None:
        self.answers = asyncio.Queue()
        await super().open()

    async def read(self) -> Registers:
        if self.hangs:
            await asyncio.Event().wait()
        registers = await super().read()
        asyncio.get_running_loop().call_later(self.answers_after, self.answers.put_nowait, registers)
        return await self.answers.get()

    async def write(self, registers: Sequence[int]) -> None:
        if self.hangs:
            await asyncio.Event().wait()
        await super().write(registers)

    async def close(self) -> None:
        if self.hangs:
            await asyncio.Event().wait()
        await super().close()


async def test_a_read_that_stop_interrupts_leaves_no_answer_to_the_next() -> None:
    wire = Slow()
    hand = RobotiqHand(wire)
    await hand.start()
    await hand.set_position(255)
    wire.pull()
    await hand.wait_for_state(State.DISCONNECTED)
    wire.plug()
    wire.answers_after = 0.05
    wire.calls.clear()
    await until(lambda: "read" in wire.calls)
    await hand.stop()
    first = wire.calls.index("read")
    assert wire.calls[first : first + 3] == ["read", "close", "open"]


async def test_stop_is_bounded_when_a_tunnel_neither_answers_nor_closes() -> None:
    wire = Slow()
    hand = RobotiqHand(wire, response_timeout=0.5)
    await hand.start()
    wire.hangs = True
    began = now()
    await hand.stop()
    assert now() - began < 2.0


async def test_a_write_fails_within_a_second_though_closing_takes_its_time_too() -> None:
    wire = Slow()
    async with RobotiqHand(wire, response_timeout=0.5) as hand:
        wire.hangs = True
        began = now()
        with pytest.raises(ConnectionLostError):
            await hand.set_position(100)
        assert now() - began < 0.6
        wire.hangs = False


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("turns", range(10))
async def test_the_fingers_are_stopped_over_a_tunnel_when_the_loop_is_torn_down(
    backwards: bool, turns: int
) -> None:
    """asyncio.run() cancels every task at once, in any order and wherever it is."""
    wire = Wire(speedup=20)
    hand = RobotiqHand(wire)
    await hand.start()
    await hand.set_position(255, Finger.A)
    await anext(hand.statuses())
    for _ in range(turns):
        await asyncio.sleep(0)
    tasks = asyncio.all_tasks() - {asyncio.current_task()}
    assert len(tasks) == 2
    for task in sorted(tasks, key=lambda each: each.get_name(), reverse=backwards):
        task.cancel()
    began = now()
    await asyncio.wait(tasks)
    assert now() - began < 0.2
    assert (wire.written[-1].activate, wire.written[-1].go) == (True, False)
    assert not wire.is_open
