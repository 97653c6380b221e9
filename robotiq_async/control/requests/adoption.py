"""What an axis is asked to do, when somebody else asked it.

The hand adopts an active gripper without writing. Its first write then carries a request for every axis,
and the axes it does not address must neither move nor let go. What they were asked can only be read off
the status, and the echoes can mislead: under simple control B, C and the scissor follow other registers
than the ones that are echoed as theirs. The rules are those of docs/decisions/adoption.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from ...enums import AXES, CLOSED, OPEN, Finger, ObjectStatus
from ...wire.request import AxisRequest, Request
from ...wire.status import RobotiqStatus
from ..contact import agrees

DIRECTION_WAIT_S: Final = 0.1
"""How long a moving axis is watched for its direction: at the slowest speed a count takes 43 ms
(234 counts in 10.0 s; thesis, table A1.1)."""


class Adoption:
    """Watches an adopted gripper until the hand writes its own first image."""

    def __init__(self, first: RobotiqStatus, asked: float | None = None, since: float | None = None) -> None:
        """Begin with the first status after the adoption.

        Args:
            first: the status.
            asked: when it was asked for, in monotonic seconds; None for the time of the reply.
            since: from when the time counts that a moving axis is given to show its direction; None for
                the same time.
        """
        self._first = first
        self._latest = first
        self._asked = first.timestamp if asked is None else asked
        self.since = self._asked if since is None else since

    def see(self, status: RobotiqStatus, asked: float | None = None) -> None:
        """Take in the next status, and when it was asked for."""
        self._latest = status
        self._asked = status.timestamp if asked is None else asked

    @property
    def is_certain(self) -> bool:
        """Whether every moving axis has shown its direction, or has had the time to."""
        if self._asked - self.since >= DIRECTION_WAIT_S:
            return True
        return all(self._direction(axis) for axis in AXES if axis in self._latest.moving)

    def request(self, settings: Sequence[AxisRequest]) -> Request:
        """The image that changes nothing about the gripper.

        Args:
            settings: where speed and force of each axis come from; they have no echo.
        """
        status = self._latest
        return Request(
            activate=status.activation_echo,
            go=status.go_echo,
            mode=status.mode,
            axes=tuple(
                AxisRequest(self._position(axis), setting.speed, setting.force)
                for axis, setting in zip(AXES, settings, strict=True)
            ),
        )

    def _position(self, axis: Finger) -> int:
        """The request an axis has."""
        status = self._latest
        position = status.position(axis)
        if not status.go_echo:
            return position
        candidates = [status.requested_position(axis)]
        if axis in Finger.B | Finger.C:
            candidates.append(status.requested_position(Finger.A))
        for request in candidates:
            if agrees(request, status.finger_status(axis), position, self._direction(axis)):
                return request
        match status.finger_status(axis):
            case ObjectStatus.CONTACT_CLOSING:
                return CLOSED
            case ObjectStatus.CONTACT_OPENING:
                return OPEN
        return position

    def _direction(self, axis: Finger) -> int:
        """Counts the axis has moved since the first status: above 0 closing, below 0 opening, 0 unknown."""
        return self._latest.position(axis) - self._first.position(axis)
