"""What callers have asked for and is not written yet.

All requests between two polls are merged into one write; the last value wins.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import reduce
from operator import or_

from ...values.enums import NO_AXES, Finger
from ...values.errors import RobotiqError
from ..waiters import Waiter, fail


@dataclass(frozen=True, slots=True)
class Command:
    """A position, a speed and a force for some axes; None changes nothing."""

    axes: Finger
    position: int | None = None
    speed: int | None = None
    force: int | None = None


@dataclass(slots=True)
class PendingCommand:
    """The changes for the next write, and the callers that wait for it.

    Attributes:
        positions: new position request by axis.
        speeds: new speed by axis.
        forces: new force by axis.
        hold: axes to hold if they move. A position of the same axis replaces the hold; but if the link goes
            down before the write, the hold remains.
        asking: callers that wait for the acknowledgement, each with the axes that it moves.
        holding: callers of hold(), with their axes. These are held whichever client moves them.
        halting: callers of halt(); None without a halt.
    """

    positions: dict[Finger, int] = field(default_factory=dict)
    speeds: dict[Finger, int] = field(default_factory=dict)
    forces: dict[Finger, int] = field(default_factory=dict)
    hold: Finger = NO_AXES
    asking: list[tuple[Finger, Waiter[None]]] = field(default_factory=list)
    holding: list[tuple[Finger, Waiter[None]]] = field(default_factory=list)
    halting: list[Waiter[None]] | None = None

    @property
    def is_empty(self) -> bool:
        # Written out, and not by holds_at_most, because this runs at every poll.
        return not (self.positions or self.speeds or self.forces or self.hold or self.halting is not None)

    @property
    def holds_at_most(self) -> bool:
        """Whether there is nothing but axes to hold."""
        return not (self.positions or self.speeds or self.forces or self.halting is not None)

    @property
    def moved(self) -> Finger:
        """The axes that get a new position."""
        return reduce(or_, self.positions, NO_AXES)

    @property
    def asked_to_hold(self) -> Finger:
        """The axes named by callers of hold()."""
        return reduce(or_, (axes for axes, _ in self.holding), NO_AXES)

    @property
    def waiters(self) -> list[Waiter[None]]:
        """The callers that have their answer with the acknowledgement."""
        return [waiter for _, waiter in (*self.asking, *self.holding)]

    def merge(self, new: Command, waiter: Waiter[None] | None = None) -> None:
        values = (new.position, new.speed, new.force)
        for changes, value in zip((self.positions, self.speeds, self.forces), values, strict=True):
            if value is not None:
                changes.update(dict.fromkeys(new.axes, value))
        if waiter is not None:
            self.asking.append((NO_AXES if new.position is None else new.axes, waiter))

    def merge_hold(self, axes: Finger, superseded: RobotiqError, waiter: Waiter[None] | None = None) -> None:
        """Hold axes. This drops their pending positions, whose callers get the error ``superseded``."""
        self._drop_positions(axes, superseded)
        self.hold |= axes
        if waiter is not None:
            self.holding.append((axes, waiter))

    def merge_halt(self, waiter: Waiter[None], superseded: RobotiqError) -> None:
        """Stop every axis. This drops all pending positions, whose callers get the error ``superseded``."""
        self._drop_positions(Finger.ALL, superseded)
        self.halting = [*(self.halting or ()), waiter]

    def fail(self, error: RobotiqError) -> None:
        """Fail every caller that waits."""
        fail((*self.waiters, *(self.halting or ())), error)

    def _drop_positions(self, axes: Finger, superseded: RobotiqError) -> None:
        self.positions = {axis: value for axis, value in self.positions.items() if axis not in axes}
        fail((waiter for mask, waiter in self.asking if mask & axes), superseded)
        self.asking = [each for each in self.asking if not each[0] & axes]
