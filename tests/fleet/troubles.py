"""What can go wrong between a client, an agent and their hosts; each trouble ends before it returns."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, Final

from tests.fleet.world import World

Trouble = Callable[[World], Coroutine[Any, Any, None]]


# -- the client --------------------------------------------------------------------------------------------


async def client_killed(world: World) -> None:
    world.kill(world.holder.host)


def client_frozen(seconds: float) -> Trouble:
    async def trouble(world: World) -> None:
        world.freeze(world.holder.host)
        await asyncio.sleep(seconds)
        world.thaw(world.holder.host)

    return trouble


def client_held_up(seconds: float) -> Trouble:
    """A callback that blocks: zenoh's own threads go on, and the link stays."""

    async def trouble(world: World) -> None:
        world.holder.host.freeze()
        await asyncio.sleep(seconds)
        world.holder.host.thaw()

    return trouble


# -- the agent ---------------------------------------------------------------------------------------------


def agent_frozen(seconds: float) -> Trouble:
    async def trouble(world: World) -> None:
        world.freeze(world.agent.host)
        await asyncio.sleep(seconds)
        world.thaw(world.agent.host)

    return trouble


def agent_killed(seconds: float) -> Trouble:
    """And the next one is started after some seconds."""

    async def trouble(world: World) -> None:
        world.kill(world.agent.host)
        await asyncio.sleep(seconds)
        await world.start_agent("next agent")

    return trouble


async def agent_ended(world: World) -> None:
    """SIGTERM, and the next one at once."""
    await world.agent.end()
    await world.start_agent("next agent")


async def second_agent(world: World) -> None:
    """Another one that does not see the first: a partition, which ends later."""
    world.network.part("agent", "second agent")
    await world.start_agent("second agent")
    world.network.join("agent", "second agent")
    await asyncio.sleep(3)
    await world.agents.pop().end()


# -- the network -------------------------------------------------------------------------------------------


def cut(seconds: float, *, out: bool = True, back: bool = True, keeps: bool = False) -> Trouble:
    async def trouble(world: World) -> None:
        world.network.keeps_links = keeps
        world.cut(world.holder, out=out, back=back)
        await asyncio.sleep(seconds)
        world.mend(world.holder)

    return trouble


async def router_restarted(world: World) -> None:
    """Everybody loses everybody, at once, and for two seconds."""
    names = [bus.name for bus in world.network.buses]
    pairs = [(one, other) for one in names for other in names if one < other]
    for pair in pairs:
        world.network.part(*pair)
    await asyncio.sleep(2)
    for pair in pairs:
        world.network.join(*pair)


def bad(seconds: float = 4.0, *, requests_only: bool = False, **what: float) -> Trouble:
    async def trouble(world: World) -> None:
        here, there = world.holder.host.name, world.agent.host.name
        streams = world.network.both(here, there)[: 1 if requests_only else 2]
        usual = [{name: getattr(stream, name) for name in what} for stream in streams]
        for stream in streams:
            for name, value in what.items():
                setattr(stream, name, value)
        await asyncio.sleep(seconds)
        for stream, values in zip(streams, usual, strict=True):
            for name, value in values.items():
                setattr(stream, name, value)
            stream.free_at = min(stream.free_at, world.now())

    return trouble


async def wrong_keys(world: World) -> None:
    """A third of everything comes under the key of the other gripper."""
    world.network.wrong_key = lambda key: _swap(key) if world.network.random.random() < 0.33 else key
    await asyncio.sleep(3)
    world.network.wrong_key = lambda key: key


def _swap(key: str) -> str:
    one, other = "/left/", "/right/"
    return key.replace(one, other) if one in key else key.replace(other, one)


async def cuts(world: World) -> None:
    """One direction or both, for about a lease, again and again, while keys are mixed up."""
    world.network.wrong_key = lambda key: _swap(key) if world.network.random.random() < 0.1 else key
    for _ in range(24):
        which = world.network.random.choice(((True, False), (False, True), (True, True)))
        world.network.keeps_links = world.network.random.random() < 0.5
        world.cut(world.holder, out=which[0], back=which[1])
        await asyncio.sleep(world.network.random.uniform(0.7, 1.4))
        world.mend(world.holder)
        await asyncio.sleep(world.network.random.uniform(0.05, 1.0))
    world.network.wrong_key = lambda key: key


# -- others ------------------------------------------------------------------------------------------------


async def other_acquires(world: World) -> None:
    from tests.fleet.cell import told  # noqa: PLC0415

    assert await world.other.do(told(world.other.hand.acquire())) == "ControlLost held"


async def other_takes(world: World) -> None:
    await world.other.do(world.other.hand.take())
    await asyncio.sleep(1)
    await world.other.do(world.other.hand.release())


async def other_halts(world: World) -> None:
    await world.other.do(world.other.hand.halt())


TROUBLES: Final[dict[str, Trouble]] = {
    "client killed": client_killed,
    "client frozen for 0.5 s": client_frozen(0.5),
    "client frozen for 3 s": client_frozen(3),
    "client's loop held up for 2 s": client_held_up(2),
    "agent frozen for 0.5 s": agent_frozen(0.5),
    "agent frozen for 3 s": agent_frozen(3),
    "agent killed, the next after 1 s": agent_killed(1),
    "agent ended, the next at once": agent_ended,
    "a second agent that did not see the first": second_agent,
    "router away for 2 s": router_restarted,
    "cable out for 0.3 s": cut(0.3),
    "cable out for 2.5 s": cut(2.5),
    "cable out for 2.5 s, and all of it comes later": cut(2.5, keeps=True),
    "nothing to the agent for 2.5 s": cut(2.5, back=False),
    "nothing to the client for 2.5 s": cut(2.5, out=False),
    "nothing to the agent for 2.5 s, and all of it comes later": cut(2.5, back=False, keeps=True),
    "nothing to the client for 2.5 s, and all of it comes later": cut(2.5, out=False, keeps=True),
    "5 % lost": bad(loss=0.05),
    "20 % lost": bad(loss=0.2),
    "50 % lost": bad(loss=0.5),
    "50 ms late": bad(delay=0.05),
    "64 kbit/s": bad(rate=8000.0),
    "requests late by 1.5 s": bad(delay=1.5, requests_only=True),
    "requests twice": bad(copies=2, requests_only=True),
    "requests out of order": bad(jitter=0.05, requests_only=True),
    "everything twice and out of order": bad(copies=2, jitter=0.05),
    "another client acquires": other_acquires,
    "another client takes": other_takes,
    "another client halts": other_halts,
    "a third under the wrong key": wrong_keys,
    "24 cuts around the lease, a tenth under the wrong key": cuts,
}
