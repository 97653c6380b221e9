"""Whether an axis rests under what it was asked last, told by an object status that may be late.

The manual says that gDT and gSTA are valid once the echo is there. The vendor's own software for the
two-finger grippers says that they trail the echo by some exchanges. So a gDT that is read just after a new
request acts may be from before it, and is right by chance at most. It is believed at once only if it can
be from no other request than the present one, or if nothing has contradicted it since it was true; and in
any case when the lag is over. docs/decisions/late-status.md has the reasons.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

from ...values.enums import ObjectStatus
from ..contact import agrees

LAG_S: Final = 0.25
"""How long gDT may show what was before a request, from the first status that echoes it. The vendor's
example for the two-finger grippers waits 0.2 s for a motion to show (robotiq/grippers, move_gripper.cpp);
a quarter of that again for a poll and for a slow host. Nothing was measured on a 3-Finger."""
LAG_READS: Final = 10
"""And so many reads: the same source counts in exchanges, and a gripper that is polled slowly makes few."""


class Moment(NamedTuple):
    """When a status was asked for, and how many had been read before it."""

    time: float
    reads: int

    def is_lag_over(self, now: Moment) -> bool:
        """Whether what was true before this moment cannot show any more."""
        return now.time - self.time >= LAG_S and now.reads - self.reads >= LAG_READS


LONG_AGO: Final = Moment(-math.inf, -LAG_READS)


@dataclass(slots=True)
class _Asked:
    """One thing that an axis was asked.

    Attributes:
        number: of the write that carried it.
        position: in counts; None while rGTO is clear.
        again: whether an axis in contact tries again because of it: rGTO is set, or the force raised.
        shown: the first status that showed that it acts.
    """

    number: int
    position: int | None
    again: bool
    shown: Moment | None = None

    def fits(self, what: ObjectStatus, position: int) -> bool:
        """Whether an axis could rest like this under it. While rGTO is clear nothing is known of gDT."""
        return self.position is None or agrees(self.position, what, position, direction=0)


class Standstill:
    """What one axis was asked within the lag, and whether it can be at rest under the last of that."""

    def __init__(self) -> None:
        """Nothing has been asked lately."""
        self._asked: deque[_Asked] = deque()
        self._rested = False
        """Whether the axis was known to rest under the first of these, and was not shown moving since."""

    def ask(
        self, number: int, position: int | None, *, before: int | None, again: bool, rested: bool
    ) -> None:
        """The axis is asked for something new.

        Args:
            number: of the write that carries it.
            position: in counts; None for rGTO = 0.
            before: what it was asked until then.
            again: whether an axis in contact tries again because of it.
            rested: whether it was known to rest under what it was asked until then: what is shown comes in
                its order, so that nothing from before that can show any more.
        """
        if rested:
            self._asked.clear()
        if not self._asked:
            self._asked.append(_Asked(0, before, again=False, shown=LONG_AGO))
            self._rested = rested
        self._asked.append(_Asked(number, position, again))

    def limit(self, position: int) -> None:
        """What the axis was asked last was replaced by a software limit."""
        if self._asked:
            self._asked[-1].position = position

    def clear(self) -> None:
        """Nothing that was asked before counts."""
        self._asked.clear()

    def see(
        self,
        what: ObjectStatus,
        acts: Callable[[int], bool],
        is_old: Callable[[int], bool],
        now: Moment,
    ) -> None:
        """Take in a status.

        Args:
            what: its gDT.
            acts: whether the write of a number acts by now.
            is_old: whether it was acknowledged long ago. Where the echo cannot tell when it began to act, the
                time for that and the lag are over together.
            now: when the status was asked for.
        """
        for asked in reversed(self._asked):  # what was asked last acts last
            if asked.shown is not None:
                break
            if acts(asked.number):
                asked.shown = LONG_AGO if is_old(asked.number) else now
        if what is ObjectStatus.IN_MOTION and self._rested:
            # What rested does not move unless it is asked to: all that shows from here on is newer.
            self._drop_first()
        self._forget(now)

    def is_known(self, what: ObjectStatus, position: int) -> bool:
        """Whether the axis is known to rest like this, under what it was asked last.

        Args:
            what: its gDT.
            position: where it is, in counts. It is never late.
        """
        if what is ObjectStatus.IN_MOTION or (self._asked and self._asked[-1].shown is None):
            return False
        if len(self._asked) <= 1:
            # From the one request that is left: it is believed also where it contradicts it, as at a software
            # limit, or of an axis that is blocked.
            return True
        if what is ObjectStatus.AT_POSITION:
            # Late or not: the position is not late, and there is no more than its tolerance to go.
            return self._asked[-1].fits(what, position)
        return self._is_true_since(what, position, unless_tried_again=True)

    def is_doubtful(self, what: ObjectStatus, position: int) -> bool:
        """Whether the axis may move, or be about to, although it is shown at rest.

        A contact is doubted if something asked within the lag has contradicted it: to doubt it without need
        would cost the grip. Who stands close to the request before the last may have some counts to go.
        """
        if len(self._asked) <= 1 or what is ObjectStatus.IN_MOTION:
            return False
        if what is ObjectStatus.AT_POSITION:
            *before, last = self._asked
            return not last.fits(what, position) or any(asked.fits(what, position) for asked in before)
        return not self._is_true_since(what, position, unless_tried_again=False)

    def _is_true_since(self, what: ObjectStatus, position: int, *, unless_tried_again: bool) -> bool:
        """Whether this fits the last request, and every one since the first that it fits.

        It was true under one that it fits. If none that came after contradicts it, it is true still.
        """
        fits = False
        for asked in self._asked:
            was_fitting, fits = fits, asked.fits(what, position)
            tried_again = unless_tried_again and asked.again and what.is_contact
            if was_fitting and (tried_again or not fits):
                return False
        return fits

    def _forget(self, now: Moment) -> None:
        """Drop what was replaced so long ago that it cannot show any more."""
        asked = self._asked
        while len(asked) > 1 and (shown := asked[1].shown) is not None and shown.is_lag_over(now):
            self._drop_first()

    def _drop_first(self) -> None:
        self._rested = False
        if len(self._asked) > 1:
            self._asked.popleft()
