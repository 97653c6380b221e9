"""Requests of callers: those for the next write, the write in flight, and moves.

All requests between two polls are merged into one write; the last value wins. A position, a speed or a force
is written once and never again: it may move an axis. A hold remains until it is acknowledged, also over a
lost link, because it can only stop one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from ..runtime.log import Log, log
from ..values.enums import NO_AXES, Finger
from ..values.errors import ConnectionLostError, MoveSupersededError, RobotiqError
from .entry import Entry
from .motion import LiveMoves
from .waiters import Waiter, fail, resolve


@dataclass(frozen=True, slots=True)
class Command:
    """A position, a speed and a force for some axes; None changes nothing."""

    axes: Finger
    position: int | None = None
    speed: int | None = None
    force: int | None = None


@dataclass(slots=True)
class Pending:
    """The changes for the next write, by axis, and the callers that wait for its acknowledgement."""

    positions: dict[Finger, int] = field(default_factory=dict)
    speeds: dict[Finger, int] = field(default_factory=dict)
    forces: dict[Finger, int] = field(default_factory=dict)
    # Axes to hold if they move. A position of the same axis goes before it, but does not end it: if the link
    # goes down before the write, the hold remains and the position does not.
    hold: Finger = NO_AXES
    # Those of commands with the axes that each moves, and those of hold() with the axes that each has named:
    # these are held whichever client moves them.
    callers: dict[Waiter[None], Finger] = field(default_factory=dict)
    holders: dict[Waiter[None], Finger] = field(default_factory=dict)

    @property
    def is_empty(self) -> bool:
        # Written out, because this runs at every poll.
        return not (self.positions or self.speeds or self.forces or self.hold)

    @property
    def has_changes(self) -> bool:
        """Whether there is more than axes to hold."""
        return bool(self.positions or self.speeds or self.forces)

    @property
    def has_caller(self) -> bool:
        """Whether there is more than holds of our own making, for which no caller waits."""
        return self.has_changes or bool(self.holders)

    @property
    def moved(self) -> Finger:
        return Finger(sum(self.positions))

    @property
    def waiters(self) -> list[Waiter[None]]:
        return [*self.callers, *self.holders]

    def merge(self, new: Command, waiter: Waiter[None] | None = None) -> None:
        # The last value wins, per axis and field; an axis keeps what a command does not name.
        values = (new.position, new.speed, new.force)
        for changes, value in zip((self.positions, self.speeds, self.forces), values, strict=True):
            if value is not None:
                changes.update(dict.fromkeys(new.axes, value))
        if waiter is not None:
            self.callers[waiter] = NO_AXES if new.position is None else new.axes

    def merge_hold(self, axes: Finger, waiter: Waiter[None] | None = None) -> None:
        self.hold |= axes
        if waiter is not None:
            self.holders[waiter] = axes

    def hold_only(self, axes: Finger) -> None:
        """Hold none but these axes, and those that callers of hold() have named."""
        for named in self.holders.values():
            axes |= named
        self.hold &= axes

    def drop_positions(self, axes: Finger, superseded: RobotiqError) -> None:
        """Drop the positions of some axes. Their callers get the error ``superseded``."""
        for axis in axes:
            self.positions.pop(axis, None)
        fail([waiter for waiter, moved in self.callers.items() if moved & axes], superseded)
        self.callers = {waiter: moved for waiter, moved in self.callers.items() if not moved & axes}

    def drop_changes(self, error: RobotiqError) -> None:
        """Drop everything that may move an axis, and holds of our own making."""
        fail(self.callers, error)
        for each in (self.positions, self.speeds, self.forces, self.callers):
            each.clear()
        self.hold_only(NO_AXES)

    def drop(self, error: RobotiqError) -> None:
        self.drop_changes(error)
        fail(self.take_holds().holders, error)

    def take_holds(self) -> Pending:
        """Take the holds alone: a halt covers them, and goes before the rest."""
        taken = Pending(hold=self.hold, holders={**self.holders})
        self.hold = NO_AXES
        self.holders.clear()
        return taken


class OpenRequests:
    """Commands, holds and moves. Halts belong to their stop."""

    def __init__(self, log: Log = log) -> None:
        self.pending = Pending()  # what is to be written
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
        taken, self.pending = self.pending, Pending()
        return taken

    def sending(self, sent: Pending, entry: Entry) -> None:
        self._sent = sent
        if sent.positions:
            self.moves.written(entry)

    def acknowledged(self) -> None:
        sent, self._sent = self._sent, Pending()
        resolve(sent.waiters)

    def fail_motions(self, error: RobotiqError) -> None:
        """Fail everything that would move an axis, sent or not; holds that callers have named remain."""
        self.pending.drop_changes(error)
        fail(self._sent.callers, error)
        self.moves.fail(error, left=Finger.ALL if isinstance(error, ConnectionLostError) else NO_AXES)

    def fail(self, error: RobotiqError) -> None:
        """Fail everything asked so far. A write may be on the line all the same."""
        self.fail_motions(error)
        self.pending.drop(error)
        fail(self._sent.holders, error)

    def lost(self, error: RobotiqError) -> None:
        """The link is down: fail everything. Holds stop motion: their axes remain, for when it is back."""
        # A hold of our own making has no caller to get the error.
        hold = self.pending.hold | self._sent.hold
        self.fail(error)
        self.pending, self._sent = Pending(hold=hold), Pending()
