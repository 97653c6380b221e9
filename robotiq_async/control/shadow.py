"""What the gripper has been asked, as far as is known: by us, or by others before and beside us.

The next image is made from the one that the gripper has. That is the last one written, unless a status
shows otherwise: after a reconnect an older one may turn out to be in force, another client may have
written, and an adopted gripper's requests are only known from its status. No I/O and no clock.
"""

from __future__ import annotations

import math
from typing import Final

from ..enums import AXES, Finger, ObjectStatus
from ..wire.request import AxisRequest, Request
from ..wire.status import RobotiqStatus
from .adoption import TOLERANCE, Adoption, agrees
from .sequences import signature_of, signature_of_status
from .writes import SILENT_S, WINDOW_S, EchoWatch

NOBODY: Final = Finger(0)


class Ledger:
    """The image that is in force, and what is known of it."""

    def __init__(self, speed: int, force: int) -> None:
        """Know nothing yet.

        Args:
            speed: what every axis gets until set otherwise, 0..255.
            force: what every axis gets until set otherwise, 0..255.
        """
        self._image = Request(axes=(AxisRequest(0, speed, force),) * len(AXES))
        """The last image written, or the one the gripper shows after a reconnect."""
        self._adoption: Adoption | None = None
        """Set from an adoption until the first write: what the base of that write is made from."""
        self._adopted = self._image
        self._watch = EchoWatch()
        self._unsure_until = -math.inf
        """Until then a write that was not acknowledged before a reconnect may still show."""
        self._moved = NOBODY
        """Axes that we have given a position since the gripper was found."""
        self._contacts: dict[Finger, tuple[ObjectStatus, int]] = {}
        """The contacts, and where, when the go bit was last seen set: gDT is not worth reading without it."""
        self._shown: Request | None = None
        """The image of ours that the newest status shows, if it shows one."""
        self._sure_at = 0.0
        """When no write was in doubt, the last time."""
        self._asked = 0.0
        """When the newest status was asked for. What it shows may be as old as that, however late its reply
        was looked at; so this is the time that the age of a write is measured by."""

    # -- what is known ---------------------------------------------------------------------------------

    @property
    def base(self) -> Request:
        """The image that the next one is made from."""
        return self._image if self._adoption is None else self._adoption.request(self._image.axes)

    @property
    def settings(self) -> tuple[AxisRequest, ...]:
        """Speed and force of each axis, as last written."""
        return self._image.axes

    @property
    def is_certain(self) -> bool:
        """Whether the base can be relied on.

        An adopted axis takes a moment to show its direction. A write that was not acknowledged before the
        link went down may have arrived, and shows within a device cycle: what is written before that would
        take the axes back to what they were asked before it.
        """
        if self._watch.is_in_doubt and self._asked - self._sure_at < SILENT_S:
            return False
        return self._adoption is None or self._adoption.is_certain

    @property
    def is_settled(self) -> bool:
        """Whether the last image acts."""
        return self._watch.is_settled(self._asked)

    @property
    def ours(self) -> Finger:
        """The axes that may move because we said so: all, unless somebody else's requests were adopted."""
        if self._adoption is None:
            return Finger.ALL
        mask = NOBODY
        for axis in AXES:
            if axis in self._moved and self._adopted.position(axis) == self._image.position(axis):
                mask |= axis
        return mask

    def acts(self, number: int) -> bool:
        """Whether the image of this number acts."""
        return self._watch.acts(number, self._asked)

    # -- what is written -------------------------------------------------------------------------------

    def writing(self, image: Request, moved: Finger, now: float) -> int:
        """An image is about to be sent, with new positions for some axes; returns the number it goes by."""
        self._image = image
        self._adoption = None
        self._unsure_until = -math.inf
        self._moved |= moved
        for axis in AXES:
            if axis in moved:
                self._contacts.pop(axis, None)
        return self._watch.writing(image, now)

    def acknowledged(self, now: float) -> int:
        """The last image was acknowledged; returns its number."""
        self._watch.acknowledged(now)
        return self._watch.last_number

    def lost(self) -> None:
        """The link is down: what others do meanwhile is not seen."""
        self._adoption = None
        self._watch.lost()

    # -- what is read ----------------------------------------------------------------------------------

    def read(self, status: RobotiqStatus, asked: float) -> None:
        """Take in a status that was asked for at a time; what follows is about it."""
        self._asked = asked
        if self._watch.last_number:
            self._shown = self._watch.observe(status, asked)
        else:
            # The very first: not ours, but what any write of ours comes after.
            self._watch.restart(self._image, signature_of_status(status), asked)
        if not self._watch.is_in_doubt:
            self._sure_at = asked

    def found(self, status: RobotiqStatus) -> None:
        """The link was lost and is back, and the gripper follows requests: ours, or it is adopted."""
        self._unsure_until = self._asked + WINDOW_S
        if self._shown is None or self._shown is self._adopted:
            self._moved = NOBODY
            self.adopt(status)
        else:
            self._image = self._watch.newest_that_shows_like(self._shown)
            self._watch.adopt(self._image, signature_of_status(status), self._asked)

    def adopt(self, status: RobotiqStatus) -> None:
        """Take the gripper as it is, without writing."""
        self._contacts.clear()
        # Who writes again and again must not make us wait again and again.
        since = self._asked if self._adoption is None else self._adoption.since
        self._adoption = Adoption(status, self._asked, since)
        self._adopted = self.base
        self._watch.adopt(self._adopted, signature_of_status(status), self._asked)

    def compare(self, status: RobotiqStatus) -> bool:
        """Look at a status of a gripper that follows our requests; False if it follows somebody else's."""
        shown = self._shown
        if shown is None:
            return False
        if self._adoption is not None and shown is self._adopted:
            self._adoption.watch(status, self._asked)
        elif self._asked < self._unsure_until and shown is self._adopted:
            self.adopt(status)
        elif self._adoption is not None or self._asked < self._unsure_until:
            # Nothing was written since the link came back, or since another client wrote, and now an older
            # write of ours shows: go on from it.
            self._image, self._adoption = self._watch.newest_that_shows_like(shown), None
        return True

    def note_contacts(self, status: RobotiqStatus) -> None:
        """Remember which axes grip, as long as that can be seen."""
        if status.go_echo:
            contacts = status.contacts
            self._contacts = (
                {
                    axis: (status.finger_status(axis), status.position(axis))
                    for axis in AXES
                    if axis in contacts
                }
                if contacts
                else {}
            )

    def gripping(self, status: RobotiqStatus) -> Finger:
        """The axes that gripped when rGTO was last set, are there still, and by the request they have."""
        mask, base = NOBODY, self.base
        for axis, (what, at) in self._contacts.items():
            is_there = abs(status.position(axis) - at) <= TOLERANCE
            if is_there and agrees(base.position(axis), what, at, direction=0):
                mask |= axis
        return mask

    def forget_contacts(self) -> None:
        """A sequence begins: it lets go."""
        self._contacts.clear()

    def is_echoed_by(self, status: RobotiqStatus) -> bool:
        """Whether a status shows the last image."""
        return signature_of_status(status) == signature_of(self._image)

    def restart(self, status: RobotiqStatus) -> None:
        """A sequence is over: what it wrote last is what the gripper has, and nothing else is on its way.

        If the status shows something else, another client has written meanwhile.
        """
        self._watch.restart(self._image, signature_of_status(status), self._asked)
