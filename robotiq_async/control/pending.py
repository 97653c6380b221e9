"""Requests of callers that are not written yet, and the images that they make of the last one.

All requests between two polls are merged into one write; the last value wins. A position, a speed or a force
is written once and never again: it may move an axis. A hold remains until it is acknowledged, also over a
lost link, because it can only stop one.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import reduce
from operator import or_

from ..values.enums import NO_AXES, Finger
from ..values.errors import RobotiqError
from ..values.request import AxisRequest, Request
from ..values.status import RobotiqStatus
from .contact import drifts
from .waiters import Waiter, fail


@dataclass(frozen=True, slots=True)
class Command:
    """A position, a speed and a force for some axes; None changes nothing."""

    axes: Finger
    position: int | None = None
    speed: int | None = None
    force: int | None = None


@dataclass(slots=True)
class Pending:
    """The changes for the next write, and the callers that wait for it.

    Attributes:
        positions: new position request by axis.
        speeds: new speed by axis.
        forces: new force by axis.
        hold: axes to hold if they move. A position of the same axis goes before it, but does not end it: if
            the link goes down before the write, the hold remains and the position does not.
        callers: those of commands, which wait for the acknowledgement, each with the axes that it moves.
        holders: those of hold(), with their axes. These are held whichever client moves them.
    """

    positions: dict[Finger, int] = field(default_factory=dict)
    speeds: dict[Finger, int] = field(default_factory=dict)
    forces: dict[Finger, int] = field(default_factory=dict)
    hold: Finger = NO_AXES
    callers: list[tuple[Finger, Waiter[None]]] = field(default_factory=list)
    holders: list[tuple[Finger, Waiter[None]]] = field(default_factory=list)

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
        """The axes that get a new position."""
        return reduce(or_, self.positions, NO_AXES)

    @property
    def named_to_hold(self) -> Finger:
        """The axes named by callers of hold()."""
        return reduce(or_, (axes for axes, _ in self.holders), NO_AXES)

    @property
    def waiters(self) -> list[Waiter[None]]:
        return [waiter for _, waiter in (*self.callers, *self.holders)]

    def merge(self, new: Command, waiter: Waiter[None] | None = None) -> None:
        # The last value wins, per axis and field; an axis keeps what a command does not name.
        values = (new.position, new.speed, new.force)
        for changes, value in zip((self.positions, self.speeds, self.forces), values, strict=True):
            if value is not None:
                changes.update(dict.fromkeys(new.axes, value))
        if waiter is not None:
            self.callers.append((NO_AXES if new.position is None else new.axes, waiter))

    def merge_hold(self, axes: Finger, waiter: Waiter[None] | None = None) -> None:
        self.hold |= axes
        if waiter is not None:
            self.holders.append((axes, waiter))

    def hold_only(self, axes: Finger) -> None:
        """Hold none but these axes, and those that callers of hold() have named."""
        self.hold &= axes | self.named_to_hold

    def drop_positions(self, axes: Finger, superseded: RobotiqError) -> None:
        """Drop the positions of some axes. Their callers get the error ``superseded``."""
        for axis in axes:
            self.positions.pop(axis, None)
        fail((waiter for mask, waiter in self.callers if mask & axes), superseded)
        self.callers = [each for each in self.callers if not each[0] & axes]

    def drop_changes(self, error: RobotiqError) -> None:
        """Drop everything that may move an axis, and holds of our own making."""
        fail((waiter for _, waiter in self.callers), error)
        for each in (self.positions, self.speeds, self.forces, self.callers):
            each.clear()
        self.hold_only(NO_AXES)

    def drop(self, error: RobotiqError) -> None:
        """Drop everything."""
        self.drop_changes(error)
        fail((waiter for _, waiter in self.holders), error)
        self.hold = NO_AXES
        self.holders.clear()

    def take_holds(self) -> Pending:
        """Take the holds alone: a halt covers them, and goes before the rest."""
        taken = Pending(hold=self.hold, holders=[*self.holders])
        self.hold = NO_AXES
        self.holders.clear()
        return taken


def merged(
    base: Request,
    pending: Pending,
    status: RobotiqStatus,
    *,
    gripping: Finger = NO_AXES,
    may_move: Finger = NO_AXES,
) -> Request:
    """Merge pending changes into ``base``. Axes that they do not address keep their requests.

    ``gripping`` has the axes that were in contact when rGTO was last set, ``may_move`` those that show rest
    and may move all the same.
    """
    if pending.positions and not base.go:
        # rGTO starts every axis [manual 2012, 4.6]: ask each for where it is. An axis that gripped keeps its
        # request, or it would lose its grip.
        base = base.with_positions(
            {axis: status.position(axis) for axis in status.model.axes if axis not in gripping}
        )
    # With rGTO set, an axis that is not addressed keeps its position request, and with it its motion or grip:
    # so speed and force alone start nothing.
    held = {
        axis: status.position(axis)
        for axis in status.model.axes
        if axis in pending.hold and drifts(axis, base, status, may_move)
    }
    positions = held | pending.positions
    return replace(
        base,
        go=base.go or bool(pending.positions),
        axes=tuple(
            AxisRequest(
                positions.get(axis, old.position),
                pending.speeds.get(axis, old.speed),
                pending.forces.get(axis, old.force),
            )
            for axis, old in base.by_axis
        ),
    )


def at_rest(base: Request, status: RobotiqStatus) -> Request:
    """Clear rGTO and ask every axis to be where it is, so that no axis starts."""
    # The positions count at the next rGTO = 1, of whichever client.
    here = {axis: status.position(axis) for axis in status.model.axes}
    return replace(base, go=False).with_positions(here)
