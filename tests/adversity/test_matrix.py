"""Every trouble in every phase: the table of docs/under-fault.md, cell by cell."""

from __future__ import annotations

import pytest

from robotiq_async.simulator.troubles.trouble import KINDS
from tests.adversity.cell import outcome
from tests.adversity.table import Cell, cells
from tests.adversity.world import HABITS, HeldLoopError, world
from tests.virtual import run

CELLS = list(cells())
FORGETTING = {
    # The other client's write comes too soon after ours, and is the one that is forgotten.
    ("tcp", "moving", "foreign 128"): "done → RUNNING_IDLE",
    ("rtu", "moving", "foreign 128"): "done → RUNNING_IDLE",
    # The one stop that gets through comes too soon after the motion, and its reply takes too long.
    ("tcp", "stopping", "multiplexer for 60"): "done, fingers went on → SHUTDOWN",
    ("tcp", "stopping", "multiplexer 0.5 for 60"): "done, fingers went on → SHUTDOWN",
    # The same, and nothing can be read after it: a stop is not repeated blindly, it might activate.
    ("tcp", "stopping", "function-3-only for 60"): "done, fingers went on → SHUTDOWN",
}
"""What comes of a cell on a gripper that forgets writes (``make habits``), where that is something else."""


@pytest.mark.parametrize(
    "cell", CELLS, ids=lambda cell: f"{cell.link}-{cell.phase.name}-{cell.trouble}".replace(" ", "_")
)
def test_cell(cell: Cell, monkeypatch: pytest.MonkeyPatch) -> None:
    if str(cell.trouble).startswith("function-3-only") and any(h.kind == "function-3-only" for h in HABITS):
        pytest.skip("the gripper has that anyway, and the hand the option for it")

    async def main() -> str:
        async with world(cell.link, patch=monkeypatch) as here:
            return await outcome(here, cell.phase, cell.trouble)

    try:
        told = run(main)
    except HeldLoopError:
        # Virtual time takes the same course again: what the code does to the loop it does twice.
        told = run(main)
    forgets = any(habit.kind == "write-spacing" for habit in HABITS)
    other = FORGETTING.get((cell.link, cell.phase.name, str(cell.trouble))) if forgets else None
    assert told == (other or cell.outcome)


def test_every_kind_of_trouble_is_in_the_table() -> None:
    assert {cell.trouble.split()[0] for cell in CELLS} - {"line"} == set(KINDS)
