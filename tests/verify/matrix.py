"""The tables of docs/hardware.md."""

from __future__ import annotations

import re

from tests.docs.pages import table


def rows(heading: str) -> list[list[str]]:
    """The cells of the table under a heading, without its head."""
    _, *rows = table("hardware.md", f"## {heading}")
    return [[cell.strip("`") for cell in row] for row in rows]


HABITS = rows("A gripper with another habit")
EVENTS_BY_ROW = [
    (trouble.strip(" `"), cells)
    for troubles, *cells in rows("Something happens in a stage")
    for trouble in troubles.split(",")
]


def stages(row: int) -> list[tuple[int, ...]]:
    """Those of each column.

    Five stages, which all move an active gripper, share a column: each trouble has two of them, and each of
    them has six of the fifteen troubles.
    """
    return [(1,), (2,), (3,), (4 + row % 5, 4 + (row + 2) % 5), (9,)]


EVENTS = [
    (trouble, stage, cell)
    for row, (trouble, cells) in enumerate(EVENTS_BY_ROW)
    for of_column, cell in zip(stages(row), cells, strict=True)
    for stage in of_column
]


def options(cell: str) -> dict[str, float]:
    """Those of a cell."""
    found = re.findall(r"(\w+)=([0-9.]+)", cell)
    return {name: int(value) if value.isdecimal() else float(value) for name, value in found}
