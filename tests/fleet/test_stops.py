"""stop() of a remote hand is final from its call on; what races with it, and with the end of an agent."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterator
from contextlib import suppress
from itertools import product
from types import SimpleNamespace
from typing import Any, cast

import pytest

from robotiq_async import ConnectionLostError, Finger, NotStartedError, RobotiqError, State
from robotiq_async.fleet.agent.jobs import Job, Jobs
from robotiq_async.fleet.errors import ControlLostError
from robotiq_async.fleet.network.bus import Query
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import AgentCall, unpack_answer
from robotiq_async.runtime.logger import Log
from robotiq_async.values.request import Request
from tests.calls import COMMANDS, called
from tests.fleet.lab import LEFT, Lab, lab
from tests.virtual import inside, until, virtual

A = Finger.A
STOPS: dict[str, dict[str, bool]] = {"leave": {"halt": False}, "keep": {"keep_grip": True}, "halt": {}}
DELAY_S = 0.02
BETWEEN_S = (0.0005, 0.003, 0.02, 0.2)
TWICE = [
    (first, second, between)
    for number, (first, second) in enumerate(product(STOPS, STOPS))
    for between in (0.0, BETWEEN_S[number % 4], BETWEEN_S[(number + 2) % 4])
]
"""Two stops, and the seconds between them: at once, and for each pair two of the moments after that."""


# -- final stop --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("call", [*COMMANDS, "acquire", "take"])
@inside(lab)
async def test_after_the_call_of_stop_every_request_is_refused(
    here: Lab, hand: RemoteHand, call: str
) -> None:
    writes = len(here.gripper.writes)
    stopping = asyncio.create_task(hand.stop())
    await asyncio.sleep(0)
    with pytest.raises(NotStartedError):
        await called(hand, call)
    await stopping
    assert not going(here, writes)


@pytest.mark.parametrize("turns", range(4))
@pytest.mark.parametrize("options", STOPS.values(), ids=STOPS)
@inside(lab)
async def test_a_control_loop_is_refused_at_once_and_nothing_of_it_is_sent_after_that(
    here: Lab, hand: RemoteHand, options: dict[str, bool], turns: int
) -> None:
    for position in range(100):
        hand.command(A, position=position)  # four run, and the rest is merged
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


@inside(lab)
async def test_a_caller_hears_at_once_that_the_hand_was_stopped(here: Lab, hand: RemoteHand) -> None:
    """It does not wait for the end of the run."""
    here.network.cut(("client", "agent"), ("agent", "client"))
    moving = asyncio.create_task(hand.move(255))
    await asyncio.sleep(0.05)
    loop = asyncio.get_running_loop()
    stopping, called = asyncio.create_task(hand.stop()), loop.time()
    await asyncio.wait({moving})
    assert isinstance(moving.exception(), NotStartedError)
    assert loop.time() - called < 0.01
    await stopping


@pytest.mark.parametrize(("first", "second", "between"), TWICE)
@inside(lab)
async def test_the_strongest_stop_counts_in_any_order(
    here: Lab, hand: RemoteHand, first: str, second: str, between: float
) -> None:
    """A gentler one that runs does not leave rGTO set."""
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
        assert is_stopped(here)


@inside(lab)
async def test_a_weaker_stop_hears_that_a_stronger_one_counts(
    here: Lab, hand: RemoteHand, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, logger="robotiq_async"):
        await asyncio.gather(hand.stop(), hand.stop(keep_grip=True))
    assert "a stronger stop has begun: the fingers are stopped" in caplog.text


@inside(lab)
async def test_a_stop_after_a_release_leaves_the_motion_that_was_released(
    here: Lab, hand: RemoteHand
) -> None:
    await here.moving(hand)
    await hand.release(halt=False)
    await hand.stop()
    await asyncio.sleep(0.1)
    assert here.gripper.is_moving


# -- stop races --------------------------------------------------------------------------------------------


def going(here: Lab, since: int = 0) -> list[Request]:
    images = [Request.from_registers(write.registers) for write in here.gripper.writes[since:]]
    return [image for image in images if image.go]


def is_stopped(here: Lab) -> bool:
    return not (here.gripper.is_moving or Request.from_registers(here.gripper.request_registers).go)


async def slowly(here: Lab, hand: RemoteHand) -> asyncio.Task[Any]:
    """Have a finger move, with a network that takes its time."""
    moving = await here.moving(hand)
    here.network.delay("client", "agent", DELAY_S)
    return moving


@pytest.mark.parametrize("after", [each / 10_000 for each in range(12)])
@inside(lab)
async def test_a_command_that_waits_for_its_lease_is_not_sent_after_stop(here: Lab, after: float) -> None:
    """control=None: the lease may come after the stop."""
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
@inside(lab)
async def test_a_gentle_stop_does_not_give_up_a_hold(here: Lab, hand: RemoteHand, how: str) -> None:
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
@inside(lab)
async def test_a_gentle_stop_does_not_give_up_a_halt(here: Lab, holds: bool) -> None:
    """Also of a hand that only reads, and whose first attempt got lost."""
    async with here.client("other") as other:
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
            moving = await here.moving(other)
        stream = here.network.stream("client", "agent")
        stream.is_cut, stream.keeps = True, False
        halting = asyncio.create_task(hand.halt())
        await asyncio.sleep(0)
        stopping = asyncio.create_task(hand.stop(halt=False))
        await asyncio.sleep(0.01)
        stream.is_cut = False
        await asyncio.gather(stopping, halting)
        assert is_stopped(here)
        if moving is not None:
            with pytest.raises(ControlLostError):
                await moving


@pytest.mark.parametrize("how", ["stop", "release"])
@inside(lab)
async def test_a_stronger_end_beside_a_gentle_release_wins(here: Lab, hand: RemoteHand, how: str) -> None:
    """While the lease is on its way back the hand is not yet one that only reads."""
    await slowly(here, hand)
    gentle = asyncio.create_task(hand.release(halt=False))
    await asyncio.sleep(0)
    await getattr(hand, how)()
    await gentle
    assert is_stopped(here)


@inside(lab)
async def test_a_stronger_stop_leaves_the_next_holder_alone(here: Lab) -> None:
    async with here.client("next", control=False) as other:
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


@inside(lab)
async def test_a_release_that_is_lost_is_said_again(here: Lab, hand: RemoteHand) -> None:
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


class Asked(Query):
    """A request that arrives at the agent."""

    def __init__(self, verb: str, call: AgentCall) -> None:
        self.answers: list[bytes] = []
        super().__init__(LEFT.key(verb), call.pack(), lambda reply: self.answers.append(reply.payload))


def every_motion(hand: RemoteHand) -> Iterator[Asked]:
    session = hand._remote.session
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
        yield Asked(f"cmd/{name}", session.dialog.call(arguments))
    yield Asked("lease", session.dialog.call({"what": "take", "label": "stranger"}))


@inside(lab)
async def test_an_ending_agent_takes_no_request(here: Lab, hand: RemoteHand) -> None:
    """The request comes before its tasks have had a turn."""
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


@inside(lab)
async def test_requests_admitted_just_before_the_end_are_not_written_after_it(
    here: Lab, hand: RemoteHand
) -> None:
    writes = len(here.gripper.writes)
    for each in every_motion(hand):
        if "lease" not in each.key:
            here.agent._receive(each)
    here.serving.cancel()
    here.agent._receive(Asked("info/stranger", AgentCall(LEFT.base, "stranger")))
    await asyncio.wait({here.serving})
    assert not going(here, writes)


@pytest.mark.parametrize("after", [0.0, 0.002, 0.05, 0.2])
@inside(lab, keep_grip=True)
async def test_a_halt_beside_the_gentle_end_of_an_agent_counts(
    here: Lab, reader: RemoteHand, after: float
) -> None:
    """The agent takes it although its hand is stopping: grips are kept otherwise."""
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


@inside(lab)
async def test_a_lease_that_comes_with_the_end_is_not_kept(here: Lab) -> None:
    hand = here.client(control=False)
    await hand.start()
    acquiring = asyncio.create_task(hand.acquire())
    await asyncio.sleep(0)
    await hand.stop()
    with pytest.raises(RobotiqError):
        await acquiring
    assert not hand.is_in_control


@virtual
async def test_a_request_that_outlasts_the_agent_is_cancelled_and_answered() -> None:
    asked = Asked("cmd/move", AgentCall(LEFT.base, "client", number=1))
    publisher = SimpleNamespace(status_message=lambda: b"")
    requests = Jobs(cast("Any", publisher), 1, Log("left"), lambda *_: None)
    requests.start(Job("move", AgentCall(LEFT.base, "client", number=1), asked), asyncio.sleep(60, {}))
    await requests.end()
    assert asked.answers
