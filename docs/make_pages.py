"""Makes everything in docs/ that repeats what the code says, or says what is out of date.

    python docs/make_pages.py
    python docs/make_pages.py --check

The layout for viewers comes from make_layout.py, the tables and the diagram from make_tables.py. With
``--check`` nothing is written: the stale files are named, and the exit code is 1 when there are any.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[1]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))

from docs import make_layout, make_tables  # noqa: E402


def generated() -> dict[Path, str]:
    """Every file that is made from the code, wholly or in part, as it has to be now.

    Raises:
        OSError: a page that holds tables is missing.
        ValueError: a page has no place for one of its tables.
    """
    files = {make_layout.FILE: make_layout.draw()}
    for page in make_tables.PAGES:
        path = make_tables.DOCS / page
        files[path] = make_tables.filled(page, path.read_text(encoding="utf-8"))
    return files


def stale() -> dict[Path, str]:
    """Those of the files that are missing or hold something else."""
    return {
        path: text
        for path, text in generated().items()
        if not path.exists() or path.read_text(encoding="utf-8") != text
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the stale files, or with ``--check`` only name them.

    Args:
        arguments: of the command line; None for those of this process.

    Returns:
        The exit code: 1 when ``--check`` found a stale file.
    """
    parser = argparse.ArgumentParser(description="Make the tables and the layout in docs/ from the code.")
    parser.add_argument("--check", action="store_true", help="write nothing; fail when a file is stale")
    check = parser.parse_args(arguments).check
    found = stale()
    for path, text in found.items():
        if check:
            sys.stdout.write(f"{path.name} is stale: run docs/make_pages.py\n")
        else:
            path.write_text(text, encoding="utf-8")
            sys.stdout.write(f"wrote {path.name}\n")
    return 1 if check and found else 0


if __name__ == "__main__":
    sys.exit(main())
