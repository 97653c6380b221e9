"""``make pythons``: the tests of the core on other Pythons.

One that is not here comes from uv, which downloads it; one that cannot be had is named and left out: nothing
fails then, and nothing is claimed.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.release.environments import CONSTRAINTS, NEEDS, ROOT, FailedError, make, run_suite, uv


def interpreter(version: str) -> str | None:
    """A Python of this version, as in ``3.12``, or None."""
    command = shutil.which(f"python{version}")
    if command is not None and (found := _asked(command, version)):
        return found
    for arguments in (("find", "--no-python-downloads"), ("install",), ("find", "--no-python-downloads")):
        try:
            found = uv("python", *arguments, version).strip().rpartition("\n")[2]
        except FailedError:
            continue
        if arguments[0] == "find":
            return found
    return None


def _asked(command: str, version: str) -> str:
    """The path of a command's interpreter; empty if it does not run."""
    # pyenv's commands do nothing unless they know which version is meant.
    variables = {**os.environ, "PYENV_VERSION": version}
    asked = [command, "-c", "import sys; print(sys.executable)"]
    done = subprocess.run(asked, env=variables, capture_output=True, text=True, check=False)
    return "" if done.returncode else done.stdout.strip()


def tried(version: str) -> str:
    """The outcome of the tests on a Python."""
    python = interpreter(version)
    if python is None:
        return "left out: it is not here, and uv cannot get it"
    with tempfile.TemporaryDirectory(prefix="robotiq_async_python") as folder:
        return run_suite(make(Path(folder) / "venv", *CONSTRAINTS, *NEEDS, "-e", str(ROOT), python=python))


def main() -> int:
    """Try each version of the command line; gives the exit code."""
    code = 0
    for version in sys.argv[1:]:
        try:
            outcome = tried(version)
        except FailedError as error:
            print(error, file=sys.stderr)
            outcome, code = "FAILED", 1
        print(f"Python {version}: {outcome}", flush=True)
    return code


if __name__ == "__main__":
    sys.exit(main())
