"""What the programs that measure have in common: parts in rounds, tables, a file of figures."""

from __future__ import annotations

import argparse
import json
import keyword
import platform
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

from tests.benchmarks.native import MissingToolError

Row = dict[str, str]


class Benchmarks(Protocol):
    """One run of all that is asked for; each part is a method of that name."""

    results: dict[str, Any]


def main(
    make: Callable[[Path, int, float], Benchmarks],
    what: str,
    parts: Sequence[str],
    packages: Sequence[str],
    seconds: float,
) -> int:
    """Read the options and run.

    Args:
        make: takes a folder for programs, the number of rounds, and how long each turn is.
        what: is measured.
        parts: by name.
        packages: whose versions belong to the figures.
        seconds: the usual length of a turn.
    """
    options = _options(what, parts, seconds)
    with tempfile.TemporaryDirectory() as folder:
        try:
            it = make(Path(folder), options.rounds, options.seconds)
        except MissingToolError as why:
            print(f"the benchmarks cannot run: {why}", file=sys.stderr)  # noqa: T201
            return 1
        for part in options.parts or parts:
            measure: Callable[[], Iterator[Row]] = getattr(
                it, f"{part}_" if keyword.iskeyword(part) else part
            )
            print(f"\n{measure.__doc__}\n\n{table(list(measure()))}", flush=True)  # noqa: T201
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
    parser.add_argument(
        "--seconds", type=float, default=seconds, help=f"how long each turn is (default: {seconds:g})"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write all figures there")
    options = parser.parse_args()
    unknown = set(options.parts) - set(parts)
    if unknown:
        parser.error(f"no such part: {', '.join(sorted(unknown))}; there are {', '.join(parts)}")
    return options


def say(what: str) -> None:
    """Progress, for the person who waits."""
    print(what, file=sys.stderr, flush=True)  # noqa: T201


def table(rows: list[Row]) -> str:
    """Rows as a Markdown table."""
    names = list(rows[0])
    lines = [names, ["--"] * len(names), *([row[name] for name in names] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
