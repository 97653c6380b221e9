"""Executes docs/notebooks/first_steps.ipynb with a kernel of Jupyter.

    pip install . ipykernel nbclient
    python docs/make_notebook.py
    python docs/make_notebook.py --check

With ``--check`` nothing is written: the exit code is 1 when the notebook shows other outputs. Edit its cells
with any editor of notebooks; a test runs them without Jupyter.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

FILE: Final = Path(__file__).parent / "notebooks" / "first_steps.ipynb"


def main(arguments: Sequence[str] | None = None) -> int:
    """Execute the notebook and write it, or with ``--check`` compare it.

    Args:
        arguments: of the command line; None for those of this process.

    Returns:
        The exit code: 1 when ``--check`` found other outputs.
    """
    parser = argparse.ArgumentParser(description="Execute docs/notebooks/first_steps.ipynb.")
    parser.add_argument("--check", action="store_true", help="write nothing; fail when its outputs differ")
    check = parser.parse_args(arguments).check
    text = json.dumps(executed(), indent=1, ensure_ascii=False) + "\n"
    if not check:
        FILE.write_text(text, encoding="utf-8")
    elif FILE.read_text(encoding="utf-8") != text:
        sys.stdout.write(f"{FILE.name} is stale: run docs/make_notebook.py\n")
        return 1
    return 0


def executed() -> dict[str, Any]:
    """The notebook with its outputs, and without what changes from machine to machine."""
    import nbformat  # noqa: PLC0415  # the other cells' tests need no Jupyter
    from nbclient import NotebookClient  # noqa: PLC0415

    notebook = nbformat.read(FILE, as_version=4)  # type: ignore[no-untyped-call]
    NotebookClient(notebook, timeout=60, kernel_name="python3", record_timing=False).execute()
    notebook.metadata.clear()
    notebook.metadata.update(
        kernelspec={"display_name": "Python 3", "language": "python", "name": "python3"},
        language_info={"name": "python"},
    )
    return json.loads(json.dumps(notebook, sort_keys=True))  # type: ignore[no-any-return]


if __name__ == "__main__":
    sys.exit(main())
