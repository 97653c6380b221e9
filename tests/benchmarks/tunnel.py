"""From a command to its echo: a hand through a tunnel, beside one at a socket that carries the same line.

    python -m tests.benchmarks.tunnel [beside] --seconds 10

An arm and a simulated 2F-85 run in a process of their own. Both clients reach the line at the tool through
that program, which takes the same time for a call: one with the tunnel of the page, in the arm's protocol,
and the other as rtu+tcp.
"""

from __future__ import annotations

import asyncio
import json
import logging
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from statistics import median
from typing import Final

from robotiq_async import JAW, RobotiqHand
from robotiq_async.hands.statistics import percentile
from tests import arms
from tests.benchmarks import program
from tests.benchmarks.program import ROOT, Row, figures_of, median_of

PARTS = ("beside",)
DELAYS_MS: Final = (0, 4, 10)
FUNCTION: Final = {"XArm": 23, "Dobot": 16, "Doosan": 23}
"""The function that writes: an arm that is the master of the line carries no other."""
PAUSE_S: Final = 0.02
"""From one command to the next, and up to 10 ms more: they meet the polls at any moment."""


async def serve(name: str, delay: float) -> None:
    """Serve both until the end is requested; print their ports."""
    # Doosan's client makes two calls for a request.
    beside = delay * (2 if name == "Doosan" else 1)
    async with arms.arm_with_jaw(name, delay) as (arm, server, _):
        port = int(server.address.partition("?")[0].rpartition(":")[2])
        async with arms.SocketController(arms.ToolLine(port), beside) as relay:
            print(arm.port, relay.port, flush=True)  # noqa: T201
            await asyncio.Event().wait()


@contextmanager
def served(name: str, delay_ms: float) -> Iterator[tuple[int, int]]:
    """The ports of the arm and of the socket."""
    command = [sys.executable, "-m", "tests.benchmarks.tunnel", "--serve", name, str(delay_ms / 1000)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        assert process.stdout is not None
        try:
            arm, beside = process.stdout.readline().split()
            yield int(arm), int(beside)
        finally:
            process.terminate()


async def measured(name: str, arm: int, beside: int, seconds: float) -> dict[str, float]:
    """Seconds from a command to the first status that shows it: one hand after the other, in short turns."""
    options = {"model": "2f85", "write_function": FUNCTION[name]}
    ends, took = time.monotonic() + seconds, (list[float](), list[float]())
    while time.monotonic() < ends:
        for times, hand in zip(
            took,
            (
                RobotiqHand(arms.tunnel_of(name, "127.0.0.1", arm), **options),  # type: ignore[arg-type]
                RobotiqHand(f"rtu+tcp://127.0.0.1:{beside}", **options),  # type: ignore[arg-type]
            ),
            strict=True,
        ):
            times += await asked_to_echo(hand)
    figures = [percentile(sorted(times), share) for times in took for share in (0.5, 0.99)]
    return dict(zip(("tunnel", "tunnel p99", "beside", "beside p99"), figures, strict=True))


async def asked_to_echo(hand: RobotiqHand, rounds: int = 25) -> list[float]:
    times = []
    async with hand:
        statuses = hand.statuses(1000)
        for number in range(rounds):
            await asyncio.sleep(PAUSE_S + 0.0004 * number)
            statuses.drain()
            asked, position = time.monotonic(), 10 + number
            hand.command(position=position)
            async for status in statuses:
                if status.requested_position(JAW) == position:
                    break
            times.append(time.monotonic() - asked)
    return times


class Benchmarks(program.Benchmarks):
    """One run of the part that there is."""

    def beside(self) -> Iterator[Row]:
        """A tunnel beside a socket, from a command to its echo."""
        turns = {
            f"{name}, {delay} ms": partial(self._one, name, delay) for name in FUNCTION for delay in DELAYS_MS
        }
        for who, figures in self.in_turns("beside", turns).items():
            it = median_of(figures)
            yield {
                "arm, time of a call": who,
                "through the tunnel p50, ms": f"{1000 * it['tunnel']:.2f}",
                "p99": f"{1000 * it['tunnel p99']:.1f}",
                "rtu+tcp p50, ms": f"{1000 * it['beside']:.2f}",
                "p99 ": f"{1000 * it['beside p99']:.1f}",
                "ratio": f"{median(each['tunnel'] / each['beside'] for each in figures):.2f}",
            }

    def _one(self, name: str, delay: float) -> dict[str, float]:
        with served(name, delay) as ports:
            return figures_of("tunnel", "--hands", name, *ports, self.seconds)


if __name__ == "__main__":
    logging.getLogger("robotiq_async").setLevel(logging.CRITICAL)
    match sys.argv[1:]:
        case ["--serve", name, delay]:
            asyncio.run(serve(name, float(delay)))
        case ["--hands", name, arm, beside, seconds]:
            print(json.dumps(asyncio.run(measured(name, int(arm), int(beside), float(seconds)))))  # noqa: T201
        case _:
            sys.exit(program.main(Benchmarks, __doc__ or "", PARTS, ["pymodbus", "anyio"], 10.0))
