"""``robotiq-async status``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ...enums import AXES
from ..arguments import USUAL, Address, Link

if TYPE_CHECKING:
    from ...protocol import Hand


async def status(
    address: Address = "sim://",
    /,
    *,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
    link: Link = USUAL,
) -> None:
    """Read the gripper once and print what it says. Nothing moves and nothing is written.

    For example:

        robotiq-async status tcp://192.168.1.11
        robotiq-async status --json 192.168.1.11 | jq .axes.A.position

    Args:
        as_json: Print one JSON object in place of the table.
    """
    from ..connect import connected
    from ..tables import print_status

    async with connected(address, link, halt=False) as hand:
        if as_json:
            print(json.dumps(as_dict(hand), indent=2))
        else:
            print_status(hand)


def as_dict(hand: Hand) -> dict[str, object]:
    """The hand's state and its last status, in types that JSON knows."""
    last = hand.status
    return {
        "state": hand.state.name,
        "fault": {
            "code": int(last.fault),
            "name": last.fault.name,
            "severity": last.fault.severity.value,
            "description": last.fault.description,
        },
        "activated": last.is_activated,
        "reset": last.is_reset,
        "moving": last.is_moving,
        "mode": last.mode.name,
        "axes": {
            str(axis.name): {
                "position": last.position(axis),
                "requested": last.requested_position(axis),
                "object": last.finger_status(axis).name,
                "current_ma": last.current_ma(axis),
            }
            for axis in AXES
        },
    }
