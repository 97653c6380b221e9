"""The common part of the programs that measure: rounds, processes, tables, a file of figures."""

from __future__ import annotations

import argparse
import contextlib
import json
import keyword
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import Any, TypeVar

Row = dict[str, str]
Figures = dict[str, Any]
T = TypeVar("T")
HERE = Path(__file__).parent
ROOT = HERE.parents[1]


class MissingToolError(RuntimeError):
    """Something that is needed to build a program is not there."""


class Benchmarks:
    """One run of the parts that are given; each part is a method of that name."""

    def __init__(self, folder: Path, rounds: int, seconds: float) -> None:
        """Programs are built in the folder; each takes a turn of so many seconds in each round."""
        self.folder, self.rounds, self.seconds = folder, rounds, seconds
        self.results: dict[str, Any] = {}

    def in_turns(self, what: str, turns: Mapping[str, Callable[[], T]]) -> dict[str, list[T]]:
        """The figures of each, round after round: the machine may be noisy, and then it is so for all."""
        rounds: dict[str, list[T]] = {each: [] for each in turns}
        for number in range(self.rounds):
            for each, turn in turns.items():
                print(f"{what}, round {number + 1} of {self.rounds}: {each}", file=sys.stderr, flush=True)  # noqa: T201
                rounds[each].append(turn())
        self.results[what] = rounds
        return rounds


def median_of(rounds: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """The median over rounds, figure by figure."""
    return {name: median(each[name] for each in rounds) for name in rounds[0]}


def figures_of(module: str, *arguments: object) -> Figures:
    """The output of a module of this folder, run in a process of its own."""
    command = [sys.executable, "-m", f"tests.benchmarks.{module}", *map(str, arguments)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, cwd=ROOT)
    figures: Figures = json.loads(done.stdout)
    return figures


# -- programs in C -----------------------------------------------------------------------------------------


def build(name: str, folder: Path, *libraries: str) -> Path:
    """Compile NAME.c into a folder.

    Raises:
        MissingToolError: no compiler, or a header or library is missing.
    """
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise MissingToolError("there is no C compiler (gcc)")
    program = folder / name
    options = [f"-l{library}" for library in libraries]
    command = [compiler, "-O2", "-o", str(program), str(HERE / f"{name}.c"), *options]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    if built.returncode:
        raise MissingToolError(f"{name}.c does not compile: {built.stderr.strip().splitlines()[0]}")
    return program


@contextlib.contextmanager
def grippers(program: Path, count: int) -> Iterator[list[int]]:
    """Run so many cheap grippers in a process of their own; yield the ports they listen on."""
    with subprocess.Popen([program, str(count)], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        yield [int(port) for port in process.stdout.readline().split()]
        process.stdin.close()


# -- the command line --------------------------------------------------------------------------------------


def main(
    make: Callable[[Path, int, float], Benchmarks],
    what: str,
    parts: Sequence[str],
    packages: Sequence[str],
    seconds: float,
) -> int:
    """Read the options, run the parts, print their tables; the packages' versions belong to the figures."""
    options = _options(what, parts, seconds)
    with tempfile.TemporaryDirectory() as folder:
        try:
            it = make(Path(folder), options.rounds, options.seconds)
        except MissingToolError as why:
            print(f"the benchmarks cannot run: {why}", file=sys.stderr)  # noqa: T201
            return 1
        for part in options.parts or parts:
            name = f"{part}_" if keyword.iskeyword(part) else part
            measure: Callable[[], Iterator[Row]] = getattr(it, name)
            print(f"\n{measure.__doc__}\n\n{_table(list(measure()))}", flush=True)  # noqa: T201
    it.results["of"] = {
        "python": platform.python_version(),
        **{name: version(name) for name in packages},
        "rounds": options.rounds,
        "seconds": options.seconds,
    }
    if options.json is not None:
        options.json.write_text(json.dumps(it.results), encoding="utf-8")
    return 0


def _options(what: str, parts: Sequence[str], seconds: float) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=what, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"which: {', '.join(parts)} (default: all)")
    parser.add_argument("--rounds", type=int, default=3, help="how often each takes its turn (default: 3)")
    usual = f"how long each turn is (default: {seconds:g})"
    parser.add_argument("--seconds", type=float, default=seconds, help=usual)
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write all figures there")
    options = parser.parse_args()
    if unknown := set(options.parts) - set(parts):
        parser.error(f"no such part: {', '.join(sorted(unknown))}; there are {', '.join(parts)}")
    return options


def _table(rows: list[Row]) -> str:
    """Rows as a Markdown table."""
    names = list(rows[0])
    lines = [names, ["--"] * len(names), *([row[name] for name in names] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
