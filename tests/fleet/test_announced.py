"""Who is announced, when there are many; and which endpoints are not reached."""

from __future__ import annotations

import asyncio

from robotiq_async.fleet.network.configuration import agent_configuration, client_configuration
from robotiq_async.fleet.network.zenoh_bus import open_bus
from tests.fleet.sessions import free_port

MANY = 600
"""More than a channel of zenoh's holds: halting so many never began."""


async def test_many_are_found_at_once() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
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


async def test_endpoints_that_are_not_reached() -> None:
    """One that is written as a name is another word for what zenoh is connected to."""
    numbers = [free_port() for _ in range(3)]
    agents = [
        await open_bus(agent_configuration("lab", "cell", [f"tcp/127.0.0.1:{n}"]), "a") for n in numbers[:2]
    ]
    endpoints = [
        f"tcp/{host}:{n}" for host, n in zip(("127.0.0.1", "localhost", "127.0.0.1"), numbers, strict=True)
    ]
    client = await open_bus(client_configuration(endpoints), "b")
    try:
        async with asyncio.timeout(20):
            while len(await client.unreached()) > 1:  # noqa: ASYNC110  # it tells nobody
                await asyncio.sleep(0.05)
        assert await client.unreached() == endpoints[2:]
        await agents[1].close()
        async with asyncio.timeout(20):
            while await client.unreached() != endpoints[1:]:  # noqa: ASYNC110
                await asyncio.sleep(0.05)
    finally:
        for bus in (client, *agents):
            await bus.close()
