"""Addresses as people give them to a command; needs no extra."""

from __future__ import annotations

from ..fleet.network.route import is_remote, parse_remote_address
from ..link.address import parse_address
from .failures import usage


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
