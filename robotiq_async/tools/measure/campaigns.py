"""Measurements of your own gripper, as in chapter 6 of the thesis: closing times, and the force of a grasp.

The clock of a simulated gripper may be faster than the program's: ``speedup`` converts times. Both campaigns
save after every row, so an interrupted one can be resumed.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from ...calibration import (
    FORCE,
    SPEED_LAYOUT,
    Layout,
    RunsTable,
    SpeedCalibration,
    TableError,
    integer,
    read_measured,
    read_rows,
    write_rows,
    write_table,
)
from ...hands import Hand
from ...runtime import now
from ...values import SPEED_MAX, THREE_FINGER, Finger, Model
from ..errors import MeasuringError

RUN_PAUSE_S: Final = 0.3
"""Pause between runs, in the gripper's time: a finger that has just stopped may still swing."""
ATTEMPTS: Final = 20  # attempts at a run: a run in which the event loop was blocked is repeated
TOLERATED: Final = 0.01  # share of a run for which the event loop may be blocked, apart from two polls
STROKE_SLACK: Final = 5  # counts by which the readings of a full closing may differ from the manual's
GRASP_S: Final = 1.0  # seconds of the gripper's time that are recorded after the fingers have stopped
CURRENT_MA: Final = 2550  # the highest current that a status can report
FINGERS: Final = (Finger.A, Finger.B, Finger.C)
_CURRENTS_HEADER: Final = ["force_value", "run", "time_ms", "a_ma", "b_ma", "c_ma"]

Sample = tuple[int, int, int, int]
"""Milliseconds since the command, and the currents of A, B and C in milliampere."""
Currents = dict[int, list[list[Sample]]]  # for each force value the samples of each run


# -- values to measure, in their order ---------------------------------------------------------------------


def speed_values(step: int = 4) -> list[int]:
    """Speed values in steps from 0, and 255; slowest first."""
    return sorted({*range(0, 256, step), 255})


def force_values(step: int = 25) -> list[int]:
    """Force values in steps from 0: every second one upwards, the others downwards."""
    values = list(range(0, 256, step))
    return values[::2] + values[1::2][::-1]


# -- speed -------------------------------------------------------------------------------------------------


async def time_closing(hand: Hand, speed: int, fingers: Finger, speedup: float = 1.0) -> float:
    """Open fully at full speed, then close at a speed; returns the seconds from the command to standstill.

    Repeats a run in which the event loop was blocked. Cancelling stops the fingers.

    Raises:
        ValueError: the scissor, which has a different stroke, is among the fingers.
        MeasuringError: the fingers met something or did not close fully, or the loop is too busy.
        RobotiqError: as :meth:`Hand.move`.
    """
    if Finger.SCISSOR in fingers:
        raise ValueError("fingers must be A, B and C only, got the scissor: it has a different stroke")
    open_below, closed_above = (
        hand.model.open_reading_max + STROKE_SLACK,
        hand.model.closed_reading_min - STROKE_SLACK,
    )
    for _ in range(ATTEMPTS):
        opened = await hand.open(fingers, speed=255)
        await asyncio.sleep(RUN_PAUSE_S / speedup)
        before = hand.statistics
        closed = await hand.close(fingers, speed=speed)
        for result in (opened, closed):
            if result.object_detected:
                what = f"the fingers met something ({result.contacts!r})"
                raise MeasuringError(f"{what}: nothing may be in their way")
        if max(opened.positions.values()) > open_below or min(closed.positions.values()) < closed_above:
            raise MeasuringError(
                f"no full closing: from {dict(opened.positions)} to {dict(closed.positions)}"
            )
        after = hand.statistics
        missed = max(0, after.overruns - before.overruns - 2)
        if missed * after.period_p50 <= TOLERATED * closed.duration:
            return closed.duration * speedup
    raise MeasuringError(
        f"the event loop was blocked in each of {ATTEMPTS} runs: the computer is too busy to measure"
    )


def expected_seconds(model: Model, speed: int) -> float:
    """Estimated duration of one run, in the gripper's time: for progress bars."""
    closing_time = SpeedCalibration.usual(model).closing_time
    return closing_time(speed) + closing_time(SPEED_MAX) + RUN_PAUSE_S


# -- force -------------------------------------------------------------------------------------------------


async def grasp(hand: Hand, force: int, speed: int, speedup: float = 1.0) -> list[Sample]:
    """Open, then close on the object between the fingers; returns the currents from the command on.

    The fingers stay closed so that the scale can be read. Cancelling stops them.

    Raises:
        MeasuringError: the fingers met nothing.
        RobotiqError: as :meth:`Hand.move`.
    """
    opened = await hand.open(speed=255)
    if opened.object_detected:
        raise MeasuringError(f"something blocks the opening ({opened.contacts!r})")
    await asyncio.sleep(RUN_PAUSE_S / speedup)
    with _sampling(hand, speedup) as samples:
        result = await hand.close(speed=speed, force=force)
        await asyncio.sleep(GRASP_S / speedup)
    if not result.object_detected:
        raise MeasuringError("the fingers closed on nothing: put the scale between them")
    return samples


@contextlib.contextmanager
def _sampling(hand: Hand, speedup: float) -> Iterator[list[Sample]]:
    samples: list[Sample] = []
    began, statuses = now(), hand.statuses(buffer=10_000)
    if hand.model is not THREE_FINGER:
        raise MeasuringError(f"this measures three fingers; a {hand.model.title} has one axis")

    async def watch() -> None:
        async for status in statuses:
            time = max(0, round(1000 * (status.timestamp - began) * speedup))
            a, b, c = (status.current_ma(finger) or 0 for finger in FINGERS)
            samples.append((time, a, b, c))

    watcher = asyncio.get_running_loop().create_task(watch())
    try:
        yield samples
    finally:
        watcher.cancel()


def peak_currents(runs: list[list[Sample]]) -> tuple[int, int, int]:
    """The highest current of each finger in any run, in milliampere."""
    samples = [sample for run in runs for sample in run]
    a, b, c = (max((sample[at] for sample in samples), default=0) for at in (1, 2, 3))
    return a, b, c


# -- campaigns ---------------------------------------------------------------------------------------------


@dataclass
class Campaign:
    """A table in a file that is filled row by row, and resumed if the file exists."""

    path: Path  # the file; read if it exists
    layout: Layout  # of the table
    values: list[int]  # the rows, in the order of measurement
    runs: int  # number of columns
    origin: dict[str, str] = field(default_factory=dict)
    """The subject and conditions of the measurement, kept beside the table. Only the same can resume it."""
    table: RunsTable = field(default_factory=dict)  # the measurements so far
    model: Model | None = None  # on which these were made; None if the file does not say

    def __post_init__(self) -> None:
        """Resume the table if the file exists.

        Raises:
            TableError: the file exists and is not such a table, or it cannot be created.
        """
        if not self.path.parent.is_dir():
            raise TableError(self.path, None, f"there is no folder {self.path.parent}")
        if not os.access(self.path.parent, os.W_OK):
            raise TableError(self.path, None, f"the folder {self.path.parent} cannot be written to")
        if not self.path.exists():
            return
        self.table, self.model = read_measured(self.path, self.layout)
        for runs in self.table.values():
            if len(runs) != self.runs:
                raise TableError(self.path, None, f"has {len(runs)} runs instead of {self.runs}")
        was = read_origin(self.path)
        if was != self.origin:
            differs = ", ".join(
                f"{name} {was.get(name, 'unknown')} there and {self.origin.get(name, 'unknown')} here"
                for name in sorted({*was, *self.origin})
                if was.get(name) != self.origin.get(name)
            )
            raise TableError(
                self.path, None, f"was measured with other settings: {differs}; choose another file"
            )

    @property
    def left(self) -> list[int]:
        """The values still to measure, in their order."""
        return [value for value in self.values if value not in self.table]

    async def measure(
        self, measure_run: Callable[[int, int], Awaitable[int]], model: Model = THREE_FINGER
    ) -> None:
        """Measure the remaining values; ``measure_run`` gets value and run (from 1), and returns the reading.

        Raises:
            TableError: a reading is outside the range of the layout, or the file is of another model.
            OSError: the file cannot be written.
        """
        if self.model not in (None, model):
            raise TableError(self.path, None, f"was measured on a {self.model}, and the gripper is a {model}")
        for value in self.left:
            readings = []
            for run in range(1, self.runs + 1):
                reading = await measure_run(value, run)
                limit = f"0..{self.layout.high} {self.layout.unit}"
                if not 0 <= reading <= self.layout.high:
                    raise TableError(self.path, None, f"a reading of {reading} is beyond {limit}")
                readings.append(reading)
            table = {**self.table, value: tuple(readings)}
            if not origin_beside(self.path).exists():
                await asyncio.to_thread(write_rows, origin_beside(self.path), sorted(self.origin.items()))
            # In a thread: a slow disk must not hold up polling.
            await asyncio.to_thread(write_table, self.path, self.layout, table, model)
            self.table, self.model = table, model


def speed_campaign(path: Path, step: int = 4, runs: int = 3, **origin: str) -> Campaign:
    """A campaign of closing times, for speed values in steps."""
    return Campaign(path, SPEED_LAYOUT, speed_values(step), runs, origin)


def force_campaign(path: Path, step: int = 25, runs: int = 3, **origin: str) -> Campaign:
    """A campaign of scale readings, for force values in steps."""
    return Campaign(path, FORCE, force_values(step), runs, origin)


def origin_beside(path: Path) -> Path:
    """The file beside a table that holds its origin."""
    return path.with_name(f"{path.name}.origin.csv")


def read_origin(path: Path) -> dict[str, str]:
    """Read the origin of a table; empty if none was recorded."""
    beside = origin_beside(path)
    if not beside.exists():
        return {}
    return {cells[0]: cells[1] for _, cells in read_rows(beside) if len(cells) == 2}


# -- currents in a file ------------------------------------------------------------------------------------


def read_currents(path: Path) -> Currents:
    """Read the currents of grasps, as :func:`write_currents` writes them.

    Raises:
        TableError: the file cannot be read, or is not one of currents.
    """
    currents: Currents = {}
    for number, (line, cells) in enumerate(read_rows(path)):
        if not number:
            if cells != _CURRENTS_HEADER:
                raise TableError(path, line, f"expected the columns {','.join(_CURRENTS_HEADER)}")
            continue
        if len(cells) != len(_CURRENTS_HEADER):
            raise TableError(path, line, f"expected {len(_CURRENTS_HEADER)} columns, got {len(cells)}")
        highs = (255, 1000, 10_000_000, CURRENT_MA, CURRENT_MA, CURRENT_MA)
        force, run, *sample = (
            integer(path, line, name, cell, high)
            for name, cell, high in zip(_CURRENTS_HEADER, cells, highs, strict=True)
        )
        runs = currents.setdefault(force, [])
        if run not in (len(runs), len(runs) + 1) or not run:
            raise TableError(path, line, f"run {run} of force {force} is out of order")
        if run > len(runs):
            runs.append([])
        time, a, b, c = sample
        runs[-1].append((time, a, b, c))
    if not currents:
        raise TableError(path, None, "it contains no currents")
    return currents


def write_currents(path: Path, currents: Currents) -> None:
    """Write the currents of grasps into a file, replacing it at once."""
    rows = (
        (force, number, *sample)
        for force in sorted(currents)
        for number, run in enumerate(currents[force], 1)
        for sample in run
    )
    write_rows(path, [_CURRENTS_HEADER, *rows])
