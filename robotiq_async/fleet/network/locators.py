"""Locators: zenoh's names for the other end of a connection, endpoints with an IP address as host."""

from __future__ import annotations

import asyncio
from typing import Final

from ...link.host_names import addresses_of
from .endpoints import parse_endpoint

RESOLVED_S: Final = 1.0
"""Seconds to resolve a host name; one that takes longer counts as unknown."""


async def locators(endpoint: str) -> set[str]:
    """All locators that a connection to an endpoint may have; empty if its host name is unknown."""
    checked, port = parse_endpoint("connect", endpoint), endpoint.rpartition(":")[2]
    try:
        async with asyncio.timeout(RESOLVED_S):
            numbers = await addresses_of(checked.host, int(port))
    except (OSError, UnicodeError, TimeoutError):
        return set()
    return {f"{checked.protocol}/{f'[{number}]' if ':' in number else number}:{port}" for number in numbers}
