"""Roles in the benchmarks of the fleet: each function here runs alone in a process of its own.

    python -m tests.benchmarks.fleet_roles NAME ENDPOINT ARGUMENT...

A role says "ready" on standard output. For each line "begin" on standard input it begins to measure, for each
"end" it prints its figures as JSON, and it ends with the input.
"""

from __future__ import annotations

import asyncio
import itertools
import json
import logging
import random
import sys
import time
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager

from robotiq_async import Finger, RobotiqHand, RobotiqStatus, State
from robotiq_async.fleet import Agent, Fleet, GripperName, RemoteHand, Route
from robotiq_async.fleet.network.bus import Query, Urgency
from robotiq_async.fleet.network.configuration import agent_configuration, client_configuration
from robotiq_async.fleet.network.zenoh_bus import ZenohBus, open_bus
from robotiq_async.fleet.wire.envelope import AgentAnswer, unpack_call
from robotiq_async.fleet.wire.status_message import StatusMessage
from robotiq_async.hands import Hand
from robotiq_async.hands.statistics import Counters, percentile
from tests.benchmarks.program import Figures

INTERVAL_S = 0.005
WATCHED = 100
"""Streams beside which a halt is measured."""
REGISTERS = (0xF900, 0xFF00, 0x0064, 0x6400, 0x0606, 0x0000, 0x0606, 0x0089)


def name(number: int, host: str = "host") -> GripperName:
    return GripperName("bench", host, f"g{number}")


async def measured(begin: Callable[[], object], more: Callable[[float], Figures]) -> None:
    """Measure from each "begin" on; at each "end" print the figures, with more about so many seconds."""
    meter = Meter()
    async for order in orders():
        if order == "begin":
            meter = Meter()
            begin()
        else:
            figures = meter.figures()
            tell({**figures, **more(figures["took"])})


async def orders() -> AsyncIterator[str]:
    """The lines of the main process."""
    print("ready", flush=True)  # noqa: T201
    while line := await asyncio.to_thread(sys.stdin.readline):
        yield line.strip()


def tell(figures: Figures) -> None:
    print(json.dumps(figures), flush=True)  # noqa: T201


class Meter:
    """CPU and time since it was begun."""

    def __init__(self) -> None:
        self.used, self.began = time.process_time(), time.monotonic()

    def figures(self) -> Figures:
        took = time.monotonic() - self.began
        return {"took": took, "cpu": (time.process_time() - self.used) / took}


def milliseconds(times: list[float]) -> Figures:
    ordered = sorted(times)
    return {f"p{share * 100:g}": 1000 * percentile(ordered, share) for share in (0.5, 0.99)}


# -- where the grippers are --------------------------------------------------------------------------------


async def agent(endpoint: str, *ports: str) -> None:
    """An agent that serves so many hands."""
    hands = hands_at(ports)
    bus = await open_bus(agent_configuration("bench", "host", hands, [endpoint]), endpoint)
    served = Agent("bench", "host", hands, bus)
    serving = asyncio.create_task(served.run())
    await active(hands)
    await measured_polls(hands)
    serving.cancel()
    await asyncio.gather(serving, return_exceptions=True)
    await bus.close()


async def local(_endpoint: str, *ports: str) -> None:
    """The same hands without an agent, and without readers."""
    hands = hands_at(ports)
    await asyncio.gather(*(each.start() for each in hands.values()))
    await measured_polls(hands)
    await asyncio.gather(*(each.stop() for each in hands.values()))


def hands_at(ports: tuple[str, ...]) -> dict[str, RobotiqHand]:
    return {f"g{n}": RobotiqHand(f"127.0.0.1:{port}", write_spacing=0.0) for n, port in enumerate(ports)}


async def active(hands: dict[str, RobotiqHand]) -> None:
    while any(each.state is not State.RUNNING_IDLE for each in hands.values()):  # noqa: ASYNC110
        await asyncio.sleep(0.05)


async def measured_polls(hands: dict[str, RobotiqHand]) -> None:
    """The number of polls in time, and their jitter; of the last ten seconds at most."""
    before: list[int] = []

    def polls() -> list[int]:
        return [each.statistics.polls for each in hands.values()]

    def begin() -> None:
        before[:] = polls()
        for each in hands.values():
            periods_of(each).clear()

    def evenness(took: float) -> Figures:
        kept = [(now - then) * INTERVAL_S / took for now, then in zip(polls(), before, strict=True)]
        p99 = sorted(1000 * percentile(sorted(periods_of(each)), 0.99) for each in hands.values())
        middle = p99[len(p99) // 2]
        return {"kept": sum(kept) / len(kept), "period_p99": middle, "worst_p99": p99[-1]}

    await measured(begin, evenness)


def periods_of(hand: RobotiqHand) -> deque[float]:
    """Every single one: the public figures are of the last few seconds, the start included."""
    session = hand._local.session
    assert session is not None
    return session.counters.periods


# -- clients -----------------------------------------------------------------------------------------------


async def reader(endpoint: str, count: str) -> None:
    """A client that reads the statuses of so many hands."""
    bus = await client(endpoint)
    async with watched(bus, [name(n) for n in range(int(count))]) as late:

        def reading(took: float) -> Figures:
            return {"rate": len(late) / int(count) / took, "latency": milliseconds(late)}

        await measured(late.clear, reading)
    await bus.close()


@asynccontextmanager
async def watched(bus: ZenohBus, names: list[GripperName]) -> AsyncIterator[list[float]]:
    """Hands whose statuses are read; gives how late each was."""
    hands = [RemoteHand(str(each), control=False, bus=bus, connect_timeout=20) for each in names]
    await asyncio.gather(*(each.start(activate=False) for each in hands))
    late: list[float] = []
    tasks = [asyncio.create_task(read(each, late)) for each in hands]
    yield late
    for task in tasks:
        task.cancel()
    await asyncio.gather(*(each.stop() for each in hands))


async def read(hand: RemoteHand, late: list[float]) -> None:
    """The delay of statuses at their reader: the agent's clock is ours, for it is on this machine."""
    async for _ in hand.statuses():
        session = hand._remote.session
        assert session is not None
        late.append(time.monotonic() - session.mirror.stamp)


async def client(*endpoints: str) -> ZenohBus:
    return await open_bus(client_configuration(endpoints), endpoints[0])


async def commander(endpoint: str) -> None:
    """A client that commands one hand."""
    async with RemoteHand(f"{name(0)}?connect={endpoint}") as hand:
        await commands(hand)


async def local_commander(_endpoint: str, port: str) -> None:
    """The same in the process of the hand."""
    async with RobotiqHand(f"127.0.0.1:{port}", write_spacing=0.0) as hand:
        await commands(hand)


async def busy_commander(endpoint: str, other: str) -> None:
    """The same beside a hundred streams of statuses in the same process."""
    bus = await client(endpoint, other)
    async with (
        watched(bus, [name(n, "generator") for n in range(WATCHED)]) as late,
        RemoteHand(str(name(0)), bus=bus) as hand,
    ):
        await commands(hand, lambda: {"streams": len(late)})
    await bus.close()


async def commands(hand: Hand, more: Callable[[], Figures] = dict) -> None:
    """The time of set_speed and halt, at any moment between two polls."""
    async for order in orders():
        if order == "begin":
            continue
        meter, speeds, halts = Meter(), [], []
        while time.monotonic() < meter.began + float(order.split()[1]):
            await asyncio.sleep(random.uniform(0, 2 * INTERVAL_S))
            asked = time.monotonic()
            await hand.set_speed(random.randrange(256), Finger.A)
            speeds.append(time.monotonic() - asked)
            await hand.set_position(random.randrange(256), Finger.A)
            await asyncio.sleep(random.uniform(0, 2 * INTERVAL_S))
            asked = time.monotonic()
            await hand.halt()
            halts.append(time.monotonic() - asked)
        figures = {"set_speed": milliseconds(speeds), "halt": milliseconds(halts), "times": len(halts)}
        tell({**meter.figures(), **figures, **more()})


# -- many grippers without a client -------------------------------------------------------------------------


async def generator(endpoint: str, count: str) -> None:
    """Statuses of so many grippers, 200 times a second each."""
    bus = await open_bus(agent_configuration("bench", "generator", (), [endpoint]), endpoint)
    names = [name(n, "generator") for n in range(int(count))]
    publishers = [bus.publisher(each.key("feed"), Urgency.TELEMETRY) for each in names]
    bus.serve(f"{names[0].base.rpartition('/')[0]}/*/info/*", describe)

    async def run() -> None:
        due = time.monotonic()
        for sequence in itertools.count(1):
            for part in range(5):
                for index in range(part, len(names), 5):
                    publishers[index](message(names[index], sequence))
                due += INTERVAL_S / 5
                await asyncio.sleep(max(0.0, due - time.monotonic()))

    await generated(run(), bus)


def message(of: GripperName, sequence: int) -> bytes:
    stamp = time.monotonic()
    return StatusMessage(
        mark=of.mark,
        epoch=1,
        stamp=stamp,
        state=State.RUNNING_IDLE,
        lease=0,
        is_held=False,
        events=0,
        is_moving=False,
        status=RobotiqStatus(REGISTERS, stamp, sequence),
    ).pack()


def describe(question: Query) -> None:
    call = unpack_call(question.payload)
    of = GripperName.of_key(question.key)
    value = {"window": 1.0, "events": [], "epoch": 1, **summary(of)}
    question.reply(AgentAnswer(of.base, call.number, 1, value).pack(), message(of, 0))


def summary(of: GripperName) -> Figures:
    return {
        "mark": of.mark,
        "epoch": 1,
        "to": of.base,
        "stamp": time.monotonic(),
        "age": 0.001,
        "address": "tcp://192.168.1.11:502",
        "model": "3f",
        "state": State.RUNNING_IDLE.name,
        "fault": 0,
        "is_moving": False,
        "holder": None,
        "problem": "",
        "statistics": Counters().snapshot(0).as_dict(),
    }


async def summaries(endpoint: str, count: str) -> None:
    """Summaries of so many grippers, once a second each."""
    bus = await open_bus(agent_configuration("bench", "generator", (), [endpoint]), endpoint)
    names = [name(n, "generator") for n in range(int(count))]
    publishers = [bus.publisher(each.key("summary"), Urgency.TELEMETRY) for each in names]
    tokens = [bus.announce(each.key("alive", "1")) for each in names]

    async def run() -> None:
        due = time.monotonic()
        while True:
            for index, of in enumerate(names):
                publishers[index](json.dumps(summary(of)).encode())
                if index % 10 == 9:
                    due += 10 / len(names)
                    await asyncio.sleep(max(0.0, due - time.monotonic()))

    await generated(run(), bus)
    assert tokens


async def generated(work: Awaitable[None], bus: ZenohBus) -> None:
    task = asyncio.ensure_future(work)
    await measured(lambda: None, lambda _: {})
    task.cancel()
    await bus.close()


async def overview(endpoint: str) -> None:
    """A client that has all summaries, and nothing else."""
    async with Fleet(route=Route((endpoint,))) as fleet:
        changes = fleet.changes()

        def heard(_: float) -> Figures:
            there = sum(each.state is not None for each in fleet)
            return {"members": there, "changes": len(list(changes.drain()))}

        await measured(lambda: None, heard)


_AGENTS = (agent, local, generator, summaries)
_CLIENTS = (reader, commander, local_commander, busy_commander, overview)
ROLES: dict[str, Callable[..., Awaitable[None]]] = {each.__name__: each for each in (*_AGENTS, *_CLIENTS)}


def main() -> None:
    """Take the part that the command line names."""
    role, *arguments = sys.argv[1:]
    logging.getLogger("robotiq_async").setLevel(logging.CRITICAL)
    asyncio.run(ROLES[role](*arguments))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
