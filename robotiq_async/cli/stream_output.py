"""The monitor without a screen: lines for people, or a JSON object a line for programs."""

from __future__ import annotations

import asyncio
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Final

from ..concurrency import in_a_thread
from ..enums import Fault, State
from ..session.clock import now
from ..session.streams import Transition
from ..telemetry.feed import compact
from ..telemetry.payloads import Fields, fault_fields, status_fields, transition_fields
from ..telemetry.raw_output import write_all
from ..wire.status import RobotiqStatus
from .log_capture import told
from .text import clock, event_line, status_line

if TYPE_CHECKING:
    from ..protocol import Hand

BUFFER: Final = 4000
"""Statuses kept for a reader that is slow: twenty seconds."""
JSON_BEAT_S: Final = 0.02
WATCH_BEAT_S: Final = 0.1
EVENTS: Final = ("transition", "fault", "remark")

Form = Callable[[list[Fields]], list[str]]


async def print_objects(hand: Hand, buffer: int = BUFFER) -> None:
    """Every status, transition and fault as a JSON object a line, until the hand ends; ``kind`` tells which.

    ``time`` is in seconds since 1970. A reader that is slow loses the oldest statuses; an object of the kind
    ``missed`` tells how many. What the library has to say is of the kind ``remark``.
    """
    await _print(_Story(hand, buffer), lambda told: [compact(each).decode() for each in told], JSON_BEAT_S)


async def watch(hand: Hand) -> None:
    """The state now; then every transition and fault, and the newest status if it shows something new."""
    await in_a_thread(lambda: _write(f"{clock(time.time())} state    {hand.state.name}\n".encode()))
    await _print(_Story(hand, BUFFER), _Words(), WATCH_BEAT_S)


async def _print(story: _Story, form: Form, beat: float) -> None:
    with told(story.remark):
        ended = False
        while not ended:
            ended = story.has_ended  # and once more for what has come with the end
            if lines := form(list(story.go_on())):
                data = "".join(f"{line}\n" for line in lines).encode()
                # Whoever reads may be slow: a full pipe must not hold up the loop that polls, nor the end.
                await in_a_thread(lambda: _write(data))  # noqa: B023  # awaited before it changes
            await asyncio.sleep(beat)


def _write(data: bytes) -> None:
    write_all(sys.stdout.fileno(), data)


class _Story:
    """What happens to a hand, in the order in which it happened."""

    def __init__(self, hand: Hand, buffer: int) -> None:
        self._hand = hand
        self._remarks: deque[tuple[float, str]] = deque(maxlen=BUFFER)
        self._statuses = hand.statuses(buffer)
        self._transitions = hand.transitions()
        self._state = hand.state
        self._fault = Fault.NONE
        self._missed = 0
        # Happenings carry a monotonic clock; people and files go by the world's.
        self._epoch = time.time() - now()

    @property
    def has_ended(self) -> bool:
        """Whether nothing more will come."""
        return self._hand.state is State.SHUTDOWN

    def remark(self, words: str) -> None:
        """What the library has to say; at any time."""
        self._remarks.append((time.time(), words))

    def go_on(self) -> Iterator[Fields]:
        """What has happened since the last time."""
        while self._remarks:
            at, words = self._remarks.popleft()
            yield {"kind": "remark", "time": at, "words": words}
        if self._statuses.missed > self._missed:
            yield {"kind": "missed", "time": time.time(), "count": self._statuses.missed - self._missed}
            self._missed = self._statuses.missed
        happened: list[RobotiqStatus | Transition] = [*self._transitions.drain(), *self._statuses.drain()]
        for each in sorted(happened, key=lambda one: one.timestamp):
            stamp = {"time": round(self._epoch + each.timestamp, 6)}
            if isinstance(each, Transition):
                self._state = each.target
                yield stamp | transition_fields(each)
                continue
            yield stamp | {"kind": "status", "state": self._state.name} | status_fields(each)
            if each.fault != self._fault:
                self._fault = each.fault
                yield stamp | fault_fields(each)


class _Words:
    """Lines for people."""

    def __init__(self) -> None:
        self._shown = ""

    def __call__(self, told: list[Fields]) -> list[str]:
        lines = [f"{clock(each['time'])} {event_line(each)}" for each in told if each["kind"] in EVENTS]
        newest = next((each for each in reversed(told) if each["kind"] == "status"), None)
        if newest is not None and (line := status_line(newest)) != self._shown:
            self._shown = line
            lines.append(f"{clock(newest['time'])} {line}")
        return lines
