"""Tables of the documentation that tests read."""

from __future__ import annotations

from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"


def table(page: str, after: str = "") -> list[list[str]]:
    """The rows of the tables on a page, heads and all; only what comes after a heading, if one is given."""
    text = (DOCS / page).read_text(encoding="utf-8")
    return [
        [word.strip() for word in line.strip("|").split("|")]
        for line in text[text.index(after) :].splitlines()
        if line.startswith("|") and not line.startswith("| --")
    ]
