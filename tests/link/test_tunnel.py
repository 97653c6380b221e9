"""A tunnel: three methods of an application, and what a hand makes of them. In virtual time."""

from __future__ import annotations

import asyncio
import contextlib
import errno
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from robotiq_async import (
    JAW,
    ConnectFailedError,
    ConnectionLostError,
    InvalidStateError,
    ProtocolError,
    RobotiqError,
    RobotiqHand,
    State,
    Tunnel,
)
from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values.events import Transition
from robotiq_async.values.model import TWO_FINGER_85
from tests.grippers import activate_beforehand
from tests.virtual import VirtualLoop, until

pytestmark = pytest.mark.virtual_time

DELAY_S = 0.002
READ, WRITE, WRITE_AND_READ = 3, 16, 23


class Arm:
    """A tunnel to a simulated gripper, a jaw unless another is given.

    Attributes:
        pdus: the requests, in order, as exchange() was called with them.
        carried: those that have reached the gripper.
        trouble: what becomes of the next exchange of a function: returns a reply, or raises.
        serves: the functions that it carries.
    """

    def __init__(self, gripper: SimulatedGripper | None = None) -> None:
        self.gripper = gripper or SimulatedGripper(
            asyncio.get_running_loop().time, model=TWO_FINGER_85, spread=False
        )
        self.pdus: list[bytes] = []
        self.carried: list[bytes] = []
        self.serves = {READ, WRITE, WRITE_AND_READ}
        self.trouble: dict[int, Callable[[bytes], Any]] = {}
        self.opened = self.closed = self.inside = 0

    async def open(self) -> None:
        self.opened += 1

    async def close(self) -> None:
        self.closed += 1

    async def exchange(self, pdu: bytes) -> bytes:
        assert not self.inside, "one call at a time"
        self.inside += 1
        try:
            self.pdus.append(pdu)
            if (trouble := self.trouble.pop(pdu[0], None)) is not None:
                reply = trouble(pdu)
                return await reply if asyncio.iscoroutine(reply) else reply  # type: ignore[no-any-return]
            await asyncio.sleep(DELAY_S)
            return self.answer(pdu)
        finally:
            self.inside -= 1

    def answer(self, pdu: bytes) -> bytes:
        if pdu[0] not in self.serves:
            return bytes((pdu[0] | 0x80, 1))
        self.carried.append(pdu)
        if pdu[0] != READ:
            image = pdu[6 if pdu[0] == WRITE else 10 :]
            words = [int.from_bytes(image[at : at + 2], "big") for at in range(0, len(image), 2)]
            self.gripper.write(0, words)
        if pdu[0] == WRITE:
            return pdu[:5]
        count = pdu[4]
        block = b"".join(each.to_bytes(2, "big") for each in self.gripper.status_registers()[:count])
        return bytes((pdu[0], 2 * count)) + block

    def functions(self) -> set[int]:
        """Those of the requests since the last look."""
        seen = {pdu[0] for pdu in self.pdus}
        self.pdus.clear()
        return seen


async def arm() -> Arm:
    made = Arm()
    await activate_beforehand(made.gripper)
    return made


def carries(tunnel: Arm, position: int) -> int:
    """How often a write of this position has reached the gripper."""
    return sum(pdu[0] != READ and pdu[-3] == position for pdu in tunnel.carried)


async def test_all_that_a_serial_line_has_is_above_it() -> None:
    tunnel = await arm()
    assert isinstance(tunnel, Tunnel)
    async with RobotiqHand(tunnel, model="2f85") as hand:
        await hand.move(200)
        await hand.move(30)
        assert tunnel.functions() == {READ, WRITE, WRITE_AND_READ}, "function 23 was tried at rest"
        await hand.set_position(100)
        assert tunnel.functions() == {WRITE_AND_READ}
        assert hand.statistics.reconnects == 0
    assert (tunnel.opened, tunnel.closed) == (1, 1)


async def test_what_cannot_carry_function_23_is_written_with_16() -> None:
    tunnel = await arm()
    tunnel.serves = {READ, WRITE}
    async with RobotiqHand(tunnel, model="2f85") as hand:
        for position in (200, 30, 200):
            await hand.move(position)
        tunnel.functions()
        await hand.set_position(100)
        assert tunnel.functions() == {WRITE}
        assert hand.statistics.reconnects == 0


def raising(error: BaseException) -> Callable[[bytes], Any]:
    def fail(_: bytes) -> bytes:
        raise error

    return fail


def for_ever(_: bytes) -> Any:
    return asyncio.Event().wait()


NO_ANSWER = {
    "a time-out": raising(TimeoutError("the arm says nothing")),
    "damage": raising(ProtocolError("a wrong checksum")),
    "half": lambda pdu: pdu[:1],
    "nothing": lambda _: b"",
    "another": lambda pdu: bytes((pdu[0], 2, 0, 0)),
    "busy": lambda pdu: bytes((pdu[0] | 0x80, 6)),
    "for ever": for_ever,
}
LOSSES = {
    "an error": raising(KeyError("tool")),
    "a loss": raising(ConnectionLostError("unplugged")),
    "a socket's time-out": raising(OSError(errno.ETIMEDOUT, "connection timed out")),
    "no bytes": lambda _: "text",
    "a cancellation": raising(asyncio.CancelledError()),
}


@pytest.mark.parametrize("what", NO_ANSWER)
async def test_a_missing_or_wrong_answer_costs_a_read_and_not_the_link(what: str) -> None:
    tunnel = await arm()
    async with RobotiqHand(tunnel, model="2f85") as hand:
        for _ in range(3):
            tunnel.trouble[READ] = NO_ANSWER[what]
            await asyncio.sleep(0.6)
        assert not tunnel.trouble
        assert hand.statistics.reconnects == 0
    assert tunnel.opened == 1


@pytest.mark.parametrize("what", ["a time-out", "half"])
async def test_a_tunnel_that_has_no_answer_at_once_costs_no_time_out(what: str) -> None:
    tunnel = await arm()
    async with RobotiqHand(tunnel, model="2f85", response_timeout=2.0) as hand:
        statuses = hand.statuses()
        before = (await anext(statuses)).timestamp
        tunnel.trouble[READ] = NO_ANSWER[what]
        for _ in range(3):
            after = (await anext(statuses)).timestamp
            assert after - before < 0.05
            before = after
        assert not tunnel.trouble


async def test_an_answer_to_a_request_that_was_given_up_is_dropped() -> None:
    """It swallows its cancellation, and brings a status of long ago in the middle of another exchange."""
    tunnel = await arm()
    old = tunnel.answer(bytes((READ, 0x07, 0xD0, 0, 3)))

    async def late(_: bytes) -> bytes:
        with contextlib.suppress(asyncio.CancelledError):
            await asyncio.Event().wait()
        return old

    async with RobotiqHand(tunnel, model="2f85", response_timeout=0.1) as hand:
        await hand.move(200)
        statuses = hand.statuses(1000)
        tunnel.trouble[READ] = late
        await asyncio.sleep(1)
        assert not tunnel.trouble
        assert {status.position(JAW) for status in statuses.drain()} == {200}
        assert hand.statistics.reconnects == 0


@pytest.mark.parametrize("what", LOSSES)
async def test_what_is_raised_ends_the_link_and_it_comes_back(what: str) -> None:
    tunnel = await arm()
    async with RobotiqHand(tunnel, model="2f85") as hand:
        tunnel.trouble[READ] = LOSSES[what]
        await hand.wait_for_state(State.DISCONNECTED, timeout=5)
        await hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
    assert (tunnel.opened, tunnel.closed) == (2, 2)


@pytest.mark.parametrize("what", ["a time-out", "half", "for ever"])
@pytest.mark.parametrize("is_carried", [False, True])
@pytest.mark.parametrize("function", [WRITE, WRITE_AND_READ])
async def test_a_command_without_an_answer_is_in_doubt_and_not_sent_again(
    what: str, is_carried: bool, function: int
) -> None:
    """With function 23 the status tells what became of it, with function 16 the link is opened again."""
    tunnel = await arm()

    def lose(pdu: bytes) -> Any:
        if is_carried:
            tunnel.answer(pdu)
        return NO_ANSWER[what](pdu)

    async with RobotiqHand(tunnel, model="2f85", write_function=function) as hand:
        tunnel.trouble[function] = lose
        is_known = is_carried and function == WRITE_AND_READ
        with contextlib.nullcontext() if is_known else pytest.raises(ConnectionLostError):
            await hand.move(200)
        await hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
        await hand.move(90)
        await asyncio.sleep(1)
        assert tunnel.gripper.target(JAW) == 90
        assert carries(tunnel, 200) == is_carried


def keeper(tunnel: Arm) -> tuple[Callable[[bytes], Awaitable[bytes]], asyncio.Event]:
    """An exchange that survives its cancellation and answers once it is released, and the event for that."""
    released = asyncio.Event()

    async def keep(pdu: bytes) -> bytes:
        while not released.is_set():
            with contextlib.suppress(asyncio.CancelledError):
                await released.wait()
        return tunnel.answer(pdu)

    return keep, released


async def test_a_request_that_the_tunnel_keeps_has_left_it_before_the_next() -> None:
    """A thread that carries a command on, although it is no longer waited for."""
    tunnel = await arm()
    keep, released = keeper(tunnel)
    async with RobotiqHand(tunnel, model="2f85", write_function=16) as hand:
        await hand.move(30)
        tunnel.trouble[WRITE] = keep
        with pytest.raises(ConnectionLostError):
            await hand.move(200)
        begun = len(tunnel.pdus)
        await asyncio.sleep(5)
        assert hand.state is State.DISCONNECTED
        assert len(tunnel.pdus) == begun, "the tunnel is asked nothing while it still carries that"
        released.set()
        await hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
        await until(lambda: not tunnel.gripper.is_moving)
        assert carries(tunnel, 200) == 1
        assert hand.status.requested_position(JAW) == tunnel.gripper.target(JAW)


async def test_a_command_that_waited_behind_a_stuck_read_is_not_sent_later() -> None:
    tunnel = await arm()
    keep, released = keeper(tunnel)
    async with RobotiqHand(tunnel, model="2f85", write_function=16) as hand:
        tunnel.trouble[READ] = keep
        await until(lambda: not tunnel.trouble)
        with pytest.raises(ConnectionLostError):
            await hand.set_position(200)
        released.set()
        await hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
        await asyncio.sleep(1)
        assert carries(tunnel, 200) == 0


@pytest.mark.parametrize("call", ["stop", "halt", "hold", "reset"])
async def test_a_write_that_is_due_is_in_the_tunnel_before_anybody_hears_of_it(call: str) -> None:
    """A listener that blocked held it up, because the tunnel's task had not run yet."""
    tunnel, heard = await arm(), list[str]()

    def hear(item: object) -> None:
        if isinstance(item, Transition):
            heard.append("listener")

    def note(pdu: bytes) -> bytes:
        heard.append("write")
        return tunnel.answer(pdu)

    async def move(hand: RobotiqHand) -> None:
        with contextlib.suppress(RobotiqError):
            await hand.move(250, speed=0)
        heard.append("caller")

    async with RobotiqHand(tunnel, model="2f85") as hand:
        moving = asyncio.create_task(move(hand))
        await until(lambda: tunnel.gripper.position(JAW) > 20)
        tunnel.trouble = {WRITE: note, WRITE_AND_READ: note}
        hand.add_listener(hear)
        await getattr(hand, call)()
        await moving
    assert heard[0] == "write"
    assert {*heard} == {"write", "listener", "caller"}


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.ECONNREFUSED, "refused"), "nothing listens there"),
        (KeyError("no such arm"), r"KeyError\('no such arm'\)"),
        (TimeoutError(), "no connection in time"),
    ],
    ids=str,
)
async def test_what_opening_raises_becomes_a_connect_failed_error(error: Exception, words: str) -> None:
    tunnel = await arm()

    async def refuse() -> None:
        raise error

    tunnel.open = refuse  # type: ignore[method-assign]
    with pytest.raises(ConnectFailedError, match=words):
        await RobotiqHand(tunnel, model="2f85").start()


async def test_an_opening_that_takes_too_long_is_cancelled() -> None:
    tunnel = await arm()
    cancelled = False

    async def wait() -> None:
        nonlocal cancelled
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            cancelled = True
            raise

    tunnel.open = wait  # type: ignore[method-assign]
    with pytest.raises(ConnectFailedError, match=r"no connection within 0\.5 s"):
        await RobotiqHand(tunnel, model="2f85", connect_timeout=0.5).start()
    assert cancelled


async def test_an_opening_outlasts_a_loop_that_is_held_up() -> None:
    """It was given up, although the time of the block counts for no limit."""
    tunnel, loop = await arm(), asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)

    async def take_three_steps() -> None:
        for _ in range(3):
            await asyncio.sleep(0.2)

    tunnel.open = take_three_steps  # type: ignore[method-assign]
    loop.call_later(0.25, loop.hold_up, 2.0)
    async with RobotiqHand(tunnel, model="2f85", connect_timeout=1.0) as hand:
        assert hand.state is State.RUNNING_IDLE


async def test_two_hands_do_not_share_a_tunnel() -> None:
    tunnel = await arm()
    async with RobotiqHand(tunnel, model="2f85"):
        with pytest.raises(InvalidStateError, match="Arm at"):
            await RobotiqHand(tunnel, model="2f85", device_id=12).start()
