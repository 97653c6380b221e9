"""A hand on a serial line at its real speed: how often it polls and writes, and how long a command takes.

    python -m tests.benchmarks.serial [idle stream beside] --seconds 20

The simulated gripper runs in a process of its own, on one end of a pair of pseudo terminals, and takes the
time that the bytes take at 115200 baud. Beside the usual interval stand others.

``beside`` compares a hand with a bare client and with pyRobotiqGripper at a 2F-85, on a line that is not
ours (line.c, needs gcc): the bytes, 0.3 ms of silence and 0.5 ms for the reply. A hand at a 3-Finger stands
beside.
"""

from __future__ import annotations

import asyncio
import json
import logging
import random
import selectors
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from robotiq_async import Finger, RobotiqHand, RobotiqStatus
from robotiq_async.hands.statistics import percentile
from robotiq_async.simulator import SerialSimulatorServer, SimulatedGripper
from tests.benchmarks import program
from tests.benchmarks.program import ROOT, Row, figures_of, median_of
from tests.serial_line import SerialLine

PARTS = ("idle", "stream", "beside")
INTERVALS = (0.005, 0.01, 0.02)
STREAM_S = 0.002
"""Seconds from one command of a stream to the next: more commands than any line can carry."""
TARGET_S = 0.01
"""Seconds from one target to the next of the control loop that is compared with others."""
ALONE_S = (0.02, 0.037)
"""Seconds from one command to the next, where each has ended before."""
LINE_MS = ("0.3", "0.5")
"""Silence and turnaround of the line that is not ours."""
OTHER = "pyRobotiqGripper"


# -- the gripper, in a process of its own ------------------------------------------------------------------


async def gripper(folder: str) -> None:
    """Serve until the end is requested; print the port once it serves."""
    with SerialLine(Path(folder)) as line:
        async with SerialSimulatorServer(line.far, SimulatedGripper(speedup=4.0)):
            print(line.near, flush=True)  # noqa: T201
            await asyncio.Event().wait()


@contextmanager
def served() -> Iterator[str]:
    """The port of a gripper."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "tests.benchmarks.serial", "--gripper", folder]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
            assert process.stdout is not None
            try:
                yield process.stdout.readline().strip()
            finally:
                process.terminate()


# -- the hand ----------------------------------------------------------------------------------------------


async def measured(port: str, interval: float, seconds: float, *, streams: bool) -> dict[str, float]:
    """Figures of a hand in so many seconds, with a stream of commands or without."""
    async with RobotiqHand(f"rtu://{port}", poll_interval=interval, write_spacing=0.0) as hand:
        await asyncio.sleep(0.3)
        before, used, began = hand.statistics, time.process_time(), time.monotonic()
        took = await (streamed(hand, seconds) if streams else asked(hand, seconds))
        wall, cpu, after = time.monotonic() - began, time.process_time() - used, hand.statistics
    polls = after.polls - before.polls
    took.sort()
    return {
        "polls": polls / wall,
        "writes": (after.writes - before.writes) / wall,
        "overruns": (after.overruns - before.overruns) / wall,
        "reconnects": after.reconnects - before.reconnects,
        "round_trip": after.round_trip_p50,
        "p50": percentile(took, 0.5),
        "p99": percentile(took, 0.99),
        "cpu": cpu / polls,
    }


async def streamed(hand: RobotiqHand, seconds: float) -> list[float]:
    """A control loop that commands all the time; how long commands take that are awaited beside it."""
    ends = time.monotonic() + seconds

    async def stream() -> None:
        position = 0
        while time.monotonic() < ends:
            position = (position + 1) % 200
            hand.command(Finger.A, position=position)
            await asyncio.sleep(STREAM_S)

    streaming = asyncio.create_task(stream())
    took = await asked(hand, seconds)
    await streaming
    return took


async def asked(hand: RobotiqHand, seconds: float) -> list[float]:
    """Now and then a command that is awaited: seconds until it was acknowledged."""
    took, ends, speed = [], time.monotonic() + seconds, 0
    while time.monotonic() < ends:
        speed = (speed + 37) % 256
        began = time.monotonic()
        await hand.set_speed(speed, Finger.B)
        took.append(time.monotonic() - began)
        await asyncio.sleep(0.2 + 0.001 * (speed % 20))
    return took


# -- beside others -----------------------------------------------------------------------------------------


@contextmanager
def independent(program: Path, model: str = "2f85") -> Iterator[str]:
    """The port of a gripper in C."""
    with tempfile.TemporaryDirectory() as folder:
        port = f"{folder}/tty"
        command = [str(program), "gripper", model, port, *LINE_MS]
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT
        ) as process:
            assert process.stdout is not None
            assert process.stdin is not None
            process.stdout.readline()
            try:
                yield port
            finally:
                process.stdin.close()


async def compared(port: str, seconds: float, options: dict[str, int | str]) -> dict[str, float]:
    """A hand that polls, then follows a target that changes 100 times a second, then single commands."""
    async with RobotiqHand(f"rtu://{port}", **options) as hand:  # type: ignore[arg-type]
        await asyncio.sleep(0.3)
        part = seconds / 3
        before, used, began = hand.statistics, time.process_time(), time.monotonic()
        await asyncio.sleep(part)
        polls, wall = hand.statistics.polls - before.polls, time.monotonic() - began
        cpu = (time.process_time() - used) / polls
        before, began = hand.statistics, time.monotonic()
        in_stream = await followed(hand, part, lambda: TARGET_S)
        streaming, after = time.monotonic() - began, hand.statistics
        alone = await followed(hand, part, lambda: random.uniform(*ALONE_S))
        return {
            "idle": polls / wall,
            "statuses": (after.polls - before.polls) / streaming,
            "writes": (after.writes - before.writes) / streaming,
            "p50": percentile(alone, 0.5),
            "p99": percentile(alone, 0.99),
            "in_stream": percentile(in_stream, 0.5),
            "cpu": cpu,
        }


async def followed(hand: RobotiqHand, seconds: float, pause: Callable[[], float]) -> list[float]:
    """Seconds from each target until a status shows it, or a later one; sorted."""
    pending: dict[int, float] = {}
    took: list[float] = []
    axis = hand.model.axes[0]

    def see(item: object) -> None:
        if isinstance(item, RobotiqStatus) and (asked := pending.get(item.requested_position(axis))):
            for target, when in list(pending.items()):
                if when <= asked:
                    took.append(item.timestamp - when)
                    del pending[target]

    remove, due, target = hand.add_listener(see), time.monotonic(), 0
    ends = due + seconds
    while time.monotonic() < ends:
        target = (target + 1) % 200
        pending[target] = time.monotonic()
        hand.command(axis, position=target)
        due += pause()
        await asyncio.sleep(max(0.0, due - time.monotonic()))
    remove()
    return sorted(took)


def blocking(port: str, seconds: float) -> dict[str, float]:
    """pyRobotiqGripper, whose calls block: it reads, and then it moves 100 times a second.

    A move writes and reads in one exchange. A target comes at a random moment, as with the bare client, and
    waits for the next cycle.
    """
    from pyrobotiqgripper import RobotiqGripper  # noqa: PLC0415  # the other programs do without it

    driver = RobotiqGripper(com_port=port)
    driver.activate()
    reads, used, began = 0, time.process_time(), time.monotonic()
    while (idle := time.monotonic() - began) < seconds / 2:
        driver.readStatus()
        reads += 1
    cpu = (time.process_time() - used) / reads
    took, cycles, target = [], 0, 0
    began = tick = time.monotonic()
    asked = began + random.uniform(0, TARGET_S)
    while (wall := time.monotonic() - began) < seconds / 2:
        is_new = time.monotonic() >= asked
        target = (target + is_new) % 200
        driver.move(target, speed=255, force=64, wait=False)
        cycles += 1
        if is_new and driver.status(refreshStatus=False)["gPR"] == target:
            took.append(time.monotonic() - asked)
            asked = time.monotonic() + random.uniform(0, TARGET_S)
        tick += TARGET_S
        time.sleep(max(0.0, tick - time.monotonic()))
    driver.disconnect()
    took.sort()
    return {
        "idle": reads / idle,
        "statuses": cycles / wall,
        "writes": cycles / wall,
        "p50": percentile(took, 0.5),
        "p99": percentile(took, 0.99),
        "cpu": cpu,
    }


# -- the tables --------------------------------------------------------------------------------------------


class Benchmarks(program.Benchmarks):
    """One run of the parts that are given."""

    def idle(self) -> Iterator[Row]:
        """A hand that polls, with a command now and then."""
        yield from self._rows("idle")

    def stream(self) -> Iterator[Row]:
        """A hand that is given a command every 2 ms."""
        yield from self._rows("stream")

    def _rows(self, what: str) -> Iterator[Row]:
        turns = {f"{1000 * interval:g}": partial(self._one, interval, what) for interval in INTERVALS}
        for interval, figures in self.in_turns(what, turns).items():
            it = median_of(figures)
            yield {
                "interval, ms": interval,
                **{f"{name} a second": f"{it[name]:.1f}" for name in ("polls", "writes", "overruns")},
                "round trip of a read p50, ms": f"{1000 * it['round_trip']:.1f}",
                "command until acknowledged p50, ms": f"{1000 * it['p50']:.1f}",
                "p99, ms": f"{1000 * it['p99']:.1f}",
                "reconnects": f"{it['reconnects']:g}",
                "CPU a poll, us": f"{1e6 * it['cpu']:.0f}",
            }

    def beside(self) -> Iterator[Row]:
        """A hand beside a bare client and pyRobotiqGripper, on the same line."""
        line = program.build("line", self.folder, "util")

        def bare(hz: int) -> dict[str, float]:
            with independent(line) as port:
                command = [str(line), "bare", port, str(hz), str(self.seconds / 2)]
                done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
                found: dict[str, float] = json.loads(done.stdout)
            return {"idle": found["statuses"], "cpu": 0.0, **found}

        def other() -> dict[str, float]:
            with independent(line) as port:
                return figures_of("serial", "--other", port, self.seconds)

        def hand(model: str = "2f85", **options: int) -> dict[str, float]:
            with independent(line, model) as port:
                said = json.dumps({"model": model, **options})
                return figures_of("serial", "--beside", port, self.seconds, said)

        turns: dict[str, Callable[[], dict[str, float]]] = {
            "bare, 100 Hz": partial(bare, 100),
            "bare, free run": partial(bare, 0),
            "hand": hand,
            "hand, write_function=16": partial(hand, write_function=16),
            "hand, 3-Finger": partial(hand, "3f"),
        }
        if find_spec("pyrobotiqgripper"):
            turns[OTHER] = other
        for name, figures in self.in_turns("beside", turns).items():
            it = median_of(figures)
            yield {
                "client": name,
                "statuses a second, idle": f"{it['idle']:.0f}",
                "streaming 100 Hz": f"{it['statuses']:.0f}",
                "writes a second": f"{it['writes']:.0f}",
                "echo p50, ms": f"{1000 * it['p50']:.2f}",
                "p99, ms": f"{1000 * it['p99']:.1f}",
                "echo in the stream p50, ms": f"{1000 * it.get('in_stream', it['p50']):.2f}",
                "CPU a status, ms": f"{1000 * it['cpu']:.2f}" if it["cpu"] else "",
            }
        if OTHER not in turns:
            print(f"{OTHER} is not installed", file=sys.stderr)  # noqa: T201

    def _one(self, interval: float, what: str) -> dict[str, float]:
        with served() as port:
            return figures_of("serial", "--hand", port, interval, self.seconds, what)


def precise_loop() -> asyncio.AbstractEventLoop:
    """A loop whose timers are not rounded up to a millisecond, as epoll's are: the line is to be exact."""
    return asyncio.SelectorEventLoop(selectors.SelectSelector())


if __name__ == "__main__":
    logging.getLogger("robotiq_async").setLevel(logging.CRITICAL)
    match sys.argv[1:]:
        case ["--gripper", folder]:
            with asyncio.Runner(loop_factory=precise_loop) as runner:
                runner.run(gripper(folder))
        case ["--beside", port, seconds, options]:
            print(json.dumps(asyncio.run(compared(port, float(seconds), json.loads(options)))))  # noqa: T201
        case ["--other", port, seconds]:
            print(json.dumps(blocking(port, float(seconds))))  # noqa: T201
        case ["--hand", port, interval, seconds, what]:
            figures = asyncio.run(measured(port, float(interval), float(seconds), streams=what == "stream"))
            print(json.dumps(figures))  # noqa: T201
        case _:
            packages = ["pymodbus", "pyserial", "anyio"]
            sys.exit(program.main(Benchmarks, __doc__ or "", PARTS, packages, 20.0))
