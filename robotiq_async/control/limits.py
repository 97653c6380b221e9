"""Software limits that a gripper echoes instead of the request.

A limit replaces a request beyond it [manual 2014, p. 45; 2018, p. 36]; which of the two the gripper echoes is
not said. If it echoes the limit [conceivable], the status looks as if another client had written just after
us. It counts as a limit only if

* the only differences are positions that this write has changed;
* each echoed value lies between the axis and its request;
* the axis can have a limit: the scissor, or a finger that closes while the scissor is near pinch;
* our own request never showed, and no other client was seen for ALONE_S.

If another client writes exactly such a request within the same device cycle, it is mistaken for a limit. This
moves nothing: in both cases our next image repeats the echo. But the move then ends with the
position at which the axis came to rest, and not with MoveSupersededError.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from ..runtime.logger import Log, log
from ..values.enums import Finger, ObjectStatus
from ..values.model import TOLERANCE
from ..values.registers import Echo
from ..values.request import Request
from ..values.status import RobotiqStatus
from .entry import Entry

ALONE_S: Final = 10.0
"""If another client was seen within this time, it explains the echo better than a limit."""
NEAR_PINCH: Final = 160
"""From this scissor position on the fingers may be limited: 137 is basic mode, 219 is pinch mode."""
_FIRST: Final = 2  # index of the first position in an echo


class Limits:
    """The limits that have been echoed instead of requests."""

    def __init__(self, log: Log = log) -> None:
        self.limited: dict[Finger, int] = {}  # by axis, the limit that shows instead of the last request
        self._log: Final = log
        # By axis, and whether it limits closing: the limit, and whether an axis has come to rest there.
        self.known: dict[tuple[Finger, bool], tuple[int, bool]] = {}
        self._others_at = -math.inf

    def forget(self, axes: Finger) -> None:
        """These axes are asked for another position."""
        self.limited = {axis: at for axis, at in self.limited.items() if axis not in axes}

    def shows(self, entry: Entry, echo: Echo) -> bool:
        """Whether an echo shows an entry with limits instead of its requests."""
        limits = self.apply(entry.image)
        return bool(limits) and entry.image.with_positions(limits).echo == echo

    def explains(self, shown: Entry, waiting: Sequence[Entry], status: RobotiqStatus, now: float) -> bool:
        """Whether limits explain a status that shows no entry; they are known from then on."""
        # Any of those that wait may be the one: a slow gripper skips images [follows].
        is_alone = now - self._others_at > ALONE_S
        return is_alone and any(self.learn(shown.image, each.image, status) for each in waiting)

    def settle(self, entry: Entry, last: Entry, echo: Echo) -> None:
        """If an entry shows as limits instead of requests, make it an entry of these limits."""
        limits = self.apply(entry.image)
        if echo == entry.echo:  # it is refuted by an image that shows as it was written
            self.known = {key: known for key, known in self.known.items() if key[0] not in limits}
            return
        # Later entries with the same request would echo the limit as well; the last is the base.
        for axis, limit in limits.items():
            if last.image.position(axis) == entry.image.position(axis):
                self.limited[axis] = limit
                image = last.image.with_positions({axis: limit})
                last.correct(image, image.echo)
        entry.correct(entry.image.with_positions(limits), echo)

    def note_rest(self, axis: Finger, status: RobotiqStatus) -> None:
        """An axis has come to rest: at its limit it proves that."""
        if axis not in self.limited or status.finger_status(axis) is not ObjectStatus.AT_POSITION:
            return
        for key, (limit, is_proven) in self.known.items():
            if key[0] is axis and not is_proven and abs(limit - status.position(axis)) <= TOLERANCE:
                self.known[key] = limit, True
                self._log.info("the gripper replaces requests of %s by its limit %d", axis, limit)
                return

    def note_other_client(self, now: float) -> None:
        """Drop the limits that no axis has proven: they may be the other client's requests."""
        # A write that shows such a limit after that counts as the other client's: it may be [conceivable].
        self._others_at = now
        self.known = {key: known for key, known in self.known.items() if known[1]}

    def apply(self, image: Request) -> dict[Finger, int]:
        """The limits that replace requests of an image, by axis."""
        return {
            axis: limit
            for (axis, closing), (limit, _) in self.known.items()
            if (image.position(axis) > limit if closing else image.position(axis) < limit)
        }

    def learn(self, before: Request, image: Request, status: RobotiqStatus) -> bool:
        """Learn the differences between a write and a status as limits; return whether they can be limits."""
        # ``before`` is the image in force before the write; the status is the first that shows neither.
        echo = status.echo
        if echo[:_FIRST] != image.echo[:_FIRST] or not image.go:
            return False
        found: dict[tuple[Finger, bool], tuple[int, bool]] = {}
        for axis, shown in zip(image.model.axes, echo[_FIRST:], strict=True):
            request = image.position(axis)
            if shown == request:
                continue
            if request == before.position(axis) or not _may_be_limit(axis, request, shown, status):
                return False
            found[axis, request > shown] = shown, False
        self.known |= found
        return bool(found)


def _may_be_limit(axis: Finger, request: int, shown: int, status: RobotiqStatus) -> bool:
    """Whether the axis can have a limit at this value, and has it between itself and its request."""
    position = status.position(axis)
    closing = request > shown
    is_on_the_way = shown >= position - TOLERANCE if closing else shown <= position + TOLERANCE
    if axis is Finger.SCISSOR or not is_on_the_way:
        return is_on_the_way
    has_scissor = Finger.SCISSOR in status.model.all_axes
    return has_scissor and closing and status.position(Finger.SCISSOR) >= NEAR_PINCH
