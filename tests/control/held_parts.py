"""Random lives are judged by what the fingers do and hold, whatever a status shows of it."""

from __future__ import annotations

from collections import Counter
from typing import Any

from robotiq_async import Finger, ObjectStatus, RobotiqStatus, State
from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values.model import TOLERANCE
from robotiq_async.values.request import Request
from tests.control.scan import Scan


class HeldParts:
    """The axes that press against something, from the first status that shows it until they move off.

    A finger that presses again, after more force or a halt, shows a motion for a while: it holds the part.
    """

    def __init__(self, gripper: SimulatedGripper) -> None:
        self._gripper = gripper
        self._contacts: dict[Finger, tuple[int, bool]] = {}
        """For each axis the place of its contact, and whether it was closing."""

    def look(self, shown: RobotiqStatus) -> None:
        """Take in a status, and where the fingers really are."""
        asked, grips = self._asked(), self._gripper.grips
        for axis in self._gripper.model.axes:
            status, place = shown.finger_status(axis), self._gripper.position(axis)
            if axis in grips and status.is_contact:
                self._contacts[axis] = place, status is ObjectStatus.CONTACT_CLOSING
            elif axis in self._contacts and abs(place - self._contacts[axis][0]) > TOLERANCE:
                del self._contacts[axis]
            if axis in self._contacts and not self._is_beyond(axis, asked.position(axis)):
                del self._contacts[axis]

    def ask(self, axes: Finger, position: int) -> None:
        """The user asks for a position, which may let go."""
        for axis in [axis for axis in self._contacts if axis in axes]:
            if not self._is_beyond(axis, position):
                del self._contacts[axis]

    def forget(self, axes: Finger) -> None:
        """Something may take the part from these axes."""
        self._contacts = {axis: at for axis, at in self._contacts.items() if axis not in axes}

    def loosened(self, image: Request) -> list[tuple[Finger, int]]:
        """The axes that hold something and get another position by an image, and that position."""
        before = self._asked()
        changed = [axis for axis in self._contacts if image.position(axis) != before.position(axis)]
        return [(axis, image.position(axis)) for axis in changed if image.go]

    def _asked(self) -> Request:
        return Request.from_registers(self._gripper.request_registers, self._gripper.model)

    def _is_beyond(self, axis: Finger, position: int) -> bool:
        """Whether a request keeps an axis pressing where it is."""
        place, closing = self._contacts[axis]
        return position > place + TOLERANCE if closing else position < place - TOLERANCE


class JudgedScan(Scan):
    """Judged by the true motion and the true grips.

    Attributes:
        parts: what is held.
        asked: number of requests of the user for an axis to go to a position.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.parts = HeldParts(self.gripper)
        self.asked: Counter[tuple[Finger, int]] = Counter()

    def ask(self, axes: Finger, position: int) -> None:
        """Take note of a request of the user, which may let go of a part."""
        self.asked.update((axis, position) for axis in self.gripper.model.axes if axis in axes)
        self.parts.ask(axes, position)

    def status(self) -> RobotiqStatus:
        shown = super().status()
        self.parts.look(shown)
        return shown

    def decide(self) -> Request | None:
        image = super().decide()
        loosened = [] if image is None else self.parts.loosened(image)
        assert all(self.asked[each] for each in loosened), f"a grip is loosened: {loosened}"
        return image

    def step(self, **options: Any) -> None:
        super().step(**options)
        is_known = not self.lag_s and self.state not in (State.DISCONNECTED, State.SHUTDOWN)
        if is_known and self.gripper.is_moving:
            assert self.controller.is_moving, "a finger moves, and is_moving is False"
