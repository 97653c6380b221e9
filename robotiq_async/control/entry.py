"""One entry of the ledger, and how a gripper may echo it."""

from __future__ import annotations

from collections.abc import Mapping
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

    def limit(self, positions: Mapping[Finger, int], echo: Echo | None = None) -> None:
        """Put limits in place of requests; ``echo`` if it is known to be another than that of the image."""
        self.image = self.image.with_positions(positions)
        self.echo = self.image.echo if echo is None else echo

    @property
    def time(self) -> float:
        return self.sent if self.acknowledged is None else self.acknowledged

    def is_lag_over(self, now: Moment) -> bool:
        return self.acts_since is not None and self.acts_since.is_lag_over(now)

    def target(self, axis: Finger, since: Moment | None) -> Target:
        position = self.image.position(axis) if self.image.go else None
        return Target(position, bool(self.again & axis), since)

    def target_before(self, axis: Finger) -> Target:
        """The request that it replaces: unknown before another client's, if rGTO was clear."""
        known = self.before if self.before.go or self.is_ours else self.image
        return Target(known.position(axis) if known.go else None)
