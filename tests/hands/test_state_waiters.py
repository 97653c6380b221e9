"""Callers that wait for a state."""

from __future__ import annotations

import asyncio
import gc

import pytest

from robotiq_async.hands.waiting import StateWaiters
from robotiq_async.values.enums import State
from robotiq_async.values.errors import ConnectionLostError, RobotiqError


def lost() -> RobotiqError:
    return ConnectionLostError("gone")


@pytest.fixture
def waiters() -> StateWaiters:
    return StateWaiters()


async def test_a_state_both_awaited_and_failing_counts_as_reached(waiters: StateWaiters) -> None:
    with waiters.watching({State.RESET}, {State.RESET: lost}) as reached:
        waiters.reached(State.RESET)
        assert await reached is State.RESET


async def test_a_shutdown_alone_does_not_tell_why_and_ends_no_wait(waiters: StateWaiters) -> None:
    """fail() follows with whether the hand was stopped or gave up."""
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


async def test_an_answered_caller_is_not_answered_again(waiters: StateWaiters) -> None:
    with waiters.watching({State.RESET}, {State.FAULT: lost}) as reached:
        waiters.reached(State.RESET)
        waiters.reached(State.FAULT)
        waiters.fail(lost)
        assert await reached is State.RESET


async def test_several_callers_may_wait_for_the_same_state(waiters: StateWaiters) -> None:
    with waiters.watching({State.RESET}, {}) as one, waiters.watching({State.RESET}, {}) as other:
        waiters.reached(State.RESET)
        assert [one.result(), other.result()] == [State.RESET, State.RESET]


async def test_two_callers_with_the_same_wish_leave_one_by_one(waiters: StateWaiters) -> None:
    with waiters.watching({State.RESET}, {}) as stays:
        with waiters.watching({State.RESET}, {}):
            pass
        waiters.reached(State.RESET)
        assert await stays is State.RESET


async def test_a_cancelled_waiter_is_passed_over(waiters: StateWaiters) -> None:
    with waiters.watching({State.RESET}, {}) as cancelled, waiters.watching({State.RESET}, {}) as reached:
        cancelled.cancel()
        waiters.reached(State.RESET)
        assert await reached is State.RESET


async def test_an_error_that_is_not_fetched_is_not_reported_by_asyncio(waiters: StateWaiters) -> None:
    """The caller may have been cancelled at the same moment."""
    complaints: list[object] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: complaints.append(context))
    with waiters.watching({State.RESET}, {}):
        waiters.fail(lost)
    gc.collect()
    assert not complaints
