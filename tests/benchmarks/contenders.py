"""The contenders: each function here runs alone in a process of its own, and returns plain figures.

    python -m tests.benchmarks.contenders NAME LOOP SECONDS PORT...

prints the figures as JSON. LOOP is asyncio or uvloop.
"""

from __future__ import annotations

import asyncio
import gc
import json
import logging
import os
import sys
import time
from collections.abc import Awaitable, Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

from pymodbus.client import AsyncModbusTcpClient, ModbusTcpClient

from robotiq_async import Finger, RobotiqHand
from tests.benchmarks.program import Figures

INTERVAL_S = 0.005
SETTLE_S = 0.3

WRITE = 16  # the function that writes registers


def resident() -> int:
    """Bytes of memory that this process has."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def cpu_and_wall() -> tuple[float, float]:
    return time.process_time(), time.monotonic()


# -- one gripper -------------------------------------------------------------------------------------------


def thread(seconds: float, ports: list[int]) -> Figures:
    """A blocking thread: pymodbus's synchronous client, sleeping to absolute deadlines."""
    client = ModbusTcpClient("127.0.0.1", port=ports[0], timeout=0.5, retries=0)
    client.connect()  # type: ignore[no-untyped-call]
    times: list[float] = []
    used, began = cpu_and_wall()
    deadline = began
    while deadline < began + seconds:
        deadline += INTERVAL_S
        time.sleep(max(0.0, deadline - time.monotonic()))
        times.append(time.monotonic())
        client.read_input_registers(0, count=8, device_id=2)
    cpu = (time.process_time() - used) / len(times)
    client.close()  # type: ignore[no-untyped-call]
    return {"periods": periods(times), "cpu_per_poll": cpu}


async def bare(seconds: float, ports: list[int]) -> Figures:
    """Bare pymodbus: the same reads in a loop, asyncio.sleep to absolute deadlines."""
    loop = asyncio.get_running_loop()
    client = await connected(ports[0])
    times: list[float] = []
    used, began = cpu_and_wall()
    deadline = loop.time()
    while time.monotonic() < began + seconds:
        deadline += INTERVAL_S
        await asyncio.sleep(max(0.0, deadline - loop.time()))
        times.append(time.monotonic())
        await client.read_input_registers(0, count=8, device_id=2)
    cpu = (time.process_time() - used) / len(times)
    client.close()
    return {"periods": periods(times), "cpu_per_poll": cpu}


async def hand(seconds: float, ports: list[int], count: int = 1) -> Figures:
    """The whole hand, with so many readers."""
    async with RobotiqHand(f"127.0.0.1:{ports[0]}") as it:
        readers = [asyncio.create_task(read(it)) for _ in range(count)]
        await asyncio.sleep(SETTLE_S)
        session = it._local.session
        assert session is not None
        counters = session.counters  # every single period: the public figures are of the last few seconds
        counters.periods.clear()
        before = it.statistics
        used, began = cpu_and_wall()
        collected: list[float] = []
        while (left := began + seconds - time.monotonic()) > 0:
            await asyncio.sleep(min(left, 5.0))  # before the oldest are forgotten
            collected += counters.periods
            counters.periods.clear()
        cpu = time.process_time() - used
        after = it.statistics
        for reader in readers:
            reader.cancel()
    return {
        "periods": collected,
        "cpu_per_poll": cpu / (after.polls - before.polls),
        "tick": after.tick,
        "overruns": after.overruns - before.overruns,
    }


async def latency(seconds: float, ports: list[int]) -> Figures:
    """Times from command() to the write, from a reply to its reader, from the last one to a move's end.

    Commands follow each other closely here; what the distance between two writes adds is not measured.
    """
    it = RobotiqHand(f"127.0.0.1:{ports[0]}", write_spacing=0.0)
    link: Any = it.options.make_transport()
    given = replace(it.options, link=replace(it.options.link, make=lambda **_: link))
    it._local.options = given  # type: ignore[misc]  # once, to get at the link
    arrived = written = 0.0
    connection = link._connection
    hear, ask = connection._on_data, link._ask

    def note_arrival(data: bytes) -> None:
        nonlocal arrived
        arrived = time.monotonic()
        hear(data)

    async def note_write(request: bytes, **limits: Any) -> bytes:
        nonlocal written
        if request[1] == WRITE:
            written = time.monotonic()
        answer: bytes = await ask(request, **limits)
        return answer

    connection._on_data, link._ask = note_arrival, note_write
    to_wire, to_reader, to_return = [], [], []
    async with it:

        async def watch() -> None:
            async for _ in it.statuses():
                to_reader.append(time.monotonic() - arrived)  # noqa: PERF401

        reader = asyncio.create_task(watch())
        ends = time.monotonic() + seconds
        position = 0
        while time.monotonic() < ends:
            position = (position + 7) % 200
            await it.move(position, Finger.A)
            to_return.append(time.monotonic() - arrived)
            await asyncio.sleep(0.001 * (position % 5))
            asked, written = time.monotonic(), 0.0
            it.command(Finger.B, position=position)
            while not written:  # noqa: ASYNC110
                await asyncio.sleep(0.0005)
            to_wire.append(written - asked)
        reader.cancel()
    return {"command_to_wire": to_wire, "reply_to_reader": to_reader, "last_status_to_return": to_return}


async def memory(seconds: float, ports: list[int]) -> Figures:
    """The memory of a hand, and the growth in an hour of polling; at a poll each millisecond."""
    hands = [RobotiqHand(f"127.0.0.1:{port}") for port in ports]
    async with hands[0]:
        await asyncio.sleep(SETTLE_S)
    gc.collect()
    before = resident()
    await asyncio.gather(*(each.start() for each in hands))
    await asyncio.sleep(SETTLE_S)
    gc.collect()
    per_hand = (resident() - before) / len(hands)
    await asyncio.gather(*(each.stop() for each in hands))
    async with RobotiqHand(f"127.0.0.1:{ports[0]}", poll_interval=0.001) as it:
        reader = asyncio.create_task(read(it))
        await asyncio.sleep(seconds / 3)  # histories fill
        gc.collect()
        polls, before = it.statistics.polls, resident()
        await asyncio.sleep(seconds)
        gc.collect()
        polls, grown = it.statistics.polls - polls, resident() - before
        reader.cancel()
    return {"per_hand": per_hand, "per_hour": grown / polls * 3600 / INTERVAL_S, "polls": polls}


# -- many grippers -----------------------------------------------------------------------------------------


async def many_bare(seconds: float, ports: list[int]) -> Figures:
    """Run so many bare pymodbus loops in one event loop, their phases spread over the interval."""
    loop = asyncio.get_running_loop()
    clients = [await connected(port) for port in ports]
    begin = loop.time() + SETTLE_S
    polls = 0

    async def poll(client: AsyncModbusTcpClient, phase: float) -> None:
        nonlocal polls
        deadline = begin + phase
        while deadline < begin + seconds:
            deadline += INTERVAL_S
            late = loop.time() - deadline
            deadline += max(0, int(late / INTERVAL_S)) * INTERVAL_S
            await asyncio.sleep(max(0.0, deadline - loop.time()))
            await client.read_input_registers(0, count=8, device_id=2)
            polls += 1

    used = time.process_time()
    await asyncio.gather(*(poll(each, n / len(ports) * INTERVAL_S) for n, each in enumerate(clients)))
    cpu = time.process_time() - used
    for each in clients:
        each.close()
    return {"in_time": polls / len(ports) / seconds * INTERVAL_S, "cpu_per_poll": cpu / polls}


async def many_hands(seconds: float, ports: list[int]) -> Figures:
    """Run so many hands in one event loop, each with a reader."""
    hands = [RobotiqHand(f"127.0.0.1:{port}") for port in ports]
    await asyncio.gather(*(each.start() for each in hands))
    readers = [asyncio.create_task(read(each)) for each in hands]
    await asyncio.sleep(SETTLE_S)
    before = [each.statistics.polls for each in hands]
    used, began = cpu_and_wall()
    await asyncio.sleep(seconds)
    cpu, took = time.process_time() - used, time.monotonic() - began
    polls = [each.statistics.polls - at for each, at in zip(hands, before, strict=True)]
    for reader in readers:
        reader.cancel()
    await asyncio.gather(*(each.stop() for each in hands))
    return {
        "in_time": sum(polls) / len(polls) / took * INTERVAL_S,
        "worst_hand": min(polls) / took * INTERVAL_S,
        "cpu_per_poll": cpu / sum(polls),
    }


AMOUNTS: list[dict[str, Any]] = [
    {"position": 120, "speed": 90, "force": 40},
    {"mm": 77.5, "speed": 90, "force": 40},
    {"open_fraction": 0.52, "speed": 90, "force": 40},
    {"position": 120, "mm_per_s": 33.5, "force": 40},
    {"position": 120, "speed": 90, "label_n": 22.5},
    {"mm": 77.5, "mm_per_s": 33.5, "label_n": 22.5},
]


async def commands(seconds: float, ports: list[int]) -> Figures:
    """The time that command() takes of a loop, by the names of its arguments: the least of many hundreds."""
    found: dict[str, float] = {}
    async with RobotiqHand(f"127.0.0.1:{ports[0]}") as it:
        began = time.monotonic()
        while time.monotonic() < began + seconds:
            for amounts in AMOUNTS:
                before = time.perf_counter()
                for _ in range(100):
                    it.command(**amounts)
                took = (time.perf_counter() - before) / 100
                names = ", ".join(amounts)
                found[names] = min(took, found.get(names, took))
                await asyncio.sleep(0.01)
    return found


# -- helpers -----------------------------------------------------------------------------------------------


async def connected(port: int) -> AsyncModbusTcpClient:
    client = AsyncModbusTcpClient("127.0.0.1", port=port, timeout=0.5, retries=0, reconnect_delay=0)
    await client.connect()
    return client


async def read(it: RobotiqHand) -> None:
    async for _ in it.statuses():
        pass


def periods(times: list[float]) -> list[float]:
    return [later - earlier for earlier, later in pairwise(times)]


CONTENDERS: dict[str, Callable[[float, list[int]], Awaitable[Figures]]] = {
    **{each.__name__: each for each in (bare, hand, latency, commands, memory, many_bare, many_hands)},
    "readers_10": partial(hand, count=10),
    "readers_100": partial(hand, count=100),
}


def main() -> None:
    """Run one and print its figures."""
    name, loop, seconds, *rest = sys.argv[1:]
    ports = [int(port) for port in rest]
    logging.getLogger("robotiq_async").setLevel(logging.CRITICAL)
    if name == "thread":
        figures = thread(float(seconds), ports)
    else:
        factory: Any = None
        if loop == "uvloop":
            import uvloop  # noqa: PLC0415

            factory = uvloop.new_event_loop
        with asyncio.Runner(loop_factory=factory) as runner:
            figures = runner.run(CONTENDERS[name](float(seconds), ports))  # type: ignore[arg-type]
    print(json.dumps(figures))  # noqa: T201


if __name__ == "__main__":
    main()
