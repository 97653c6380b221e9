"""The notebook: its cells run and print their outputs; make_notebook.py has Jupyter do the same."""

from __future__ import annotations

import contextlib
import io
import json
import re
from typing import Any

from docs import make_notebook
from tests.docs.pages import compiled_prompt, run_prompt

NOTEBOOK: dict[str, Any] = json.loads(make_notebook.FILE.read_text(encoding="utf-8"))
CELLS: list[dict[str, Any]] = NOTEBOOK["cells"]


def shown(cell: dict[str, Any]) -> str:
    """The printed text of a cell; nothing else may be among its outputs."""
    assert [each["name"] for each in cell["outputs"]] == ["stdout"] * len(cell["outputs"])
    return "".join(each["text"] for each in cell["outputs"])


async def test_its_cells_print_what_they_show() -> None:
    names: dict[str, Any] = {}
    for cell in CELLS:
        if cell["cell_type"] == "code":
            source = "".join(cell["source"]).replace("speedup=10", "speedup=100")
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed):
                await run_prompt(compiled_prompt(source, cell["id"]), names)
            assert printed.getvalue() == shown(cell), cell["source"]


def test_its_cells_were_executed_in_their_order() -> None:
    executed = [cell["execution_count"] for cell in CELLS if cell["cell_type"] == "code"]
    assert executed == [*range(1, len(executed) + 1)]


def test_it_holds_nothing_of_the_machine_that_made_it() -> None:
    assert NOTEBOOK["metadata"].keys() == {"kernelspec", "language_info"}
    assert all(cell["metadata"] == {} for cell in CELLS)
    assert not re.search(r"/(home|root|tmp|usr|Users)\b|0x[0-9a-f]{6}", json.dumps(CELLS))
