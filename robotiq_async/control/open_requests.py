"""Calls that wait for a result: pending changes and holds, the write in flight, and moves."""

from __future__ import annotations

from typing import Final

from ..runtime.log import Log, log
from ..values.enums import NO_AXES, Finger
from ..values.errors import ConnectionLostError, MoveSupersededError, RobotiqError
from .entry import Entry
from .motion import LiveMoves
from .pending import Command, Pending
from .waiters import Waiter, fail, resolve


class OpenRequests:
    """Commands, holds and moves. Halts belong to their stop.

    Attributes:
        pending: what is to be written.
        moves: the moves that callers wait for.
    """

    def __init__(self, log: Log = log) -> None:
        self.pending = Pending()
        self.moves: Final = LiveMoves(log)
        self._sent = Pending()  # the write in flight

    @property
    def has_caller(self) -> bool:
        """Whether a caller waits for an acknowledgement, or for a write."""
        return self.pending.has_caller or self._sent.has_caller

    @property
    def has_undelivered_hold(self) -> bool:
        return bool(self.pending.hold or self._sent.hold)

    def command(self, command: Command, waiter: Waiter[None] | None = None) -> None:
        """Ask something of axes. A position supersedes the moves of these axes."""
        if command.position is not None and self.moves:  # few loops at 200 Hz have a move to end
            self.moves.take_over(command.axes, MoveSupersededError(f"another command moves {command.axes}"))
        self.pending.merge(command, waiter)

    def hold(self, axes: Finger, why: str, waiter: Waiter[None] | None = None) -> None:
        """Hold those axes that move. It supersedes what moves them."""
        self.supersede(axes, MoveSupersededError(why))
        self.pending.merge_hold(axes, waiter)

    def supersede(self, axes: Finger, error: MoveSupersededError) -> None:
        """Fail what moves these axes, and is not sent."""
        self.moves.take_over(axes, error)
        self.pending.drop_positions(axes, error)

    # -- what becomes of it ----------------------------------------------------------------------------

    def taken(self) -> Pending:
        """Take what is pending, to be sent."""
        taken, self.pending = self.pending, Pending()
        return taken

    def sending(self, sent: Pending, entry: Entry) -> None:
        """The changes taken from the pending ones go out with this entry."""
        self._sent = sent
        if sent.positions:
            self.moves.written(entry)

    def acknowledged(self) -> None:
        sent, self._sent = self._sent, Pending()
        resolve(sent.waiters)

    def fail_motions(self, error: RobotiqError) -> None:
        """Fail everything that would move an axis, sent or not; holds that callers have named remain."""
        self.pending.drop_changes(error)
        fail((waiter for _, waiter in self._sent.callers), error)
        self._sent.callers.clear()
        self.moves.fail(error, left=Finger.ALL if isinstance(error, ConnectionLostError) else NO_AXES)

    def fail(self, error: RobotiqError) -> None:
        """Fail everything asked so far. A write may be on the line all the same."""
        self.fail_motions(error)
        self.pending.drop(error)
        fail((waiter for _, waiter in self._sent.holders), error)
        self._sent.holders.clear()

    def lost(self, error: RobotiqError) -> None:
        """The link is down: fail everything. Holds stop motion: their axes remain, for when it is back."""
        # A hold of our own making has no caller to get the error.
        hold = self.pending.hold | self._sent.hold
        self.fail(error)
        self.pending.merge_hold(hold)
        self._sent = Pending()
