"""A recording as a table in a CSV file. Needs the extra ``record``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from heapq import heappop, heappush
from itertools import chain
from pathlib import Path
from typing import Final

from ...values.calibration.csv_tables import write_rows
from .recordings import Entry
from .table import COLUMNS, Table

NEARBY: Final = 100
"""Size of the window for sorting."""
PREFIX: Final = "/gripper/"


def export(entries: Iterable[Entry], kind: str, target: Path | str) -> int:
    """Write the messages of one kind into a CSV file, all or none; an existing file is replaced.

    Args:
        entries: of a recording, JSON.
        kind: "status", "command" or "event".
        target: the file.

    Returns:
        The number of rows; 0 writes no file.

    Raises:
        RecordingError: a message does not have a recorder's format.
        OSError: the file cannot be written; it is unchanged.
    """
    count = 0

    def counted(rows: Iterator[list[object]]) -> Iterator[list[object]]:
        nonlocal count
        for row in rows:
            count += 1
            yield row

    rows = counted(_rows(entries, kind))
    first = next(rows, None)
    if first is not None:
        write_rows(target, chain([COLUMNS[kind], first], rows))
    return count


def _rows(entries: Iterable[Entry], kind: str) -> Iterator[list[object]]:
    table = Table(kind)
    for entry in in_order(entries):
        of = entry.topic.removeprefix(PREFIX)
        if of in (kind, "event") and of != entry.topic:
            row = entry.read(lambda fields: table.row(of, entry.nanoseconds, fields))  # noqa: B023  # at once
            if row is not None:
                yield row


def in_order(entries: Iterable[Entry]) -> Iterator[Entry]:
    """Sort by time: messages of different streams are some milliseconds out of order in the file."""
    waiting: list[tuple[int, int, Entry]] = []
    for number, entry in enumerate(entries):
        heappush(waiting, (entry.nanoseconds, number, entry))
        if len(waiting) > NEARBY:
            yield heappop(waiting)[2]
    while waiting:
        yield heappop(waiting)[2]
