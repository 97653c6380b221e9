"""Jitter, cost and number of hands beside bare pymodbus and a C thread, in one run.

    python -m tests.benchmarks --json FILE

Every contender runs in a process of its own against grippers in another one (gripper.c). What is compared
takes turns, round after round, and medians of the rounds are printed. Needs gcc; the C thread also needs
libmodbus (Debian: libmodbus-dev).
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from statistics import median

from robotiq_async.hands.statistics import percentile
from tests.benchmarks import program
from tests.benchmarks.contenders import INTERVAL_S, periods
from tests.benchmarks.program import (
    ROOT,
    Figures,
    MissingToolError,
    Row,
    build,
    figures_of,
    grippers,
    median_of,
)

PARTS = ("steady", "many", "latency", "commands", "readers", "import", "memory")
LOOPS = ["asyncio", "uvloop"] if find_spec("uvloop") else ["asyncio"]
HANDS = {"asyncio": (64, 96, 128), "uvloop": (96, 128, 160, 192)}


def jitter(measured: list[float]) -> dict[str, float]:
    """Deviation of periods from the interval, in microseconds."""
    off = sorted(abs(period - INTERVAL_S) * 1e6 for period in measured)
    return {
        **{f"p{100 * share:g}": percentile(off, share) for share in (0.5, 0.99, 0.999)},
        "max": off[-1],
    }


class Benchmarks(program.Benchmarks):
    """One run of the parts that are given."""

    def __init__(self, folder: Path, rounds: int, seconds: float) -> None:
        super().__init__(folder, rounds, seconds)
        self.gripper = build("gripper", folder)
        try:
            self.c_thread: Path | None = build("thread", folder, "modbus")
        except MissingToolError as why:
            self.c_thread = None
            print(f"without the C thread: {why}", file=sys.stderr)  # noqa: T201

    def contender(self, name: str, loop: str, seconds: float, count: int = 1) -> Figures:
        """Run one, against so many grippers of its own."""
        with grippers(self.gripper, count) as ports:
            if name == "libmodbus":
                return self.libmodbus(seconds, ports[0])
            return figures_of("contenders", name, loop, seconds, *ports)

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

        def turn(name: str, loop: str) -> dict[str, float]:
            figures = self.contender(name, loop, self.seconds)
            return {**jitter(figures["periods"]), "cpu": 1e6 * figures["cpu_per_poll"]}

        rounds = self.in_turns("steady", {" ".join(each): partial(turn, *each) for each in who})
        for name, loop in who:
            own, bare = rounds[f"{name} {loop}"], rounds.get(f"bare {loop}")
            it = median_of(own)
            # Pairs of one round: what the machine did then, it did to both.
            pairs = zip(own, bare, strict=True) if bare else ()
            ratio = bare and median(mine["cpu"] / theirs["cpu"] for mine, theirs in pairs)
            yield {
                "who": name,
                "loop": loop,
                **{f"jitter {key}, us": f"{it[key]:.0f}" for key in ("p50", "p99", "p99.9", "max")},
                "CPU a poll, us": f"{it['cpu']:.0f}",
                "CPU against bare": f"{ratio:.2f}" if ratio else "",
            }

    def many(self) -> Iterator[Row]:
        """Grippers that one loop polls at 200 Hz: the share of polls that come in time."""
        seconds = min(self.seconds, 6.0)
        for loop in LOOPS:
            for count in HANDS[loop]:
                names = ("many_bare", "many_hands")
                turns = {name: partial(self.contender, name, loop, seconds, count) for name in names}
                row = {"loop": loop, "grippers": str(count)}
                for name, results in self.in_turns(f"many, {loop} {count}", turns).items():
                    it = median_of(results)
                    row[f"{name.removeprefix('many_')}: in time"] = f"{100 * it['in_time']:.1f} %"
                    row[f"{name.removeprefix('many_')}: CPU a poll, us"] = f"{1e6 * it['cpu_per_poll']:.0f}"
                yield row

    def latency(self) -> Iterator[Row]:
        """Times from command() to the wire, from a reply to its reader, from the last one to a move's end."""
        for loop in LOOPS:
            figures = self.contender("latency", loop, self.seconds)
            self.results.setdefault("latency", {})[loop] = figures
            for name, values in figures.items():
                p50, p99 = (1e6 * percentile(sorted(values), share) for share in (0.5, 0.99))
                shown = {"p50, us": f"{p50:.0f}", "p99, us": f"{p99:.0f}"}
                yield {"what": name.replace("_", " "), "loop": loop, **shown}

    def commands(self) -> Iterator[Row]:
        """The time that a command takes of the loop, in counts and in other amounts."""
        turns = {"asyncio": partial(self.contender, "commands", "asyncio", 5.0)}
        for name, took in median_of(self.in_turns("commands", turns)["asyncio"]).items():
            yield {"command": name, "a call, us": f"{1e6 * took:.0f}"}

    def readers(self) -> Iterator[Row]:
        """The cost of readers of statuses()."""
        names = {"1": "hand", "10": "readers_10", "100": "readers_100"}
        turns = {count: partial(self.contender, name, "asyncio", 5.0) for count, name in names.items()}
        for count, rounds in self.in_turns("readers", turns).items():
            cost = median(1e6 * each["cpu_per_poll"] for each in rounds)
            yield {"readers": count, "CPU a poll, us": f"{cost:.0f}"}

    def import_(self) -> Iterator[Row]:
        """The time of the import."""
        code = "import time; t = time.perf_counter(); import {}; print(time.perf_counter() - t)"
        for module in ("pymodbus.client", "robotiq_async"):
            command = [sys.executable, "-c", code.format(module)]
            times = [
                float(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, cwd=ROOT).stdout)
                for _ in range(4 * self.rounds)
            ]
            self.results.setdefault("import", {})[module] = times
            yield {"module": module, "import, ms": f"{1000 * median(times):.0f}"}

    def memory(self) -> Iterator[Row]:
        """The memory of a hand, and the growth in an hour (measured at 1000 polls a second)."""
        figures = self.contender("memory", "asyncio", 2 * self.seconds, 50)
        self.results["memory"] = figures
        yield {
            "a hand, KiB": f"{figures['per_hand'] / 1024:.0f}",
            "growth in an hour of polls at 200 Hz, KiB": f"{figures['per_hour'] / 1024:.0f}",
            "polls it is taken from": str(figures["polls"]),
        }


if __name__ == "__main__":
    sys.exit(program.main(Benchmarks, __doc__ or "", PARTS, ["pymodbus", "anyio", *LOOPS[1:]], 20.0))
