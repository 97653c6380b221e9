"""What the gripper has been asked, as far as is known: by us, or by others before and beside us.

The next image is made from the one that the gripper has. That is the last one written, unless a status
shows otherwise: after a reconnect an older one may turn out to be in force, another client may have
written, and an adopted gripper's requests are only known from its status. No I/O and no clock.
"""

from __future__ import annotations

from dataclasses import replace
from functools import reduce
from operator import or_
from typing import Final

from ...runtime.log import Log, log
from ...values.enums import AXES, NO_AXES, Finger, ObjectStatus
from ...values.request import AxisRequest, Request
from ...values.status import RobotiqStatus
from ...values.trigger import Trigger
from ..contact import TOLERANCE, agrees
from ..triggers import classify
from .adoption import Adoption
from .limits import ALONE_S
from .standstill import Moment, Standstill
from .writes import SILENT_S, WINDOW_S, WriteHistory

NEVER: Final = float("-inf")


class RequestShadow:
    """The image that is in force, and what is known of it."""

    def __init__(self, speed: int, force: int, *, log: Log = log) -> None:
        """Know nothing yet.

        Args:
            speed: what every axis gets until set otherwise, 0..255.
            force: what every axis gets until set otherwise, 0..255.
            log: of the hand.
        """
        self._log = log
        self._image = Request(axes=(AxisRequest(0, speed, force),) * len(AXES))
        """The last image written, or the one the gripper shows after a reconnect."""
        self._adoption: Adoption | None = None
        """From an adoption until the first write: what the base of that write is made from."""
        self._adopted = self._image
        """What others had asked at the last adoption."""
        self._writes = WriteHistory()
        self._shown: Request | None = None
        """The image of ours that the newest status shows, if it shows one."""
        self._moved = NO_AXES
        """Axes that we have given a position since the gripper was found."""
        self._contacts: dict[Finger, tuple[ObjectStatus, int]] = {}
        """The contacts, and where, when the go bit was last seen set: gDT is not worth reading without it."""
        self.arrived = Finger.ALL
        """Axes that are known to rest under the position that they were asked last; the others move, or are
        about to, or what is shown of them may be from before."""
        self._standstill = {axis: Standstill() for axis in AXES}
        self._reads = 0
        self.limited: dict[Finger, int] = {}
        """What the gripper shows in place of requests of ours that lie beyond a software limit."""
        self._others_at = NEVER
        self.asked = 0.0
        """When the newest status was asked for. What it shows may be as old as that, however late its reply
        was looked at; so this is the time that the age of a write is measured by."""
        self._sure_at = 0.0
        """When no write was in doubt, the last time."""
        self._unsure_until = NEVER
        """Until then a write that was not acknowledged before a reconnect may still show."""

    # -- what is known ---------------------------------------------------------------------------------

    @property
    def base(self) -> Request:
        """The image that the next one is made from."""
        return self._image if self._adoption is None else self._adoption.request(self._image.axes)

    def at_rest(self, status: RobotiqStatus) -> Request:
        """The base with rGTO clear and every axis asked to be where it is: nothing to wake."""
        return replace(self.base, go=False).with_positions({axis: status.position(axis) for axis in AXES})

    def may_go(self, status: RobotiqStatus) -> bool:
        """Whether rGTO is set, or an image that does not act yet may set it."""
        return status.go_echo or not self.is_settled

    def last_image(self, status: RobotiqStatus) -> Request | None:
        """The image to leave the gripper with; None when there is nothing to stop."""
        if classify(status) is Trigger.SEEN_READY and not self.is_ours(status):
            self.adopt(status)
        if not self.may_go(status):
            return None
        # A gripper that lost its activation unnoticed must not be activated by our shutdown, nor one
        # that a reset of ours is just about to reach; and one that others have activated not be reset.
        active = status.activation_echo and (self.base.activate or self.is_settled)
        return replace(self.base, activate=active, go=False)

    @property
    def speeds(self) -> dict[Finger, int]:
        """The speed of each axis, as last written."""
        return {axis: request.speed for axis, request in zip(AXES, self._image.axes, strict=True)}

    @property
    def is_certain(self) -> bool:
        """Whether the base can be relied on.

        An adopted axis takes a moment to show its direction, or that it is at rest. A write that was not
        acknowledged before the link went down may have arrived, and shows within a device cycle: what is
        written before that would take the axes back to what they were asked before it.
        """
        return not self._is_in_doubt and (self._adoption is None or self._adoption.is_certain)

    @property
    def is_adoption_late(self) -> bool:
        """Whether nothing but an adopted axis keeps the base from being certain."""
        return not self._is_in_doubt and self._adoption is not None and not self._adoption.is_certain

    @property
    def _is_in_doubt(self) -> bool:
        return self._writes.is_in_doubt and self.asked - self._sure_at < SILENT_S

    def is_ready(self, status: RobotiqStatus, *, moves: bool) -> bool:
        """Whether the next image can be made from the base now.

        Args:
            status: the newest status.
            moves: whether it is to set an axis going: after a halt that waits until it has acted, for only
                then it is known where the fingers stopped.
        """
        stopping = not self.base.go and status.go_echo and not self.is_settled
        return self.is_certain and not (moves and stopping)

    @property
    def is_settled(self) -> bool:
        """Whether the last image acts."""
        return self.acts(self._writes.last_number)

    @property
    def may_begin_to_move(self) -> bool:
        """Whether an image that does not act yet, or does not show in gDT, may set something in motion.

        While rGTO is clear a speed or a force does not: they have no echo, so all that waits looks alike.
        """
        if not self.is_settled:
            return self._image.go or not self._writes.all_look_alike
        return self.arrived is not Finger.ALL and self._image.go and self._adoption is None

    @property
    def ours(self) -> Finger:
        """The axes that may move because we said so: all, unless somebody else's requests were adopted."""
        if self._adoption is None:
            return Finger.ALL
        adopted, image = self._adopted, self._image
        unchanged = (axis for axis in AXES if adopted.position(axis) == image.position(axis))
        return self._moved & reduce(or_, unchanged, NO_AXES)

    def acts(self, number: int) -> bool:
        """Whether the image of this number acts."""
        return self._writes.acts(number, self.asked)

    # -- what is written -------------------------------------------------------------------------------

    def writing(self, image: Request, moved: Finger, now: float) -> int:
        """An image is about to be sent, with new positions for some axes; returns the number it goes by."""
        before, self._image, self._adoption = self.base, image, None
        self._unsure_until = NEVER
        self._moved |= moved
        self._contacts = {axis: at for axis, at in self._contacts.items() if axis not in moved}
        self.limited = {axis: at for axis, at in self.limited.items() if axis not in moved}
        number = self._writes.writing(image, now)
        self._ask(number, before, image)
        return number

    def _ask(self, number: int, before: Request, image: Request) -> None:
        """Note which axes are asked for something else than before; what gDT says of them may be late."""
        raised = image.go and not before.go
        for axis, old, new in zip(AXES, before.axes, image.axes, strict=True):
            # More force lets an axis in contact try again; one that moves goes on as it did.
            pressed = new.force > old.force
            is_new = image.go is not before.go or new.position != old.position
            if is_new or (pressed and axis in self.arrived):
                self._standstill[axis].ask(
                    number,
                    new.position if image.go else None,
                    before=old.position if before.go else None,
                    again=raised or pressed,
                    rested=axis in self.arrived and before.go,
                )
                if image.go:
                    self.arrived &= ~axis

    def acknowledged(self, now: float) -> int:
        """The last image was acknowledged; returns its number."""
        self._writes.acknowledged(now)
        return self._writes.last_number

    def lost(self) -> None:
        """The link is down: what others do meanwhile is not seen."""
        self._image, self._adoption = self.base, None
        self._writes.lost()

    # -- what is read ----------------------------------------------------------------------------------

    def see(self, status: RobotiqStatus, asked: float) -> None:
        """Take in a status and when it was asked for; what follows is about it."""
        self.asked = asked
        self._reads += 1
        if self._writes.last_number:
            self._shown = self._writes.see(status, asked)
            if self._shown is None and self._suspects_limits(status):
                self._shown = self._writes.see(status, asked)
            if self._writes.replaced:
                self._take_limits()
        else:
            # The very first: not ours, but what any write of ours comes after.
            self._writes.restart(self._image, status.echo, asked)
        if not self._writes.is_in_doubt:
            self._sure_at = asked

    def _suspects_limits(self, status: RobotiqStatus) -> bool:
        """Whether what is not ours may be limits in place of our last requests."""
        is_alone = self.asked - self._others_at > ALONE_S and self._adoption is None
        return is_alone and self._writes.suspect_limits(status)

    def _take_limits(self) -> None:
        """What is shown in place of our requests is what the axes are asked from here on."""
        replaced, self._writes.replaced = self._writes.replaced, {}
        for axis, (request, limit) in replaced.items():
            if self._image.position(axis) == request:
                self._image = self._image.with_positions({axis: limit})
                self._standstill[axis].limit(limit)
                self.limited[axis] = limit

    def see_others(self) -> None:
        """Another client was seen."""
        self._others_at = self.asked
        self._writes.limits.doubt()

    def returned(self, status: RobotiqStatus) -> None:
        """The link was lost and is back, and the gripper follows requests: ours, or it is adopted."""
        self._unsure_until = self.asked + WINDOW_S
        if self._shown is None or self._shown is self._adopted:
            self._moved = NO_AXES
            self.adopt(status)
        else:
            self._image = self._writes.newest_that_shows_like(self._shown)
            self._writes.adopt(self._image, status.echo, self.asked)

    def adopt(self, status: RobotiqStatus) -> None:
        """Take the gripper as it is, without writing."""
        self._contacts.clear()
        # Who writes again and again must not make us wait again and again.
        since = self.moment if self._adoption is None else self._adoption.since
        self._adoption = Adoption(status, self.moment, since)
        self._adopted = self.base
        self._writes.adopt(self._adopted, status.echo, self.asked)

    def is_ours(self, status: RobotiqStatus) -> bool:
        """Whether a gripper that follows requests follows ours, and not those of somebody else."""
        shown = self._shown
        if shown is None:
            return False
        if self._adoption is not None and shown is self._adopted:
            self._adoption.see(status, self.moment)
        elif self.asked < self._unsure_until and shown is self._adopted:
            self.adopt(status)
        elif self._adoption is not None or self.asked < self._unsure_until:
            # Nothing was written since the link came back, or since another client wrote, and now an older
            # write of ours shows: go on from it.
            self._image, self._adoption = self._writes.newest_that_shows_like(shown), None
        return True

    def restart(self, status: RobotiqStatus) -> bool:
        """A sequence is over: what it wrote last is what the gripper has, and nothing else is on its way.

        Returns:
            Whether the status shows that. If not, another client has written meanwhile. rATR has no echo; a
            gripper that follows requests does not follow that one.
        """
        self._writes.restart(self._image, status.echo, self.asked)
        self.arrived = Finger.ALL
        for standstill in self._standstill.values():
            standstill.clear()
        return status.echo == self._image.echo and not self._image.release

    def see_arrivals(self, status: RobotiqStatus) -> None:
        """Remember which axes have come to rest, from a status of a gripper that has no fault.

        In a fault an axis that has not begun yet is at rest, too.
        """
        if self.arrived is Finger.ALL or not status.go_echo:
            return  # quickly: this runs at every poll
        now = self.moment
        for axis in AXES:
            if axis not in self.arrived:
                standstill = self._standstill[axis]
                what = status.finger_status(axis)
                standstill.see(what, self.acts, self._is_old, now)
                if standstill.is_known(what, status.position(axis)):
                    self.arrived |= axis
                    self._prove_limit(axis, what, status.position(axis))

    def _prove_limit(self, axis: Finger, what: ObjectStatus, position: int) -> None:
        if axis in self.limited and what is ObjectStatus.AT_POSITION:
            limit = self._writes.limits.prove(axis, position)
            if limit is not None:
                self._log.info("the gripper replaces requests of %s by its limit %d", axis, limit)

    def doubtful(self, status: RobotiqStatus) -> Finger:
        """The axes that may move, or be about to, although they are shown at rest."""
        doubtful, now = NO_AXES, self.moment
        for axis, standstill in self._standstill.items():
            what = status.finger_status(axis)
            standstill.see(what, self.acts, self._is_old, now)
            if standstill.is_doubtful(what, status.position(axis)):
                doubtful |= axis
        return doubtful

    def _is_old(self, number: int) -> bool:
        return self._writes.is_old(number, self.asked)

    @property
    def moment(self) -> Moment:
        """When the newest status was asked for, and how many have been read."""
        return Moment(self.asked, self._reads)

    # -- grips -----------------------------------------------------------------------------------------

    def see_contacts(self, status: RobotiqStatus) -> None:
        """Remember which axes grip, as long as that can be seen."""
        if status.go_echo and (self._contacts or status.contacts):
            contacts = status.contacts
            if self.arrived is not Finger.ALL and contacts & ~self.arrived:
                contacts &= ~self.doubtful(status)
            self._contacts = {
                axis: (status.finger_status(axis), status.position(axis)) for axis in AXES if axis in contacts
            }

    def gripping(self, status: RobotiqStatus) -> Finger:
        """The axes that gripped when rGTO was last set, are there still, and by the request they have."""
        base = self.base
        gripping = (
            axis
            for axis, (what, at) in self._contacts.items()
            if abs(status.position(axis) - at) <= TOLERANCE
            and agrees(base.position(axis), what, at, direction=0)
        )
        return reduce(or_, gripping, NO_AXES)

    def forget_contacts(self) -> None:
        """A sequence begins: it lets go."""
        self._contacts.clear()
