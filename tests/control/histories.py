"""A shadow of requests, with images and the statuses that show them, in few words."""

from __future__ import annotations

from robotiq_async.control.requests.shadow import RequestShadow, Whose
from robotiq_async.values.enums import Finger
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.register_words import status_of

EPSILON = 0.001


def image(position: int, *, speed: int = 100, force: int = 50, go: bool = True) -> Request:
    return Request(activate=True, go=go, axes=(AxisRequest(position, speed, force),) * 4)


def shows(position: int, at: float, *, go: bool = True) -> RobotiqStatus:
    return status_of(0x31 | go << 3, 0xFF, echo=position, position=position, at=at)


class Shadow(RequestShadow):
    """One that sees statuses as they are answered, and writes that are acknowledged at once."""

    def __init__(self) -> None:
        super().__init__(128, 64)
        self.at = 0.0

    def shown(self, status: RobotiqStatus, at: float) -> RobotiqStatus:
        self.at = at
        self.see(status, at)
        return status

    def follows(self, status: RobotiqStatus) -> bool:
        """Whether it goes on from a status that shows requests of ours, or those that were adopted."""
        whose = self.identify()
        if whose is not Whose.FOREIGN:
            self.follow(whose, status)
        return whose is not Whose.FOREIGN

    def write(self, request: Request, moved: Finger = Finger.ALL, *, answered: bool = True) -> int:
        number = self.writing(request, moved, self.at)
        if answered:
            self.acknowledged(self.at)
        else:
            self.lost()
        return number
