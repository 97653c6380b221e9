"""The tables of docs/hardware.md."""

from __future__ import annotations

import re

from tests.docs.pages import DOCS

PAGE = DOCS / "hardware.md"


def rows(heading: str) -> list[list[str]]:
    """The cells of the table under a heading, without its head."""
    section = PAGE.read_text(encoding="utf-8").partition(f"## {heading}\n")[2].partition("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip().strip("`") for cell in line.strip("|").split("|")] for line in lines[2:]]


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
