"""The monitor without a screen: lines for people, or a JSON object a line for programs."""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Final

from ..enums import Fault
from ..feed import compact
from ..payloads import Fields, fault_fields, status_fields, transition_fields
from ..status import RobotiqStatus
from ..streams import Transition
from .words import clock, event_line, status_line

if TYPE_CHECKING:
    from .. import RobotiqHand

BUFFER: Final = 4000
"""Statuses kept for a reader that is slow: twenty seconds."""
JSON_BEAT_S: Final = 0.02
WATCH_BEAT_S: Final = 0.1

Form = Callable[[list[Fields]], list[str]]


async def print_objects(hand: RobotiqHand, buffer: int = BUFFER) -> None:
    """Every status, transition and fault as a JSON object a line, for ever; ``kind`` tells which.

    A reader that is slow loses the oldest statuses; an object of the kind ``missed`` tells how many.
    """
    await _print(_Story(hand, buffer), lambda told: [compact(each).decode() for each in told], JSON_BEAT_S)


async def watch(hand: RobotiqHand) -> None:
    """Every transition and fault, and of the statuses the newest if it shows something new, for ever."""
    await _print(_Story(hand, BUFFER), _Words(), WATCH_BEAT_S)


async def _print(story: _Story, form: Form, beat: float) -> None:
    while True:
        lines = form(list(story.go_on()))
        # Whoever reads may be slow: a full pipe must not hold up the loop that polls.
        await asyncio.to_thread(_write, lines)
        await asyncio.sleep(beat)


def _write(lines: list[str]) -> None:
    if lines:
        sys.stdout.write("".join(f"{line}\n" for line in lines))
        sys.stdout.flush()


class _Story:
    """What happens to a hand, in the order in which it happened."""

    def __init__(self, hand: RobotiqHand, buffer: int) -> None:
        self._statuses = hand.statuses(buffer)
        self._transitions = hand.transitions()
        self._state = hand.state
        self._fault = Fault.NONE
        self._missed = 0

    def go_on(self) -> Iterator[Fields]:
        """What has happened since the last time."""
        if self._statuses.missed > self._missed:
            yield {"kind": "missed", "count": self._statuses.missed - self._missed}
            self._missed = self._statuses.missed
        happened: list[RobotiqStatus | Transition] = [*self._transitions.drain(), *self._statuses.drain()]
        for each in sorted(happened, key=lambda one: one.timestamp):
            if isinstance(each, Transition):
                self._state = each.target
                yield transition_fields(each)
                continue
            yield {"kind": "status", "state": self._state.name, **status_fields(each)}
            if each.fault != self._fault:
                self._fault = each.fault
                yield fault_fields(each)


class _Words:
    """Lines for people."""

    def __init__(self) -> None:
        self._shown = ""
        # Happenings carry the loop's clock; people read the world's.
        self._epoch = time.time() - asyncio.get_running_loop().time()

    def __call__(self, told: list[Fields]) -> list[str]:
        events = [each for each in told if each["kind"] in ("transition", "fault")]
        lines = [f"{clock(self._epoch + each['monotonic'])} {event_line(each)}" for each in events]
        newest = next((each for each in reversed(told) if each["kind"] == "status"), None)
        if newest is not None and (line := status_line(newest)) != self._shown:
            self._shown = line
            lines.append(f"{clock(self._epoch + newest['monotonic'])} {line}")
        return lines
