"""The hand that the parameters select."""

from __future__ import annotations

from importlib.util import find_spec

from ...fleet.remote.remote_hand import RemoteHand
from ...hand import Hand
from ...hand.robotiq_hand import RobotiqHand
from ...link.address import is_remote
from ...runtime.extras import install
from ...values.errors import RobotiqError
from ..translation.settings import Settings


def make_hand(settings: Settings) -> Hand:
    """A hand that is not started. In the ROS node only this function knows which kind of hand it is.

    A hand on another host acquires its lease with the first command: connecting only reads.

    Raises:
        ValueError: an option that the hand refuses.
        RobotiqError: the extra that this address needs is not installed.
    """
    if is_remote(settings.address):
        if find_spec("zenoh") is None:
            raise RobotiqError(f"a gripper on another host needs zenoh: {install('fleet')}")
        return RemoteHand(settings.address, control=None)
    return RobotiqHand(settings.address, speed=settings.speed, force=settings.force, **settings.options)
