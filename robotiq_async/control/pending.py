"""What callers have asked for and the gripper has not been told yet.

Between two polls everything asked is merged, the last value wins, and it leaves as one write. Whoever
waits for a write is told once: None when it was acknowledged, an error when it never will be.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final

from ..enums import AXES, Finger
from ..errors import RobotiqError

Delivery = Callable[[RobotiqError | None], None]
"""Called once: with None when the write was acknowledged, else with the reason why not."""

NONE: Final = Finger(0)
"""The empty mask."""

Failure = Callable[[], RobotiqError]
"""Makes the error: each waiting caller raises one of its own."""


@dataclass(slots=True)
class Desk:
    """Changes that wait for the next write.

    Attributes:
        positions: new position request by axis.
        speeds: new speed by axis.
        forces: new force by axis.
        hold: axes to be held where they are, if they move.
        replaced: axes whose hold was replaced by a command: if that is lost, the hold is not.
        halt: callers of halt(); None when nobody asked to halt.
        going: callers that wait for a position to be sent, with their axes.
        setting: callers that wait for nothing but a speed or a force.
    """

    positions: dict[Finger, int] = field(default_factory=dict)
    speeds: dict[Finger, int] = field(default_factory=dict)
    forces: dict[Finger, int] = field(default_factory=dict)
    hold: Finger = NONE
    replaced: Finger = NONE
    halt: list[Delivery] | None = None
    going: list[tuple[Finger, Delivery]] = field(default_factory=list)
    setting: list[Delivery] = field(default_factory=list)

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to write."""
        return not (self.positions or self.speeds or self.forces or self.hold or self.halt is not None)

    @property
    def only_holds(self) -> bool:
        """Whether axes to be held are all there is."""
        return not (self.positions or self.speeds or self.forces or self.halt is not None)

    def put(
        self,
        axes: Finger,
        position: int | None,
        speed: int | None,
        force: int | None,
        delivery: Delivery | None = None,
    ) -> None:
        """Merge a command; the last value wins."""
        for changes, value in ((self.positions, position), (self.speeds, speed), (self.forces, force)):
            if value is not None:
                changes.update(dict.fromkeys((axis for axis in AXES if axis in axes), value))
        if position is not None:
            self.replaced |= self.hold & axes
            self.hold &= ~axes
        if delivery is not None and position is None:
            self.setting.append(delivery)
        elif delivery is not None:
            self.going.append((axes, delivery))

    def put_hold(self, axes: Finger, superseded: Failure) -> None:
        """Hold axes; a position that was not sent yet is dropped, and who waits for it is told."""
        for axis in AXES:
            if axis in axes:
                self.positions.pop(axis, None)
        going, self.going = self.going, []
        for mask, delivery in going:
            if mask & axes:
                delivery(superseded())
            else:
                self.going.append((mask, delivery))
        self.hold |= axes

    def put_halt(self, delivery: Delivery, superseded: Failure) -> None:
        """Stop everything; a position that was asked before and not sent yet is dropped."""
        self.positions.clear()
        going, self.going = self.going, []
        tell((delivery for _, delivery in going), superseded)
        self.replaced |= self.hold
        self.hold = NONE
        self.halt = [*(self.halt or ()), delivery]

    def fail(self, failure: Failure) -> None:
        """Tell everybody who waits that it will not happen."""
        tell((*self.senders, *(self.halt or ())), failure)

    @property
    def moved(self) -> Finger:
        """The axes that get a new position."""
        mask = NONE
        for axis in self.positions:
            mask |= axis
        return mask

    @property
    def senders(self) -> list[Delivery]:
        """Callers that wait for nothing but the acknowledgement."""
        return [*(delivery for _, delivery in self.going), *self.setting]


def tell(deliveries: Iterable[Delivery], failure: Failure | None = None) -> None:
    """Tell callers that their write was acknowledged, or each why it was not."""
    for delivery in deliveries:
        delivery(failure() if failure is not None else None)
