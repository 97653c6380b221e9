"""Everything at once over a network of namespaces: cuts, losses, agents that are killed, halts, floods.

``python -m tests.fleet.chaos [ROUNDS]`` as root on Linux with ip and nft. A gripper, its agent and those who
halts are on one side of a cable, a client that requests bursts of moves on the other, with a program that
sends questions without end. :func:`judged` has the promises.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import random
import signal
import sys
import tempfile
import time
from asyncio.subprocess import Process
from collections import Counter
from typing import Any

from robotiq_async import Finger, RobotiqError
from robotiq_async.fleet.network.bus import Urgency
from robotiq_async.fleet.network.configuration import client_configuration
from robotiq_async.fleet.network.zenoh_bus import open_bus
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import AgentCall
from robotiq_async.simulator import SimulatorServer
from robotiq_async.values.request import Request
from tests.fleet.cuts import ENDPOINT, PROGRAMS, WAYS, Namespaces, kill, missing, report
from tests.fleet.programs import address, say
from tests.grippers import active_gripper

CHAOS = "tests.fleet.chaos"
SPEED, FORCE = 10, 5
BURST = 48
LIMIT_S = 20.0


def ended_by(number: signal.Signals) -> asyncio.Event:
    event = asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(number, event.set)
    return event


async def gripper() -> None:
    """One that notes when an image that sets it going came, and with which speed and force of finger A."""
    ended, one = ended_by(signal.SIGTERM), active_gripper(speedup=20.0, spread=False)
    async with SimulatorServer(one) as server:
        say(server.address)
        await ended.wait()
        ahead = time.monotonic() - one._clock()
        images = [(write.time + ahead, Request.from_registers(write.registers)) for write in one.writes]
        say(json.dumps([(at, image.axes[0].speed, image.axes[0].force) for at, image in images if image.go]))


async def worker() -> None:
    """Moves in bursts, and continues as soon as it may; when stopped by others it waits for SIGUSR1."""
    ended, acquire = ended_by(signal.SIGTERM), ended_by(signal.SIGUSR1)
    outcomes: Counter[str] = Counter()
    longest = 0.0

    async def move(hand: RemoteHand, to: int) -> None:
        nonlocal longest
        begun = time.monotonic()
        try:
            async with asyncio.timeout(LIMIT_S):
                await hand.move(to, Finger.A)
            outcomes["done"] += 1
        except TimeoutError:
            outcomes["STILL OPEN"] += 1
        except RobotiqError as error:
            outcomes[f"{type(error).__name__} {getattr(error, 'reason', '')}".strip()] += 1
        longest = max(longest, time.monotonic() - begun)

    async with RemoteHand(address("left", ENDPOINT)) as hand:
        await hand.set_speed(SPEED)
        await hand.set_force(FORCE)
        say("ready")
        while not ended.is_set():
            if acquire.is_set():
                acquire.clear()
                with contextlib.suppress(RobotiqError):
                    await hand.acquire()
            if hand.is_in_control:
                await asyncio.gather(*(move(hand, 10 + 3 * (each % 60)) for each in range(BURST)))
            await asyncio.sleep(0.05)
    say(json.dumps({"calls": outcomes, "longest": round(longest, 2)}))


async def curious() -> None:
    """Sends questions without end."""
    ended = ended_by(signal.SIGTERM)
    bus, number, answers = await open_bus(client_configuration([ENDPOINT], insecure=True), ENDPOINT), 0, 0
    say("ready")
    while not ended.is_set():
        asked = []
        for _ in range(20):
            number += 1
            call = AgentCall("robotiq/v1/lab/cell/left", "curious", number=number)
            asked.append(
                bus.ask(f"{call.to}/info/{call.client}", call.pack(), timeout=0.2, urgency=Urgency.COMMAND)
            )
        answers += sum(reply is not None for reply in await asyncio.gather(*asked))
    await bus.close()
    say(json.dumps({"asked": number, "answered": answers}))


async def panel() -> None:
    """Halts with each SIGUSR1, on the agent's side of the cable; prints the time of the answer, or 0."""
    pressed = ended_by(signal.SIGUSR1)
    async with RemoteHand(address("left", ENDPOINT), control=False) as hand:
        say("ready")
        while True:
            await pressed.wait()
            pressed.clear()
            try:
                await hand.halt()
            except RobotiqError:
                say(0.0)
            else:
                say(time.monotonic())


async def chaos(rounds: int, seed: int = 1) -> dict[str, Any]:
    namespaces = Namespaces()
    with tempfile.TemporaryDirectory() as state:
        async with namespaces.made():
            return await _run(namespaces, state, rounds, random.Random(seed))


async def _run(namespaces: Namespaces, state: str, rounds: int, chance: random.Random) -> dict[str, Any]:
    here, there = namespaces.agent, namespaces.client
    grippers, where = await namespaces.start(here, CHAOS, "gripper")

    async def start_agent() -> Process:
        words = (PROGRAMS, "agent", ENDPOINT, where)
        return (await namespaces.start(here, *words, STATE_DIRECTORY=state))[0]

    agent = await start_agent()
    client, _ = await namespaces.start(there, CHAOS, "worker")
    asking, _ = await namespaces.start(there, CHAOS, "curious")
    panel, _ = await namespaces.start(here, CHAOS, "panel")
    barred: list[tuple[float, float]] = []
    happened: Counter[str] = Counter()
    for number in range(rounds):
        what = ("cut", "loss", "restart", "halt and restart")[number % 4]
        happened[what] += 1
        if what == "loss":
            async with namespaces.dropping("input", "output", share=chance.choice((5, 20))):
                await asyncio.sleep(1.5)
        elif what == "restart":
            await kill(agent)
            await asyncio.sleep(chance.uniform(0.0, 1.0))
            agent = await start_agent()
            await asyncio.sleep(2.0)
        else:
            halted_at = 0.0
            async with namespaces.dropping(*WAYS[number % 3 if what == "cut" else 2]):
                await asyncio.sleep(chance.uniform(0.0, 1.3))
                if what != "cut":
                    panel.send_signal(signal.SIGUSR1)
                    assert panel.stdout is not None
                    halted_at = float((await panel.stdout.readline()).decode())
                    happened["halts acknowledged"] += halted_at > 0
                    await kill(agent)
                    agent = await start_agent()
            if halted_at:
                await asyncio.sleep(4.0)
                barred.append((halted_at, time.monotonic()))
                client.send_signal(signal.SIGUSR1)
        await asyncio.sleep(chance.uniform(0.5, 1.5))
    await asyncio.sleep(3)
    reports = {"worker": await report(client), "curious": await report(asking)}
    await kill(agent)
    return {"rounds": happened, **reports, **judged(await report(grippers), barred)}


def judged(images: list[tuple[float, int, int]], barred: list[tuple[float, float]]) -> dict[str, Any]:
    """The broken promises: motion after a halt that was not taken back, or with another speed or force."""
    first = next((at for at, speed, force in images if (speed, force) == (SPEED, FORCE)), 0.0)
    return {
        "images": len(images),
        "with another speed or force": sum(
            at > first and (speed, force) != (SPEED, FORCE) for at, speed, force in images
        ),
        "after a halt": sum(since < at < until for at, _, _ in images for since, until in barred),
    }


PARTS = {"gripper": gripper, "worker": worker, "curious": curious, "panel": panel}

if __name__ == "__main__":
    if sys.argv[1:] and sys.argv[1] in PARTS:
        asyncio.run(PARTS[sys.argv[1]]())
    else:
        say(missing() or json.dumps(asyncio.run(chaos(int((sys.argv[1:] or ["20"])[0])))))
