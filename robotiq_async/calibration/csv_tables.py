"""CSV tables of measured runs: one value a row, one run a column.

The layout follows the thesis's own tables (``data/``)::

    speed_value,run_1_ms,run_2_ms,run_3_ms
    0,10021,10021,10021

A last column ``model`` may say on which model it was measured: a hand of another one refuses the table.
Reading refuses a bad file with its line and the reason. Writing replaces the file in one step: an interrupted
program leaves the table of the last complete write.
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

from ..values.model import Model, model_of
from ..values.stroke import Point, Points, why_not_after

RunsTable = dict[int, tuple[int, ...]]  # for each value, its runs
CsvRow = tuple[int, list[str]]  # line number and cells


@dataclass(frozen=True, slots=True)
class Layout:
    """The columns of a table: a value, and the measurements at this value, one of each run.

    Attributes:
        value: name of the first column; its values are 0..255.
        unit: unit of the measurements.
        high: highest measurement allowed; the lowest is 0.
    """

    value: str
    unit: str
    high: int

    def header(self, runs: int) -> list[str]:
        """The column names of a table with this number of runs."""
        return [self.value, *(f"run_{number}_{self.unit}" for number in range(1, runs + 1))]


SPEED_LAYOUT: Final = Layout("speed_value", "ms", 600_000)  # closing times, at most 10 minutes
FORCE: Final = Layout("force_value", "g", 100_000)  # readings of a scale between the fingers, at most 100 kg
LONGEST_ROW: Final = 10_000
"""Characters of a line at most, so that a large file without line ends is not read into memory."""
NEW_MODE: Final = 0o666  # mode of a new file, before the umask


class TableError(ValueError):
    """A file that is not such a table; the message names file, line and reason."""

    def __init__(self, path: Path | str, line: int | None, reason: str) -> None:
        super().__init__(str(path), line, reason)

    def __str__(self) -> str:
        path, line, reason = self.args
        return f"{path}{'' if line is None else f', line {line}'}: {reason}"


def read_table(path: Path | str, layout: Layout) -> RunsTable:
    """Read a table from a file.

    Raises:
        TableError: the file cannot be read or does not have this layout.
    """
    return read_measured(path, layout)[0]


def read_measured(path: Path | str, layout: Layout) -> tuple[RunsTable, Model | None]:
    """Read a table, and the model on which it was measured; None if the file does not say.

    Raises:
        TableError: as :func:`read_table`.
    """
    table: RunsTable = {}
    columns = 0
    rows, model = _without_model(path, read_rows(path))
    for line, cells in rows:
        if not columns:
            columns = len(cells)
            expected = layout.header(max(1, columns - 1))
            if cells != expected:
                wanted, there = ",".join(expected), ",".join(cells)
                raise TableError(path, line, f"expected the columns {wanted}, got {there:.100}")
            continue
        if len(cells) != columns:
            raise TableError(path, line, f"expected {columns} columns, got {len(cells)}")
        value = integer(path, line, layout.value, cells[0], 255)
        if value in table:
            raise TableError(path, line, f"{layout.value} {value} appears twice")
        names = layout.header(columns - 1)[1:]
        table[value] = tuple(
            integer(path, line, name, cell, layout.high) for name, cell in zip(names, cells[1:], strict=True)
        )
    if not columns:
        raise TableError(path, None, "the file is empty")
    return table, model


def write_table(
    path: Path | str, layout: Layout, table: Mapping[int, Sequence[int]], model: Model | None = None
) -> None:
    """Write a table, rows by rising value, replacing the file in one step; without a model, if it is None.

    Raises:
        OSError: the file cannot be written; it stays as it was.
    """
    runs = len(next(iter(table.values()), ()))
    _write(path, model, [layout.header(runs), *([value, *table[value]] for value in sorted(table))])


STROKE: Final = ["position_counts", "opening_mm"]
"""The columns of a stroke: measured points of one gripper, from open to closed."""


def read_stroke(path: Path | str, model: Model | None = None) -> Points:
    """Read the measured points of a gripper, as ``robotiq-async measure stroke`` writes them.

    Raises:
        TableError: the file cannot be read, its points do not make a stroke, or it was measured on another
            model than ``model``.
    """
    found, measured_on = _without_model(path, read_rows(path))
    if model is not None and measured_on not in (None, model):
        raise TableError(path, None, f"it was measured on a {measured_on}, and the gripper is a {model}")
    rows = iter(found)
    line, header = next(rows, (None, []))
    if header != STROKE:
        there = ",".join(header) or "none"
        raise TableError(path, line, f"expected the columns {','.join(STROKE)}, got {there:.100}")
    points: list[Point] = []
    for line, cells in rows:
        if len(cells) != 2 or not re.fullmatch(r"[0-9]{1,3}(\.[0-9]{1,6})?", cells[1]):
            raise TableError(
                path, line, f"expected counts and millimetres, such as 113,46.2, got {','.join(cells)!r:.100}"
            )
        point = (integer(path, line, STROKE[0], cells[0], 255), float(cells[1]))
        if points and (why := why_not_after(points[-1], point)):
            raise TableError(path, line, why)
        points.append(point)
    if len(points) < 2:
        raise TableError(path, None, f"two or more points are needed, got {len(points)}")
    return tuple(points)


def write_stroke(path: Path | str, points: Points, model: Model | None = None) -> None:
    """Write measured points, replacing the file in one step.

    Raises:
        OSError: the file cannot be written; it stays as it was.
    """
    _write(path, model, [STROKE, *([position, f"{mm:g}"] for position, mm in points)])


# -- the column of the model -------------------------------------------------------------------------------

MODEL: Final = "model"


def _without_model(path: Path | str, rows: Sequence[CsvRow]) -> tuple[Sequence[CsvRow], Model | None]:
    """The rows without their last column, and the model in it, if that column names the model."""
    if not rows or rows[0][1][-1] != MODEL:
        return rows, None
    found = None
    for line, cells in rows[1:]:
        if len(cells) != len(rows[0][1]):
            raise TableError(path, line, f"expected {len(rows[0][1])} columns, got {len(cells)}")
        try:
            model = model_of(cells[-1])
        except ValueError as error:
            raise TableError(path, line, str(error)) from None
        if found not in (None, model):
            raise TableError(path, line, f"model must be the same in each row, got {cells[-1]!r}")
        found = model
    return [(line, cells[:-1]) for line, cells in rows], found


def _write(path: Path | str, model: Model | None, rows: Sequence[Sequence[object]]) -> None:
    if model is not None:
        rows = [[*row, model.name if number else MODEL] for number, row in enumerate(rows)]
    write_rows(path, rows)


# -- for other tables as well ------------------------------------------------------------------------------


def read_rows(path: Path | str) -> list[CsvRow]:
    """The rows of a CSV file with their line numbers; empty lines are left out.

    Raises:
        TableError: the file cannot be read.
    """
    rows: list[CsvRow] = []
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            lines = csv.reader(_lines(path, file), strict=True)
            try:
                rows += ((lines.line_num, [cell.strip() for cell in cells]) for cells in lines if cells)
            except csv.Error as error:
                raise TableError(path, lines.line_num, str(error)) from error
    except TableError:
        raise
    except OSError as error:
        raise TableError(path, None, f"cannot be read: {error.strerror}") from error
    except ValueError as error:  # not UTF-8, or a path with a null character
        raise TableError(path, None, f"cannot be read: {error}") from error
    return rows


def _lines(path: Path | str, file: TextIO) -> Iterator[str]:
    number = 0
    while line := file.readline(LONGEST_ROW + 1):
        number += 1
        if len(line) > LONGEST_ROW:
            raise TableError(path, number, f"it has more than {LONGEST_ROW} characters")
        yield line


def integer(path: Path | str, line: int, name: str, text: str, high: int) -> int:
    """An integer in 0..high."""
    if not re.fullmatch(r"[0-9]{1,12}", text) or int(text) > high:
        raise TableError(path, line, f"{name} must be an integer in 0..{high}, got {text!r}")
    return int(text)


def write_rows(path: Path | str, rows: Iterable[Sequence[object]]) -> None:
    """Write a CSV file completely or not at all. An existing file keeps its mode.

    Raises:
        OSError: the file cannot be written; it stays as it was.
    """
    mode = _mode(path)
    target = Path(os.path.realpath(path))  # a symbolic link stays a link
    beside = target.with_name(f".{target.name}.{secrets.token_hex(8)}")
    # O_EXCL: in a folder that others can write to, a file of this name could be a link that they made.
    descriptor = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, NEW_MODE if mode is None else mode)
    try:
        # A recording of others may hold half a character, which UTF-8 does not have.
        with open(descriptor, "w", encoding="utf-8", errors="backslashreplace", newline="") as file:
            if mode is not None:
                # The umask has removed bits from the mode given to os.open().
                os.chmod(descriptor if os.chmod in os.supports_fd else beside, mode)
            csv.writer(file, lineterminator="\n").writerows(rows)
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, target)
    finally:
        with contextlib.suppress(FileNotFoundError):
            beside.unlink()


def _mode(path: Path | str) -> int | None:
    """The permission bits of a file; None if it does not exist."""
    try:
        return stat.S_IMODE(os.stat(path).st_mode)
    except FileNotFoundError:
        return None
