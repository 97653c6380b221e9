"""stop() of a remote hand is final from its call on; what races with it, and with the end of an agent."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Iterator
from contextlib import suppress
from typing import Any

import pytest

from robotiq_async import ConnectionLostError, Finger, NotStartedError, RobotiqError, State
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import Call, unpack_answer
from robotiq_async.values.errors import ControlLostError
from robotiq_async.values.request import Request
from tests.contract.bench import until
from tests.fleet.cell import LEFT
from tests.fleet.lab import Lab, lab
from tests.virtual import virtual

A = Finger.A
STOPS: dict[str, dict[str, bool]] = {"leave": {"halt": False}, "keep": {"keep_grip": True}, "halt": {}}
REQUESTS: dict[str, Callable[[RemoteHand], Any]] = {
    "command": lambda hand: hand.command(position=255),
    "move": lambda hand: hand.move(255),
    "grasp": lambda hand: hand.grasp(),
    "set_position": lambda hand: hand.set_position(255),
    "set_speed": lambda hand: hand.set_speed(255),
    "hold": lambda hand: hand.hold(),
    "halt": lambda hand: hand.halt(),
    "activate": lambda hand: hand.activate(),
    "reset": lambda hand: hand.reset(),
    "recover": lambda hand: hand.recover(),
    "acquire": lambda hand: hand.acquire(),
    "take": lambda hand: hand.take(),
}
DELAY_S = 0.02


# -- final stop --------------------------------------------------------------------------------------------


async def call(what: Callable[[], Any]) -> None:
    answer = what()
    if isinstance(answer, Awaitable):
        await answer


@pytest.mark.parametrize("request_", REQUESTS.values(), ids=REQUESTS)
@virtual
async def test_after_the_call_of_stop_every_request_is_refused(request_: Callable[[RemoteHand], Any]) -> None:
    async with lab() as here:
        hand = here.client()
        await hand.start()
        writes = len(here.gripper.writes)
        stopping = asyncio.create_task(hand.stop())
        await asyncio.sleep(0)
        with pytest.raises(NotStartedError):
            await call(lambda: request_(hand))
        await stopping
        assert not going(here, writes)


@pytest.mark.parametrize("turns", range(4))
@pytest.mark.parametrize("options", STOPS.values(), ids=STOPS)
@virtual
async def test_a_control_loop_is_refused_at_once_and_nothing_of_it_is_sent_after_that(
    options: dict[str, bool], turns: int
) -> None:
    async with lab() as here:
        hand = here.client()
        await hand.start()
        for position in range(100):
            hand.command(A, position=position)  # four are under way, and the rest is merged
        for _ in range(turns):
            await asyncio.sleep(0)
        stopping = asyncio.create_task(hand.stop(**options))
        await asyncio.sleep(0)
        with pytest.raises(NotStartedError):
            hand.command(A, position=200)
        await stopping
        asked = [image.axes[0].position for image in going(here, 0)]
        await asyncio.sleep(1)
        assert [image.axes[0].position for image in going(here, 0)] == asked
        assert 99 not in asked, "what waited to be sent was dropped"


@virtual
async def test_a_caller_hears_at_once_that_the_hand_was_stopped() -> None:
    """It waited for the end of the run."""
    async with lab() as here:
        hand = here.client()
        await hand.start()
        here.network.cut(("client", "agent"), ("agent", "client"))
        moving = asyncio.create_task(hand.move(255))
        await asyncio.sleep(0.05)
        loop = asyncio.get_running_loop()
        stopping, called = asyncio.create_task(hand.stop()), loop.time()
        await asyncio.wait({moving})
        assert isinstance(moving.exception(), NotStartedError)
        assert loop.time() - called < 0.01
        await stopping


@pytest.mark.parametrize("between", [0.0, 0.0005, 0.003, 0.02, 0.2])
@pytest.mark.parametrize("second", STOPS)
@pytest.mark.parametrize("first", STOPS)
@virtual
async def test_the_strongest_stop_counts_whoever_asks_first(first: str, second: str, between: float) -> None:
    """With a gentler one under way, stop() returned with rGTO set, and the fingers went on."""
    async with lab() as here:
        hand = here.client()
        await hand.start()
        await hand.set_speed(0)
        await hand.set_position(255)
        await until(lambda: here.gripper.is_moving)
        stops = [asyncio.create_task(hand.stop(**STOPS[first]))]
        await asyncio.sleep(between)
        was_over = hand.state is State.SHUTDOWN
        stops.append(asyncio.create_task(hand.stop(**STOPS[second])))
        await asyncio.gather(*stops)
        await asyncio.sleep(0.1)
        strongest = max(first, first if was_over else second, key=list(STOPS).index)
        assert here.gripper.is_moving == (strongest == "leave")
        if strongest == "halt":
            assert not Request.from_registers(here.gripper.request_registers).go


@virtual
async def test_a_weaker_stop_hears_that_a_stronger_one_counts(caplog: pytest.LogCaptureFixture) -> None:
    async with lab() as here:
        hand = here.client()
        await hand.start()
        with caplog.at_level(logging.WARNING, logger="robotiq_async"):
            await asyncio.gather(hand.stop(), hand.stop(keep_grip=True))
        assert "a stop that is under way is stronger: the fingers are stopped" in caplog.text


# -- stop races --------------------------------------------------------------------------------------------


def going(here: Lab, since: int = 0) -> list[Request]:
    images = [Request.from_registers(write.registers) for write in here.gripper.writes[since:]]
    return [image for image in images if image.go]


def is_stopped(here: Lab) -> bool:
    return not Request.from_registers(here.gripper.request_registers).go


async def slowly(here: Lab, hand: RemoteHand) -> asyncio.Task[Any]:
    """Have a finger move, with a network that takes its time."""
    moving = asyncio.create_task(hand.move(255, A, speed=0))
    moving.add_done_callback(lambda task: task.cancelled() or task.exception())
    await until(lambda: here.gripper.is_moving)
    for stream in here.network.both("client", "agent"):
        stream.delay = DELAY_S
    return moving


@pytest.mark.parametrize("after", [each / 10_000 for each in range(12)])
@virtual
async def test_a_command_that_waits_for_its_lease_is_not_sent_after_stop(after: float) -> None:
    """control=None: the lease came, and the command went out, with the hand stopped."""
    async with lab() as here:
        hand = here.client(control=None)
        await hand.start()
        writes = len(here.gripper.writes)
        moving = asyncio.create_task(hand.move(200, A))
        await asyncio.sleep(after)
        sent = here.network.loop.time()
        stopping = asyncio.create_task(hand.stop())
        await asyncio.wait({moving})
        assert isinstance(moving.exception(), NotStartedError)
        await stopping
        await asyncio.sleep(2)
        late = [write for write in here.gripper.writes[writes:] if write.time > sent + 0.01]
        assert not [write for write in late if Request.from_registers(write.registers).go]
        assert not here.gripper.is_moving


@pytest.mark.parametrize("how", ["a cancelled move", "hold()"])
@virtual
async def test_a_gentle_stop_does_not_give_up_a_hold(how: str) -> None:
    async with lab() as here:
        hand = here.client()
        await hand.start()
        held = await slowly(here, hand)
        if how == "hold()":
            held = asyncio.create_task(hand.hold())
            await asyncio.sleep(0)
        else:
            held.cancel()
            await asyncio.wait({held})
        await hand.stop(halt=False)
        await asyncio.gather(held, return_exceptions=True)
        await asyncio.sleep(0.1)
        assert not here.gripper.is_moving


@pytest.mark.parametrize("holds", [True, False])
@virtual
async def test_a_gentle_stop_does_not_give_up_a_halt(holds: bool) -> None:
    """Also of a hand that only reads, and whose first attempt got lost."""
    async with lab() as here, here.client("other") as other:
        await other.release(halt=False)
        hand = here.client(control=holds)
        await hand.start()
        moving = None
        if holds:
            await slowly(here, hand)
        else:
            await other.acquire()
            await hand.halt()
            await other.acquire()
            moving = asyncio.create_task(other.move(255, A, speed=0))
            await until(lambda: here.gripper.is_moving)
        stream = here.network.stream("client", "agent")
        stream.is_cut, stream.keeps = True, False
        halting = asyncio.create_task(hand.halt())
        await asyncio.sleep(0)
        stopping = asyncio.create_task(hand.stop(halt=False))
        await asyncio.sleep(0.01)
        stream.is_cut = False
        await asyncio.gather(stopping, halting)
        assert is_stopped(here)
        assert not here.gripper.is_moving
        if moving is not None:
            with pytest.raises(ControlLostError):
                await moving


@pytest.mark.parametrize("how", ["stop", "release"])
@virtual
async def test_a_stronger_end_beside_a_gentle_release_wins(how: str) -> None:
    """The lease was on its way back, and so the hand took itself for one that only reads."""
    async with lab() as here:
        hand = here.client()
        await hand.start()
        await slowly(here, hand)
        gentle = asyncio.create_task(hand.release(halt=False))
        await asyncio.sleep(0)
        await getattr(hand, how)()
        await gentle
        assert is_stopped(here)
        assert not here.gripper.is_moving
        await hand.stop()


@virtual
async def test_a_stronger_end_leaves_whoever_has_come_after_alone() -> None:
    async with lab() as here, here.client("next", control=False) as other:
        hand = here.client()
        await hand.start()
        moving = await slowly(here, hand)
        gentle = asyncio.create_task(hand.stop(halt=False))
        await asyncio.sleep(DELAY_S * 1.2)
        await other.acquire()
        going_on = asyncio.create_task(other.move(250, A, speed=0))
        await hand.stop()
        await gentle
        assert other.is_in_control
        await asyncio.sleep(0.1)
        assert here.gripper.is_moving
        for each in (moving, going_on):
            each.cancel()
        await asyncio.gather(moving, going_on, return_exceptions=True)


@virtual
async def test_a_release_that_is_lost_is_said_again() -> None:
    async with lab() as here:
        hand = here.client()
        await hand.start()
        await slowly(here, hand)
        stream = here.network.stream("client", "agent")
        stream.is_cut, stream.keeps = True, False
        stopping = asyncio.create_task(hand.stop())
        await asyncio.sleep(0.01)
        stream.is_cut = False
        begun = here.network.loop.time()
        await stopping
        assert is_stopped(here)
        assert here.network.loop.time() - begun < 0.5


class Asked:
    """A request that arrives at the agent."""

    def __init__(self, verb: str, call: Call) -> None:
        self.key, self.payload = LEFT.key(verb), call.pack()
        self.answers: list[bytes] = []

    def reply(self, payload: bytes, attachment: bytes = b"") -> None:  # noqa: ARG002
        self.answers.append(payload)


def every_motion(hand: RemoteHand) -> Iterator[Asked]:
    session = hand._session
    assert session is not None
    for name, arguments in (
        ("move", {"position": 250}),
        ("command", {"axes": {"1": {"position": 250}}}),
        ("set_position", {"value": 250}),
        ("set_speed", {"value": 250}),
        ("activate", {}),
        ("reset", {}),
        ("recover", {}),
    ):
        yield Asked(f"cmd/{name}", session.call(arguments))
    yield Asked("lease", session.call({"what": "take", "label": "somebody"}))


@virtual
async def test_an_agent_takes_nothing_from_the_moment_it_is_told_to_end() -> None:
    """Before its tasks have had a turn."""
    async with lab() as here:
        hand = here.client()
        await hand.start()
        requests = list(every_motion(hand))
        writes = len(here.gripper.writes)
        here.serving.cancel()
        for each in requests:
            here.agent._receive(each)
            error = unpack_answer(each.answers[0]).error
            assert error is not None
            assert error["reason"] == "closed"
        await asyncio.wait({here.serving})
        assert not going(here, writes)
        await hand.stop()


@virtual
async def test_what_was_let_in_just_before_does_not_go_out_after_it() -> None:
    async with lab() as here:
        hand = here.client()
        await hand.start()
        writes = len(here.gripper.writes)
        for each in every_motion(hand):
            if "lease" not in each.key:
                here.agent._receive(each)
        here.serving.cancel()
        here.agent._receive(Asked("info", Call(LEFT.base, "somebody")))
        await asyncio.wait({here.serving})
        assert not going(here, writes)
        await hand.stop()


@pytest.mark.parametrize("after", [0.0, 0.002, 0.05, 0.2])
@virtual
async def test_a_halt_beside_the_gentle_end_of_an_agent_counts(after: float) -> None:
    """It was refused: the hand is being stopped. But its grips were kept, and its fingers held."""
    async with lab(keep_grip=True) as here, here.client("reader", control=False) as reader:
        here.gripper.place_object(Finger.B, 30)
        await here.local.set_speed(0, A)
        await here.local.close(Finger.B)
        await here.local.set_position(255, A)
        here.serving.cancel()
        await asyncio.sleep(after)
        try:
            await reader.halt()
        except (ConnectionLostError, RobotiqError):
            assert here.serving.done(), "there was a client to ask"
        else:
            assert is_stopped(here)
        with suppress(asyncio.CancelledError):
            await here.serving


@virtual
async def test_a_lease_that_comes_with_the_end_is_not_kept() -> None:
    async with lab() as here:
        hand = here.client(control=False)
        await hand.start()
        acquiring = asyncio.create_task(hand.acquire())
        await asyncio.sleep(0)
        await hand.stop()
        with pytest.raises(RobotiqError):
            await acquiring
        assert not hand.is_in_control
