"""What goes out of what callers have asked for, and who is told then."""

from __future__ import annotations

from robotiq_async.control.open_requests import OpenRequests
from robotiq_async.control.requests.pending import Command
from robotiq_async.values.enums import Fault, Finger
from robotiq_async.values.errors import ConnectionLostError, GripperFaultError
from robotiq_async.values.model import THREE_FINGER
from tests.control.outcome import Outcome

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
    assert not setter.is_told
    assert not halter.is_told, "nothing shows that it acts"


def test_a_halt_does_for_every_hold_and_is_told_to_who_waits_for_one() -> None:
    """The hold alone would leave nothing to write, and nobody would be told."""
    callers, before, after = OpenRequests(), Outcome(), Outcome()
    callers.hold(A, "", before)
    callers.halt(Outcome())
    callers.hold(B, "", after)
    sent = callers.take()
    assert (sent.hold, callers.pending.is_empty) == (A | B, True)
    callers.acknowledged(1)
    assert before.told == after.told == [None]


def test_what_was_to_be_held_when_the_link_was_lost_is_given_back() -> None:
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


def test_what_fails_on_the_line_is_not_told_again_when_it_is_acknowledged() -> None:
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
    assert not halter.is_told
    assert not holder.is_told
    assert (callers.pending.hold, callers.pending.speeds) == (B, {})
