"""A recording as a table with one row per poll. Needs no extra; a truncated file is readable."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable

from .feed import EVENT, STATUS, Message
from .table import COLUMNS, Table

_KINDS = {STATUS: "status", EVENT: "event"}


class CsvFile:
    """Encodes messages as CSV."""

    def __init__(self, write: Callable[[bytes], object]) -> None:
        self._write = write
        self._table = Table("status")
        self._line(COLUMNS["status"])

    def take(self, message: Message) -> None:
        """Add a row for a status. Events set the state of the following rows; commands have no row."""
        kind = _KINDS.get(message.topic)
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
