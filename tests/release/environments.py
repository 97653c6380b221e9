"""New environments with the packages that are given and no others; programs and the tests, run there."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
CONSTRAINTS: Final = ("--constraints", str(ROOT / "constraints.txt"))
BARE: Final = {"PATH": "/usr/local/bin:/usr/bin:/bin"}
"""Variables that lend a program no modules."""
PATIENCE: Final = 600.0
"""Seconds after which a program counts as hanging."""
CORE: Final = "@tests/core.txt tests/contract"
"""The tests that run unless the variable TESTS names others."""
NEEDS: Final = ("--requirement", str(ROOT / "tests" / "core-needs.txt"))


class FailedError(Exception):
    """Something did not do what a release needs."""


def make(folder: Path, *requirements: str, python: str = sys.executable) -> Path:
    """A new environment with these requirements (and options of ``pip install``); gives its interpreter."""
    uv("venv", "--quiet", "--python", python, str(folder))
    interpreter = folder / "bin" / "python"
    uv("pip", "install", "--quiet", "--python", str(interpreter), *requirements)
    return interpreter


def installed(interpreter: Path) -> list[str]:
    """The packages of an environment: ``name==version`` each."""
    printed = uv("pip", "list", "--python", str(interpreter), "--format", "freeze", "--exclude-editable")
    return [line for line in printed.splitlines() if "==" in line]


def uv(*arguments: str) -> str:
    """The output of uv; its way to the package index may be in the variables."""
    return run(sys.executable, "-m", "uv", *arguments, variables=os.environ)


def run(
    *command: str,
    folder: Path = ROOT,
    code: int = 0,
    variables: Mapping[str, str] = BARE,
    patience: float | None = PATIENCE,
) -> str:
    """The output of a program that ends as it should, and in time."""
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            env=variables,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
            timeout=patience,
        )
    except subprocess.TimeoutExpired as error:
        raise FailedError(f"{' '.join(command)} still ran after {patience:g} s") from error
    if done.returncode != code:
        raise FailedError(f"{' '.join(command)} ended with {done.returncode}:\n{done.stdout}")
    return done.stdout


def run_suite(python: Path) -> str:
    """Run the tests of the core; gives pytest's last line."""
    tests = os.environ.get("TESTS", CORE).split()
    command = [str(python), "-m", "pytest", "-p", "no:cacheprovider", "--numprocesses", "auto", "-q", *tests]
    return run(*command, variables=os.environ, patience=None).strip().rpartition("\n")[2].strip("= ")


def exit_code(work: Callable[[], object]) -> int:
    """1 if a part of the work fails; prints which."""
    try:
        work()
    except FailedError as error:
        print(error, file=sys.stderr)
        return 1
    return 0
