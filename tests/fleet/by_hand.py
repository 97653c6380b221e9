"""A motion that lasts, and requests that are put together by hand."""

from __future__ import annotations

import asyncio

from robotiq_async.fleet.network.bus import Urgency
from robotiq_async.fleet.wire.envelope import Call, unpack_answer
from robotiq_async.fleet.wire.names import GripperName
from robotiq_async.values.errors import AgentError
from tests.fleet.cell import Doing, moving
from tests.fleet.world import Client, World

LEFT = GripperName("lab", "cell", "left")


async def move_slowly(here: World) -> asyncio.Task[str]:
    doing = Doing(here)
    await moving(doing)
    assert doing.call is not None
    return doing.call


async def ask(client: Client, verb: str, call: Call, key: str = "") -> AgentError | None:
    """Ask something by hand; returns what it was refused with."""

    async def once() -> bytes:
        reply = await client.bus.ask(key or LEFT.key(verb), call.pack(), timeout=2.0, urgency=Urgency.COMMAND)
        assert reply is not None
        return reply.payload

    answer = unpack_answer(await client.do(once()))
    try:
        answer.outcome(lambda stamp: stamp)
    except AgentError as error:
        return error
    return None
