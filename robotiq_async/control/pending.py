"""Requests of callers: changes for the next write, those in flight, and the calls that wait for an answer.

All requests between two writes are merged into one; the last value wins. A position, a speed or a force is
sent as a change once and never again: it may move an axis. A hold remains until it is acknowledged, also over
a lost link, because it can only stop one. One without a caller goes if another client takes the axis over.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from ..runtime.logger import Log, log
from ..values.enums import NO_AXES, Finger, ObjectStatus
from ..values.errors import MoveSupersededError, RobotiqError
from ..values.move_result import MoveResult
from ..values.status import RobotiqStatus
from .entry import Entry
from .ledger import Ledger
from .motion import Move
from .waiters import Call, Waiter, fail, resolve


@dataclass(frozen=True, slots=True)
class Command:
    """A position, a speed and a force for some axes; None changes nothing."""

    axes: Finger
    position: int | None = None
    speed: int | None = None
    force: int | None = None


@dataclass(slots=True)
class Pending:
    """The changes of one write, by axis."""

    positions: dict[Finger, int] = field(default_factory=dict)
    speeds: dict[Finger, int] = field(default_factory=dict)
    forces: dict[Finger, int] = field(default_factory=dict)
    # Axes to hold if they move. A position of the same axis goes before it, but does not end it: if the link
    # goes down before the write, the hold remains and the position does not.
    hold: Finger = NO_AXES
    # When the hold was first about to be written: what may press on a part is held later, or not at all.
    hold_began: float = math.inf

    @property
    def is_empty(self) -> bool:
        # Written out, because this runs at every poll.
        return not (self.positions or self.speeds or self.forces or self.hold)

    @property
    def has_changes(self) -> bool:
        """Whether there is more than axes to hold."""
        return bool(self.positions or self.speeds or self.forces)

    @property
    def moved(self) -> Finger:
        return Finger(sum(self.positions))

    def note_hold(self, now: float) -> float:
        """The hold is about to be written; return when it first was."""
        self.hold_began = min(self.hold_began, now)
        return self.hold_began

    def held_later(self, axes: Finger) -> Pending:
        """The hold of those of these axes that are not moved, for a later write."""
        return Pending(hold=self.hold & ~self.moved & axes, hold_began=self.hold_began)

    def merge(self, new: Command) -> None:
        # The last value wins, per axis and field; an axis keeps what a command does not name.
        values = (new.position, new.speed, new.force)
        for changes, value in zip((self.positions, self.speeds, self.forces), values, strict=True):
            if value is not None:
                changes.update(dict.fromkeys(new.axes, value))


class OpenRequests:
    """Commands, holds and moves. Halts belong to their stop."""

    def __init__(self, log: Log = log) -> None:
        self.pending: Pending = Pending()  # for the next write
        self.calls: list[Call] = []  # those that wait for their answer
        self._sent = Pending()  # in the write in flight
        # The move that an axis follows, until something else takes the axis over. A failed move counts as
        # well: a caller that gives up as its move fails does not see the error, and counts on a hold.
        self._followed: Final[dict[Finger, Move]] = {}
        self._log: Final = log
        # Callers whom a request has ended, each with the error. What they do then may hold up the loop.
        self.ended: list[tuple[Waiter[Any], RobotiqError]] = []
        self._has_warned = False

    @property
    def has_caller(self) -> bool:
        """Whether there is more to write, or to acknowledge, than holds of our own making."""
        return self.pending.has_changes or self._sent.has_changes or any(call.held for call in self.calls)

    @property
    def has_undelivered_hold(self) -> bool:
        return bool(self.pending.hold or self._sent.hold)

    # -- what is asked ---------------------------------------------------------------------------------

    def command(self, command: Command, waiter: Waiter[None] | None = None) -> None:
        if command.position is not None and self._followed:  # few loops at 200 Hz have a move to end
            self._end(self._take_over(command.axes), f"another command moves {command.axes}")
        self.pending.merge(command)
        if waiter is not None:
            self.calls.append(Call(waiter, NO_AXES if command.position is None else command.axes))

    def add(self, move: Move) -> None:
        """Add a move whose command is pending."""
        self.calls.append(move)
        self._followed.update(dict.fromkeys(move.axes, move))

    def hold(self, axes: Finger, why: str, waiter: Waiter[None] | None = None) -> None:
        """Hold those axes that move. It supersedes what moves them."""
        self.supersede(axes, why)
        self.merge_hold(axes, why if waiter is None else "")
        if waiter is not None:
            self.calls.append(Call(waiter, held=axes))

    def merge_hold(self, axes: Finger, why: str = "") -> None:
        """Hold those axes that move; ``why`` is for the log, if no caller has asked for it."""
        if axes and why:
            self._log.info("%s: what moves of %s is held", why, axes)
        pending = self.pending
        began = math.inf if axes & ~pending.hold else pending.hold_began  # an axis more has its own time
        self.pending = replace(pending, hold=pending.hold | axes, hold_began=began)

    def hold_only(self, axes: Finger) -> None:
        """Drop all holds but those of these axes, and those that callers of hold() wait for."""
        for call in self.calls:
            axes |= call.held if call.entry is None else NO_AXES
        self.pending = replace(self.pending, hold=self.pending.hold & axes)

    def supersede(self, axes: Finger, why: str) -> None:
        """End the moves of these axes, and the calls that would move one of them and are not sent."""
        # Of a call for several axes the others are sent all the same.
        self._end(self._take_over(axes), why)
        for axis in axes:
            self.pending.positions.pop(axis, None)
        self._end([call for call in self.calls if call.entry is None and call.axes & axes], why)

    def _take_over(self, axes: Finger) -> list[Call]:
        # The other axes of these moves still follow them.
        taken = [self._followed.pop(axis) for axis in axes if axis in self._followed]
        return [call for call in self.calls if call in taken]

    def _end(self, calls: Sequence[Call], why: str) -> None:
        self._remove(calls)
        self.end((call.waiter for call in calls), MoveSupersededError(why))

    def end(self, waiters: Iterable[Waiter[Any]], error: RobotiqError) -> None:
        """A request has ended what these callers wait for: they are to be answered after its write."""
        self.ended += [(waiter, error) for waiter in waiters]

    def answer_ended(self) -> None:
        ended, self.ended = self.ended, []
        for waiter, error in ended:
            fail([waiter], error)

    # -- what becomes of it ----------------------------------------------------------------------------

    def sending(self, entry: Entry, left: Pending) -> None:
        """An entry has what is pending, but for what is left."""
        pending, self.pending = self.pending, left
        keeps = left.has_changes
        has_sent = pending.has_changes and not keeps
        self._sent = pending if has_sent else Pending(hold=pending.hold & ~left.hold)
        for call in self.calls:
            is_left = call.held & left.hold if call.held else keeps
            if call.entry is None and not is_left:
                call.written(entry)

    def acknowledged(self) -> None:
        self._sent = Pending()
        done = [call for call in self.calls if call.entry is not None and not isinstance(call, Move)]
        self._remove(done)
        resolve(call.waiter for call in done)

    def end_arrived(self, status: RobotiqStatus, ledger: Ledger) -> None:
        """End the moves that a status shows to have arrived."""
        resting, limited = ledger.resting, ledger.limits.limited
        for move in self._written_moves:
            assert move.entry is not None
            if move.see(status, resting, limited) and ledger.acts(move.entry):
                self.leave(move)
                self._warn_of_unreached(move, move.end(status), limited)

    def _warn_of_unreached(self, move: Move, result: MoveResult, limited: Mapping[Finger, int]) -> None:
        """Warn once if a gripper shows "at position" and stands far from where it was asked to go."""
        # Not of the scissor: its range ends within 15..232 (drivers), and programs ask it for 0 and 255.
        for axis, how in result.outcomes.items():
            is_there = axis in result.reached or axis in limited or axis is Finger.SCISSOR
            if self._has_warned or is_there or how is not ObjectStatus.AT_POSITION:
                continue
            self._has_warned = True
            self._log.warning(
                "%s was asked for %d, and the gripper says that it is at position, at %d: it ends there (a "
                "software limit, fingertips of your own), or it did not follow. See MoveResult.reached; "
                "logged once",
                axis,
                move.position,
                result.positions[axis],
            )

    def leave(self, move: Move) -> tuple[bool, Finger]:
        """A move has ended, or its caller has left: whether it was open, and the axes that followed it."""
        axes = [axis for axis, followed in self._followed.items() if followed is move]
        for axis in axes:
            del self._followed[axis]
        is_open = move in self.calls
        self._remove([move])
        return is_open, Finger(sum(axes))

    def drop(self, *, holds: bool) -> list[Waiter[Any]]:
        """Drop all that would move an axis, sent or not, and with ``holds`` those that callers have named.

        Returns:
            The callers that wait for it.
        """
        # A write may be on the line all the same. Holds of our own making go in any case.
        dropped = [call for call in self.calls if holds or not call.held]
        self._remove(dropped)
        self._followed.clear()
        self.pending = Pending(hold=self.pending.hold)
        self.hold_only(NO_AXES)
        return [call.waiter for call in dropped]

    def fail_replaced(self, status: RobotiqStatus, limited: Mapping[Finger, int]) -> None:
        """Fail the moves whose request another client has replaced. Their axes still follow them."""
        replaced = [move for move in self._written_moves if not move.is_under(status, limited)]
        self._fail(replaced, MoveSupersededError("another client commands the gripper"))

    def lost(self, error: RobotiqError) -> None:
        """The link is down: fail everything. Holds stop motion: their axes remain, for when it is back."""
        # A hold of our own making has no caller to get the error.
        hold = self.pending.hold | self._sent.hold
        self._fail(self.calls, error)
        self.pending, self._sent = Pending(hold=hold), Pending()

    @property
    def _written_moves(self) -> list[Move]:
        return [call for call in self.calls if isinstance(call, Move) and call.entry is not None]

    def _fail(self, calls: Sequence[Call], error: RobotiqError) -> None:
        self._remove(calls)
        fail((call.waiter for call in calls), error)

    def _remove(self, calls: Sequence[Call]) -> None:
        self.calls = [call for call in self.calls if call not in calls]
