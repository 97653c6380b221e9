"""Which axes grip, and where: remembered, because gDT shows a contact only while rGTO is set."""

from __future__ import annotations

from functools import reduce
from operator import or_

from ...values.enums import NO_AXES, Finger, ObjectStatus
from ...values.model import TOLERANCE
from ...values.request import Request
from ...values.status import RobotiqStatus
from ..contact import agrees


class Grips:
    """The contacts when rGTO was last seen set. Empty at first; false while it is empty."""

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
