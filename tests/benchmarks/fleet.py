"""Hands on other hosts beside hands of the own process, in one run: how quick, how cheap, how many.

    python -m tests.benchmarks.fleet --json FILE

Agent, clients and grippers (gripper.c) run in processes of their own on one machine, over zenoh on loopback.
The contenders take turns, round after round, and medians of the rounds are printed. Needs gcc.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from statistics import median

from tests.benchmarks import program
from tests.benchmarks.program import ROOT, Figures, Row, build, grippers
from tests.fleet.sessions import free_port

PARTS = ("commands", "agents", "overview")
HANDS = (1, 8, 16, 32)
READERS = (0, 1, 5)
OVERVIEW = 1000
WATCHED = 100


class Role:
    """A process that takes a part; see fleet_roles.py."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self._hear("ready")

    def begin(self) -> None:
        """Have it begin to measure."""
        self._say("begin")

    def end(self, seconds: float = 0) -> Figures:
        """Its figures; of one that measures by itself, after so many seconds."""
        self._say(f"end {seconds}")
        figures: Figures = json.loads(self._hear())
        return figures

    def _say(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n")
        self._process.stdin.flush()

    def _hear(self, expected: str = "") -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline().strip()
        if not line or (expected and line != expected):
            raise RuntimeError(f"{self._process.args!r} failed")
        return line


@contextmanager
def role(*arguments: object) -> Iterator[Role]:
    """Start one; it has ended at the end of the block."""
    command = [sys.executable, "-m", "tests.benchmarks.fleet_roles", *map(str, arguments)]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT
    ) as process:
        try:
            yield Role(process)
        finally:
            assert process.stdin is not None
            process.stdin.close()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()


def endpoint() -> str:
    """An endpoint at which no server listens yet."""
    return f"tcp/127.0.0.1:{free_port()}"


class Benchmarks(program.Benchmarks):
    """One run of the parts that are given."""

    def __init__(self, folder: Path, rounds: int, seconds: float) -> None:
        super().__init__(folder, rounds, seconds)
        self.gripper = build("gripper", folder)

    def commands(self) -> Iterator[Row]:
        """Seconds from a command to its acknowledgement, and from a halt to the status that confirms it."""
        who = ("local", "remote", f"remote, beside {WATCHED} streams of 200 Hz")
        turns = {each: partial(self._commands, kind) for kind, each in enumerate(who)}
        rounds = self.in_turns("commands", turns)
        for what in ("set_speed", "halt"):
            for each in who:
                figures = [it[what] for it in rounds[each]]
                yield {
                    "what": what,
                    "hand": each,
                    **{f"{key}, ms": f"{median(it[key] for it in figures):.2f}" for key in ("p50", "p99")},
                    "times": str(sum(it["times"] for it in rounds[each])),
                }

    def _commands(self, kind: int) -> Figures:
        with ExitStack() as stack:
            (port,) = stack.enter_context(grippers(self.gripper, 1))
            if kind == 0:
                it = stack.enter_context(role("local_commander", "-", port))
                return it.end(self.seconds)
            where = endpoint()
            stack.enter_context(role("agent", where, port))
            if kind == 1:
                return stack.enter_context(role("commander", where)).end(self.seconds)
            other = endpoint()
            stack.enter_context(role("generator", other, WATCHED))
            return stack.enter_context(role("busy_commander", where, other)).end(self.seconds)

    def agents(self) -> Iterator[Row]:
        """The cost of serving, and its effect on the polls; each hand is polled 200 times a second."""
        cases = [(count, readers) for count in HANDS for readers in (None, *READERS)]
        turns = {f"{count} {readers}": partial(self._agent, count, readers) for count, readers in cases}
        rounds = self.in_turns("agents", turns)
        for count, readers in cases:
            own, bare = rounds[f"{count} {readers}"], rounds[f"{count} None"]
            ratio = median(it["period_p99"] / base["period_p99"] for it, base in zip(own, bare, strict=True))
            yield {
                "hands": str(count),
                "readers": "no agent" if readers is None else str(readers),
                "CPU of the process": f"{100 * median(it['cpu'] for it in own):.1f} %",
                "polls kept": f"{100 * median(it['kept'] for it in own):.1f} %",
                "period p99, ms": f"{median(it['period_p99'] for it in own):.2f}",
                "against no agent": f"{ratio:.2f}",
                **reader_cells([it["readers"] for it in own], count),
            }

    def _agent(self, count: int, readers: int | None) -> Figures:
        with ExitStack() as stack:
            ports = stack.enter_context(grippers(self.gripper, count))
            where = endpoint()
            serving = stack.enter_context(role("local" if readers is None else "agent", where, *ports))
            reading = [stack.enter_context(role("reader", where, count)) for _ in range(readers or 0)]
            time.sleep(1.0)
            for each in (serving, *reading):
                each.begin()
            time.sleep(self.seconds)
            return {**serving.end(), "readers": [each.end() for each in reading]}

    def overview(self) -> Iterator[Row]:
        """Summaries of a thousand grippers, one a second each, in one client."""
        (rounds,) = self.in_turns("overview", {f"{OVERVIEW} grippers": self._overview}).values()
        yield {
            "grippers heard of": f"{median(it['members'] for it in rounds):.0f}",
            "CPU of the client": f"{100 * median(it['cpu'] for it in rounds):.1f} %",
        }

    def _overview(self) -> Figures:
        where = endpoint()
        with role("summaries", where, OVERVIEW), role("overview", where) as client:
            time.sleep(2.5)
            client.begin()
            time.sleep(self.seconds)
            figures = client.end()
        assert figures["members"] == OVERVIEW, "the client could not read every summary"
        return figures


def reader_cells(rounds: list[list[Figures]], count: int) -> Row:
    """The statuses that readers got, and their cost."""
    every = [each for readers in rounds for each in readers]
    names = ("reader: CPU a hand", "statuses a second", "late p50, ms", "late p99, ms")
    if not every:
        return dict.fromkeys(names, "")
    values = (
        f"{100 * median(it['cpu'] for it in every) / count:.1f} %",
        f"{median(it['rate'] for it in every):.0f}",
        f"{median(it['latency']['p50'] for it in every):.2f}",
        f"{median(it['latency']['p99'] for it in every):.2f}",
    )
    return dict(zip(names, values, strict=True))


if __name__ == "__main__":
    sys.exit(program.main(Benchmarks, __doc__ or "", PARTS, ["eclipse-zenoh", "pymodbus"], 10.0))
