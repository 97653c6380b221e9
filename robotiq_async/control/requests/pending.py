"""What callers have asked for and the gripper has not been told yet.

Between two polls everything asked is merged, the last value wins, and it leaves as one write.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import reduce
from operator import or_

from ...values.enums import AXES, NO_AXES, Finger
from ...values.errors import RobotiqError
from ..waiters import Waiter, fail


@dataclass(frozen=True, slots=True)
class Command:
    """What is asked of some axes: a position, a speed, a force; None leaves what there is."""

    axes: Finger
    position: int | None = None
    speed: int | None = None
    force: int | None = None


@dataclass(slots=True)
class PendingCommand:
    """Changes that wait for the next write, and who waits for that.

    Attributes:
        positions: new position request by axis.
        speeds: new speed by axis.
        forces: new force by axis.
        hold: axes to be held where they are, if they move. A position goes before it; but if that is lost
            with the link, the hold is not.
        asking: callers that wait for the acknowledgement, each with the axes that are to move for it.
        holding: callers of hold(), with their axes. The axes are held whoever moves them.
        halting: callers of halt(); None when nobody asked to halt.
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
        """Whether there is nothing to write."""
        # In full, and not by the next one: this runs at every poll.
        return not (self.positions or self.speeds or self.forces or self.hold or self.halting is not None)

    @property
    def holds_at_most(self) -> bool:
        """Whether axes to be held are all there is, if anything."""
        return not (self.positions or self.speeds or self.forces or self.halting is not None)

    @property
    def moved(self) -> Finger:
        """The axes that get a new position."""
        return reduce(or_, self.positions, NO_AXES)

    @property
    def asked_to_hold(self) -> Finger:
        """The axes that callers of hold() have named."""
        return reduce(or_, (axes for axes, _ in self.holding), NO_AXES)

    @property
    def waiters(self) -> list[Waiter[None]]:
        """Callers that wait for nothing but the acknowledgement."""
        return [waiter for _, waiter in (*self.asking, *self.holding)]

    def merge(self, new: Command, waiter: Waiter[None] | None = None) -> None:
        """Merge a command; the last value wins."""
        values = (new.position, new.speed, new.force)
        for changes, value in zip((self.positions, self.speeds, self.forces), values, strict=True):
            if value is not None:
                changes.update(dict.fromkeys((axis for axis in AXES if axis in new.axes), value))
        if waiter is not None:
            self.asking.append((NO_AXES if new.position is None else new.axes, waiter))

    def merge_hold(self, axes: Finger, superseded: RobotiqError, waiter: Waiter[None] | None = None) -> None:
        """Hold axes; a position that was not sent yet is dropped, and who waits for it is told."""
        self._drop_positions(axes, superseded)
        self.hold |= axes
        if waiter is not None:
            self.holding.append((axes, waiter))

    def merge_halt(self, waiter: Waiter[None], superseded: RobotiqError) -> None:
        """Stop everything; a position that was asked before and not sent yet is dropped."""
        self._drop_positions(Finger.ALL, superseded)
        self.halting = [*(self.halting or ()), waiter]

    def fail(self, error: RobotiqError) -> None:
        """Tell everybody who waits that it will not happen."""
        fail((*self.waiters, *(self.halting or ())), error)

    def _drop_positions(self, axes: Finger, superseded: RobotiqError) -> None:
        self.positions = {axis: value for axis, value in self.positions.items() if axis not in axes}
        fail((waiter for mask, waiter in self.asking if mask & axes), superseded)
        self.asking = [each for each in self.asking if not each[0] & axes]
