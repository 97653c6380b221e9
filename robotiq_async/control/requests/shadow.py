"""The request that the gripper has, as far as it is known.

The gripper's requests cannot be read back whole: speed and force have no echo, a write shows a device cycle
late, and another client may write at any time. So the hand keeps a shadow of the request block. The next
image is made from it: the last image written, unless a status shows otherwise. After a reconnect an older
image may be in force; an adopted gripper's requests are known only from its status. No I/O and no clock.
"""

from __future__ import annotations

from enum import Enum
from functools import reduce
from operator import or_
from typing import Final

from ...runtime.log import Log, log
from ...values.enums import NO_AXES, Finger
from ...values.model import THREE_FINGER, Model
from ...values.request import AxisRequest, Request
from ...values.status import RobotiqStatus
from .adoption import Adoption
from .axes import Axes
from .limits import ALONE_S
from .standstill import Moment
from .writes import SILENT_S, WINDOW_S, WriteHistory

NEVER: Final = float("-inf")


class Doubt(Enum):
    """Why the image that the next one is made from cannot be relied on yet."""

    __hash__ = object.__hash__  # see State

    LOST_WRITE = "a write may have arrived that was not acknowledged: an image from before it would undo it"
    ADOPTED_AXIS = "an adopted axis has not shown its direction, or that it is at rest"


class Whose(Enum):
    """Whose request a status shows."""

    __hash__ = object.__hash__  # see State

    OURS = "ours: the write that showed last, or one after it"
    ADOPTED = "that of another client, as it was adopted"
    OLDER = "an older one of ours: the link came back, or another client wrote meanwhile"
    FOREIGN = "another client's"


class RequestShadow:
    """The image in force.

    Args:
        speed: what every axis gets until set otherwise, 0..255.
        force: what every axis gets until set otherwise, 0..255.
        model: of the gripper.
        log: of the hand.

    Attributes:
        axes: which axes have come to rest, and which grip.
        now: when the newest status was asked for. It may show the state of that time, however late a busy
            loop reads the reply; so the age of a write is measured by this.
    """

    def __init__(self, speed: int, force: int, model: Model = THREE_FINGER, *, log: Log = log) -> None:
        self._image = Request(axes=(AxisRequest(0, speed, force),) * len(model.axes), model=model)
        """The last image written, or the one that the gripper shows after a reconnect."""
        self._adoption: Adoption | None = None
        """From an adoption to the next write: makes the base of that write."""
        self._adopted = self._image
        """The request of another client at the last adoption."""
        self._writes = WriteHistory()
        self._shown: Request | None = None
        """The image of ours that the newest status shows, if any."""
        self._moved = NO_AXES
        """The axes that we have given a position since the gripper was found."""
        self.axes: Final = Axes(model, self._writes, log)
        self.now = Moment(0.0, 0)
        self._others_at = NEVER
        """When another client was last seen."""
        self._sure_at = 0.0
        """When no write was in doubt, the last time."""
        self._unsure_until = NEVER
        """Until then a write that was not acknowledged before a reconnect may show."""

    # -- what is known ---------------------------------------------------------------------------------

    @property
    def base(self) -> Request:
        """The image that the next one is made from."""
        return self._image if self._adoption is None else self._adoption.request(self._image.axes)

    @property
    def doubt(self) -> Doubt | None:
        """Why the base cannot be relied on yet; None if it can."""
        if self._writes.is_in_doubt and self.now.time - self._sure_at < SILENT_S:
            return Doubt.LOST_WRITE
        is_certain = self._adoption is None or self._adoption.is_certain
        return None if is_certain else Doubt.ADOPTED_AXIS

    def acts(self, number: int | None = None) -> bool:
        """Whether the image of this number, or a later one, acts by now; None for the last one."""
        return self._writes.acts(self._writes.last_number if number is None else number, self.now.time)

    @property
    def may_begin_to_move(self) -> bool:
        """Whether an image that does not act yet, or does not show in gDT yet, may start an axis.

        While rGTO is clear a speed or a force does not: then all writes that wait have the same echo.
        """
        if not self.acts():
            return self._image.go or not self._writes.all_look_alike
        return self.axes.resting is not Finger.ALL and self._image.go and self._adoption is None

    @property
    def ours(self) -> Finger:
        """The axes that may move because of our requests: all, unless another client's were adopted."""
        if self._adoption is None:
            return Finger.ALL
        adopted, image = self._adopted, self._image
        unchanged = (axis for axis, asked in image.by_axis if adopted.position(axis) == asked.position)
        return self._moved & reduce(or_, unchanged, NO_AXES)

    # -- what is written -------------------------------------------------------------------------------

    def writing(self, image: Request, moved: Finger, now: float) -> int:
        """Add an image that is about to be sent, with new positions for ``moved``; return its number."""
        before, self._image, self._adoption = self.base, image, None
        self._unsure_until = NEVER
        self._moved |= moved
        number = self._writes.writing(image, now)
        self.axes.ask(number, before, image, moved)
        return number

    def acknowledged(self, now: float) -> int:
        """The last image was acknowledged; returns its number."""
        self._writes.acknowledged(now)
        return self._writes.last_number

    def lost(self) -> None:
        self._image, self._adoption = self.base, None
        self._writes.lost()

    # -- what is read ----------------------------------------------------------------------------------

    def see(self, status: RobotiqStatus, asked: float) -> None:
        """Take in a status. The other methods then speak of it."""
        self.now = Moment(asked, self.now.reads + 1)
        if self._writes.last_number:
            self._shown = self._writes.see(status, asked)
            if self._shown is None and self._learn_limits(status):
                self._shown = self._writes.see(status, asked)
            if self._writes.replaced:
                self._take_limits()
        else:
            # The very first status: every write of ours comes after it.
            self._writes.restart(self._image, status.echo, asked)
        if not self._writes.is_in_doubt:
            self._sure_at = asked

    def _learn_limits(self, status: RobotiqStatus) -> bool:
        """Learn limits from a foreign echo; return whether it may be limits in place of our last requests."""
        is_alone = self.now.time - self._others_at > ALONE_S and self._adoption is None
        return is_alone and self._writes.learn_limits(status)

    def _take_limits(self) -> None:
        """Make the limits that show in place of our requests part of the base."""
        replaced, self._writes.replaced = self._writes.replaced, {}
        for axis, (request, limit) in replaced.items():
            if self._image.position(axis) == request:
                self._image = self._image.with_positions({axis: limit})
                self.axes.limit(axis, limit)

    def returned(self, status: RobotiqStatus) -> None:
        """The link is back: go on from the image of ours that shows, or adopt the gripper."""
        self._unsure_until = self.now.time + WINDOW_S
        if self._shown is None or self._shown is self._adopted:
            self._moved = NO_AXES
            self._adopt(status)
        else:
            self._image = self._writes.newest_that_shows_like(self._shown)
            self._writes.adopt(self._image, status.echo, self.now.time)

    def _adopt(self, status: RobotiqStatus) -> None:
        """Take the gripper's request from its status; write nothing."""
        self.axes.grips.forget()
        # A client that keeps writing must not make us wait anew each time.
        since = self.now if self._adoption is None else self._adoption.since
        before, self._adoption = self.base, Adoption(status, self.now, since)
        self._adopted = self.base
        self.axes.adopt(before, self._adopted)
        self._writes.adopt(self._adopted, status.echo, self.now.time)

    def identify(self) -> Whose:
        """Whose request the newest status shows; asked only of a gripper that follows requests."""
        if self._shown is None:
            return Whose.FOREIGN
        if self._adoption is None and self.now.time >= self._unsure_until:
            return Whose.OURS
        # Nothing was written since the link came back, or since another client wrote.
        return Whose.ADOPTED if self._shown is self._adopted else Whose.OLDER

    def follow(self, whose: Whose, status: RobotiqStatus) -> None:
        """Take over the request that the status shows; ``whose`` is the result of :meth:`identify`."""
        if whose is Whose.FOREIGN:
            self._others_at = self.now.time
            self._writes.limits.doubt()
            self._adopt(status)
        elif whose is Whose.ADOPTED and self._adoption is None:
            self._adopt(status)
        elif whose is Whose.ADOPTED and self._adoption is not None:
            self._adoption.see(status, self.now)
        elif whose is Whose.OLDER and self._shown is not None:
            newest = self._writes.newest_overtaken() or self._writes.newest_that_shows_like(self._shown)
            self._image, self._adoption = newest, None

    def restart(self, status: RobotiqStatus) -> bool:
        """A sequence has ended: the gripper has its last image, and no other write is under way.

        Returns:
            Whether the status shows that image. If not, another client has written meanwhile. rATR has no
            echo, so an image with rATR counts as not shown by a gripper that follows requests.
        """
        self._writes.restart(self._image, status.echo, self.now.time)
        self.axes.clear()
        return status.echo == self._image.echo and not self._image.release
