"""A hand at a URCap's text port, beside one over Modbus TCP and a bare loop of questions: statuses and CPU.

    python -m tests.benchmarks.urcap [idle stream] --seconds 10

The simulated gripper runs in a process of its own, and answers at once or some milliseconds late.
"""

from __future__ import annotations

import asyncio
import json
import logging
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from robotiq_async import JAW, TWO_FINGER_85, RobotiqHand
from robotiq_async.hands.statistics import percentile
from robotiq_async.link.urcap.transport import SLOW
from robotiq_async.simulator import SimulatedGripper, SimulatorServer, Trouble, UrcapSimulatorServer
from tests.benchmarks import program
from tests.benchmarks.program import ROOT, Row, figures_of, median_of

PARTS = ("idle", "stream")
DELAYS_MS = (0, 1, 4)
STREAM_S = 0.02
ALL = ("PRE", "OBJ", "POS", *SLOW)
WHO = {"Modbus TCP": SimulatorServer, "text port": UrcapSimulatorServer}


async def gripper(who: str, delay: float) -> None:
    """Serve until the end is requested; print the address once it serves."""
    async with WHO[who](SimulatedGripper(model=TWO_FINGER_85)) as server:
        if delay:
            await server.fault_injector.begin(Trouble("delay", delay))
        print(server.address, flush=True)  # noqa: T201
        await asyncio.Event().wait()


@contextmanager
def served(who: str, delay: float) -> Iterator[str]:
    """The address of a gripper."""
    command = [sys.executable, "-m", "tests.benchmarks.urcap", "--gripper", who, str(delay)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.terminate()


async def measured(address: str, seconds: float, *, streams: bool) -> dict[str, float]:
    """Figures of a hand in so many seconds, with 50 commands a second or without."""
    async with RobotiqHand(address) as hand:
        await hand.open()
        before, used, began = hand.statistics, time.process_time(), time.monotonic()
        echoes = await streamed(hand, seconds) if streams else []
        await asyncio.sleep(began + seconds - time.monotonic())
        wall, cpu, after = time.monotonic() - began, time.process_time() - used, hand.statistics
    return {
        "rate": (after.polls - before.polls) / wall,
        "status": after.round_trip_p50,
        "status p99": after.round_trip_p99,
        "cpu": cpu / wall,
        "echo": percentile(sorted(echoes), 0.5) if echoes else 0.0,
        "foreign": after.foreign_commands,
    }


async def streamed(hand: RobotiqHand, seconds: float) -> list[float]:
    """Seconds from each command to the status that echoes it; a command that is never seen has none."""
    asked: dict[int, float] = {}
    echoes: list[float] = []

    async def watch() -> None:
        async for status in hand.statuses():
            began = asked.pop(status.requested_position(JAW), None)
            if began is not None:
                echoes.append(status.timestamp - began)

    watching, ends, position = asyncio.create_task(watch()), time.monotonic() + seconds, 30
    while time.monotonic() < ends:
        position = 30 + (position + 7) % 190
        asked[position] = time.monotonic()
        hand.command(position=position, speed=255)
        await asyncio.sleep(STREAM_S)
    watching.cancel()
    return echoes


def bare(address: str, seconds: float) -> dict[str, float]:
    """All variables, one after the other, as fast as they come."""
    host, _, port = address.removeprefix("urcap://").partition("?")[0].partition(":")
    used, began, statuses = time.process_time(), time.monotonic(), 0
    with socket.create_connection((host, int(port))) as line:
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        while time.monotonic() - began < seconds:
            for name in ALL:
                line.sendall(f"GET {name}\n".encode())
                line.recv(100)
            statuses += 1
    wall = time.monotonic() - began
    return {"rate": statuses / wall, "status": wall / statuses, "cpu": (time.process_time() - used) / wall}


class Benchmarks(program.Benchmarks):
    """One run of the parts that are given."""

    def idle(self) -> Iterator[Row]:
        """A hand that polls."""
        yield from self._rows("idle")

    def stream(self) -> Iterator[Row]:
        """A hand that is given a command every 20 ms."""
        yield from self._rows("stream")

    def _rows(self, what: str) -> Iterator[Row]:
        loops = ("bare loop",) if what == "idle" else ()
        turns = {
            f"{who}, {delay} ms": partial(self._one, who, delay, what)
            for delay in DELAYS_MS
            for who in (*WHO, *loops)
        }
        for who, figures in self.in_turns(what, turns).items():
            it = median_of(figures)
            yield {
                "who, delay of an answer": who,
                "statuses a second": f"{it['rate']:.0f}",
                "a status p50, ms": f"{1000 * it['status']:.2f}",
                "p99, ms": f"{1000 * it['status p99']:.2f}" if "status p99" in it else "",
                "command to echo p50, ms": f"{1000 * it['echo']:.1f}" if it.get("echo") else "",
                "CPU, %": f"{100 * it['cpu']:.1f}",
                "commands of others": f"{it['foreign']:g}" if "foreign" in it else "",
            }

    def _one(self, who: str, delay: int, what: str) -> dict[str, float]:
        with served("text port" if who == "bare loop" else who, delay / 1000) as address:
            if who == "bare loop":
                return bare(address, self.seconds)
            return figures_of("urcap", "--hand", address, self.seconds, what)


if __name__ == "__main__":
    logging.getLogger("robotiq_async").setLevel(logging.CRITICAL)
    match sys.argv[1:]:
        case ["--gripper", who, delay]:
            asyncio.run(gripper(who, float(delay)))
        case ["--hand", address, seconds, what]:
            figures = asyncio.run(measured(address, float(seconds), streams=what == "stream"))
            print(json.dumps(figures))  # noqa: T201
        case _:
            sys.exit(program.main(Benchmarks, __doc__ or "", PARTS, ["pymodbus", "anyio"], 10.0))
