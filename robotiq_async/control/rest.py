"""Rest of an axis under its last request, by an object status (gDT) that may be late.

gDT and gSTA are valid once the echo shows [manual 2014, pp. 70, 84]. In the vendor's own software for the
two-finger grippers they trail the echo by some exchanges [vendor]. So a gDT that is read just after a request
acts may be from before it. It counts at once if it can result from no other request than the last; if it
says "at position" and the axis is where it was last asked to be, as a position is never late; or if it is a
contact that no request contradicts since it was true. In any case it counts when the lag is over.
docs/decisions/late-status.md has the reasons. The functions here are questions about the last requests of
one axis.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from enum import Enum
from functools import cache
from typing import Final, NamedTuple

from ..values.enums import NO_AXES, Finger, ObjectStatus
from ..values.model import TOLERANCE, Model
from ..values.request import Request
from ..values.status import RobotiqStatus

LAG_S: Final = 0.25
"""Time in which gDT may show the state before a request, from the first status that echoes the request. The
vendor's example for the two-finger grippers waits 0.2 s for a motion to show (robotiq/grippers,
move_gripper.cpp); 0.05 s are added for a poll and a slow host. Nothing was measured on a 3-Finger."""
LAG_READS: Final = 10
"""The reads that the lag lasts at least: the same source counts exchanges, and a slow poll makes few of
them."""

PAD_MM: Final = 1.6
"""The most by which pads and part yield as the force rises [conceivable]: 7 counts of a Hand-E, for 10 ms in
simulation, 4 of a 2F-85, 2 of the others."""


def agrees(model: Model, request: int, what: ObjectStatus, position: int, direction: int) -> bool:
    """Whether what an axis shows at a position can result from a request; positions are in counts."""
    # ``direction`` is above 0 closing, below 0 opening, 0 unknown; it is used only while the axis moves.
    # gDT says that an axis has stopped before its request, and in which direction it was going [manual 2014,
    # p. 51; 2018, p. 39]. One at its request may be off by the model's tolerance [manual: up to 2 counts].
    match what:
        case ObjectStatus.CONTACT_CLOSING:
            return request > position
        case ObjectStatus.CONTACT_OPENING:
            return request < position
        case ObjectStatus.IN_MOTION:
            return request != position and (direction == 0 or (request > position) == (direction > 0))
    return model.has_reached(request, position)


def drifts(axis: Finger, base: Request, status: RobotiqStatus, may_move: Finger = NO_AXES) -> bool:
    """Whether an axis moves or is about to, so that a hold must ask for its present position."""
    # An axis in contact keeps its request, and with it its grip; so does one at rest where it was asked to
    # be. An axis may still show what the request before this one made it do: then the two disagree.
    # ``may_move`` has the axes that show rest, and may move because of an earlier request.
    if not base.go:
        return False  # rGTO = 0 stops every axis [manual 2014, p. 50]
    # A needless hold would cost an axis in contact its grip: it would be asked for where it is.
    if axis in may_move:
        return base.position(axis) != status.position(axis)
    what, position, request = status.finger_status(axis), status.position(axis), base.position(axis)
    return what is ObjectStatus.IN_MOTION or not agrees(status.model, request, what, position, direction=0)


class Moment(NamedTuple):
    """The time at which a status was asked for, in monotonic seconds and in statuses read."""

    time: float
    reads: int

    def is_lag_over(self, now: Moment) -> bool:
        """Whether a status asked for at ``now`` cannot show anything from before this moment."""
        return now.time - self.time >= LAG_S and now.reads - self.reads >= LAG_READS


LONG_AGO: Final = Moment(-math.inf, -LAG_READS)


class Target(NamedTuple):
    """One request of an axis."""

    position: int | None  # None while rGTO is clear, where gDT has no meaning [manual 2014, p. 51]
    again: bool = False  # it makes an axis in contact try again: it sets rGTO or raises the force
    since: Moment | None = LONG_AGO  # the first status that showed that it acts; None before that

    def fits(self, model: Model, what: ObjectStatus, position: int) -> bool:
        return self.position is None or agrees(model, self.position, what, position, direction=0)


class Rest(Enum):
    """The certainty with which an axis that shows rest is at rest."""

    UNKNOWN = "it may move, or be about to"
    KNOWN = "it is where it was asked to be; a status from before its request may still come"
    PROVEN = "what it shows is from after its last request, so that no older status can follow"


def rest_of(targets: Iterator[Target], model: Model, what: ObjectStatus, position: int) -> Rest:
    """Whether an axis rests under the last of its targets, the newest first. Its position is never late."""
    # Only the newest requests are looked at where they decide: this runs at every poll of a motion, and a
    # control loop leaves fifty requests in the lag.
    last = next(targets, None)
    if what is ObjectStatus.IN_MOTION or (last is not None and last.since is None):
        return Rest.UNKNOWN
    before = next(targets, None)
    if last is None or before is None:
        # gDT results from the only request that is left, even if it contradicts it: the axis may be at a
        # software limit, or blocked.
        return Rest.PROVEN
    if what is ObjectStatus.AT_POSITION:  # within its tolerance, whatever the age of gDT
        return Rest.KNOWN if last.fits(model, what, position) else Rest.UNKNOWN
    is_true = _is_true_since((last, before, *targets), model, what, position, unless_again=True)
    return Rest.PROVEN if is_true else Rest.UNKNOWN


def may_move(targets: Iterable[Target], model: Model, what: ObjectStatus, position: int) -> bool:
    """Whether an axis may move, or be about to, although it shows rest; its newest target comes first."""
    # A contact is doubted only if a request within the lag contradicts it: a needless doubt would cost the
    # grip. An axis close to the request before the last may have some counts to go [conceivable].
    last, *before = [*targets] or [Target(None)]
    if not before or what is ObjectStatus.IN_MOTION:
        return False
    if what is ObjectStatus.AT_POSITION:
        others = (each for each in before if each.position != last.position)
        fits_other = any(each.fits(model, what, position) for each in others)
        return fits_other or not last.fits(model, what, position)
    return not _is_true_since((last, *before), model, what, position, unless_again=False)


def _is_true_since(
    targets: tuple[Target, ...], model: Model, what: ObjectStatus, position: int, *, unless_again: bool
) -> bool:
    """Whether this fits the last request, and every request since the first that it fits."""
    # It was true under that one. If no later request contradicts it, it is still true.
    fits = False
    for each in reversed(targets):
        was_fitting, fits = fits, each.fits(model, what, position)
        if was_fitting and ((unless_again and each.again) or not fits):
            return False
    return fits


@cache
def yields(model: Model) -> int:
    """The counts that an axis in contact may go on without having moved off."""
    return max(TOLERANCE, int(PAD_MM * model.stroke.counts / model.stroke.mm))


class Contacts:
    """Where each axis was last seen in contact, until it has moved off: what may press. False while empty.

    An axis in contact that is asked to press on keeps its request, and with it its grip: when others are
    held, and when rGTO rises (gDT shows no contact while that is clear; what becomes of a grip then is
    unknown [conceivable]). More force and a rising rGTO make it press again: for a while it shows a motion
    and stays where it is [conceivable]. Until a contact shows, or it has moved off, that is open.
    """

    def __init__(self) -> None:
        self._shown: dict[Finger, RobotiqStatus] = {}  # by axis, the newest status that shows it in contact
        self.open: Finger = NO_AXES

    def __bool__(self) -> bool:
        return bool(self._shown)

    def see(self, status: RobotiqStatus, contacts: Finger) -> None:
        """Take in a status with gGTO = 1, and those of its contacts that can be believed."""
        before, self.open = self._shown, NO_AXES
        self._shown = dict.fromkeys(contacts, status)
        for axis in before.keys() - self._shown.keys():  # usually none
            at = before[axis].position(axis)
            if axis in status.moving and abs(status.position(axis) - at) <= yields(status.model):
                self._shown[axis] = before[axis]
                self.open |= axis

    def ask(self, axes: Finger) -> None:
        """Axes are asked for a position, perhaps the same: what they do next is open."""
        if self._shown:
            self.open |= axes

    def forget(self) -> None:
        """A reset and an activation end every grip."""
        self._shown = {}

    def pressing(self, status: RobotiqStatus, base: Request) -> Finger:
        """The axes that have not moved since, and that ``base`` asks to press on."""
        pressing = NO_AXES
        for axis, shown in self._shown.items():
            what, at = shown.finger_status(axis), shown.position(axis)
            is_there = abs(status.position(axis) - at) <= yields(status.model)
            if is_there and agrees(status.model, base.position(axis), what, at, direction=0):
                pressing |= axis
        return pressing
