"""Connections that are opened and left alone: by a scanner, a load balancer, or to keep others out."""

from __future__ import annotations

import asyncio
import contextlib
import socket

import pytest

pytest.importorskip("zenoh")

from robotiq_async.fleet.network.bus import Urgency
from robotiq_async.fleet.network.configuration import agent_configuration, client_configuration
from robotiq_async.fleet.network.zenoh_bus import open_bus
from tests.fleet.sessions import free_port


async def test_idle_connections_keep_nobody_out() -> None:
    """300 of them, by somebody who only opens them, kept new clients out for 12 s."""
    port = free_port()
    endpoint = f"tcp/127.0.0.1:{port}"
    async with contextlib.AsyncExitStack() as stack:
        agent = await open_bus(agent_configuration("lab", "cell-1", [endpoint]), endpoint)
        stack.push_async_callback(agent.close)
        agent.serve("robotiq/v1/lab/cell-1/*/info", lambda query: query.reply(b"!"))
        for _ in range(300):
            idle = stack.enter_context(socket.socket())
            idle.connect(("127.0.0.1", port))
        client = await open_bus(client_configuration([endpoint]), endpoint)
        stack.push_async_callback(client.close)
        async with asyncio.timeout(8):
            asked = None
            while asked is None:
                asked = await client.ask(
                    "robotiq/v1/lab/cell-1/left/info", b"?", timeout=1.0, urgency=Urgency.COMMAND
                )
