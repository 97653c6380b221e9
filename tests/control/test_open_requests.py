"""Which open requests a write takes, and which callers are answered: once, with an error of their own."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async.control.open_requests import OpenRequests
from robotiq_async.control.requests.pending import Command
from robotiq_async.control.waiters import copy_of, fail, resolve
from robotiq_async.values.enums import Fault, Finger
from robotiq_async.values.errors import ConnectionLostError, GripperFaultError, RobotiqError
from robotiq_async.values.model import THREE_FINGER
from tests.control.scan import Outcome

A, B, C, S = THREE_FINGER.axes
NONE = Finger(0)


def test_a_halt_goes_before_what_was_asked_with_it() -> None:
    callers, halter, setter = OpenRequests(), Outcome(), Outcome()
    callers.command(Command(A, None, 50), setter)
    callers.halt(halter)
    callers.command(Command(B, 100))
    sent = callers.take()
    assert (sent.halting, sent.speeds, sent.positions) == ([halter], {}, {})
    assert (callers.pending.speeds, callers.pending.positions) == ({A: 50}, {B: 100})
    callers.acknowledged(1)
    assert not setter.is_answered
    assert not halter.is_answered, "nothing shows that it acts"


def test_a_halt_covers_every_hold_and_answers_its_callers() -> None:
    """The hold alone would leave nothing to write, and no call would end."""
    callers, before, after = OpenRequests(), Outcome(), Outcome()
    callers.hold(A, "", before)
    callers.halt(Outcome())
    callers.hold(B, "", after)
    sent = callers.take()
    assert (sent.hold, callers.pending.is_empty) == (A | B, True)
    callers.acknowledged(1)
    assert before.answers == after.answers == [None]


def test_a_link_loss_returns_the_axes_whose_hold_was_not_delivered() -> None:
    """Also where a position or a halt went before it: that is dropped, and a stop is not."""
    callers, holder = OpenRequests(), Outcome()
    callers.hold(A, "", holder)
    callers.halt(Outcome())
    callers.take()
    callers.hold(B, "")
    callers.command(Command(B, 100))
    assert callers.lost(ConnectionLostError("gone")) == A | B
    assert isinstance(holder.error, ConnectionLostError)
    assert callers.lost(ConnectionLostError("gone")) == NONE


def test_a_request_that_failed_on_the_line_is_not_answered_again() -> None:
    callers, asking = OpenRequests(), Outcome()
    callers.command(Command(A, 100), asking)
    callers.take()
    callers.fail(ConnectionLostError("gone"))
    callers.acknowledged(1)
    assert isinstance(asking.error, ConnectionLostError)


def test_a_fault_ends_what_moves_and_not_what_stops() -> None:
    callers, asking, holder, halter = OpenRequests(), Outcome(), Outcome(), Outcome()
    callers.command(Command(A, 100), asking)
    callers.hold(B, "", holder)
    callers.halt(halter)
    callers.hold(C, "of a move that was given up")
    callers.command(Command(S, None, 50))
    callers.fail_but_stops(GripperFaultError(Fault.COMMUNICATION_NOT_READY))
    assert not halter.is_answered
    assert not holder.is_answered
    assert (callers.pending.hold, callers.pending.speeds) == (B, {})


# -- callers that wait -------------------------------------------------------------------------------------


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
    copy = copy_of(error)
    assert isinstance(copy, GripperFaultError)
    assert copy is not error
    assert (str(copy), copy.fault, copy.__cause__) == (str(error), Fault.SCISSOR_BLOCKED, cause)
