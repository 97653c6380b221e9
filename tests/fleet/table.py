"""Reads the table of docs/fleet-under-fault.md."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

PAGE = Path(__file__).parents[2] / "docs" / "fleet-under-fault.md"


class Cell(NamedTuple):
    """One cell.

    Attributes:
        outcomes: the words of each outcome that there may be.
        held_after: the limit in seconds; None for none.
    """

    trouble: str
    phase: str
    outcomes: tuple[str, ...]
    held_after: float | None


def cells() -> Iterator[Cell]:
    """Every cell."""
    head, *rows = (
        [word.strip() for word in line.strip("|").split("|")]
        for line in PAGE.read_text(encoding="utf-8").splitlines()
        if line.startswith("|") and not line.startswith("| --")
    )
    for troubles, *outcomes, limit in rows:
        held_after = None if limit == "-" else float(limit.removesuffix(" s"))
        for trouble in re.findall(r"`(.+?)`", troubles):
            for phase, outcome in zip(head[1:-1], outcomes, strict=True):
                yield Cell(trouble, phase, tuple(outcome.split(" or ")), held_after)
