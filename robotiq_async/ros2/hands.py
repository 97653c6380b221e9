"""The hand that the parameters name, and why it takes no goals now. Knows no ROS."""

from __future__ import annotations

from importlib.util import find_spec

from ..control.state_machine import RUNNING
from ..enums import State
from ..errors import RobotiqError
from ..fleet.network.route import is_remote
from ..fleet.remote.remote_hand import RemoteHand
from ..hand import RobotiqHand
from ..protocol import Hand
from .settings import Settings


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


def is_connected(hand: Hand) -> bool:
    """Whether what the hand shows is what the gripper does now."""
    return hand.state not in (State.DISCONNECTED, State.DO_SHUTDOWN, State.SHUTDOWN)


def why_not(hand: Hand) -> str | None:
    """Why the hand takes no goal now; None if it does."""
    state = hand.state
    if state in RUNNING:
        return None
    if not is_connected(hand):
        return "the link to the gripper is down"
    if state is State.RESET:
        return "the gripper is not activated: call ~/activate (its fingers MOVE)"
    if state in (State.FAULT, State.ATR_DONE):
        fault = hand.status.fault
        return f"the gripper is in fault 0x{int(fault):02X}, {fault.description}: call ~/recover"
    return f"an activation, a reset or a release is under way ({state.name})"
