"""How steady, how cheap, how many: the hand beside bare pymodbus and a C thread, in one run.

    python -m tests.benchmarks --json FILE

Every contender runs in a process of its own against grippers in another one (gripper.c). What is compared
takes turns, round after round, and medians of the rounds are shown: the machine may be noisy, and then it
is so for all. Needs gcc; the C thread also needs libmodbus (Debian: libmodbus-dev).
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import Any

from robotiq_async.values.statistics import percentile
from tests.benchmarks.contenders import INTERVAL_S, Figures, periods
from tests.benchmarks.native import MissingToolError, build, grippers
from tests.benchmarks.program import Row, main, say

PARTS = ("steady", "many", "latency", "readers", "import", "memory")
ROOT = Path(__file__).parents[2]
LOOPS = ["asyncio", "uvloop"] if find_spec("uvloop") else ["asyncio"]
HANDS = {"asyncio": (64, 96, 128), "uvloop": (96, 128, 160, 192)}


def jitter(measured: list[float]) -> dict[str, float]:
    """How far periods are from the interval, in microseconds."""
    off = sorted(abs(period - INTERVAL_S) * 1e6 for period in measured)
    return {
        **{f"p{100 * share:g}": percentile(off, share) for share in (0.5, 0.99, 0.999)},
        "max": off[-1],
    }


def median_of(rounds: list[dict[str, Any]]) -> dict[str, float]:
    """The median over rounds, figure by figure."""
    return {name: median(each[name] for each in rounds) for name in rounds[0]}


class Benchmarks:
    """One run of all that is asked for."""

    def __init__(self, folder: Path, rounds: int, seconds: float) -> None:
        self.gripper = build("gripper", folder)
        self.rounds = rounds
        self.seconds = seconds
        self.results: dict[str, Any] = {}
        try:
            self.c_thread: Path | None = build("thread", folder, "modbus")
        except MissingToolError as why:
            self.c_thread = None
            say(f"without the C thread: {why}")

    def contender(self, name: str, loop: str, seconds: float, count: int = 1) -> Figures:
        """Run one, against so many grippers of its own."""
        with grippers(self.gripper, count) as ports:
            if name == "libmodbus":
                return self.libmodbus(seconds, ports[0])
            command = [sys.executable, "-m", "tests.benchmarks.contenders", name, loop, str(seconds)]
            done = subprocess.run(
                [*command, *map(str, ports)], stdout=subprocess.PIPE, text=True, check=True, cwd=ROOT
            )
        figures: Figures = json.loads(done.stdout)
        return figures

    def libmodbus(self, seconds: float, port: int) -> Figures:
        """The C thread."""
        assert self.c_thread is not None
        polls = round(seconds / INTERVAL_S)
        command = [str(self.c_thread), str(port), str(round(INTERVAL_S * 1e6)), str(polls)]
        out = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
        cpu, *lines = out.splitlines()
        times = [int(line.split()[0]) / 1e9 for line in lines]
        return {"periods": periods(times), "cpu_per_poll": float(cpu) / polls}

    def steady(self) -> Iterator[Row]:
        """Jitter of the period, and CPU per poll, of one gripper at 200 Hz."""
        who = [("libmodbus", "C")] if self.c_thread else []
        who += [("thread", "blocking"), *((name, loop) for loop in LOOPS for name in ("bare", "hand"))]
        rounds: dict[tuple[str, str], list[dict[str, float]]] = {each: [] for each in who}
        for number in range(self.rounds):
            for name, loop in who:
                say(f"steady, round {number + 1} of {self.rounds}: {name} ({loop})")
                figures = self.contender(name, loop, self.seconds)
                cpu = 1e6 * figures["cpu_per_poll"]
                rounds[name, loop].append({**jitter(figures["periods"]), "cpu": cpu})
        self.results["steady"] = {" ".join(each): rounds[each] for each in who}
        medians = {each: median_of(rounds[each]) for each in who}
        for name, loop in who:
            it = medians[name, loop]
            against = medians.get(("bare", loop))
            # Pairs of one round: what the machine did then, it did to both.
            ratio = against and median(
                mine["cpu"] / theirs["cpu"]
                for mine, theirs in zip(rounds[name, loop], rounds["bare", loop], strict=True)
            )
            yield {
                "who": name,
                "loop": loop,
                **{f"jitter {key}, us": f"{it[key]:.0f}" for key in ("p50", "p99", "p99.9", "max")},
                "CPU a poll, us": f"{it['cpu']:.0f}",
                "CPU against bare": f"{ratio:.2f}" if ratio else "",
            }

    def many(self) -> Iterator[Row]:
        """How many grippers one loop polls at 200 Hz: the share of polls that come in time."""
        seconds = min(self.seconds, 6.0)
        for loop in LOOPS:
            for count in HANDS[loop]:
                rounds: dict[str, list[Figures]] = {"many_bare": [], "many_hands": []}
                for number in range(self.rounds):
                    for name, results in rounds.items():
                        say(f"many, round {number + 1} of {self.rounds}: {count} x {name} ({loop})")
                        results.append(self.contender(name, loop, seconds, count))
                self.results.setdefault("many", {})[f"{loop} {count}"] = rounds
                row = {"loop": loop, "grippers": str(count)}
                for name, results in rounds.items():
                    it = median_of(results)
                    row[f"{name.removeprefix('many_')}: in time"] = f"{100 * it['in_time']:.1f} %"
                    row[f"{name.removeprefix('many_')}: CPU a poll, us"] = f"{1e6 * it['cpu_per_poll']:.0f}"
                yield row

    def latency(self) -> Iterator[Row]:
        """From command() to the wire, from a reply to its reader, from the last reply to move()'s return."""
        for loop in LOOPS:
            say(f"latency ({loop})")
            figures = self.contender("latency", loop, self.seconds)
            self.results.setdefault("latency", {})[loop] = figures
            for name, values in figures.items():
                p50, p99 = (1e6 * percentile(sorted(values), share) for share in (0.5, 0.99))
                yield {
                    "what": name.replace("_", " "),
                    "loop": loop,
                    "p50, us": f"{p50:.0f}",
                    "p99, us": f"{p99:.0f}",
                }

    def readers(self) -> Iterator[Row]:
        """What readers of statuses() cost."""
        names = {"hand": "1", "readers_10": "10", "readers_100": "100"}
        costs: dict[str, list[float]] = {name: [] for name in names}
        for number in range(self.rounds):
            for name in names:
                say(f"readers, round {number + 1} of {self.rounds}: {names[name]}")
                costs[name].append(1e6 * self.contender(name, "asyncio", 5.0)["cpu_per_poll"])
        self.results["readers"] = costs
        for name, values in costs.items():
            yield {"readers": names[name], "CPU a poll, us": f"{median(values):.0f}"}

    def import_(self) -> Iterator[Row]:
        """How long the import takes."""
        program = "import time; t = time.perf_counter(); import {}; print(time.perf_counter() - t)"
        for module in ("pymodbus.client", "robotiq_async"):
            say(f"import {module}")
            command = [sys.executable, "-c", program.format(module)]
            times = [
                float(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, cwd=ROOT).stdout)
                for _ in range(4 * self.rounds)
            ]
            self.results.setdefault("import", {})[module] = times
            yield {"module": module, "import, ms": f"{1000 * median(times):.0f}"}

    def memory(self) -> Iterator[Row]:
        """What a hand takes, and what an hour adds (measured at 1000 polls a second)."""
        say("memory")
        figures = self.contender("memory", "asyncio", 2 * self.seconds, 50)
        self.results["memory"] = figures
        yield {
            "a hand, KiB": f"{figures['per_hand'] / 1024:.0f}",
            "growth in an hour of polls at 200 Hz, KiB": f"{figures['per_hour'] / 1024:.0f}",
            "polls it is taken from": str(figures["polls"]),
        }


if __name__ == "__main__":
    sys.exit(main(Benchmarks, __doc__ or "", PARTS, ["pymodbus", "anyio", *LOOPS[1:]], 20.0))
