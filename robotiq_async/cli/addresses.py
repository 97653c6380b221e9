"""Addresses of grippers as users type them; needs no extra."""

from __future__ import annotations

from ..link import is_remote, parse_address
from ..values import Model, model_of
from .failures import usage


def full_address(address: str) -> str:
    """The full form of an address, of a local or a remote gripper."""
    with usage():
        if not is_remote(address):
            return str(parse_address(address))
        from ..fleet.network.route import parse_remote_address

        return str(parse_remote_address(address)[0])


def gripper_words(address: str) -> str:
    """The first line of a command: the gripper that it uses."""
    kind = "Simulated gripper" if is_simulated(address) else "Gripper"
    return f"{kind} {full_address(address)}"


def is_simulated(address: str) -> bool:
    """Whether the gripper is simulated inside the command."""
    return full_address(address).startswith("sim:")


def named_model(address: str) -> Model:
    """The model that an address names. Of a remote gripper its agent knows it: the 3-Finger until then."""
    with usage():
        return model_of(None if is_remote(address) else parse_address(address).model)
