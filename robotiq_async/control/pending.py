"""What callers have asked for and the gripper has not been told yet.

Between two polls everything asked is merged, the last value wins, and it leaves as one write.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from ..enums import AXES, NO_AXES, Finger
from ..errors import RobotiqError
from .waiters import Waiter, fail


@dataclass(slots=True)
class PendingCommand:
    """Changes that wait for the next write, and who waits for that.

    Attributes:
        positions: new position request by axis.
        speeds: new speed by axis.
        forces: new force by axis.
        hold: axes to be held where they are, if they move.
        replaced: axes whose hold was replaced by a command: if that is lost, the hold is not.
        halting: callers of halt(); None when nobody asked to halt.
        going: callers that wait for a position to be acknowledged, with their axes.
        setting: callers that wait for nothing but a speed or a force.
        holding: callers of hold(), with their axes.
    """

    positions: dict[Finger, int] = field(default_factory=dict)
    speeds: dict[Finger, int] = field(default_factory=dict)
    forces: dict[Finger, int] = field(default_factory=dict)
    hold: Finger = NO_AXES
    replaced: Finger = NO_AXES
    halting: list[Waiter[None]] | None = None
    going: list[tuple[Finger, Waiter[None]]] = field(default_factory=list)
    setting: list[Waiter[None]] = field(default_factory=list)
    holding: list[tuple[Finger, Waiter[None]]] = field(default_factory=list)

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to write."""
        return not (self.positions or self.speeds or self.forces or self.hold or self.halting is not None)

    @property
    def holds_at_most(self) -> bool:
        """Whether axes to be held are all there is, if anything."""
        return not (self.positions or self.speeds or self.forces or self.halting is not None)

    @property
    def moved(self) -> Finger:
        """The axes that get a new position."""
        mask = NO_AXES
        for axis in self.positions:
            mask |= axis
        return mask

    @property
    def waiters(self) -> list[Waiter[None]]:
        """Callers that wait for nothing but the acknowledgement."""
        return [*(waiter for _, waiter in (*self.going, *self.holding)), *self.setting]

    @property
    def asked_to_hold(self) -> Finger:
        """The axes that callers of hold() have named: to be held whoever moves them."""
        mask = NO_AXES
        for axes, _ in self.holding:
            mask |= axes
        return mask

    def merge(
        self,
        axes: Finger,
        position: int | None,
        speed: int | None,
        force: int | None,
        waiter: Waiter[None] | None = None,
    ) -> None:
        """Merge a command; the last value wins."""
        for changes, value in ((self.positions, position), (self.speeds, speed), (self.forces, force)):
            if value is not None:
                changes.update(dict.fromkeys((axis for axis in AXES if axis in axes), value))
        if position is not None:
            self.replaced |= self.hold & axes
            self.hold &= ~axes
        if waiter is not None and position is None:
            self.setting.append(waiter)
        elif waiter is not None:
            self.going.append((axes, waiter))

    def merge_hold(self, axes: Finger, superseded: RobotiqError, waiter: Waiter[None] | None = None) -> None:
        """Hold axes; a position that was not sent yet is dropped, and who waits for it is told."""
        for axis in AXES:
            if axis in axes:
                self.positions.pop(axis, None)
        fail([waiter for mask, waiter in self.going if mask & axes], superseded)
        self.going = [(mask, waiter) for mask, waiter in self.going if not mask & axes]
        self.hold |= axes
        if waiter is not None:
            self.holding.append((axes, waiter))

    def merge_halt(self, waiter: Waiter[None], superseded: RobotiqError) -> None:
        """Stop everything; a position that was asked before and not sent yet is dropped."""
        self.positions.clear()
        fail([waiting for _, waiting in self.going], superseded)
        self.going.clear()
        self.replaced |= self.hold
        self.hold = NO_AXES
        # What was to be held is stopped by this.
        self.halting = [*(self.halting or ()), *(holder for _, holder in self.holding), waiter]
        self.holding.clear()

    def fail(self, error: RobotiqError) -> None:
        """Tell everybody who waits that it will not happen."""
        fail((*self.waiters, *(self.halting or ())), error)
