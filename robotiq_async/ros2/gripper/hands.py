"""The hand that the parameters name."""

from __future__ import annotations

from importlib.util import find_spec

from ...errors import RobotiqError
from ...fleet.network.route import is_remote
from ...fleet.remote.remote_hand import RemoteHand
from ...hand import RobotiqHand
from ...protocol import Hand
from ..translation.settings import Settings


def make_hand(settings: Settings) -> Hand:
    """A hand that is not started. Nothing else in the node knows what kind of hand it is.

    A hand on another host acquires its lease with the first command: connecting only reads.

    Raises:
        ValueError: an option that the hand refuses.
        RobotiqError: the extra that this address needs is not installed.
    """
    if is_remote(settings.address):
        if find_spec("zenoh") is None:
            raise RobotiqError("a gripper on another host needs zenoh: pip install 'robotiq-async[fleet]'")
        return RemoteHand(settings.address, control=None)
    return RobotiqHand(
        settings.address,
        poll_interval=settings.poll_interval,
        speed=settings.speed,
        force=settings.force,
    )
