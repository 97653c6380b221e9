"""Messages of a hand as rows of a table, for spreadsheets and pandas, and a recording as such a table.

A column has the name of its JSON key, for an axis with a prefix: ``A.position``. ``time`` is the wall clock,
in UTC and ISO 8601; ``timestamp`` is in seconds of the program's monotonic clock.
"""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from datetime import UTC, datetime
from heapq import heappop, heappush
from itertools import chain, compress
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from ...calibration import Convention, write_rows
from .feed import EVENT, STATUS, Message
from .payloads import SCHEMAS, Properties

if TYPE_CHECKING:
    from .recordings import RecordedMessage

_SECOND: Final = 10**9
_FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")
"""A spreadsheet takes a text that begins with one of these for a formula."""
_MAY_LACK: Final = ("B", "C", "SCISSOR")
"""The axes that a sibling of the 3-Finger does not have."""
_LATER_COLUMNS: Final = ("opening_mm", "open_fraction")
"""Columns that recordings of earlier versions do not have."""
CURRENT_COLUMN: Final = "current_ma"
"""The column that recordings over a URCap do not have."""
STATE: Final = "state"
"""The column with the state of the hand as of the last event; the JSON of a status does not have it."""
LABEL: Final = "label"
"""The column with the label of the last mark."""
VALUES: Final = "values"
"""The column with the values of the last mark, as JSON; empty for a mark without values."""

NEARBY: Final = 100  # entries in the window for sorting
PREFIX: Final = "/gripper/"


def _names(schema: Mapping[str, Any], prefix: str = "") -> list[str]:
    names: list[str] = []
    for name, part in schema["properties"].items():
        is_axis = "properties" in part
        names += _names(part, f"{prefix}{name}.") if is_axis else [f"{prefix}{name}"]
    return names


COLUMNS: Final = {
    "status": ["time", STATE, LABEL, VALUES, *_names(SCHEMAS["status"])],
    "command": ["time", *_names(SCHEMAS["command"])],
    "event": ["time", *_names(SCHEMAS["event"])],
}
"""The columns of the three tables."""


class Table:
    """The rows of one table, made of messages in chronological order.

    With a convention the last column has its name, and the opening in its numbers: the mean of the fingers.
    """

    def __init__(self, kind: str, convention: Convention | None = None) -> None:
        self._kind = kind
        self._convention = convention
        self._names = COLUMNS[kind]
        self._state = ""
        self._label = ""
        self._values = ""

    def row(self, kind: str, nanoseconds: int, fields: Properties) -> list[object] | None:
        """The row of a message of this kind, with its time since 1970; None for a message without a row."""
        if kind == "event" and "target" in fields:
            self._state = fields["target"]
        if kind == "event" and fields.get("kind") == "mark":
            self._label = str(fields["label"])
            self._values = json.dumps(fields["values"]) if fields["values"] else ""
        if kind != self._kind:
            return None
        given = {"time": wall_clock(nanoseconds)}
        if kind == "status":
            given |= {STATE: self._state, LABEL: self._label, VALUES: self._values}
        row = [_cell(given[name] if name in given else _value(fields, name, kind)) for name in self._names]
        return row if self._convention is None else [*row, _opening(fields, self._convention)]

    @property
    def columns(self) -> list[str]:
        """The names of the columns."""
        return self._names if self._convention is None else [*self._names, self._convention.name]


def wall_clock(nanoseconds: int) -> str:
    """Format nanoseconds since 1970 in UTC, ISO 8601 to the microsecond."""
    seconds, rest = divmod(nanoseconds, _SECOND)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{rest // 1000:06d}Z"


def _value(fields: Properties, name: str, kind: str) -> Any:  # noqa: ANN401  # as JSON has it
    axis, _, key = name.rpartition(".")
    if kind == "event":
        return fields.get(name)
    if axis not in fields and axis in _MAY_LACK:
        return None
    if key in _LATER_COLUMNS or key == CURRENT_COLUMN:
        return fields[axis].get(key)
    return fields[axis][key] if axis else fields[name]


def _opening(fields: Properties, convention: Convention) -> float | None:
    """The opening as a number of a convention; None in a recording of an earlier version, which lacks it."""
    shares = [fields[finger].get("open_fraction") for finger in ("A", "B", "C") if finger in fields]
    return None if None in shares else convention.value(sum(shares) / len(shares))


def _cell(value: object) -> object:
    """Format a value: lists with blanks between, empty for null, and no text as a formula."""
    if isinstance(value, list):
        return " ".join(map(str, value))
    if isinstance(value, dict):
        return json.dumps(value)
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value


_ROW_KINDS: Final = {STATUS: "status", EVENT: "event"}


class CsvFile:
    """A recording as a table with one row per poll. Needs no extra; a truncated file is readable."""

    def __init__(self, write: Callable[[bytes], object]) -> None:
        self._write = write
        self._table = Table("status")
        self._line(COLUMNS["status"])

    def take(self, message: Message) -> None:
        """Add a row for a status. Events set the state of the following rows; commands have no row."""
        kind = _ROW_KINDS.get(message.topic)
        if kind and (row := self._table.row(kind, message.nanoseconds, json.loads(message.data))):
            self._line(row)

    def flush(self) -> None:
        """Do nothing: no row is buffered."""

    def finish(self) -> None:
        """Do nothing: CSV has no footer."""

    def _line(self, cells: list[object] | list[str]) -> None:
        line = io.StringIO(newline="")
        csv.writer(line, lineterminator="\n").writerow(cells)
        self._write(line.getvalue().encode())


class Exported(NamedTuple):
    """The outcome of :func:`export`.

    Attributes:
        rows: their number; 0 writes no file.
        left_out: columns that have no value in any row.
    """

    rows: int
    left_out: tuple[str, ...]


def export(
    entries: Iterable[RecordedMessage], kind: str, target: Path | str, convention: Convention | None
) -> Exported:
    """Write the messages of one kind into a CSV file, all or none; an existing file is replaced.

    A column that has no value in any row is left out. With a convention statuses have a last column of its
    name: the opening in its numbers. The argument is required, even as None, so that no reader has to guess
    the sign of another column.

    Raises:
        RecordingError: a message does not have a recorder's format.
        OSError: the file cannot be written; it is unchanged.
    """
    table = Table(kind, convention)
    count, filled = 0, [False] * len(table.columns)
    # Which columns have a value is known at the last row, and memory does not hold the rows of an hour.
    with TemporaryFile("w+", encoding="ascii", dir=Path(os.path.realpath(target)).parent) as waiting:
        for row in _rows(entries, kind, table):
            count += 1
            filled = [had or cell not in (None, "") for had, cell in zip(filled, row, strict=True)]
            waiting.write(f"{json.dumps(row)}\n")
        if count:
            waiting.seek(0)
            rows = chain([table.columns], map(json.loads, waiting))
            write_rows(target, (list(compress(row, filled)) for row in rows))
    left_out = (name for name, has_value in zip(table.columns, filled, strict=True) if not has_value)
    return Exported(count, tuple(left_out))


def _rows(entries: Iterable[RecordedMessage], kind: str, table: Table) -> Iterator[list[object]]:
    for entry in in_order(entries):
        of = entry.topic.removeprefix(PREFIX)
        if of in (kind, "event") and of != entry.topic:
            row = entry.read(lambda fields: table.row(of, entry.nanoseconds, fields))  # noqa: B023  # at once
            if row is not None:
                yield row


def in_order(entries: Iterable[RecordedMessage]) -> Iterator[RecordedMessage]:
    """Sort by time: messages of different streams are some milliseconds out of order in the file."""
    waiting: list[tuple[int, int, RecordedMessage]] = []
    for number, entry in enumerate(entries):
        heappush(waiting, (entry.nanoseconds, number, entry))
        if len(waiting) > NEARBY:
            yield heappop(waiting)[2]
    while waiting:
        yield heappop(waiting)[2]
