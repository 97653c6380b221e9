"""``make canary``: does the library live with the newest of everything it depends on?

The constraints are left out, so the environment has what a user gets who installs today, the tools of the
tests included. It is thrown away; packages newer than in constraints.txt are named, whatever the result of
the tests.

    make canary TESTS="tests/cli tests/tools"
    make canary PYMODBUS="pymodbus>=4.0.0.dev0"

The second leaves the limit of pymodbus out, and takes pre-releases of it: docs/dependencies.md.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

from tests.release.environments import ROOT, exit_code, installed, make, run_suite


def pinned() -> dict[str, set[str]]:
    """The versions in constraints.txt; several where Python versions differ."""
    found: dict[str, set[str]] = {}
    for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines():
        name, _, version = line.partition(" ;")[0].partition("==")
        found.setdefault(name, set()).add(version)
    return found


def news(packages: Iterable[str]) -> list[str]:
    """The packages, ``name==version`` each, that differ from the constraints: ``name old -> new`` each."""
    known, found = pinned(), []
    for package in packages:
        name, _, version = package.partition("==")
        before = known.get(name.lower(), {"nothing"})
        if version not in before:
            found.append(f"{name} {' or '.join(sorted(before))} -> {version}")
    return found


def unlimited(requirement: str, folder: Path) -> list[str]:
    """The options that put a requirement in the place of the library's own; none without one."""
    if not requirement:
        return []
    overrides = folder / "overrides.txt"
    overrides.write_text(f"{requirement}\n", encoding="utf-8")
    return ["--overrides", str(overrides), "--prerelease", "if-necessary-or-explicit"]


def main() -> None:
    """Install, and test."""
    with tempfile.TemporaryDirectory(prefix="robotiq_async_canary") as folder:
        options = unlimited(os.environ.get("PYMODBUS", ""), Path(folder))
        python = make(Path(folder) / "venv", "--upgrade", *options, "--editable", f"{ROOT}[all,dev]")
        print("not as in constraints.txt:", "; ".join(news(installed(python))) or "nothing", flush=True)
        print(run_suite(python))


if __name__ == "__main__":
    sys.exit(exit_code(main))
