"""Callers that wait for a state."""

from __future__ import annotations

import asyncio
import gc

import pytest

from robotiq_async.session.waiting import StateWaiters
from robotiq_async.values.enums import Fault, State
from robotiq_async.values.errors import ConnectionLostError, GripperFaultError, RobotiqError


def lost() -> RobotiqError:
    return ConnectionLostError("gone")


@pytest.fixture
def waiters() -> StateWaiters:
    return StateWaiters()


async def test_who_waits_for_a_state_is_told_when_it_is_reached(waiters: StateWaiters) -> None:
    with waiters.watching({State.RESET, State.FAULT}, {}) as reached:
        waiters.reached(State.WF_RESET)
        assert not reached.done()
        waiters.reached(State.RESET)
        assert await reached is State.RESET


async def test_a_state_that_lasts_no_time_at_all_is_not_missed(waiters: StateWaiters) -> None:
    with waiters.watching({State.RUNNING_CC}, {}) as reached:
        waiters.reached(State.RUNNING_CC)
        waiters.reached(State.RUNNING_IDLE)
        waiters.reached(State.SHUTDOWN)
        assert await reached is State.RUNNING_CC


async def test_a_state_that_means_it_will_not_come_fails_with_its_error(waiters: StateWaiters) -> None:
    failing = {State.FAULT: lambda: GripperFaultError(Fault.ACTIVATION_FAULT)}
    with waiters.watching({State.RUNNING_IDLE}, failing) as reached:
        waiters.reached(State.FAULT)
        with pytest.raises(GripperFaultError) as caught:
            await reached
    assert caught.value.fault is Fault.ACTIVATION_FAULT


async def test_what_is_waited_for_comes_before_what_fails(waiters: StateWaiters) -> None:
    with waiters.watching({State.RESET}, {State.RESET: lost}) as reached:
        waiters.reached(State.RESET)
        assert await reached is State.RESET


async def test_a_shutdown_alone_does_not_tell_why_and_ends_no_wait(waiters: StateWaiters) -> None:
    """Whether the hand was stopped or gave up is told by fail(), right after."""
    with waiters.watching({State.RESET}, {}) as reached:
        waiters.reached(State.SHUTDOWN)
        assert not reached.done()
        waiters.fail(lost)
        with pytest.raises(ConnectionLostError):
            await reached


async def test_a_failure_ends_every_wait_with_an_error_of_its_own(waiters: StateWaiters) -> None:
    with waiters.watching({State.RESET}, {}) as one, waiters.watching({State.FAULT}, {}) as other:
        waiters.fail(lost)
        outcomes = await asyncio.gather(one, other, return_exceptions=True)
    assert all(isinstance(outcome, ConnectionLostError) for outcome in outcomes)
    assert outcomes[0] is not outcomes[1]


async def test_who_has_been_told_is_not_told_again(waiters: StateWaiters) -> None:
    with waiters.watching({State.RESET}, {State.FAULT: lost}) as reached:
        waiters.reached(State.RESET)
        waiters.reached(State.FAULT)
        waiters.fail(lost)
        assert await reached is State.RESET


async def test_two_callers_with_the_same_wish_leave_one_by_one(waiters: StateWaiters) -> None:
    with waiters.watching({State.RESET}, {}) as stays:
        with waiters.watching({State.RESET}, {}):
            pass
        waiters.reached(State.RESET)
        assert await stays is State.RESET


async def test_who_leaves_with_an_error_is_not_told_any_more(waiters: StateWaiters) -> None:
    with pytest.raises(KeyError), waiters.watching({State.RESET}, {}) as reached:
        raise KeyError
    waiters.reached(State.RESET)
    assert not reached.done()
    assert not waiters._waiters


async def test_who_was_cancelled_is_passed_over(waiters: StateWaiters) -> None:
    with waiters.watching({State.RESET}, {}) as cancelled, waiters.watching({State.RESET}, {}) as reached:
        cancelled.cancel()
        waiters.reached(State.RESET)
        assert await reached is State.RESET


async def test_an_error_nobody_fetches_is_not_complained_about(waiters: StateWaiters) -> None:
    """The caller may have been cancelled at the same moment."""
    complaints: list[object] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: complaints.append(context))
    with waiters.watching({State.RESET}, {}):
        waiters.fail(lost)
    gc.collect()
    assert not complaints
