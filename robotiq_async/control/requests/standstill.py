"""Whether an axis rests under its last request, by an object status (gDT) that may be late.

The manual says that gDT and gSTA are valid once the echo shows. The vendor's own software for the two-finger
grippers says that they trail the echo by some exchanges. So a gDT that is read just after a new request acts
may be from before it. It counts at once only if it can result from no other request than the last, or if no
request contradicts it since it was true; and in any case when the lag is over. docs/decisions/late-status.md
has the reasons.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from ...values.enums import ObjectStatus
from ...values.model import Model
from ..contact import agrees

LAG_S: Final = 0.25
"""How long gDT may show the state before a request, from the first status that echoes the request. The
vendor's example for the two-finger grippers waits 0.2 s for a motion to show (robotiq/grippers,
move_gripper.cpp); 0.05 s are added for a poll and a slow host. Nothing was measured on a 3-Finger."""
LAG_READS: Final = 10
"""The reads that the lag lasts at least: the same source counts exchanges, and a slow poll makes few of
them."""


class Moment(NamedTuple):
    """When a status was asked for, in monotonic seconds and in statuses read."""

    time: float
    reads: int

    def is_lag_over(self, now: Moment) -> bool:
        """Whether a status asked for at ``now`` cannot show anything from before this moment."""
        return now.time - self.time >= LAG_S and now.reads - self.reads >= LAG_READS


LONG_AGO: Final = Moment(-math.inf, -LAG_READS)


@dataclass(slots=True)
class _Asked:
    """One request of an axis.

    Attributes:
        model: of the gripper.
        number: of its write.
        position: in counts; None while rGTO is clear.
        again: whether it makes an axis in contact try again: it sets rGTO or raises the force.
        shown: the first status that showed that it acts.
    """

    model: Model
    number: int
    position: int | None
    again: bool
    shown: Moment | None = None

    def fits(self, what: ObjectStatus, position: int) -> bool:
        """Whether an axis can rest like this under it. While rGTO is clear gDT says nothing."""
        return self.position is None or agrees(self.model, self.position, what, position, direction=0)


class Standstill:
    """The requests of one axis within the lag, and whether it rests under the last of them."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._asked: deque[_Asked] = deque()
        self._rested = False
        """Whether the axis was known to rest under the first of these, and did not show motion since."""

    def ask(
        self, number: int, position: int | None, *, before: int | None, again: bool, rested: bool
    ) -> None:
        """Add a request.

        Args:
            number: of its write.
            position: in counts; None for rGTO = 0.
            before: the request that it replaces.
            again: whether it makes an axis in contact try again.
            rested: whether the axis was known to rest under the request before. Statuses come in order, so
                nothing older can show then.
        """
        if rested:
            self._asked.clear()
        if not self._asked:
            self._asked.append(_Asked(self._model, 0, before, again=False, shown=LONG_AGO))
            self._rested = rested
        self._asked.append(_Asked(self._model, number, position, again))

    def limit(self, position: int) -> None:
        """The last request was replaced by a software limit."""
        if self._asked:
            self._asked[-1].position = position

    def clear(self) -> None:
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
            is_old: whether that write was acknowledged long ago. If the echo cannot tell when it began to
                act, the time for that and the lag end together.
            now: when the status was asked for.
        """
        for asked in reversed(self._asked):  # requests act in their order
            if asked.shown is not None:
                break
            if acts(asked.number):
                asked.shown = LONG_AGO if is_old(asked.number) else now
        if what is ObjectStatus.IN_MOTION and self._rested:
            # An axis at rest moves only for a new request: from here on every status is from after it.
            self._drop_first()
        self._forget(now)

    def copy(self) -> Standstill:
        """A copy that can take in a status for a question, and leave this one as it is."""
        copied = Standstill(self._model)
        copied._asked = deque(replace(asked) for asked in self._asked)
        copied._rested = self._rested
        return copied

    def is_known(self, what: ObjectStatus, position: int) -> bool:
        """Whether the axis is known to rest like this under its last request.

        Args:
            what: its gDT.
            position: where it is, in counts. It is never late.
        """
        if what is ObjectStatus.IN_MOTION or (self._asked and self._asked[-1].shown is None):
            return False
        if len(self._asked) <= 1:
            # gDT results from the only request that is left, even if it contradicts it: the axis may be at a
            # software limit, or blocked.
            return True
        if what is ObjectStatus.AT_POSITION:
            # The position is never late, and the axis is within its tolerance.
            return self._asked[-1].fits(what, position)
        return self._is_true_since(what, position, unless_tried_again=True)

    def is_proven(self, what: ObjectStatus, position: int) -> bool:
        """Whether what it shows is from after its last request, so that no older status can follow.

        An axis within its tolerance is known to rest by its position alone: its object status may still be
        from before the request, and that of its motion is to come.
        """
        return self.is_known(what, position) and (what.is_contact or len(self._asked) <= 1)

    def is_doubtful(self, what: ObjectStatus, position: int) -> bool:
        """Whether the axis may move, or be about to, although it shows rest.

        A contact is doubted only if a request within the lag contradicts it: a needless doubt would cost the
        grip. An axis close to the request before the last may have some counts to go.
        """
        if len(self._asked) <= 1 or what is ObjectStatus.IN_MOTION:
            return False
        if what is ObjectStatus.AT_POSITION:
            *before, last = self._asked
            others = [asked for asked in before if asked.position != last.position]
            return not last.fits(what, position) or any(asked.fits(what, position) for asked in others)
        return not self._is_true_since(what, position, unless_tried_again=False)

    def _is_true_since(self, what: ObjectStatus, position: int, *, unless_tried_again: bool) -> bool:
        """Whether this fits the last request, and every request since the first that it fits.

        It was true under that one. If no later request contradicts it, it is still true.
        """
        fits = False
        for asked in self._asked:
            was_fitting, fits = fits, asked.fits(what, position)
            tried_again = unless_tried_again and asked.again and what.is_contact
            if was_fitting and (tried_again or not fits):
                return False
        return fits

    def _forget(self, now: Moment) -> None:
        """Drop the requests that were replaced so long ago that no status can show them."""
        asked = self._asked
        while len(asked) > 1 and (shown := asked[1].shown) is not None and shown.is_lag_over(now):
            self._drop_first()

    def _drop_first(self) -> None:
        self._rested = False
        if len(self._asked) > 1:
            self._asked.popleft()
