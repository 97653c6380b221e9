"""Line numbers of keys in a TOML file, which the parser of the standard library does not provide."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from typing import Final

Names = tuple[str, ...]
_KEY: Final = re.compile(r"""\s*((?:"[^"\n]*"|'[^'\n]*'|[A-Za-z0-9_.\s-])+)=""")


def line_of(text: str, path: Names) -> int | None:
    """The line, counted from 1, of the key or the table at a path; None if it is not certain.

    Inside an inline table or an array it is the line where that begins. The search looks at single lines, and
    a multi-line string may contain what looks like a key.
    """
    for length in range(len(path), 0, -1):
        lines = [number for number, found in _keys(text) if found == path[:length]]
        if lines:
            return lines[0] if len(lines) == 1 else None
    return None


def _keys(text: str) -> Iterator[tuple[int, Names]]:
    """Line number and path of each line that begins with a key or is the header of a table."""
    table: Names = ()
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith("["):
            table = _path(line) or table
            yield number, table
        elif (found := _KEY.match(line)) is not None:
            yield number, table + _path(f"{found[1]}= 0")


def _path(line: str) -> Names:
    """The nested names on a line; empty if the line is not TOML."""
    try:
        found: object = tomllib.loads(line)
    except tomllib.TOMLDecodeError:
        return ()
    names: list[str] = []
    while isinstance(found, dict) and found:
        name, found = next(iter(found.items()))
        names.append(name)
    return tuple(names)
