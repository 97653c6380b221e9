"""Which axes have come to rest under the position that they were asked last."""

from __future__ import annotations

from typing import Final

from ...runtime.log import Log
from ...values.enums import NO_AXES, Finger, ObjectStatus
from ...values.model import Model
from ...values.request import Request
from ...values.status import RobotiqStatus
from .standstill import Moment, Standstill
from .writes import WriteHistory


class Arrivals:
    """Follows each axis from the write that asks it for something to the status that shows it at rest.

    Attributes:
        axes: those that are known to rest, and those that the model lacks. The others move, or are about to,
            or the object status that they show may be from before the write.
        limited: what the gripper shows in place of requests that lie beyond a software limit.
    """

    def __init__(self, model: Model, writes: WriteHistory, log: Log) -> None:
        self.axes: Finger = Finger.ALL
        self.limited: dict[Finger, int] = {}
        self._writes: Final = writes
        self._log: Final = log
        self._standstill = {axis: Standstill(model) for axis in model.axes}

    def ask(self, number: int, before: Request, image: Request, moved: Finger) -> None:
        """A write replaces ``before`` by ``image``, which gives the axes in ``moved`` a position."""
        self.limited = {axis: at for axis, at in self.limited.items() if axis not in moved}
        raised = image.go and not before.go
        for axis, old, new in zip(image.model.axes, before.axes, image.axes, strict=True):
            # More force lets an axis in contact try again; one that moves goes on as it did.
            pressed = new.force > old.force
            is_new = image.go is not before.go or new.position != old.position
            if is_new or (pressed and axis in self.axes):
                self._standstill[axis].ask(
                    number,
                    new.position if image.go else None,
                    before=old.position if before.go else None,
                    again=raised or pressed,
                    rested=axis in self.axes and before.go,
                )
                if image.go:
                    self.axes &= ~axis

    def limit(self, axis: Finger, limit: int) -> None:
        """The last request of an axis was replaced by a software limit."""
        self._standstill[axis].limit(limit)
        self.limited[axis] = limit

    def clear(self) -> None:
        """Every axis rests, and nothing that was asked before counts."""
        self.axes = Finger.ALL
        for standstill in self._standstill.values():
            standstill.clear()

    def see(self, status: RobotiqStatus, now: Moment) -> None:
        """Take in a status that shows rGTO set: without it the object status says nothing."""
        if self.axes is Finger.ALL:
            return  # the usual case
        for axis in self._standstill:
            if not axis & self.axes:
                standstill, what = self._seen(axis, status, now), status.finger_status(axis)
                if standstill.is_known(what, status.position(axis)):
                    self.axes |= axis
                    self._prove_limit(axis, what, status.position(axis))

    def doubtful(self, status: RobotiqStatus, now: Moment) -> Finger:
        """The axes that may move, or be about to, although the status shows them at rest."""
        doubtful = NO_AXES
        for axis in self._standstill:
            standstill = self._seen(axis, status, now)
            if standstill.is_doubtful(status.finger_status(axis), status.position(axis)):
                doubtful |= axis
        return doubtful

    def _seen(self, axis: Finger, status: RobotiqStatus, now: Moment) -> Standstill:
        standstill, writes = self._standstill[axis], self._writes
        standstill.see(
            status.finger_status(axis),
            lambda number: writes.acts(number, now.time),
            lambda number: writes.is_old(number, now.time),
            now,
        )
        return standstill

    def _prove_limit(self, axis: Finger, what: ObjectStatus, position: int) -> None:
        if axis in self.limited and what is ObjectStatus.AT_POSITION:
            limit = self._writes.limits.prove(axis, position)
            if limit is not None:
                self._log.info("the gripper replaces requests of %s by its limit %d", axis, limit)
