"""Addresses as people give them to a command; needs no extra."""

from __future__ import annotations

from ..fleet.network.route import is_remote, parse_remote_address
from ..link.address import parse_address
from ..values.model import THREE_FINGER
from .failures import UsageError, usage


def full_address(address: str) -> str:
    """The full form of a gripper's address, wherever it is.

    Raises:
        UsageError: malformed.
    """
    with usage():
        return str(parse_remote_address(address)[0] if is_remote(address) else parse_address(address))


def gripper_words(address: str) -> str:
    """Which gripper an address means, for people: the first that a command says."""
    kind = "Simulated gripper" if is_simulated(address) else "Gripper"
    return f"{kind} {full_address(address)}"


def is_simulated(address: str) -> bool:
    """Whether the gripper is a simulated one inside the command."""
    return full_address(address).startswith("sim:")


def check_three_finger(address: str) -> None:
    """Refuse a sibling of the 3-Finger where a command needs three fingers.

    Raises:
        UsageError: the address names one.
    """
    if is_remote(address):
        return  # it is found out once the agent answers
    with usage():
        model = parse_address(address).model
    if model not in (None, THREE_FINGER):
        raise UsageError(f"this command is for the 3-Finger, and {address} names a {model}")
