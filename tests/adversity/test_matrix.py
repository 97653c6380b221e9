"""Every trouble in every phase: the tables of docs/under-fault.md, cell by cell.

Troubles of one kind of link that end alike in every phase take turns: at most a fifth of them is tried in a
phase. So each outcome is tried in each phase, and each trouble in two phases at least. Fault 9 is tried in
all of them: a mistake is known that it reveals and the interference, which ends alike, does not. A gripper's
own troubles are tried with a jaw on a serial line, and with a 3-Finger over TCP. ``make habits``, and
``MODEL`` in the environment, try every trouble in every phase.
"""

from __future__ import annotations

import contextlib
import os
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator

import pytest

from robotiq_async import Finger
from robotiq_async.simulator.troubles.trouble import KINDS
from robotiq_async.values.model import TWO_FINGER_85, Model
from robotiq_async.values.registers import REGISTER_COUNT
from tests.adversity.cell import Cell, cells, cells_of_a_tunnel, cells_of_a_urcap, outcome
from tests.adversity.phases import PHASES
from tests.adversity.world import HABITS, MODEL, HeldLoopError, world
from tests.virtual import run

EVERY = list(cells())
IN_EVERY_PHASE = "fault 9 for 60"
LEFT_TO_A_JAW = ("power-cut for 60", "foreign 128", "fault 14 for ever", "release", "e-stop for 60")
"""Troubles of the gripper: over TCP it is a 3-Finger that has them, on a serial line a jaw."""


def in_turn(every: Iterable[Cell]) -> list[Cell]:
    """Of the troubles that end alike in every phase a fifth, or one of fewer; the next phase has the next."""
    every = [*every]
    if HABITS or "MODEL" in os.environ:
        return every
    alike: dict[tuple[str, ...], list[str]] = defaultdict(list)
    for trouble, ends in rows(every).items():
        alike[ends].append(trouble)
    chosen = {
        (phase.name, trouble)
        for number, troubles in enumerate(alike.values())
        for turn, phase in enumerate(PHASES, number)
        for trouble in troubles[turn % min(len(troubles), 5) :: 5]
    }
    return [
        cell
        for cell in every
        if (cell.phase.name, named(cell)) in chosen or cell.trouble == IN_EVERY_PHASE
        if cell.link != "rtu" or cell.trouble not in LEFT_TO_A_JAW or not ends_alike_on_a_jaw(cell)
    ]


def in_rows(chosen: Iterable[Cell]) -> dict[str, list[Cell]]:
    """Cells of a kind of link and a trouble together."""
    every: dict[str, list[Cell]] = defaultdict(list)
    for cell in chosen:
        every[named(cell).replace(" ", "-", 1).replace(" ", "_")].append(cell)
    return every


def rows(every: Iterable[Cell]) -> dict[str, tuple[str, ...]]:
    """The outcomes of each trouble on each kind of link, in the order of the phases, behind the link."""
    ends: dict[str, tuple[str, ...]] = {}
    for cell in every:
        ends[named(cell)] = (*ends.get(named(cell), (cell.link,)), cell.outcome)
    return ends


def named(cell: Cell) -> str:
    return f"{cell.link} {cell.trouble}"


POLL_S = 0.03 if HABITS else 0.1
"""Seconds between polls. A trouble lasts for some twenty of them: more reveal no more, but for a habit."""
POLL_WHILE_KEEPING_S = min(POLL_S, 0.05)
"""A stop that keeps a grip has half a second to see that the rest has stopped, or it lets go."""
TROUBLES_OF_A_JAW = (
    *(*LEFT_TO_A_JAW, "controller-fault for 60"),
    *("drop once", "silence for 60", "line pulled", "status-lag 0.2 for 60", "strict-silence for 60"),
)
"""The troubles for a sibling here. ``MODEL=2f85`` in the environment tries the whole table."""
OF_A_JAW = [cell for cell in EVERY if cell.link == "rtu" and cell.trouble in TROUBLES_OF_A_JAW]
LETS_GO = ("power-cut", "foreign", "fault", "release", "stranded", "e-stop")
"""Troubles that end a grip if no other axis can move. Else a stop writes nothing that could fail."""
CONNECTION_LOST = [("tcp", "silence once"), ("tcp", "reset"), ("tcp", "close"), ("rtu", "echo for 60")]
"""Troubles of links that do so too, as with a 3-Finger: the fate of the grip cannot be seen in time."""
PASSES = "fault 9 for 60"
"""A poll sees it once, so it does not end a grip."""
OF_AN_AXIS = {
    # The first exchange reads all registers, which a jaw may refuse: it is made again.
    ("tcp", "connecting", "exception once"): "done → RUNNING_IDLE",
}
"""Outcomes of cells on a jaw."""
WITH_FUNCTION_23 = {
    # By the status read after the damage the write was carried out.
    ("command pending", f"{trouble} {lasts}"): "done → RUNNING_IDLE"
    for trouble in (
        *("drop", "half", "wrong-checksum", "wrong-function", "wrong-length", "wrong-count", "wrong-unit"),
        *("wrong-echo", "byte-before", "garbled", "seven-bits"),
    )
    for lasts in ("once", "for 60")
}
WITH_FUNCTION_23 |= {
    # The function is tried before the first command: what the trial loses, or shows, the command does not.
    ("command pending", "silence once"): "done → RUNNING_IDLE",
    ("command pending", "strict-silence for 60"): "done → RUNNING_IDLE",
    ("command pending", "registers for 60"): "done → RUNNING_IDLE",
    ("command pending", "drop for 60"): "ConnectionLost → RUNNING_IDLE",  # by function 16 from then on
    ("command pending", "half for 60"): "ConnectionLost → RUNNING_IDLE",
    ("command pending", "fault 9 for 60"): "GripperFault → RUNNING_IDLE",
    **{("command pending", f"fault {code} for ever"): "GripperFault → FAULT" for code in (12, 13, 14)},
    ("command pending", "interference for ever"): "GripperFault → FAULT",
    ("command pending", "release"): "GripperFault → ATR_DONE",
    ("command pending", "stranded"): "NotActivated → RESET",
    ("command pending", "e-stop for 60"): "NotActivated → WF_ACTIVATION",
    ("command pending", "e-stop 2 for 60"): "NotActivated → WF_ACTIVATION",
}
"""Outcomes of cells on a serial line to a jaw, which is written with function 23."""
WITH_HABIT = {
    "write-spacing": {
        # The other client's write comes too soon after ours, and is the one that is forgotten.
        **{(link, "moving", "foreign 128"): "done → RUNNING_IDLE" for link in ("tcp", "rtu", "urcap")},
        # The stop comes too soon after the command. No status can be read, so it cannot be written again.
        **{
            (link, "stopping", f"{trouble} for 60"): "done, fingers went on → SHUTDOWN"
            for link, trouble in (
                ("tcp", "multiplexer"),
                ("tcp", "multiplexer 0.5"),
                ("tcp", "function-3-only"),
                ("urcap", "multiplexer"),
                ("tunnel", "echo"),
            )
        },
        # It is written again half a second later: such a quick jaw is there by then.
        **{
            ("tunnel", "stopping", f"late {lasts}"): "done, fingers went on → SHUTDOWN"
            for lasts in ("once", "for 60")
        },
    },
    # Such a stop takes longer, and so sees the fault.
    "status-lag": {
        ("urcap", "keeping a grip", f"fault {code} for 60"): "done, let go → SHUTDOWN" for code in (5, 9)
    },
}
"""Outcomes of cells on a gripper with a habit (``make habits``), where they differ."""


def kind_of(cell: Cell) -> str:
    return cell.trouble.split()[0]


def expected(cell: Cell, model: Model) -> str:
    if len(model.axes) == 1 and cell.phase.name == "keeping a grip":
        lets_go = kind_of(cell) in LETS_GO and cell.trouble != PASSES
        lets_go = lets_go or (cell.link, cell.trouble) in CONNECTION_LOST
        return f"done, {'let go' if lets_go else 'kept'} → SHUTDOWN"
    if len(model.axes) == 1 and cell.link == "rtu" and (cell.phase.name, cell.trouble) in WITH_FUNCTION_23:
        return WITH_FUNCTION_23[cell.phase.name, cell.trouble]
    place = cell.link, cell.phase.name, cell.trouble
    return OF_AN_AXIS.get(place, usual(cell)) if len(model.axes) == 1 else usual(cell)


def usual(cell: Cell) -> str:
    """The outcome on the page, unless the gripper has habits."""
    place = cell.link, cell.phase.name, cell.trouble
    others = (WITH_HABIT.get(habit.kind, {}).get(place) for habit in HABITS)
    return next(filter(None, others), cell.outcome)


def ends_alike_on_a_jaw(cell: Cell) -> bool:
    return expected(cell, TWO_FINGER_85) == cell.outcome


def through_a_tunnel() -> Iterator[Cell]:
    """Every cell of a trouble of the bytes, at a jaw."""
    own = {(cell.trouble, cell.phase): cell for cell in cells_of_a_tunnel()}
    for cell in EVERY:
        kind = kind_of(cell)
        is_of_bytes = kind in ("silence", "echo") or (kind in KINDS and KINDS[kind].corruption is not None)
        if cell.link == "rtu" and is_of_bytes:
            as_on_a_line = cell._replace(link="tunnel", outcome=expected(cell, TWO_FINGER_85))
            yield own.get((cell.trouble, cell.phase), as_on_a_line)


CELLS = in_turn(EVERY)
THROUGH_A_TUNNEL = in_turn(through_a_tunnel())
OF_A_URCAP = in_turn(cells_of_a_urcap())


def tried(cell: Cell, model: Model, patch: pytest.MonkeyPatch) -> str:
    poll_s = POLL_WHILE_KEEPING_S if cell.phase.name == "keeping a grip" else POLL_S

    async def main() -> str:
        async with world(cell.link, monkeypatch=patch, model=model, poll_interval=poll_s) as here:
            return await outcome(here, cell.phase, cell.trouble)

    # Virtual time takes the same course again: what the code does to the loop it does each time. The machine,
    # which is slow at any moment, was seen to do so twice in a row.
    for _ in range(3):
        with contextlib.suppress(HeldLoopError):
            return run(main)
    return run(main)


def tried_in_turn(row: list[Cell], model: Model) -> dict[str, str]:
    """The outcomes of cells, by their phases; each has a world of its own."""
    ends = {}
    for cell in row:
        with pytest.MonkeyPatch.context() as patch:
            try:
                ends[cell.phase.name] = tried(cell, model, patch)
            except BaseException as error:
                error.add_note(f"while {cell.phase.name}")
                raise
    return ends


@pytest.mark.parametrize("row", in_rows(CELLS).values(), ids=in_rows(CELLS))
def test_row(row: list[Cell]) -> None:
    if kind_of(row[0]) == "interference" and Finger.SCISSOR not in MODEL.all_axes:
        pytest.skip("there is no scissor")
    if kind_of(row[0]) == "controller-fault" and MODEL.has_modes:
        pytest.skip("there is no controller before it")
    if kind_of(row[0]) == "registers" and MODEL.rtu.count < REGISTER_COUNT:
        pytest.skip("it has no more")
    reads_with_3 = any(habit.kind == "function-3-only" for habit in HABITS) or MODEL.tcp.read_function == 3
    if kind_of(row[0]) == "function-3-only" and reads_with_3:
        pytest.skip("the hand reads with function 3 anyway")
    assert tried_in_turn(row, MODEL) == {cell.phase.name: expected(cell, MODEL) for cell in row}


@pytest.mark.parametrize("row", in_rows(OF_A_JAW).values(), ids=in_rows(OF_A_JAW))
def test_row_of_a_jaw(row: list[Cell]) -> None:
    assert tried_in_turn(row, TWO_FINGER_85) == {
        cell.phase.name: expected(cell, TWO_FINGER_85) for cell in row
    }


@pytest.mark.parametrize("row", in_rows(OF_A_URCAP).values(), ids=in_rows(OF_A_URCAP))
def test_row_of_a_urcap(row: list[Cell]) -> None:
    assert tried_in_turn(row, TWO_FINGER_85) == {cell.phase.name: usual(cell) for cell in row}


@pytest.mark.parametrize("row", in_rows(THROUGH_A_TUNNEL).values(), ids=in_rows(THROUGH_A_TUNNEL))
def test_row_through_a_tunnel(row: list[Cell]) -> None:
    assert tried_in_turn(row, TWO_FINGER_85) == {cell.phase.name: usual(cell) for cell in row}


def test_every_kind_of_trouble_is_in_the_table() -> None:
    assert {cell.trouble.split()[0] for cell in [*CELLS, *OF_A_URCAP]} - {"line"} == set(KINDS)
    assert {IN_EVERY_PHASE, *TROUBLES_OF_A_JAW} <= {cell.trouble for cell in EVERY}


@pytest.mark.parametrize(
    ("chosen", "every"),
    [
        ([*CELLS, *filter(ends_alike_on_a_jaw, OF_A_JAW)], EVERY),
        (OF_A_URCAP, [*cells_of_a_urcap()]),
        (THROUGH_A_TUNNEL, [*through_a_tunnel()]),
    ],
)
def test_every_outcome_is_tried_in_every_phase_and_every_trouble_in_some(
    chosen: list[Cell], every: list[Cell]
) -> None:
    ends = rows(every)
    assert {(ends[named(cell)], cell.phase) for cell in chosen} == {
        (ends[named(cell)], cell.phase) for cell in every
    }
    phases = Counter(map(named, chosen))
    assert phases.keys() == ends.keys()
    assert min(phases.values()) >= 2
