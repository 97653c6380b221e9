"""The task that owns the link: its exchanges, their order, its beginning and its end."""

from __future__ import annotations

import asyncio
import logging
import sys
import types
from itertools import pairwise

import pytest

from robotiq_async.control.pending import changes
from robotiq_async.hands.options import LATE_POLLS, HandOptions, ReconnectPolicy
from robotiq_async.local.cycle import READS
from robotiq_async.local.ending import STOP_S
from robotiq_async.local.late_polls import LATE_WARNING_S
from robotiq_async.local.opening import SHORTEST_S, Opener
from robotiq_async.values.enums import Finger, State
from robotiq_async.values.errors import (
    ConnectFailedError,
    ConnectionLostError,
    ProtocolError,
    ResponseTimeoutError,
    RobotiqConnectionError,
)
from robotiq_async.values.request import Request
from tests.fake_transport import LOST
from tests.local.polled import POLL_S, Polled, polled
from tests.virtual import VirtualLoop

pytestmark = pytest.mark.virtual_time

# -- read, decide, write -----------------------------------------------------------------------------------


async def test_while_nothing_is_asked_it_reads_at_its_interval_and_writes_nothing(here: Polled) -> None:
    await here.polls(50)
    assert here.wire.calls == ["open", *["read"] * 51]
    asked = [status.timestamp for status in here.statuses[1:]]
    assert all(later - earlier == pytest.approx(POLL_S) for earlier, later in pairwise(asked))
    assert [status.sequence for status in here.statuses] == list(range(7, 58))
    assert here.counters.polls == 51
    assert not here.requests


async def test_a_status_is_read_before_anything_is_written_and_the_write_follows_at_once(
    here: Polled,
) -> None:
    await here.polls(3)
    here.controller.command(changes(Finger.A, 100))
    del here.wire.calls[:]
    await here.polls(2)
    assert here.wire.calls[:3] == ["read", "write", "read"]
    (sent,) = here.requests
    assert sent.acknowledged
    assert sent.request.position(Finger.A) == 100
    assert sent.timestamp == here.statuses[-2].timestamp, "decided on what was read just now"
    assert here.counters.writes == 1


async def test_a_halt_does_not_wait_for_the_tick_and_shifts_no_tick(here: Polled) -> None:
    await here.polls(3)
    here.controller.command(changes(Finger.A, 200))
    await here.polls(3)
    await asyncio.sleep(POLL_S / 4)
    del here.wire.calls[:]
    before, asked = here.statuses[-1].timestamp, here.loop.time()
    here.controller.halt(asyncio.get_running_loop().create_future())
    here.run.note_request()
    here.run.note_request()
    await here.polls()
    assert here.wire.calls == ["write", "read"]
    assert here.statuses[-1].timestamp - asked < POLL_S / 2
    await here.polls(2)
    later = [status.timestamp for status in here.statuses[-2:]]
    assert later == [pytest.approx(before + POLL_S), pytest.approx(before + 2 * POLL_S)]
    assert not here.counters.overruns
    whole = list(here.counters.periods)[1:]  # the first is from the first contact to the first tick
    assert len(whole) == 6, "those around a hurried cycle do not count"
    assert all(period == pytest.approx(POLL_S) for period in whole)


async def test_a_request_that_is_no_stop_waits_for_the_tick(here: Polled) -> None:
    await here.polls(3)
    before = here.statuses[-1].timestamp
    here.controller.command(changes(Finger.A, 200))
    here.run.note_request()
    await here.polls()
    assert here.statuses[-1].timestamp == pytest.approx(before + POLL_S)


async def test_decisions_use_the_status_just_read(here: Polled) -> None:
    """Another client resets it between two polls: a command that was waiting would activate it again."""
    await here.polls(3)
    here.controller.command(changes(Finger.A, 100))
    here.wire.gripper.write(0, Request().registers)
    await here.polls(3)
    assert here.machine.state is State.RESET
    assert not here.requests


async def test_a_write_that_was_not_acknowledged_is_published_as_such_and_never_repeated(
    here: Polled,
) -> None:
    await here.polls(3)
    here.wire.failing["write"] = LOST
    here.controller.command(changes(Finger.A, 100))
    await here.polls(1)
    await asyncio.sleep(0.005)
    assert here.machine.state is State.DISCONNECTED
    here.wire.failing.clear()
    await here.polls(20)
    assert here.machine.state is State.RUNNING_IDLE
    assert [sent.acknowledged for sent in here.requests] == [False]
    assert here.counters.writes == 0
    assert here.counters.reconnects == 1


async def test_when_the_loop_was_held_up_the_gripper_is_read_again_before_anything_is_written(
    here: Polled,
) -> None:
    """Another client's write, or a new position of an axis, must be seen before the next write."""
    await here.polls(3)
    here.controller.command(changes(Finger.A, 100))

    def hold_up() -> None:
        here.wire.gripper.write(0, Request().registers)
        here.loop.hold_up(0.5)

    del here.wire.calls[:]
    here.at_next_status = hold_up
    await here.polls(3)
    assert here.wire.calls[:3] == ["read", "read", "read"]
    assert here.machine.state is State.RESET
    assert not here.requests


async def test_when_the_loop_was_held_up_between_two_cycles_a_stop_reads_first(here: Polled) -> None:
    """Another client has reset the gripper: the halt, made of the old status, would activate it."""
    await here.polls(3)
    waiter = here.loop.create_future()

    def hold_up() -> None:
        here.wire.gripper.write(0, Request().registers)
        here.loop.hold_up(0.5)
        here.controller.halt(waiter)
        here.run.note_request()

    here.loop.call_later(POLL_S / 2, hold_up)
    await here.polls(1)
    del here.wire.calls[:]
    await here.polls(3)
    assert here.wire.calls[0] == "read"
    assert not any(image.activate for image in here.wire.written)
    waiter.cancel()


async def test_in_a_loop_that_is_always_held_up_something_is_written_in_the_end(here: Polled) -> None:
    await here.polls(3)
    here.controller.command(changes(Finger.A, 100))

    def hold_up() -> None:
        here.loop.hold_up(0.1)
        here.at_next_status = hold_up

    del here.wire.calls[:]
    here.at_next_status = hold_up
    await here.polls(READS + 1)
    assert here.wire.calls[: READS + 1] == [*["read"] * READS, "write"]
    here.at_next_status = None


async def late(here: Polled, seconds: float, times: int) -> None:
    """Hold up the loop so often, each time during a poll."""
    for _ in range(times):
        here.at_next_status = lambda: here.loop.hold_up(seconds)
        await here.polls(3)


async def test_late_polls_are_warned_of_once_a_minute_and_counted(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING, "robotiq_async")
    async with polled(poll_interval=0.1) as here:  # a minute has fewer of them
        await late(here, 0.3, 5)
        await asyncio.sleep(LATE_WARNING_S - 10)
        await late(here, 0.3, 4)
        await asyncio.sleep(10)
        await late(here, 0.4, 3)
    first, second = [each for each in caplog.messages if LATE_POLLS in each]
    assert "late, 200 ms: something holds up the event loop" in first
    assert "late, 9 times, at most 300 ms" in second


@pytest.mark.parametrize("in_ipython", [False, True])
async def test_a_late_poll_may_be_a_prompt_of_ipython(
    here: Polled, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, in_ipython: bool
) -> None:
    caplog.set_level(logging.WARNING, "robotiq_async")
    ipython = types.SimpleNamespace(get_ipython=lambda: object() if in_ipython else None)
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    await late(here, 0.2, 1)
    (said,) = [each for each in caplog.messages if LATE_POLLS in each]
    assert ("IPython" in said) is in_ipython


# -- the first contact -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("failing", "error", "expected"),
    [
        ("open", ConnectFailedError("wire", "refused"), ConnectFailedError),
        ("open", ProtocolError("no gripper"), ProtocolError),
        ("read", ResponseTimeoutError("silence"), ConnectFailedError),
        ("read", ConnectionLostError("gone"), ConnectFailedError),
        ("read", ProtocolError("no gripper"), ProtocolError),
    ],
)
async def test_a_failed_first_contact_is_reported_and_ends_the_task(
    failing: str, error: RobotiqConnectionError, expected: type[RobotiqConnectionError]
) -> None:
    here = Polled(ReconnectPolicy())
    here.wire.failing[failing] = error
    here.start()
    with pytest.raises(expected) as caught:
        await here.run.connected
    assert caught.value is error or caught.value.__cause__ is error
    await here.end()
    assert "write" not in here.wire.calls
    assert here.run.failure is None, "the hand has not given up: it has never begun"


@pytest.mark.parametrize(
    ("activate", "policy", "active", "at_first", "after_a_power_cut"),
    [
        (True, ReconnectPolicy(), False, State.RUNNING_IDLE, State.RESET),
        # The start might have activated it, had it been reset then.
        (True, ReconnectPolicy(), True, State.RUNNING_IDLE, State.RESET),
        (False, ReconnectPolicy(), True, State.RUNNING_IDLE, State.RESET),
        (False, ReconnectPolicy(activate=True), True, State.RUNNING_IDLE, State.RUNNING_IDLE),
        (False, ReconnectPolicy(activate=True), False, State.RESET, State.RUNNING_IDLE),
    ],
)
async def test_the_start_and_the_policy_may_activate_and_nothing_else_does_unasked(
    activate: bool, policy: ReconnectPolicy, active: bool, at_first: State, after_a_power_cut: State
) -> None:
    async with polled(policy, activate=activate, active=active, poll_interval=0.05) as here:
        await asyncio.sleep(10)
        assert here.machine.state is at_first
        written = len(here.requests)
        assert written == (activate and not active)
        here.wire.failing["read"] = LOST
        here.wire.gripper.power_cycle()
        await asyncio.sleep(0.1)
        here.wire.failing.clear()
        await asyncio.sleep(10)
        assert here.machine.state is after_a_power_cut
        assert len(here.requests) == written + (after_a_power_cut is State.RUNNING_IDLE)


# -- a link that is lost -----------------------------------------------------------------------------------


async def test_without_a_policy_a_lost_link_is_the_end() -> None:
    async with polled(None) as here:
        await here.polls(3)
        here.wire.failing["read"] = here.wire.failing["open"] = LOST
        await here.end()
        assert here.run.failure is LOST


@pytest.mark.parametrize("why", [RuntimeError("can't start new thread"), MemoryError(), KeyError("odd")])
async def test_whatever_keeps_a_link_from_being_opened_again_is_a_failed_try(why: Exception) -> None:
    """The hand had given up for good, with an internal error."""
    async with polled() as here:
        await here.polls(3)
        here.wire.failing["read"] = LOST
        here.wire.failing["open"] = why
        await asyncio.sleep(1.0)
        assert here.machine.state is State.DISCONNECTED
        assert repr(why) in str(here.machine.why_down)
        here.wire.failing.clear()
        await here.polls(3)
        assert here.counters.reconnects == 1


async def test_whatever_keeps_a_link_from_being_opened_for_a_stop_is_a_failed_try() -> None:
    async with polled() as here:
        here.controller.command(changes(Finger.ABC, 255, 0))
        await here.polls(10)
        here.wire.failing = {"read": LOST, "write": LOST, "open": RuntimeError("can't start new thread")}
        here.run.request_stop(halt=True)
        await asyncio.sleep(0.3)
        here.wire.failing.clear()
        await here.end()
        assert not here.wire.gripper.is_moving


async def test_the_delays_between_tries_double_up_to_their_limit() -> None:
    async with polled(ReconnectPolicy(first_delay=0.1, max_delay=0.5)) as here:
        await here.polls(3)
        opened: list[float] = []
        here.wire.failing["read"] = here.wire.failing["open"] = LOST
        del here.wire.calls[:]
        while len(opened) < 6:
            await asyncio.sleep(0.0005)
            if here.wire.calls.count("open") > len(opened):
                opened.append(here.loop.time())
        gaps = [later - earlier for earlier, later in pairwise(opened)]
        assert gaps == [pytest.approx(gap, abs=0.003) for gap in (0.2, 0.4, 0.5, 0.5, 0.5)]
        here.wire.failing.clear()
        await here.polls(3)
        assert here.counters.reconnects == 1


async def test_the_policy_may_give_up_and_says_why() -> None:
    async with polled(ReconnectPolicy(give_up_after=0.3)) as here:
        await here.polls(3)
        here.wire.failing["read"] = LOST
        here.wire.failing["open"] = why = ConnectFailedError("wire", "no route")
        await here.end(within=0.6 + STOP_S)
        assert here.run.failure is why


@pytest.mark.parametrize(
    ("policy", "tries", "gives_up"),
    [
        # A first try at once is not followed by others at once.
        (ReconnectPolicy(0.0, 1.0), [0, SHORTEST_S, 3 * SHORTEST_S, 7 * SHORTEST_S], False),
        # No delay but the first is above the limit.
        (ReconnectPolicy(5.0, 0.3), [5, 5.3, 5.6], False),
        (ReconnectPolicy(0.1, 60), [0.1, 0.3, 0.7, 1.5, 3.1, 6.3, 12.7, 25.5, 51.1, 102.3, 162.3], False),
        # The last try begins when the time is over.
        (ReconnectPolicy(0.1, 60, give_up_after=1), [0.1, 0.3, 0.7, 1], True),
        (ReconnectPolicy(0.1, 60, give_up_after=0), [0.1], True),
    ],
)
async def test_when_it_is_tried_and_given_up(
    policy: ReconnectPolicy, tries: list[float], gives_up: bool
) -> None:
    loop = asyncio.get_running_loop()
    began, tried, failed = loop.time(), list[float](), list[RobotiqConnectionError]()

    async def connect() -> None:
        tried.append(loop.time() - began)
        if len(tried) < len(tries) or gives_up:
            raise LOST

    opener = Opener(connect, HandOptions())
    if gives_up:
        with pytest.raises(ConnectionLostError):
            await opener.again(policy, failed.append)
    else:
        assert await opener.again(policy, failed.append)
    assert tried == pytest.approx(tries)
    assert failed == [LOST] * (len(tried) - 1)


async def test_time_in_which_the_loop_was_held_up_is_no_time_of_a_hand_that_tries() -> None:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    began, tried = loop.time(), list[float]()

    async def connect() -> None:
        tried.append(loop.time() - began)
        raise LOST

    loop.call_later(0.35, loop.hold_up, 60.0)
    with pytest.raises(ConnectionLostError):
        await Opener(connect, HandOptions()).again(ReconnectPolicy(0.1, 0.1, give_up_after=1), lambda _: None)
    assert tried[-1] == pytest.approx(61.0, abs=0.1)
    assert len(tried) >= 9


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("first_delay", -0.1, ValueError),
        ("first_delay", 10.1, ValueError),
        ("max_delay", 0.0, ValueError),
        ("max_delay", 61.0, ValueError),
        ("give_up_after", -1.0, ValueError),
        ("give_up_after", float("nan"), ValueError),
        ("activate", 1, TypeError),
        ("first_delay", "soon", TypeError),
        ("max_delay", True, TypeError),
    ],
)
def test_a_policy_with_a_wrong_value_is_refused(name: str, value: object, error: type[Exception]) -> None:
    with pytest.raises(error, match=name):
        ReconnectPolicy(**{name: value})  # type: ignore[arg-type]
