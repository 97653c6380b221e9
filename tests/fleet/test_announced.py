"""Who is announced, when there are many."""

from __future__ import annotations

import asyncio
import socket

from robotiq_async.fleet.network.configuration import agent_configuration, client_configuration
from robotiq_async.fleet.network.zenoh_bus import open_bus

MANY = 600
"""More than a channel of zenoh's holds: halting so many never began."""


async def test_many_are_found_at_once() -> None:
    with socket.socket() as reserved:
        reserved.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{reserved.getsockname()[1]}"
    agent = await open_bus(agent_configuration("lab", "cell", [endpoint]), endpoint)
    client = await open_bus(client_configuration([endpoint]), endpoint)
    try:
        keys = {f"robotiq/v1/lab/cell/g{number}/alive/1" for number in range(MANY)}
        tokens = [agent.announce(key) for key in keys]
        found: set[str] = set()
        async with asyncio.timeout(20):
            while found != keys:
                found = set(await client.announced("robotiq/v1/lab/*/*/alive/*", timeout=0.5))
        assert await client.announced("robotiq/v1/nowhere/**", timeout=0.5) == []
        for take_back in tokens:
            take_back()
    finally:
        await client.close()
        await agent.close()
    assert await client.announced("robotiq/v1/**", timeout=0.5) == []
