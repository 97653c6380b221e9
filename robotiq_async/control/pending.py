"""Requests of callers: changes for the next write, changes in flight, and the calls that wait for an answer.

All requests between two writes are merged into one; the last value wins. Over a lost link a hold alone
remains, unless a status has shown its write. One without a caller goes if another client takes the axis over.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from ..runtime.logger import Log, log
from ..values.enums import NO_AXES, Finger
from ..values.errors import MoveSupersededError, RobotiqError, StateTimeoutError
from ..values.status import RobotiqStatus
from .entry import Entry
from .ledger import WINDOW_S, Ledger
from .waiters import AnswerCallers, Call, Move, Waiter, fail, resolve

MOST_HALTS: Final = 2
"""The most times that a halt is sent. If rGTO still shows then, its callers get an error."""


@dataclass(frozen=True, slots=True)
class Pending:
    """The changes of one write, by axis."""

    positions: Mapping[Finger, int] = field(default_factory=dict)
    speeds: Mapping[Finger, int] = field(default_factory=dict)
    forces: Mapping[Finger, int] = field(default_factory=dict)
    # Axes to hold if they move. A position of the same axis goes before it, but does not end it: if the link
    # goes down before the write, the hold remains and the position does not.
    hold: Finger = NO_AXES
    # When the hold was first about to be written: an axis that may press is held later, or not at all.
    hold_began: float = math.inf

    @property
    def has_changes(self) -> bool:
        """Whether there is more than axes to hold."""
        return bool(self.positions or self.speeds or self.forces)

    @property
    def moved(self) -> Finger:
        return Finger(sum(self.positions))

    def held_later(self, axes: Finger) -> Pending:
        """The hold of the axes among these that are not moved, for a later write."""
        return Pending(hold=self.hold & ~self.moved & axes, hold_began=self.hold_began)

    def merged(self, new: Pending) -> Pending:
        # The last value wins, per axis and field; an axis keeps the values that a command does not name.
        return replace(
            self,
            positions={**self.positions, **new.positions},
            speeds={**self.speeds, **new.speeds},
            forces={**self.forces, **new.forces},
        )


def changes(
    axes: Finger, position: int | None = None, speed: int | None = None, force: int | None = None
) -> Pending:
    """A command for some axes; None changes nothing."""
    values = [{} if value is None else dict.fromkeys(axes, value) for value in (position, speed, force)]
    return Pending(values[0], values[1], values[2])


NONE_PENDING: Final = Pending()
"""Nothing is pending: there is no other object for that, so that a poll can tell it without a look inside."""


class OpenRequests:
    """The requests of callers, but for procedures and resets: those callers wait for a state."""

    def __init__(self, log: Log = log, ended: AnswerCallers = fail) -> None:
        self.pending: Pending = NONE_PENDING  # for the next write
        self._sent = NONE_PENDING  # in the write in flight
        self.calls: list[Call] = []  # the commands, holds and halts whose callers wait
        self.moves: list[Move] = []  # the same of moves, in the order of their calls
        # By axis the move that it follows, until something else takes the axis over. It may have failed: a
        # caller that gives up as its move fails does not see the error, and counts on a hold.
        self._followed: Final[dict[Finger, Move]] = {}
        self._log: Final = log
        self._ended: Final = ended  # gets the callers whom a request has ended

    @property
    def has_caller(self) -> bool:
        """Whether there is more to write, or to acknowledge, than holds without a caller."""
        return self.pending.has_changes or self._sent.has_changes or any(call.held for call in self.calls)

    @property
    def has_undelivered_hold(self) -> bool:
        return bool(self.pending.hold or self._sent.hold)

    # -- requests --------------------------------------------------------------------------------------

    def command(self, command: Pending, waiter: Waiter[None] | None = None) -> None:
        # Few loops at 200 Hz have a move to end.
        if command.positions and self._followed:
            self._take_over(command.moved, f"another command moves {command.moved}")
        self.pending = self.pending.merged(command)
        if waiter is not None:
            self.calls.append(Call(waiter, command.moved))

    def add(self, move: Move) -> None:
        """Add a move whose command is pending."""
        self.moves.append(move)
        self._followed.update(dict.fromkeys(move.axes, move))

    def hold(self, axes: Finger, why: str, waiter: Waiter[None] | None = None) -> None:
        """Hold axes that move. It supersedes the requests that move them."""
        self.supersede(axes, why)
        self.merge_hold(axes, why if waiter is None else "")
        if waiter is not None:
            self.calls.append(Call(waiter, held=axes))

    def halt(self, waiter: Waiter[None]) -> None:
        self.supersede(Finger.ALL, "a halt stopped the fingers")
        self.calls.append(Call(waiter, halts=True))

    def merge_hold(self, axes: Finger, why: str = "") -> None:
        """Hold axes that move; ``why`` is for the log, if no caller has requested it."""
        if axes and why:
            self._log.info("%s: the moving axes of %s are held", why, axes)
        pending = self.pending
        began = math.inf if axes & ~pending.hold else pending.hold_began  # an axis more has its own time
        self._keep(replace(pending, hold=pending.hold | axes, hold_began=began))

    def begin_hold(self, now: float) -> Pending:
        """The hold is about to be written; return the pending changes, with the time of its first attempt."""
        if self.pending.hold_began == math.inf:
            self.pending = replace(self.pending, hold_began=now)
        return self.pending

    def hold_only(self, axes: Finger) -> None:
        """Drop all holds but the holds of these axes, and the holds that callers of hold() wait for."""
        for call in self.calls:
            axes |= call.held if call.entry is None else NO_AXES
        self._keep(replace(self.pending, hold=self.pending.hold & axes))

    def _keep(self, pending: Pending) -> None:
        self.pending = pending if pending.has_changes or pending.hold else NONE_PENDING

    def supersede(self, axes: Finger, why: str) -> None:
        """End the moves of these axes, and the calls that would move one of them and are not sent."""
        # The other axes of a call for several axes are still sent.
        positions = {axis: at for axis, at in self.pending.positions.items() if axis not in axes}
        self._keep(replace(self.pending, positions=positions))
        self._take_over(axes, why, [call for call in self.calls if call.entry is None and call.axes & axes])

    def _take_over(self, axes: Finger, why: str, calls: Sequence[Call] = ()) -> None:
        """Let these axes follow no move; end the moves that they followed, and some other calls."""
        moves = [move for move in self.moves if move.axes & axes]
        self._ended(self._close([*moves, *calls]), MoveSupersededError(why))
        for axis in axes:  # the other axes of these moves still follow them
            self._followed.pop(axis, None)

    def _close(self, calls: Sequence[Call]) -> list[Waiter[Any]]:
        """These calls have ended; return their callers."""
        if calls:
            self.calls = [call for call in self.calls if call not in calls]
            self.moves = [move for move in self.moves if move not in calls]
        return [call.waiter for call in calls]

    # -- outcomes --------------------------------------------------------------------------------------

    def sending(self, entry: Entry, left: Pending) -> None:
        """An entry has the pending changes but for ``left``. While a halt is open, no other is sent."""
        keeps = left.has_changes
        has_sent = self.pending.has_changes and not keeps
        self._sent = self.pending if has_sent else Pending(hold=self.pending.hold & ~left.hold)
        self._keep(left)
        entry.hold(self._sent.hold)
        for call in (*self.calls, *self.moves):
            is_left = call.held & left.hold if call.held else keeps and not call.halts
            if call.entry is None and not is_left:
                call.written(entry)

    def acknowledged(self) -> None:
        self._sent = NONE_PENDING
        if self.calls:
            resolve(self._close([call for call in self.calls if call.entry is not None and not call.halts]))

    def answer_halts(self, ledger: Ledger, status: RobotiqStatus, *, is_over: bool) -> None:
        """Answer all callers of halts once the halt is over; until then, those that have waited too long."""
        # A halt may be replaced by newer halts again and again: its callers do not wait for ever.
        since = ledger.now.time - MOST_HALTS * WINDOW_S
        halts = [each for each in self.calls if each.halts]
        halts = [each for each in halts if is_over or (each.entry is not None and each.entry.time <= since)]
        if halts and status.go_echo:
            error = StateTimeoutError(
                f"the gripper does not show that it has stopped after {MOST_HALTS} halts: the fingers may "
                "still move (another client commands it, or it forgets writes)"
            )
            self._log.warning("%s", error)
            fail(self._close(halts), error)
        elif is_over:
            resolve(self._close(halts))

    def end_arrived(self, status: RobotiqStatus, ledger: Ledger) -> None:
        """End the moves that a status shows to have arrived."""
        unrested, limited = ledger.requests.unrested, ledger.limits.limited
        for move in self._written_moves:
            assert move.entry is not None
            if move.see(status, unrested, limited) and ledger.acts(move.entry):
                self.leave(move)
                move.end(status)

    def leave(self, move: Move) -> tuple[bool, Finger]:
        """A move has ended, or its caller has left: whether it was open, and the axes that followed it."""
        is_open = move in self.moves
        self._close([move])
        axes = [axis for axis, followed in self._followed.items() if followed is move]
        for axis in axes:
            del self._followed[axis]
        return is_open, Finger(sum(axes))

    def drop(self, *, holds: bool) -> list[Waiter[Any]]:
        """Drop all requests that move an axis, with ``holds`` also holds and halts; return the callers."""
        # A write may still be on the line. Holds without a caller are always dropped.
        calls = [call for call in self.calls if holds or not (call.held or call.halts)]
        dropped = self._close([*calls, *self.moves])
        self._followed.clear()
        self.pending = Pending(hold=self.pending.hold)
        self.hold_only(NO_AXES)
        return dropped

    def fail_replaced(self, status: RobotiqStatus, limited: Mapping[Finger, int]) -> None:
        """Fail the moves whose request another client has replaced. Their axes still follow them."""
        replaced = [move for move in self._written_moves if not move.is_under(status, limited)]
        fail(self._close(replaced), MoveSupersededError("another client commands the gripper"))

    def lost(self, error: RobotiqError, ahead: Sequence[Entry]) -> None:
        """The link is down: fail everything. Holds stop motion: their axes remain, for when it is back."""
        # A hold may have no caller to get the error. The entries ``ahead`` have not shown: a UR
        # may acknowledge a SET, lose it, and lose its link next.
        hold = self.pending.hold
        for each in ahead:
            hold |= each.held
        fail(self._close([*self.calls, *self.moves]), error)
        self._keep(Pending(hold=hold))
        self._sent = NONE_PENDING

    @property
    def _written_moves(self) -> list[Move]:
        return [move for move in self.moves if move.entry is not None]
