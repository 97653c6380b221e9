"""Rest of an axis under its last request, by an object status (gDT) that may be late.

gDT and gSTA are valid once the echo shows [manual 2014, pp. 70, 84]. In the vendor's own software for the
two-finger grippers they trail the echo by some exchanges [vendor]. So a gDT that is read just after a request
acts may be from before it. It counts at once if it can result from no other request than the last; if it
says "at position" and the axis is at its last request, as a position is never late; or if it is a
contact that no request contradicts since it was true. In any case it counts when the lag is over.
docs/decisions/late-status.md has the reasons.

A hold acts a device cycle after it was sent. With its last position as request an axis would drive back, 20
counts if the cycle is 0.2 s. So the request is the position that the axis will have, as far as statuses show
it.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cache
from typing import Final, NamedTuple

from ..values.enums import NO_AXES, Finger, ObjectStatus
from ..values.model import TOLERANCE, Model
from ..values.request import Request
from ..values.status import RobotiqStatus
from .entry import Entry

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

BASELINE_S: Final = 0.25
"""The statuses of this time give the speed. Positions are whole counts: it is right to 4 counts a second."""
SPACING_S: Final = 0.02
"""Seconds between the statuses that are kept."""


def agrees(model: Model, request: int, what: ObjectStatus, position: int, direction: int) -> bool:
    """Whether an object status at a position can result from a request; positions are in counts."""
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
    """Whether an axis moves or is about to, so that a hold must request its present position."""
    # An axis may still show the effect of an earlier request: then the two disagree. ``may_move``
    # has the axes that show rest, and may move because of an earlier request. A needless hold would cost an
    # axis in contact its grip: its request would become its present position.
    if axis in may_move:
        return base.position(axis) != status.position(axis)
    what, position, request = status.finger_status(axis), status.position(axis), base.position(axis)
    return what is ObjectStatus.IN_MOTION or not agrees(status.model, request, what, position, direction=0)


class Moment(NamedTuple):
    """The time at which a status was requested, in monotonic seconds and in statuses read."""

    time: float
    reads: int

    def is_lag_over(self, now: Moment) -> bool:
        """Whether a status requested at ``now`` cannot show anything from before this moment."""
        return now.time - self.time >= LAG_S and now.reads - self.reads >= LAG_READS


LONG_AGO: Final = Moment(-math.inf, -LAG_READS)


@dataclass(slots=True, eq=False)
class Target:
    """One request of an axis."""

    axis: Finger
    entry: Entry | None  # None if it is not known
    again: bool = False  # it makes an axis in contact try again: it sets rGTO or raises the force
    since: Moment | None = LONG_AGO  # the first status that showed that it acts; None before that
    rested: bool = False  # the axis was proven to rest under it: any motion is due to a later one

    @property
    def position(self) -> int | None:
        """Its position; None while rGTO is clear, where gDT has no meaning [manual 2014, p. 51]."""
        image = None if self.entry is None else self.entry.image
        return None if image is None or not image.go else image.position(self.axis)

    def act(self, now: Moment) -> None:
        """Note that it acts, or may have acted unseen, since a status."""
        self.since = now

    def fits(self, model: Model, what: ObjectStatus, position: int) -> bool:
        request = self.position
        return request is None or agrees(model, request, what, position, direction=0)


class Rest(Enum):
    """The certainty with which an axis that shows rest is at rest."""

    UNKNOWN = "it may move, or be about to"
    KNOWN = "it is at its request; a status from before its request may still come"
    PROVEN = "its status is from after its last request, so that no older status can follow"


def rest_of(targets: Sequence[Target], model: Model, what: ObjectStatus, position: int) -> Rest:
    """Whether an axis rests under the last of its targets. Its position is never late."""
    # Only the last is looked at where that decides: this runs at every poll of a motion, and a control loop
    # leaves fifty requests in the lag.
    last = targets[-1]
    if what is ObjectStatus.IN_MOTION or last.since is None:
        return Rest.UNKNOWN
    if len(targets) == 1:
        # gDT results from the only request that is left, even if it contradicts it: the axis may be at a
        # software limit, or blocked.
        return Rest.PROVEN
    if what is ObjectStatus.AT_POSITION:  # within its tolerance, at any age of gDT
        return Rest.KNOWN if last.fits(model, what, position) else Rest.UNKNOWN
    is_true = _is_true_since(targets, model, what, position, unless_again=True)
    return Rest.PROVEN if is_true else Rest.UNKNOWN


def may_move(targets: Sequence[Target], model: Model, what: ObjectStatus, position: int) -> bool:
    """Whether an axis may move, or be about to, although it shows rest."""
    # A contact is doubted only if a request within the lag contradicts it: a needless doubt would cost the
    # grip. An axis close to the request before the last may have some counts to go [conceivable].
    *before, last = targets
    if not before or what is ObjectStatus.IN_MOTION:
        return False
    if what is ObjectStatus.AT_POSITION:
        others = (each for each in before if each.position != last.position)
        fits_other = any(each.fits(model, what, position) for each in others)
        return fits_other or not last.fits(model, what, position)
    return not _is_true_since(targets, model, what, position, unless_again=False)


def _is_true_since(
    targets: Sequence[Target], model: Model, what: ObjectStatus, position: int, *, unless_again: bool
) -> bool:
    """Whether this fits the last request, and every request since the first that it fits."""
    # It was true under that one. If no later request contradicts it, it is still true.
    fits = False
    for each in targets:
        was_fitting, fits = fits, each.fits(model, what, position)
        if was_fitting and ((unless_again and each.again) or not fits):
            return False
    return fits


class RecentRequests:
    """The requests that the object status of each axis may be from, until it is proven to rest."""

    def __init__(self, model: Model) -> None:
        self.unrested: Finger = NO_AXES  # the axes that are not known to rest under their last request
        self.course: Final = Course()  # of the axes with recent requests
        self._model: Final = model
        # By axis, the oldest first. Usually there is none, which spares a poll all questions about them.
        self.targets: Final[dict[Finger, list[Target]]] = {}

    def ask(
        self, entry: Entry, before: Entry, *, is_at_rest: bool = False, later: Sequence[Entry] = ()
    ) -> Finger:
        """Note an image with other requests than the one before; return the axes with other requests.

        It acts before the ``later`` entries. With ``is_at_rest`` other axes have proven to rest until now.
        """
        image, replaced, changed = entry.image, before.image, NO_AXES
        is_switched = image.go is not replaced.go
        is_raised = is_switched and image.go and entry.is_ours
        for (axis, old), new in zip(replaced.by_axis, image.axes, strict=True):
            is_pressed = new.force > old.force
            is_new = is_switched or new.position != old.position
            # More force lets an axis in contact try again [conceivable]; one that moves keeps moving.
            if not is_new and not (is_pressed and not axis & self.unrested):
                continue
            if (targets := self.targets.get(axis)) is None:
                # Before another client's it is unknown, if rGTO was clear.
                known = before if replaced.go or entry.is_ours else entry
                targets = self.targets[axis] = [Target(axis, known, rested=is_at_rest)]
            target, place = Target(axis, entry, is_pressed or is_raised, since=None), len(targets)
            if later:
                after = (n for n, each in enumerate(targets) if each.since is None and each.entry in later)
                place = next(after, place)
            targets.insert(place, target)
            changed |= axis
        if image.go and entry.is_ours:
            self.unrested |= changed
        return changed

    def lose(self, entry: Entry) -> None:
        """The newest entry may act, or never: the request that moves its axes is not known."""
        for axis, targets in self.targets.items():
            if targets[-1].entry is entry:
                targets.pop()
                if targets and targets[0].since is LONG_AGO:
                    targets[0] = Target(axis, targets[0].entry)
                else:
                    targets.insert(0, Target(axis, None))

    def overtake(self, now: Moment) -> None:
        """Another client's image shows: entries that do not act yet may have acted until now, unseen."""
        for targets in self.targets.values():
            for each in targets:
                if each.since is None:
                    each.act(now)

    def forget(self) -> None:
        self.unrested = NO_AXES
        self.targets.clear()

    def see(
        self, status: RobotiqStatus, now: Moment, unsettled: Sequence[Entry], *, is_known: bool
    ) -> Finger:
        """Take in a status; return the axes that have come to rest, if their requests are known."""
        # The ``unsettled`` entries do not act yet.
        self.course.keep(status, now.time)
        rested = NO_AXES
        for axis, targets in [*self.targets.items()]:
            for each in reversed(targets):
                if each.since is not None:
                    break
                if each.entry not in unsettled:
                    each.act(now)
            _forget_old(targets, now)
            if not is_known:
                continue
            what = status.finger_status(axis)
            if what is ObjectStatus.IN_MOTION:
                # An axis at rest moves only for a new request: every later status is from after it [follows].
                if targets[0].rested:
                    del targets[0]
                continue
            rest = rest_of(targets, self._model, what, status.position(axis))
            if rest is not Rest.UNKNOWN:
                rested |= axis
            if rest is Rest.PROVEN:
                del self.targets[axis]
        rested &= self.unrested
        self.unrested &= ~rested
        return rested

    def may_move(self, status: RobotiqStatus, now: Moment) -> Finger:
        """The axes that may move, or be about to, although a status shows them at rest."""
        moving = NO_AXES
        for axis, targets in self.targets.items():
            _forget_old(targets, now)
            if may_move(targets, self._model, status.finger_status(axis), status.position(axis)):
                moving |= axis
        return moving


def _forget_old(targets: list[Target], now: Moment) -> None:
    """Drop the targets from which no status can be any more."""
    while len(targets) > 1 and (since := targets[1].since) is not None and since.is_lag_over(now):
        del targets[0]


@cache
def yields(model: Model) -> int:
    """The counts that an axis in contact may move without having moved off."""
    return max(TOLERANCE, int(PAD_MM * model.stroke.counts / model.stroke.mm))


class Contacts:
    """The place where each axis was last seen in contact, until it has moved off: these may press.

    An axis in contact whose request lies beyond the part keeps that request, and with it its grip: when
    others are held, and when rGTO rises (gDT shows no contact while rGTO is clear; the fate of a grip then is
    unknown [conceivable]). More force and a rising rGTO make it press again: for a while it shows a motion
    and stays where it is [conceivable]. Until a contact shows, or it has moved off, that is open.
    """

    def __init__(self) -> None:
        self.shown: dict[Finger, RobotiqStatus] = {}  # by axis, the newest status that shows it in contact
        self.open: Finger = NO_AXES

    def see(self, status: RobotiqStatus, contacts: Finger) -> None:
        """Take in a status with gGTO = 1, and its credible contacts."""
        before, self.open = self.shown, NO_AXES
        self.shown = dict.fromkeys(contacts, status)
        for axis in before.keys() - self.shown.keys():  # usually none
            at = before[axis].position(axis)
            if axis in status.moving and abs(status.position(axis) - at) <= yields(status.model):
                self.shown[axis] = before[axis]
                self.open |= axis

    def ask(self, axes: Finger) -> None:
        """Axes get a position request, perhaps the same: their next motion is open."""
        self.open |= axes

    def forget(self) -> None:
        """A reset and an activation end every grip."""
        self.shown = {}

    def pressing(self, status: RobotiqStatus, base: Request) -> Finger:
        """The axes that have not moved since, and whose request in ``base`` presses."""
        pressing = NO_AXES
        for axis, shown in self.shown.items():
            what, at = shown.finger_status(axis), shown.position(axis)
            is_there = abs(status.position(axis) - at) <= yields(status.model)
            if is_there and agrees(status.model, base.position(axis), what, at, direction=0):
                pressing |= axis
        return pressing


class Course:
    """Some of the statuses in which an axis moves: how far it will have gone when a write acts."""

    def __init__(self) -> None:
        # Each with the time of its request: a loop that is held up reads a reply late, and a speed from the
        # times of the replies would drive a held axis on to its request.
        self._kept: Final[deque[tuple[float, RobotiqStatus]]] = deque(
            maxlen=math.ceil(BASELINE_S / SPACING_S)
        )

    def keep(self, status: RobotiqStatus, asked: float) -> None:
        if not self._kept or asked >= self._kept[-1][0] + SPACING_S:
            self._kept.append((asked, status))

    def after(self, axis: Finger, request: int, status: RobotiqStatus, asked: float, seconds: float) -> int:
        """The position of an axis some seconds after a status, on its way to a request.

        If the axis may stand, that is the position in the status, which was requested at ``asked``.
        """
        at, since, first = status.position(axis), asked, status
        # A fault stops the axes, and gDT shows a motion.
        if axis not in status.moving or status.fault.is_serious:
            return at
        forward = 1 if request > at else -1
        for kept, each in reversed(self._kept):
            way = forward * (first.position(axis) - each.position(axis))
            if axis not in each.moving or asked - kept > BASELINE_S or way < 0:
                break
            if way:  # a jaw shows a motion for a while before it begins to move
                since, first = kept, each
        time = asked - since
        place = at if time == 0 else at + int((at - first.position(axis)) * seconds / time)
        return sorted((at, place, request))[1]
