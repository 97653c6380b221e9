"""Every trouble: the table of docs/fleet-under-fault.md, cell by cell."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import Finger
from tests.fleet.cell import (
    LOOP,
    PHASES,
    SETTLE_S,
    TARGET,
    TROUBLES,
    Cell,
    Doing,
    cells,
    ending,
    moving,
    outcome,
    tried,
)
from tests.fleet.world import World, world
from tests.virtual import inside

CELLS = list(tried())
HALTED = {cell.row: cell.trouble for cell in cells()}.values()
"""One trouble of each row."""
HALTED_AFTER_S = 0.25
"""Seconds from the trouble to the halt: in the midst of all that last."""


@pytest.mark.parametrize("cell", CELLS, ids=lambda cell: f"{cell.phase}-{cell.trouble}".replace(" ", "_"))
@inside(world)
async def test_cell(here: World, cell: Cell) -> None:
    words, held_after = await outcome(here, cell.phase, TROUBLES[cell.trouble])
    assert words in cell.outcomes
    if cell.held_after is not None and held_after is not None:
        assert held_after <= cell.held_after


def test_the_table_is_complete() -> None:
    every = {(cell.trouble, cell.phase) for cell in cells()}
    assert every == {(trouble, phase) for trouble in TROUBLES for phase in PHASES}


def test_every_cell_of_the_table_is_tried() -> None:
    assert {(cell.row, cell.phase) for cell in CELLS} == {(cell.row, cell.phase) for cell in cells()}
    for others in (False, True):
        assert {cell.trouble for cell in CELLS if (cell.phase != LOOP) is others} == set(TROUBLES)


@pytest.mark.parametrize("trouble", HALTED)
@inside(world)
async def test_a_halt_in_the_midst(here: World, trouble: str) -> None:
    """A client that queries gets the truth, and the old holder does not come back."""
    doing = Doing(here)
    await moving(doing)
    going_on = asyncio.create_task(TROUBLES[trouble](here))
    await asyncio.sleep(HALTED_AFTER_S)
    at = here.now()
    heard = await here.other.do(ending(here.other.hand.halt()))
    assert here.now() - at <= 2.5
    if heard == "done":
        assert not here.gripper.is_moving
    else:
        assert heard == "ConnectionLost"
    await going_on
    await asyncio.sleep(SETTLE_S)
    assert not here.gripper.is_moving or heard != "done"
    if heard == "done":
        # The next agent, if the first was killed, answers after 1.4 s: half of the way.
        assert here.gripper.position(Finger.A) < 0.6 * TARGET
    if not here.holder.host.is_dead:
        assert heard != "done" or not here.holder.hand.is_in_control
        assert doing.call is not None
        await here.until(doing.call.done)
