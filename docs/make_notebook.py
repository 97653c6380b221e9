"""Makes docs/notebooks/first_steps.ipynb, executed by a kernel of Jupyter.

    pip install . ipykernel nbclient
    python docs/make_notebook.py
    python docs/make_notebook.py --check

With ``--check`` nothing is written: the exit code is 1 when the notebook that is there is another one, or
shows other outputs. What it holds is below; a test runs the same cells without Jupyter.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

FILE: Final = Path(__file__).parent / "notebooks" / "first_steps.ipynb"
TEXT, CODE = "markdown", "code"
CELLS: Final = (
    (
        TEXT,
        """# First steps in a notebook

A simulated gripper, ten times as fast as a real one, with something between its fingers. For a real one put
its address in place of `sim://...`, and mind that **its fingers move** when it is activated, and whenever a
cell asks. Nothing of this has run on real hardware yet.""",
    ),
    (
        CODE,
        """from robotiq_async import Finger, RobotiqHand

hand = RobotiqHand("sim://?speedup=10&object=150")
await hand.start()
print(hand.state.name)""",
    ),
    (
        TEXT,
        """## With `await`

Jupyter's event loop runs between two cells as well: the hand polls on, 200 times a second, until it is
stopped. A cell that computes for seconds, or sleeps without `await`, holds it up.""",
    ),
    (
        CODE,
        """result = await hand.close(speed=255)
print("holding it with", result.contacts.name)
print("at", [result.positions[axis] for axis in (Finger.A, Finger.B, Finger.C)])""",
    ),
    (
        CODE,
        """import asyncio

seen = []
async for status in hand.statuses():
    if not seen:
        opening = asyncio.create_task(hand.open())
    seen.append(status.position(Finger.A))
    if opening.done():
        break
print("from", seen[0], "to", seen[-1])""",
    ),
    (CODE, """await hand.stop()\nprint(hand.state.name)"""),
    (
        TEXT,
        """## Without

The same for code that is not async, from a script perhaps. The hand has a thread of its own: no cell holds it
up. **Interrupt** (the square button) during one of its calls holds what moves.""",
    ),
    (
        CODE,
        """from robotiq_async.sync import RobotiqHand as BlockingHand

with BlockingHand("sim://?speedup=10&object=150") as hand:
    print("holding it with", hand.close(speed=255).contacts.name)
    hand.open()
    for status in hand.statuses():
        print("A at", status.position(Finger.A))
        break
print(hand.state.name)""",
    ),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Execute the notebook and write it, or with ``--check`` compare it.

    Args:
        arguments: of the command line; None for those of this process.

    Returns:
        The exit code: 1 when ``--check`` found another one.
    """
    parser = argparse.ArgumentParser(description="Make docs/notebooks/first_steps.ipynb.")
    parser.add_argument("--check", action="store_true", help="write nothing; fail when it is another one")
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
    from nbclient import NotebookClient  # noqa: PLC0415  # whoever looks at the cells needs no Jupyter
    from nbformat import v4  # noqa: PLC0415

    new = {TEXT: v4.new_markdown_cell, CODE: v4.new_code_cell}
    cells = [new[kind](source, id=f"cell-{number}") for number, (kind, source) in enumerate(CELLS)]
    notebook = v4.new_notebook(cells=cells)
    NotebookClient(notebook, timeout=60, kernel_name="python3", record_timing=False).execute()
    notebook.metadata.clear()
    notebook.metadata.update(
        kernelspec={"display_name": "Python 3", "language": "python", "name": "python3"},
        language_info={"name": "python"},
    )
    return json.loads(json.dumps(notebook, sort_keys=True))  # type: ignore[no-any-return]


if __name__ == "__main__":
    sys.exit(main())
