"""The monitor without a screen: lines of text for people, lines of JSON for programs."""

from __future__ import annotations

import asyncio
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Final

from ...runtime.concurrency import in_a_thread
from ...tools.recording.feed import compact
from ...tools.recording.payloads import Fields
from ...tools.recording.raw_output import write_all
from ...tools.recording.timeline import Timeline
from ...values.enums import State
from ...values.status import RobotiqStatus
from .log_capture import forwarded_warnings
from .text import clock, event_line, status_line

if TYPE_CHECKING:
    from ...hand import Hand

BUFFER: Final = 4000
"""Statuses kept for a slow reader: 20 s."""
JSON_INTERVAL_S: Final = 0.02
WATCH_INTERVAL_S: Final = 0.1
EVENTS: Final = ("transition", "fault", "log")

Formatter = Callable[[list[Fields]], list[str]]


async def print_objects(hand: Hand, buffer: int = BUFFER) -> None:
    """Print every status, transition and fault as a line of JSON until the hand is stopped.

    ``kind`` is the kind of the line, ``time`` is in seconds since 1970. A slow reader loses the oldest
    statuses; a line of kind ``missed`` has their number. Warnings of the library have the kind ``log``.
    """
    await _print(_History(hand, buffer), _json_lines, JSON_INTERVAL_S)


async def watch(hand: Hand) -> None:
    """Print the state; then every transition and fault, and the newest status if its line has changed."""
    await in_a_thread(lambda: _write(f"{clock(time.time())} state    {hand.state.name}\n".encode()))
    await _print(_History(hand, BUFFER), _TextLines(), WATCH_INTERVAL_S)


async def _print(history: _History, formatter: Formatter, interval: float) -> None:
    with forwarded_warnings(history.add_warning, of=history.hand.name):
        ended = False
        while not ended:
            ended = history.hand.state is State.SHUTDOWN  # and once more for the last events
            if lines := formatter(list(history.new())):
                data = "".join(f"{line}\n" for line in lines).encode()
                # The reader may be slow: a full pipe must not block the event loop that polls, nor the stop.
                await in_a_thread(lambda: _write(data))  # noqa: B023  # awaited before it changes
            await asyncio.sleep(interval)


def _write(data: bytes) -> None:
    write_all(sys.stdout.fileno(), data)


class _History:
    """The timeline of a hand as objects, with the warnings of the library."""

    def __init__(self, hand: Hand, buffer: int) -> None:
        self.hand = hand
        self._warnings: deque[tuple[float, str]] = deque(maxlen=BUFFER)
        self._timeline = Timeline(hand, buffer)
        self._state = hand.state.name
        self._missed = 0

    def add_warning(self, message: str) -> None:
        self._warnings.append((time.time(), message))

    def new(self) -> Iterator[Fields]:
        while self._warnings:
            at, message = self._warnings.popleft()
            yield {"kind": "log", "time": at, "message": message}
        if missed := self._timeline.missed - self._missed:
            yield {"kind": "missed", "time": time.time(), "count": missed}
            self._missed += missed
        for at, each in self._timeline.new():
            stamp = {"time": round(at, 6)}
            if isinstance(each, RobotiqStatus):
                yield stamp | {"kind": "status", "state": self._state} | each.as_dict()
            else:
                self._state = each.get("target", self._state)
                yield stamp | each


def _json_lines(new: list[Fields]) -> list[str]:
    return [compact(each).decode() for each in new]


class _TextLines:
    def __init__(self) -> None:
        self._shown = ""

    def __call__(self, new: list[Fields]) -> list[str]:
        lines = [f"{clock(each['time'])} {event_line(each)}" for each in new if each["kind"] in EVENTS]
        newest = next((each for each in reversed(new) if each["kind"] == "status"), None)
        if newest is not None and (line := status_line(newest)) != self._shown:
            self._shown = line
            lines.append(f"{clock(newest['time'])} {line}")
        return lines
