"""A transport object in place of an address, and what the owner task does with a link that fails."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

import pytest

from robotiq_async import (
    ConnectFailedError,
    ConnectionLostError,
    Finger,
    ProtocolError,
    ReconnectPolicy,
    RobotiqHand,
    State,
    Transport,
)
from robotiq_async.registers import Registers
from robotiq_async.simulator import SimulatedGripper


class Wire:
    """A gripper without a network: the link breaks when told to."""

    def __init__(self) -> None:
        self.gripper = SimulatedGripper(speedup=20)
        self.is_open = False
        self.fail_opens = 0
        self.opened_at: list[float] = []
        self.broken = False

    async def open(self) -> None:
        await asyncio.sleep(0)
        self.opened_at.append(asyncio.get_running_loop().time())
        if self.fail_opens:
            self.fail_opens -= 1
            raise ConnectFailedError("wire", "unplugged")
        self.broken, self.is_open = False, True

    async def read(self) -> Registers:
        await self._carry()
        return self.gripper.status_registers()

    async def write(self, registers: Sequence[int]) -> None:
        await self._carry()
        self.gripper.write(0, registers)

    async def close(self) -> None:
        self.is_open = False

    async def _carry(self) -> None:
        await asyncio.sleep(0)
        if self.broken:
            self.is_open = False
            raise ConnectionLostError("unplugged")


async def test_a_transport_object_is_as_good_as_an_address() -> None:
    wire = Wire()
    assert isinstance(wire, Transport)
    async with RobotiqHand(wire) as hand:
        result = await hand.move(100, Finger.A)
        assert result.positions[Finger.A] == pytest.approx(100, abs=2)
    assert not wire.is_open


async def test_the_delay_between_tries_doubles_up_to_its_limit() -> None:
    wire = Wire()
    policy = ReconnectPolicy(first_delay=0.02, max_delay=0.08)
    async with RobotiqHand(wire, reconnect=policy) as hand:
        wire.opened_at.clear()
        wire.fail_opens, wire.broken = 6, True
        await hand.wait_for_state(State.DISCONNECTED)
        await hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
        assert hand.statistics.reconnects == 1
    gaps = [after - before for before, after in zip(wire.opened_at, wire.opened_at[1:], strict=False)]
    # A busy machine only makes them longer.
    assert all(gap >= want - 0.002 for gap, want in zip(gaps, [0.04, 0.08, 0.08, 0.08, 0.08], strict=False))
    assert min(gaps) < 0.08
    assert len(wire.opened_at) == 7


async def test_the_policy_may_give_up() -> None:
    wire = Wire()
    policy = ReconnectPolicy(first_delay=0.0, max_delay=0.01, give_up_after=0.05)
    hand = RobotiqHand(wire, reconnect=policy)
    await hand.start()
    wire.fail_opens, wire.broken = 1_000_000, True
    with pytest.raises(ConnectionLostError):
        await hand.wait_for_state(State.FAULT)
    with pytest.raises(ConnectionLostError):
        hand.command(position=3)
    await hand.stop()


async def test_a_start_on_an_unplugged_wire_can_be_repeated() -> None:
    wire = Wire()
    wire.fail_opens = 1
    hand = RobotiqHand(wire)
    with pytest.raises(ConnectFailedError):
        await hand.start()
    await hand.start()
    await hand.stop()


async def test_missed_ticks_are_skipped_and_not_caught_up() -> None:
    """A poll every 10 ms; ten of them are missed, and only the next ones follow."""
    wire = Wire()
    held = asyncio.Event()

    async def hold() -> None:
        held.set()
        await asyncio.sleep(0.1)

    async with RobotiqHand(wire, poll_interval=0.01) as hand:
        carry, wire._carry = wire._carry, hold  # type: ignore[method-assign]  # the fake's own
        await held.wait()
        wire._carry = carry  # type: ignore[method-assign]
        statuses = hand.statuses(buffer=100)
        timestamps = [(await anext(statuses)).timestamp for _ in range(6)]
        assert hand.statistics.overruns >= 8
        assert statuses.missed == 0
        assert timestamps[-1] - timestamps[0] > 0.03, "a burst of polls"


# -- a transport that does not keep to the rules ----------------------------------------------------------


class Rogue(Wire):
    """Does something that a transport must not do, in the call that it is told."""

    def __init__(self, call: str, what: str) -> None:
        super().__init__()
        self.call, self.what = call, what
        self.is_rogue = False

    async def open(self) -> None:
        await self._misbehave("open")
        await super().open()

    async def read(self) -> Registers:
        await self._misbehave("read")
        registers = await super().read()
        if self.is_rogue and self.what == "seven":
            return registers[:7]
        if self.is_rogue and self.what == "range":
            return (0x10000, *registers[1:])
        return registers

    async def write(self, registers: Sequence[int]) -> None:
        await self._misbehave("write")
        await super().write(registers)

    async def _misbehave(self, call: str) -> None:
        if not self.is_rogue or call != self.call:
            return
        if self.what == "never":
            await asyncio.Event().wait()
        if self.what == "raise":
            raise OSError(5, "input/output error")


WAYS = [
    ("open", "never"),
    ("open", "raise"),
    ("read", "never"),
    ("read", "raise"),
    ("read", "seven"),
    ("read", "range"),
]


@pytest.mark.parametrize(("call", "what"), WAYS)
async def test_a_rogue_transport_fails_the_start(call: str, what: str) -> None:
    wire = Rogue(call, what)
    wire.is_rogue = True
    hand = RobotiqHand(wire, connect_timeout=0.2, response_timeout=0.1)
    async with asyncio.timeout(5):
        with pytest.raises((ConnectFailedError, ProtocolError)):
            await hand.start()
    assert hand.state is State.SHUTDOWN
    wire.is_rogue = False
    async with hand:
        await hand.move(30, Finger.A)


@pytest.mark.parametrize(("call", "what"), [*WAYS[2:], ("write", "never"), ("write", "raise")])
async def test_a_rogue_transport_is_a_lost_link(call: str, what: str) -> None:
    wire = Rogue(call, what)
    async with RobotiqHand(wire, connect_timeout=0.2, response_timeout=0.1) as hand:
        wire.is_rogue = True
        hand.command(Finger.A, position=100)
        await hand.wait_for_state(State.DISCONNECTED, timeout=5)
        wire.is_rogue = False
        await hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
        await hand.move(30, Finger.B)


@pytest.mark.parametrize("what", ["never", "raise"])
async def test_stop_ends_on_a_rogue_transport(what: str) -> None:
    wire = Rogue("read", what)
    hand = RobotiqHand(wire, connect_timeout=0.2)
    await hand.start()
    wire.is_rogue = True
    async with asyncio.timeout(3):
        await hand.stop()
    assert hand.state is State.SHUTDOWN


class Slow(Wire):
    """Its answers come in order, and closing it takes a moment, or for ever."""

    def __init__(self) -> None:
        super().__init__()
        self.answers: asyncio.Queue[Registers] = asyncio.Queue()
        self.calls: list[str] = []
        self.answers_after = 0.0
        self.hangs = False

    async def open(self) -> None:
        self.calls.append("open")
        self.answers = asyncio.Queue()
        await super().open()

    async def read(self) -> Registers:
        self.calls.append("read")
        if self.hangs:
            await asyncio.Event().wait()
        registers = await super().read()
        asyncio.get_running_loop().call_later(self.answers_after, self.answers.put_nowait, registers)
        return await self.answers.get()

    async def close(self) -> None:
        if self.hangs:
            await asyncio.Event().wait()
        await asyncio.sleep(0)
        self.calls.append("close")
        await super().close()


async def test_a_read_that_stop_interrupts_leaves_no_answer_to_the_next() -> None:
    wire = Slow()
    hand = RobotiqHand(wire)
    await hand.start()
    await hand.set_position(255)
    wire.broken = True
    await hand.wait_for_state(State.DISCONNECTED)
    wire.answers_after = 0.05
    wire.calls.clear()
    async with asyncio.timeout(5):
        while "read" not in wire.calls:  # noqa: ASYNC110
            await asyncio.sleep(0)
    await hand.stop()
    first = wire.calls.index("read")
    assert wire.calls[first : first + 3] == ["read", "close", "open"]


async def test_stop_is_bounded_when_a_transport_neither_answers_nor_closes() -> None:
    wire = Slow()
    hand = RobotiqHand(wire, response_timeout=0.5)
    await hand.start()
    wire.hangs = True
    began = asyncio.get_running_loop().time()
    await hand.stop()
    assert asyncio.get_running_loop().time() - began < 2.0
