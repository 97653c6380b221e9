"""One entry of the ledger, and how a gripper may echo it."""

from __future__ import annotations

from dataclasses import dataclass

from ..values.enums import NO_AXES, Finger
from ..values.registers import Echo
from ..values.request import Request
from .rest import Moment, Target


@dataclass(slots=True, eq=False)
class Entry:
    """One image. Callers keep the entry and not its number, which may change."""

    number: int  # its place in the order in which the entries act
    image: Request
    before: Request  # the image that it replaces
    echo: Echo
    is_ours: bool
    sent: float  # monotonic seconds; of a write lost with the link the latest at which it may have arrived
    acknowledged: float | None = None  # when; None before that
    acts_since: Moment | None = None  # the first status that showed that it acts, as far as that was needed
    # The axes whose request it changes, and of these: those that it lets try again (it sets rGTO or raises
    # the force); those that were proven to rest before it; and of the latter those that have shown motion
    # since, so that no status from before can follow.
    changes: Finger = NO_AXES
    again: Finger = NO_AXES
    rested: Finger = NO_AXES
    started: Finger = NO_AXES

    @property
    def time(self) -> float:
        return self.sent if self.acknowledged is None else self.acknowledged

    def compare(self, before: Request, unrested: Finger, unproven: Finger) -> None:
        """Note what it changes, given the axes that are not known to rest, and not proven to."""
        self.before, image = before, self.image
        both = zip(before.by_axis, image.axes, strict=True)
        pressed = Finger(sum(axis for (axis, old), new in both if new.force > old.force))
        # More force lets an axis in contact try again [conceivable]; one that moves keeps moving.
        self.changes = changed(before, image) | pressed & ~unrested
        self.again = self.changes & pressed if before.go or not image.go else self.changes
        # With rGTO clear gDT has no meaning, so no axis was proven to rest under what was asked before.
        if before.go:
            self.rested = self.changes & ~unproven

    def acknowledge(self, now: float) -> None:
        self.acknowledged = now

    def lose(self, now: float) -> None:
        """Note that the link went down before its acknowledgement."""
        self.sent = max(self.sent, now)

    def renumber(self, number: int) -> None:
        self.number = number

    def correct(self, image: Request, echo: Echo) -> None:
        """Take in what a status has shown of it: another client's requests, or limits in place of ours."""
        self.image, self.echo = image, echo

    def note_acting(self, since: Moment) -> None:
        self.acts_since = since

    def note_start(self, axis: Finger) -> None:
        self.started |= axis

    def is_lag_over(self, now: Moment) -> bool:
        return self.acts_since is not None and self.acts_since.is_lag_over(now)

    def target(self, axis: Finger, since: Moment | None) -> Target:
        position = self.image.position(axis) if self.image.go else None
        return Target(position, bool(self.again & axis), since)

    def target_before(self, axis: Finger) -> Target:
        """The request that it replaces: unknown before another client's, if rGTO was clear."""
        known = self.before if self.before.go or self.is_ours else self.image
        return Target(known.position(axis) if known.go else None)


def changed(before: Request, image: Request) -> Finger:
    """The axes whose request is another: all if rGTO is."""
    return moved(before, image) if image.go is before.go else image.model.all_axes


def moved(before: Request, image: Request) -> Finger:
    """The axes whose position request is another."""
    both = zip(before.by_axis, image.axes, strict=True)
    return Finger(sum(axis for (axis, old), new in both if new.position != old.position))
