"""One entry of the ledger, and what the entries ask of an axis."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Final

from ..values.enums import Finger
from ..values.registers import Echo
from ..values.request import Request
from .rest import Moment, Target


@dataclass(slots=True, eq=False)
class Entry:
    """One image. Callers keep the entry and not its number, which may change."""

    number: int  # its place in the order in which the entries act
    image: Request
    echo: Echo
    is_ours: bool
    sent: float  # monotonic seconds; of a write lost with the link the latest at which it may have arrived
    acknowledged: float | None = None  # when; None before that
    acts_since: Moment | None = None  # the first status that showed that it acts, as far as that was needed

    @property
    def time(self) -> float:
        return self.sent if self.acknowledged is None else self.acknowledged

    def is_lag_over(self, now: Moment) -> bool:
        return self.acts_since is not None and self.acts_since.is_lag_over(now)

    def acknowledge(self, now: float) -> None:
        self.acknowledged = now

    def lose(self, now: float) -> None:
        """Note that the link went down before its acknowledgement."""
        self.sent = max(self.sent, now)

    def overtaken(self, number: int) -> None:
        """Note that another client's image shows: from its new place on it may act once more, if at all."""
        self.number, self.acts_since = number, None

    def correct(self, image: Request, echo: Echo) -> None:
        """Take in what a status has shown of it: another client's requests, or limits in place of ours."""
        self.image, self.echo = image, echo

    def note_acting(self, since: Moment) -> None:
        self.acts_since = since


class RecentRequests:
    """The requests that the object status of an axis may be from, until it is proven to rest."""

    def __init__(
        self, axis: Finger, before: Target, *, is_at_rest: bool, changes: Iterable[tuple[Entry, bool]] = ()
    ) -> None:
        self._axis: Final = axis
        # The entries that change its request, the oldest first, and whether each makes it try again.
        self._changes: Final = [*changes]
        # Its request before them; None if no status can be from that time any more.
        self._before: Target | None = before
        # Whether it was proven to rest under that: then any motion is due to one of the changes.
        self._was_at_rest: Final = is_at_rest

    def add(self, entry: Entry, now: Moment, *, again: bool) -> None:
        changes = self._changes
        while len(changes) > 1 and changes[1][0].is_lag_over(now):
            del changes[0]
        is_revived = bool(changes) and changes[-1][0].number > entry.number  # it was in doubt
        changes.append((entry, again))
        if is_revived:
            changes.sort(key=lambda change: change[0].number)

    def without(self, doubtful: list[Entry]) -> RecentRequests:
        """The same without the entries that may act, or never: what moves the axis is not known."""
        kept = [each for each in self._changes if each[0] not in doubtful]
        if len(kept) == len(self._changes):
            return self
        return RecentRequests(self._axis, self._before or Target(None), is_at_rest=False, changes=kept)

    def note_overtaken(self, doubtful: list[Entry], now: Moment) -> None:
        """Another client's image shows: these entries may have acted until now, unseen, and may act later."""
        # A copy stands for the time until now. If the entry acts later, it is added again.
        self._changes[:] = [
            (replace(each, acts_since=now) if each in doubtful else each, again)
            for each, again in self._changes
        ]

    def note_motion(self) -> None:
        """An axis at rest moves only for a new request: every later status is from after it [follows]."""
        if self._was_at_rest:
            self._before = None

    def waiting(self) -> Iterator[Entry]:
        """The entries that are not known to act."""
        for each, _ in reversed(self._changes):
            if each.acts_since is not None:
                return
            yield each

    def targets(self, now: Moment) -> Iterator[Target]:
        """The newest first, as far back as a status can be from."""
        for each, again in reversed(self._changes):
            position = each.image.position(self._axis) if each.image.go else None
            yield Target(position, again, each.acts_since)
            if each.is_lag_over(now):
                return
        if self._before is not None:
            yield self._before
