"""Text of a source file, whose lines are of one width, as text for a terminal of any width."""

from __future__ import annotations

import inspect
from itertools import groupby


def reflow(text: str) -> str:
    """Docstrings have lines of one width; a terminal has its own: a paragraph becomes one line.

    What is indented, examples say, keeps its lines.
    """
    lines = inspect.cleandoc(text).splitlines()
    return "\n".join(
        line
        for is_prose, block in groupby(lines, key=_is_prose)
        for line in ([" ".join(block)] if is_prose else block)
    )


def _is_prose(line: str) -> bool:
    return bool(line.strip()) and not line.startswith(" ")
