"""Which axes have come to rest under the position that they were asked last, and which of them grip."""

from __future__ import annotations

from functools import reduce
from operator import or_
from typing import Final

from ...runtime.log import Log
from ...values.enums import NO_AXES, Finger, ObjectStatus
from ...values.model import TOLERANCE, Model
from ...values.request import Request
from ...values.status import RobotiqStatus
from ..contact import agrees
from .standstill import Moment, Standstill
from .writes import WriteHistory


class Grips:
    """The contacts when rGTO was last seen set: gDT shows none while it is clear. False while it is empty."""

    def __init__(self) -> None:
        self._contacts: dict[Finger, tuple[ObjectStatus, int]] = {}

    def __bool__(self) -> bool:
        return bool(self._contacts)

    def see(self, status: RobotiqStatus, contacts: Finger) -> None:
        """Remember the axes that are in contact in a status that shows rGTO set."""
        self._contacts = {axis: (status.finger_status(axis), status.position(axis)) for axis in contacts}

    def forget(self, axes: Finger = Finger.ALL) -> None:
        """Forget the grips of some axes, which are asked to move or let go."""
        self._contacts = {axis: at for axis, at in self._contacts.items() if axis not in axes}

    def held(self, status: RobotiqStatus, base: Request) -> Finger:
        """The axes that gripped when rGTO was last set, have not moved since, and by ``base`` still grip."""
        held = (
            axis
            for axis, (what, at) in self._contacts.items()
            if abs(status.position(axis) - at) <= TOLERANCE
            and agrees(status.model, base.position(axis), what, at, direction=0)
        )
        return reduce(or_, held, NO_AXES)


class Axes:
    """Follows each axis from the write that asks it for something to the status that shows it at rest.

    An axis at rest where it was asked to be has come to rest, whatever the age of its object status. The
    status of that motion may still come: moving, and at position once more. Until it cannot, the rest is not
    proven, and a motion that is seen does not show that the next request acts.

    Attributes:
        resting: those that are known to rest, and those that the model lacks. The others move, or are about
            to, or the object status that they show may be from before the write.
        limited: what the gripper shows in place of requests that lie beyond a software limit.
        grips: which axes grip.
    """

    def __init__(self, model: Model, writes: WriteHistory, log: Log) -> None:
        self.resting: Finger = Finger.ALL
        self.limited: dict[Finger, int] = {}
        self.grips: Final = Grips()
        self._proven: Finger = Finger.ALL
        """Those of the resting axes that no status from before their rest can show any more."""
        self._writes: Final = writes
        self._log: Final = log
        self._standstill = {axis: Standstill(model) for axis in model.axes}

    def ask(self, number: int, before: Request, image: Request, moved: Finger) -> None:
        """A write replaces ``before`` by ``image``, which gives the axes in ``moved`` a position."""
        self.grips.forget(moved)
        self.limited = {axis: at for axis, at in self.limited.items() if axis not in moved}
        raised = image.go and not before.go
        for axis, old, new in zip(image.model.axes, before.axes, image.axes, strict=True):
            # More force lets an axis in contact try again; one that moves goes on as it did.
            pressed = new.force > old.force
            is_new = image.go is not before.go or new.position != old.position
            if is_new or (pressed and axis in self.resting):
                self._standstill[axis].ask(
                    number,
                    new.position if image.go else None,
                    before=old.position if before.go else None,
                    again=raised or pressed,
                    rested=axis in self._proven and before.go,
                )
                self._proven &= ~axis
                if image.go:
                    self.resting &= ~axis

    def adopt(self, before: Request, adopted: Request) -> None:
        """Another client replaces ``before`` by ``adopted``.

        Without rGTO before, nothing is known that its request could contradict: no contact is doubted then.
        """
        for axis, old, new in zip(adopted.model.axes, before.axes, adopted.axes, strict=True):
            if adopted.go is not before.go or new.position != old.position:
                position = new.position if adopted.go else None
                known = old.position if before.go else position
                self._standstill[axis].ask(0, position, before=known, again=False, rested=False)
                self._proven &= ~axis

    def limit(self, axis: Finger, limit: int) -> None:
        """The last request of an axis was replaced by a software limit."""
        self._standstill[axis].limit(limit)
        self.limited[axis] = limit

    def clear(self) -> None:
        """Every axis rests, and nothing that was asked before counts."""
        self.resting = self._proven = Finger.ALL
        for standstill in self._standstill.values():
            standstill.clear()

    def see(self, status: RobotiqStatus, now: Moment) -> None:
        """Take in a status. Not one with a fault: it keeps axes from starting."""
        if not status.go_echo:
            return  # gDT says nothing without rGTO
        if self._proven is not Finger.ALL:  # usually it is
            self._see_rest(status, now)
        if self.grips or status.contacts:
            contacts = status.contacts
            if contacts & ~self.resting:
                contacts &= ~self.doubtful(status, now)
            self.grips.see(status, contacts)

    def _see_rest(self, status: RobotiqStatus, now: Moment) -> None:
        for axis in self._standstill:
            if not axis & self._proven:
                what = status.finger_status(axis)
                standstill = self._seen(self._standstill[axis], what, now)
                if not axis & self.resting and standstill.is_known(what, status.position(axis)):
                    self.resting |= axis
                    self._prove_limit(axis, what, status.position(axis))
                if axis & self.resting and standstill.is_proven(what, status.position(axis)):
                    self._proven |= axis

    def doubtful(self, status: RobotiqStatus, now: Moment) -> Finger:
        """The axes that may move, or be about to, although the status shows them at rest."""
        doubtful = NO_AXES
        for axis, standstill in self._standstill.items():
            what = status.finger_status(axis)
            seen = self._seen(standstill.copy(), what, now)  # a question: it takes no status in
            if seen.is_doubtful(what, status.position(axis)):
                doubtful |= axis
        return doubtful

    def _seen(self, standstill: Standstill, what: ObjectStatus, now: Moment) -> Standstill:
        writes = self._writes
        standstill.see(
            what,
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
