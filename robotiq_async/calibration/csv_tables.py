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
    return read_table(Path(__file__).parents[1] / "data" / f"{name}.csv", layout)


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
    """Write a CSV file, whole or not at all.

    Raises:
        OSError: it cannot be written; the file is what it was.
    """
    path = Path(os.path.realpath(path))
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with open(beside, "w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows(rows)
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, path)
    finally:
        with contextlib.suppress(FileNotFoundError):
            beside.unlink()
