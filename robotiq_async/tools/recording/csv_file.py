"""A recording as a table: a row for every poll. Needs no extra, and a file that ends anywhere is readable."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable

from .feed import EVENT, STATUS, Message
from .table import COLUMNS, Table

_KINDS = {STATUS: "status", EVENT: "event"}


class CsvFile:
    """Makes the bytes of a CSV file of messages."""

    def __init__(self, write: Callable[[bytes], object]) -> None:
        self._write = write
        self._table = Table("status")
        self._line(COLUMNS["status"])

    def take(self, message: Message) -> None:
        """Add a row for a status; an event changes the state of the rows that follow, commands have none."""
        kind = _KINDS.get(message.topic)
        if kind and (row := self._table.row(kind, message.nanoseconds, json.loads(message.data))):
            self._line(row)

    def flush(self) -> None:
        """Nothing waits."""

    def finish(self) -> None:
        """A table has no end of its own."""

    def _line(self, cells: list[object] | list[str]) -> None:
        line = io.StringIO(newline="")
        csv.writer(line, lineterminator="\n").writerow(cells)
        self._write(line.getvalue().encode())
