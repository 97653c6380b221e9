"""``robotiq-async status``."""

from __future__ import annotations

import json
from typing import Annotated

from cyclopts import Parameter

from ...tools.recording.payloads import reading_fields
from ..addresses import gripper_words
from ..arguments import USUAL, Address, Flag, Link
from ..output.notices import tell


async def status(
    address: Address = "sim://",
    /,
    *,
    as_json: Annotated[Flag, Parameter(name="--json")] = False,
    link: Link = USUAL,
) -> None:
    """Read the gripper once and print its status. Nothing moves and nothing is written.

    For example:

        robotiq-async status tcp://192.168.1.11
        robotiq-async status --json 192.168.1.11 | jq .A.position

    Args:
        as_json: Print one JSON object instead of the table.
    """
    from ..connect import connected
    from ..output.tables import print_status

    if not as_json:
        print(gripper_words(address), flush=True)
    async with connected(address, link, halt=False) as hand:
        if as_json:
            tell(gripper_words(address))
            print(json.dumps(reading_fields(hand), indent=2))
        else:
            print_status(hand)
