"""Answers to callers: one each, with an error of their own."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async.control.waiters import fail, resolve
from robotiq_async.values.enums import Fault
from robotiq_async.values.errors import ConnectionLostError, GripperFaultError, RobotiqError
from tests.control.scan import Outcome


def test_an_acknowledgement_answers_none() -> None:
    callers = [Outcome(), Outcome()]
    resolve(callers)
    assert [caller.answers for caller in callers] == [[None], [None]]


def test_every_caller_gets_an_error_of_its_own() -> None:
    callers, error = [Outcome(), Outcome()], ConnectionLostError("gone")
    fail(callers, error)
    errors = [caller.error for caller in callers]
    assert all(isinstance(each, ConnectionLostError) and str(each) == "gone" for each in errors)
    assert len({id(each) for each in (*errors, error)}) == 3


def test_an_answered_caller_is_not_answered_again() -> None:
    caller = Outcome()
    resolve([caller])
    fail([caller], ConnectionLostError("gone"))
    resolve([caller])
    assert caller.answers == [None]


async def test_a_caller_that_was_cancelled_is_passed_over() -> None:
    future: asyncio.Future[None] = asyncio.get_running_loop().create_future()
    future.cancel()
    resolve([future])
    fail([future], ConnectionLostError("gone"))
    assert future.cancelled()


async def test_a_future_is_a_waiter() -> None:
    done: asyncio.Future[None] = asyncio.get_running_loop().create_future()
    failed: asyncio.Future[None] = asyncio.get_running_loop().create_future()
    resolve([done])
    fail([failed], ConnectionLostError("gone"))
    await done
    with pytest.raises(ConnectionLostError, match="gone"):
        await failed


@pytest.mark.parametrize("cause", [None, OSError(104, "reset by peer")])
def test_a_copy_of_an_error_says_what_the_error_says(cause: OSError | None) -> None:
    error: RobotiqError = GripperFaultError(Fault.SCISSOR_BLOCKED)
    error.__cause__ = cause
    caller = Outcome()
    fail([caller], error)
    copy = caller.error
    assert isinstance(copy, GripperFaultError)
    assert copy is not error
    assert (str(copy), copy.fault, copy.__cause__) == (str(error), Fault.SCISSOR_BLOCKED, cause)
