"""Whether a hand is connected, and why it accepts no goals now."""

from __future__ import annotations

from ...control.state_machine import RUNNING
from ...hand import Hand
from ...values.enums import State


def is_connected(hand: Hand) -> bool:
    """Whether the status of the hand is current."""
    return hand.state not in (State.DISCONNECTED, State.DO_SHUTDOWN, State.SHUTDOWN)


def why_not(hand: Hand) -> str | None:
    """Why the hand accepts no goal now; None if it does."""
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
