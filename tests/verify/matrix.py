"""The tables of docs/hardware.md."""

from __future__ import annotations

import re

from tests.docs.pages import table


def rows(heading: str) -> list[list[str]]:
    """The cells of the table under a heading, without its head."""
    _, *rows = table("hardware.md", f"## {heading}")
    return [[cell.strip("`") for cell in row] for row in rows]


HABITS = rows("A gripper with another habit")
STAGES = ((1,), (2,), (3,), range(4, 9), (9,))
"""Those of each column."""
EVENTS = [
    (trouble.strip(" `"), stage, cell)
    for troubles, *cells in rows("Something happens in a stage")
    for trouble in troubles.split(",")
    for stages, cell in zip(STAGES, cells, strict=True)
    for stage in stages
]


def options(cell: str) -> dict[str, float]:
    """Those of a cell."""
    found = re.findall(r"(\w+)=([0-9.]+)", cell)
    return {name: int(value) if value.isdecimal() else float(value) for name, value in found}
