"""Software limits that a gripper echoes in place of the request.

The manual says that a request beyond a limit is replaced by the limit, and not which of the two is echoed.
Where it is the limit, the first status that shows our write looks as if another client had written just after
us. It is taken for a limit only where everything else speaks for that:

* nothing but positions that this write has changed shows otherwise than written;
* each shows a value on the way from the axis to its request, so that it may be where the way is barred;
* the axis may have a limit: the scissor, or a finger that closes while the scissor stands near pinch;
* our own request was never shown, and no other client was seen for some time.

Another client that writes within the same device cycle as we do, and just that, is taken for a limit by
mistake. Nothing is moved by that: what shows becomes the request that our next image repeats, in either case.
Lost is that the move ends with where its axis came to rest, in place of MoveSupersededError.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from ...values.enums import AXES, Finger
from ...values.registers import Echo
from ...values.request import Request
from ...values.status import RobotiqStatus
from ..contact import TOLERANCE

ALONE_S: Final = 10.0
"""No other client was seen for so long: one that was is the better explanation."""
NEAR_PINCH: Final = 160
"""A scissor reading from which on the fingers may be limited: 137 is basic, 219 pinch."""
FIRST_POSITION: Final = 2
"""Index of the first position in an echo."""


class Limits:
    """What has been echoed in place of requests, so far."""

    def __init__(self) -> None:
        """None is known."""
        self._known: dict[tuple[Finger, bool], int] = {}
        """By axis, and whether it limits closing."""
        self._proven: set[tuple[Finger, bool]] = set()

    def alias(self, image: Request) -> Echo | None:
        """How an image would be echoed under the limits that are known, if otherwise than written."""
        if not self._known:
            return None
        limited = image.with_positions(self.apply(image)).echo
        return limited if limited != image.echo else None

    def apply(self, image: Request) -> dict[Finger, int]:
        """What stands in place of the requests of an image that lie beyond a limit."""
        return {
            axis: limit
            for (axis, closing), limit in self._known.items()
            if (image.position(axis) > limit if closing else image.position(axis) < limit)
        }

    def suspect(self, before: Request, image: Request, status: RobotiqStatus) -> bool:
        """Take what a status shows in place of a write for limits, if it can be that.

        Args:
            before: the image that was in force before the write.
            image: the one written.
            status: the first that shows something else than either.
        """
        echo = status.echo
        if echo[:FIRST_POSITION] != image.echo[:FIRST_POSITION] or not image.go:
            return False
        found: dict[tuple[Finger, bool], int] = {}
        for axis, shown in zip(AXES, echo[FIRST_POSITION:], strict=True):
            request = image.position(axis)
            if shown == request:
                continue
            if request == before.position(axis) or not _may_be_limit(axis, request, int(shown), status):
                return False
            found[axis, request > shown] = int(shown)
        self._known |= found
        self._proven -= set(found)
        return bool(found)

    def prove(self, axis: Finger, position: int) -> int | None:
        """An axis has come to rest: the limit that it has proven by that, if it is news."""
        for key, limit in self._known.items():
            if key[0] is axis and key not in self._proven and abs(limit - position) <= TOLERANCE:
                self._proven.add(key)
                return limit
        return None

    def doubt(self) -> None:
        """Another client was seen: what was not proven may have been its doing."""
        self._known = {key: limit for key, limit in self._known.items() if key in self._proven}

    def forget(self, image: Request, echo: Echo) -> None:
        """A status shows an image as it was written: what would limit it does not."""
        beyond: Mapping[Finger, int] = self.apply(image) if echo == image.echo else {}
        self._known = {key: limit for key, limit in self._known.items() if key[0] not in beyond}


def _may_be_limit(axis: Finger, request: int, shown: int, status: RobotiqStatus) -> bool:
    """Whether a value lies on the way of an axis that may have a limit there."""
    position = status.position(axis)
    closing = request > shown
    is_on_the_way = shown >= position - TOLERANCE if closing else shown <= position + TOLERANCE
    if axis is Finger.SCISSOR:
        return is_on_the_way
    return is_on_the_way and closing and status.position(Finger.SCISSOR) >= NEAR_PINCH
