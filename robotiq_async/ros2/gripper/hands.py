"""The hand that the parameters name."""

from __future__ import annotations

from importlib.util import find_spec

from ...fleet.network.route import is_remote
from ...fleet.remote.remote_hand import RemoteHand
from ...hand import Hand
from ...hand.robotiq_hand import RobotiqHand
from ...runtime.extras import install
from ...session.options import POLL_INTERVAL_S
from ...values.errors import RobotiqError
from ..translation.settings import USUAL, Settings


def make_hand(settings: Settings) -> Hand:
    """A hand that is not started. Nothing else in the node knows what kind of hand it is.

    A hand on another host acquires its lease with the first command: connecting only reads.

    Raises:
        ValueError: an option that the hand refuses.
        RobotiqError: the extra that this address needs is not installed.
    """
    if is_remote(settings.address):
        if find_spec("zenoh") is None:
            raise RobotiqError(f"a gripper on another host needs zenoh: {install('fleet')}")
        return RemoteHand(settings.address, control=None)
    return RobotiqHand(
        settings.address,
        device_id=_given(settings.device_id),
        read_function=_given(settings.read_function),
        poll_interval=_or_usual(settings.poll_interval),
        write_spacing=settings.write_spacing,
        response_timeout=settings.response_timeout,
        speed=settings.speed,
        force=settings.force,
    )


def _given(number: int) -> int | None:
    return None if number == USUAL else number


def _or_usual(interval: float) -> float:
    """The default comes back from ROS as a plain figure, which would count as given on purpose."""
    return POLL_INTERVAL_S if interval == POLL_INTERVAL_S else interval
