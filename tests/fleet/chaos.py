"""Everything at once over a network of namespaces: cuts, losses, agents that are killed, halts, floods.

``python -m tests.fleet.chaos [ROUNDS]`` as root on Linux with ip and nft. A gripper, its agent and those who
halts are on one side of a cable, a client that asks for bursts of moves on the other, with a program that
asks questions without end. What it must show is in :func:`judged`.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from typing import Any

from robotiq_async import Finger, RobotiqError
from robotiq_async.fleet.network.bus import Urgency
from robotiq_async.fleet.network.configuration import client_configuration
from robotiq_async.fleet.network.zenoh_bus import open_bus
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import Call
from robotiq_async.simulator import SimulatorServer
from robotiq_async.values.request import Request
from tests.fleet.cuts import ENDPOINT, ROOT, Namespaces, missing
from tests.fleet.programs import address, say
from tests.grippers import active_gripper

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
    """Moves in bursts, and goes on as soon as it may; who was stopped by others waits for SIGUSR1."""
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
    """Asks without end."""
    ended = ended_by(signal.SIGTERM)
    bus, number, answers = await open_bus(client_configuration([ENDPOINT], insecure=True), ENDPOINT), 0, 0
    say("ready")
    while not ended.is_set():
        asked = []
        for _ in range(20):
            number += 1
            call = Call("robotiq/v1/lab/cell/left", "curious", number=number)
            asked.append(bus.ask(f"{call.to}/info", call.pack(), timeout=0.2, urgency=Urgency.COMMAND))
        answers += sum(reply is not None for reply in await asyncio.gather(*asked))
    await bus.close()
    say(json.dumps({"asked": number, "answered": answers}))


async def panel() -> None:
    """Halts with each SIGUSR1, on the agent's side of the cable; says when that was acknowledged, or 0."""
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


class Cell:
    """The processes."""

    def __init__(self, namespaces: Namespaces, state: str) -> None:
        self.namespaces = namespaces
        self.state = state
        self.running: list[asyncio.subprocess.Process] = []

    async def start(self, where: str, module: str, *words: str) -> tuple[asyncio.subprocess.Process, str]:
        process = await asyncio.create_subprocess_exec(
            *("ip", "netns", "exec", where, sys.executable, "-m", f"tests.fleet.{module}", *words),
            cwd=ROOT,
            env={**os.environ, "STATE_DIRECTORY": self.state},
            stdout=asyncio.subprocess.PIPE,
        )
        self.running.append(process)
        assert process.stdout is not None
        async with asyncio.timeout(LIMIT_S):
            return process, (await process.stdout.readline()).decode().strip()

    async def end(self, process: asyncio.subprocess.Process) -> Any:
        """What it says at its end."""
        process.send_signal(signal.SIGTERM)
        async with asyncio.timeout(LIMIT_S):
            said, _ = await process.communicate()
        return json.loads(said.splitlines()[-1])

    async def kill(self, process: asyncio.subprocess.Process) -> None:
        if process.returncode is None:
            process.kill()
            await process.wait()


async def chaos(rounds: int, seed: int = 1) -> dict[str, Any]:
    chance, namespaces = random.Random(seed), Namespaces()
    with tempfile.TemporaryDirectory() as state:
        async with namespaces.made():
            cell = Cell(namespaces, state)
            try:
                return await _run(cell, rounds, chance)
            finally:
                for process in cell.running:
                    await cell.kill(process)


async def _run(cell: Cell, rounds: int, chance: random.Random) -> dict[str, Any]:
    here, there = cell.namespaces.agent, cell.namespaces.client
    grippers, where = await cell.start(here, "chaos", "gripper")
    agent, _ = await cell.start(here, "programs", "agent", ENDPOINT, where)
    client, _ = await cell.start(there, "chaos", "worker")
    asking, _ = await cell.start(there, "chaos", "curious")
    panel, _ = await cell.start(here, "chaos", "panel")
    barred: list[tuple[float, float]] = []
    happened: Counter[str] = Counter()
    for number in range(rounds):
        what = ("cut", "loss", "restart", "halt and restart")[number % 4]
        happened[what] += 1
        if what == "loss":
            await cell.namespaces.drop("input", "output", share=chance.choice((5, 20)))
            await asyncio.sleep(1.5)
            await cell.namespaces.mend()
        elif what == "restart":
            await cell.kill(agent)
            await asyncio.sleep(chance.uniform(0.0, 1.0))
            agent, _ = await cell.start(here, "programs", "agent", ENDPOINT, where)
            await asyncio.sleep(2.0)
        else:
            ways = (("input",), ("output",), ("input", "output"))
            both = what != "cut" or number % 3 == 2
            await cell.namespaces.drop(*(ways[2] if both else ways[number % 3]))
            await asyncio.sleep(chance.uniform(0.0, 1.3))
            halted_at = 0.0
            if what != "cut":
                panel.send_signal(signal.SIGUSR1)
                assert panel.stdout is not None
                halted_at = float((await panel.stdout.readline()).decode())
                happened["halts acknowledged"] += halted_at > 0
                await cell.kill(agent)
                agent, _ = await cell.start(here, "programs", "agent", ENDPOINT, where)
            await cell.namespaces.mend()
            if halted_at:
                await asyncio.sleep(4.0)
                barred.append((halted_at, time.monotonic()))
                client.send_signal(signal.SIGUSR1)
        await asyncio.sleep(chance.uniform(0.5, 1.5))
    await asyncio.sleep(3)
    reports = {"worker": await cell.end(client), "curious": await cell.end(asking)}
    await cell.kill(agent)
    images = await cell.end(grippers)
    return {"rounds": happened, **reports, **judged(images, barred)}


def judged(images: list[tuple[float, int, int]], barred: list[tuple[float, float]]) -> dict[str, Any]:
    """What must not be: motion after a halt that was not taken back, or with another speed or force."""
    first = next((at for at, speed, force in images if (speed, force) == (SPEED, FORCE)), 0.0)
    return {
        "images": len(images),
        "with another speed or force": sum(
            at > first and (speed, force) != (SPEED, FORCE) for at, speed, force in images
        ),
        "after a halt": sum(since < at < until for at, _, _ in images for since, until in barred),
    }


PROGRAMS = {"gripper": gripper, "worker": worker, "curious": curious, "panel": panel}

if __name__ == "__main__":
    if sys.argv[1:] and sys.argv[1] in PROGRAMS:
        asyncio.run(PROGRAMS[sys.argv[1]]())
    else:
        say(missing() or json.dumps(asyncio.run(chaos(int((sys.argv[1:] or ["20"])[0])))))
