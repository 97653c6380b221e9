"""What zenoh calls the other end of a connection: the endpoint, with a number in place of a name."""

from __future__ import annotations

import asyncio
from typing import Final

from ...link.host_names import addresses_of
from .endpoints import parse_endpoint

RESOLVED_S: Final = 1.0
"""A name that takes longer is taken for unknown."""


async def locators(endpoint: str) -> set[str]:
    """What the other end of a connection to an endpoint may be called; empty if nobody knows its name."""
    checked, port = parse_endpoint("connect", endpoint), endpoint.rpartition(":")[2]
    try:
        async with asyncio.timeout(RESOLVED_S):
            numbers = await addresses_of(checked.host, int(port))
    except (OSError, UnicodeError, TimeoutError):
        return set()
    return {f"{checked.protocol}/{f'[{number}]' if ':' in number else number}:{port}" for number in numbers}
