"""The requests of another client for each axis, as far as the status shows them.

The hand adopts an active gripper without writing. Its first write carries a request for every axis, and the
axes that it does not address must neither move nor let go. Their requests are known only from the status, and
the echo can mislead: under simple control B, C and the scissor follow other registers than those echoed as
theirs. docs/decisions/adoption.md has the rules.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from ..values.enums import CLOSED, OPEN, Finger, ObjectStatus
from ..values.request import AxisRequest, Request
from ..values.status import RobotiqStatus
from .rest import Moment, agrees

DIRECTION_WAIT_S: Final = 0.1
"""Time in which a moving axis shows its direction: at the slowest speed a count takes 43 ms
(234 counts in 10.0 s; thesis, table A1.1)."""


class Adoption(NamedTuple):
    """The requests of an adopted gripper, as it shows them until the hand writes its own first image."""

    since: Moment  # from then on a moving axis has time to show its direction, and a late gDT to come
    first: RobotiqStatus
    latest: RobotiqStatus
    now: Moment  # when the latest status was requested

    @property
    def is_certain(self) -> bool:
        """Whether the request made from the status can be relied on."""
        status, moving = self.latest, self.latest.moving
        # A moving axis must have shown its direction, or have had the time to.
        has_time = self.now.time - self.since.time < DIRECTION_WAIT_S
        if has_time and not all(self._direction(axis) for axis in moving):
            return False
        # An axis at rest must agree with its echo; if it does not, its gDT may be from before that request,
        # and gets time to come. Under simple control some never agree. Speed has no echo, so a slow start
        # cannot be told from a contradiction but by its time [vendor].
        at_rest = (axis for axis in status.model.axes if axis not in moving)
        return (
            self.since.is_lag_over(self.now)
            or not status.go_echo
            or all(self._agrees(axis, status.requested_position(axis)) for axis in at_rest)
        )

    def request(self, settings: Sequence[AxisRequest]) -> Request:
        """The image that changes nothing, with speed and force from ``settings``: they have no echo."""
        status = self.latest
        return Request(
            activate=status.activation_echo,
            go=status.go_echo,
            mode=status.mode,
            axes=tuple(
                AxisRequest(self._position(axis), setting.speed, setting.force)
                for axis, setting in zip(status.model.axes, settings, strict=True)
            ),
            model=status.model,
        )

    def _position(self, axis: Finger) -> int:
        """The request to repeat: the echo that agrees, else one that keeps the contact or the position."""
        status, position = self.latest, self.latest.position(axis)
        if not status.go_echo:
            return position  # it stands [manual 2014, p. 50], and the next rGTO = 1 must not move it
        # Under simple control the fingers B and C follow the registers of A [manual 2014, pp. 45, 47].
        for register in (axis, Finger.A) if axis in Finger.B | Finger.C else (axis,):
            requested = status.requested_position(register)
            if self._agrees(axis, requested):
                return requested
        # No echo explains the contact: press on in its direction, so that the grip is not given up.
        match status.finger_status(axis):
            case ObjectStatus.CONTACT_CLOSING:
                return CLOSED
            case ObjectStatus.CONTACT_OPENING:
                return OPEN
        return position

    def _agrees(self, axis: Finger, request: int) -> bool:
        status = self.latest
        return agrees(
            status.model, request, status.finger_status(axis), status.position(axis), self._direction(axis)
        )

    def _direction(self, axis: Finger) -> int:
        """Counts the axis has moved since the first status: above 0 closing, below 0 opening, 0 unknown."""
        return self.latest.position(axis) - self.first.position(axis)
