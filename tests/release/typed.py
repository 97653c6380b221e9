"""``make typed``: how many of the names that users get have types that every checker sees the same way.

pyright counts them in a new environment with every extra; its errors are those of packages without types. It
comes from the package index, and its own program from npm's.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Final

from tests.release.environments import CONSTRAINTS, ROOT, FailedError, exit_code, make, run

NEEDED: Final = 98.0  # percent


def main() -> None:
    """Install, and count."""
    with tempfile.TemporaryDirectory(prefix="robotiq_async_typed") as folder:
        python = make(Path(folder) / "venv", *CONSTRAINTS, "pyright[nodejs]", f"{ROOT}[all]")
        path = f"{python.parent}{os.pathsep}{os.environ['PATH']}"  # pyright asks the first Python there
        count = ("-m", "pyright", "--verifytypes", "robotiq_async", "--ignoreexternal")
        said = run(str(python), *count, folder=Path(folder), code=1, variables={**os.environ, "PATH": path})
    (symbols,) = re.findall(r'^Symbols exported by "robotiq_async": (\d+)', said, re.MULTILINE)
    (score,) = re.findall(r"^Type completeness score: ([\d.]+)%", said, re.MULTILINE)
    print(f"{score} % of {symbols} names have a known type")
    if float(score) < NEEDED:
        errors = "\n".join(line for line in said.splitlines() if " - error: " in line)
        raise FailedError(f"fewer than {NEEDED:g} %:\n{errors}")


if __name__ == "__main__":
    sys.exit(exit_code(main))
