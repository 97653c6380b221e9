"""Reflows docstrings for terminals of any width."""

from __future__ import annotations

import inspect
from itertools import groupby


def reflow(text: str) -> str:
    """Join the lines of each paragraph; a terminal wraps them to its own width.

    Indented lines, such as examples, stay as they are.
    """
    lines = inspect.cleandoc(text).splitlines()
    return "\n".join(
        line
        for is_prose, block in groupby(lines, key=_is_prose)
        for line in ([" ".join(block)] if is_prose else block)
    )


def _is_prose(line: str) -> bool:
    return bool(line.strip()) and not line.startswith(" ")
