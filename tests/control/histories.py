"""Images, and the statuses that echo them, in few words."""

from __future__ import annotations

from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.register_words import status_of

EPSILON = 0.001
RESET = status_of(0x00)
BUSY = status_of(0x11)
READY = status_of(0x31)
RUNNING = status_of(0x39, 0xC0)
FAULTY = status_of(0x39, fault=0x0E)
RELEASED = status_of(0x01, fault=0x0F)


def image(position: int, *, speed: int = 100, force: int = 50, go: bool = True) -> Request:
    return Request(activate=True, go=go, axes=(AxisRequest(position, speed, force),) * 4)


def shows(position: int, at: float, *, go: bool = True) -> RobotiqStatus:
    return status_of(0x31 | go << 3, 0xFF, echo=position, position=position, at=at)
