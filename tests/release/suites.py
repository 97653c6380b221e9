"""The tests in environments that are not the usual one."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Final

from tests.release.environments import ROOT

LIBRARY: Final = "tests/wire tests/control tests/link tests/session tests/hand tests/simulator tests/contract"
"""What is run unless the variable TESTS says otherwise."""
LEFT_OUT: Final = ("tests/contract/test_loops.py::test_a_loop_that_was_closed_under_it",)
"""It leaves tasks in a closed loop. On Python 3.12 and 3.13 they outlive it, and fail the next test."""


def run_suite(python: Path) -> str:
    """Run the tests of the library; gives pytest's last line, and an empty one if something failed.

    What pytest prints is shown if it fails.
    """
    tests = os.environ.get("TESTS", LIBRARY).split()
    command = [str(python), "-m", "pytest", "-p", "no:cacheprovider", "--numprocesses", "auto", "-q", *tests]
    command += [f"--deselect={each}" for each in LEFT_OUT]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        print(done.stdout, done.stderr, sep="\n")
        return ""
    return done.stdout.strip().rpartition("\n")[2].strip("= ")
