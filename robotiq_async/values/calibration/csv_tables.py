"""Tables of measured runs: one value a row, one run a column, in CSV files.

The layout is that of the thesis's own tables (``data/``)::

    speed_value,run_1_ms,run_2_ms,run_3_ms
    0,10021,10021,10021

A file is read whole or refused with file, line and reason, and written whole or not at all: an interrupted
program leaves the table as it was after the last row.
"""

from __future__ import annotations

import contextlib
import csv
import os
import re
import secrets
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TextIO

Table = dict[int, tuple[int, ...]]
"""The runs of each value."""


@dataclass(frozen=True, slots=True)
class Layout:
    """What the columns hold.

    Attributes:
        value: name of the first column; its values are 0..255.
        unit: of the runs.
        high: no run is above this; none is below 0.
    """

    value: str
    unit: str
    high: int

    def header(self, runs: int) -> list[str]:
        """The names of the columns of a table with so many runs."""
        return [self.value, *(f"run_{number}_{self.unit}" for number in range(1, runs + 1))]


SPEED: Final = Layout("speed_value", "ms", 600_000)
"""Closing times."""
FORCE: Final = Layout("force_value", "g", 100_000)
"""Readings of a scale between the fingers."""
LONGEST: Final = 10_000
"""Characters of a line; a file without line ends is no table."""
NEW: Final = 0o666
"""Mode of a file that was not there, before the umask."""


class TableError(ValueError):
    """A file that is not such a table; tells file, line and reason."""

    def __init__(self, path: Path | str, line: int | None, reason: str) -> None:
        """Keep what the message is made of; the line counts from 1."""
        super().__init__(str(path), line, reason)

    def __str__(self) -> str:
        """File, line and reason."""
        path, line, reason = self.args
        return f"{path}{'' if line is None else f', line {line}'}: {reason}"


def read_table(path: Path | str, layout: Layout) -> Table:
    """A table from a file.

    Raises:
        TableError: it cannot be read, or is not a table of this layout.
    """
    table: Table = {}
    columns = 0
    for line, cells in read_rows(path):
        if not columns:
            columns = len(cells)
            expected = layout.header(max(1, columns - 1))
            if cells != expected:
                wanted, there = ",".join(expected), ",".join(cells)
                raise TableError(path, line, f"expected the columns {wanted}, got {there}")
            continue
        if len(cells) != columns:
            raise TableError(path, line, f"expected {columns} columns, got {len(cells)}")
        value = integer(path, line, layout.value, cells[0], 255)
        if value in table:
            raise TableError(path, line, f"{layout.value} {value} is there twice")
        names = layout.header(columns - 1)[1:]
        table[value] = tuple(
            integer(path, line, name, cell, layout.high) for name, cell in zip(names, cells[1:], strict=True)
        )
    if not columns:
        raise TableError(path, None, "the file is empty")
    return table


def write_table(path: Path | str, layout: Layout, table: Mapping[int, Sequence[int]]) -> None:
    """Put a table into a file, rows by rising value; what was there before is replaced at once.

    Raises:
        OSError: it cannot be written; the file is what it was.
    """
    runs = len(next(iter(table.values()), ()))
    write_rows(path, [layout.header(runs), *([value, *table[value]] for value in sorted(table))])


def thesis_table(name: str, layout: Layout) -> Table:
    """One of the thesis's own tables: closing_time_ms (A1.1), force_foam_grams or force_rigid_grams."""
    return read_table(Path(__file__).parents[2] / "data" / f"{name}.csv", layout)


# -- what other tables are made of too ---------------------------------------------------------------------


def read_rows(path: Path | str) -> Iterable[tuple[int, list[str]]]:
    """The rows of a CSV file with their line numbers; empty lines are left out.

    Raises:
        TableError: it cannot be read.
    """
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            lines = csv.reader(_lines(file), strict=True)
            return [(lines.line_num, [cell.strip() for cell in cells]) for cells in lines if cells]
    except (OSError, ValueError, csv.Error) as error:
        why = error.strerror if isinstance(error, OSError) else str(error)
        raise TableError(path, None, f"cannot be read: {why}") from error


def _lines(file: TextIO) -> Iterator[str]:
    while line := file.readline(LONGEST + 1):
        if len(line) > LONGEST:
            raise ValueError(f"a line has more than {LONGEST} characters")
        yield line


def integer(path: Path | str, line: int, name: str, text: str, high: int) -> int:
    """An integer in 0..high.

    Raises:
        TableError: it is none.
    """
    if not re.fullmatch(r"[0-9]{1,12}", text) or int(text) > high:
        raise TableError(path, line, f"{name} must be an integer in 0..{high}, got {text!r}")
    return int(text)


def write_rows(path: Path | str, rows: Iterable[Sequence[object]]) -> None:
    """Write a CSV file, whole or not at all. A file that is there keeps its mode.

    Raises:
        OSError: it cannot be written; the file is what it was.
    """
    mode = _mode(path)
    target = Path(os.path.realpath(path))  # a link to a table stays a link
    beside = target.with_name(f".{target.name}.{secrets.token_hex(8)}")
    # A new file, or none: where others write too, what has its name may be a link that they made.
    descriptor = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, NEW if mode is None else mode)
    try:
        with open(descriptor, "w", encoding="utf-8", newline="") as file:
            if mode is not None:
                # Of the mode above the umask has taken some.
                os.chmod(descriptor if os.chmod in os.supports_fd else beside, mode)
            csv.writer(file, lineterminator="\n").writerows(rows)
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, target)
    finally:
        with contextlib.suppress(FileNotFoundError):
            beside.unlink()


def _mode(path: Path | str) -> int | None:
    """Who may read and write a file; None if it is not there.

    Raises:
        OSError: nobody may know, or follow the link.
    """
    try:
        return stat.S_IMODE(os.stat(path).st_mode)
    except FileNotFoundError:
        return None
