"""Statuses, requests and events as lines: of text for people, of JSON for programs."""

from __future__ import annotations

import asyncio
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from datetime import datetime
from typing import TYPE_CHECKING, Any, Final

from ...runtime import in_a_thread, write_all
from ...tools.recording.feed import Timeline, compact
from ...tools.recording.payloads import Properties, is_command
from ...tools.wording import JAW_NAME, inhibit_words
from ...values import NO_REQUEST, Finger, RobotiqStatus, State, Trigger
from .messages import forwarded_warnings

if TYPE_CHECKING:
    from ...hands import Hand

NO_VALUE: Final = "-"
"""The text for a state without a meaning."""
_AXIS_NAMES: Final = [str(axis.name) for axis in Finger.ALL]


def clock(seconds: float) -> str:
    """The local time of day, to the millisecond, of seconds since 1970."""
    return f"{datetime.fromtimestamp(seconds).astimezone():%H:%M:%S.%f}"[:-3]


def _axes_in(fields: Properties) -> list[str]:
    return [name for name in _AXIS_NAMES if name == "A" or name in fields]  # a sibling has A alone


def _title(name: str, fields: Properties) -> str:
    return JAW_NAME if len(_axes_in(fields)) == 1 else name


def status_line(fields: Properties) -> str:
    """The line for a status: position and state of every axis; of a jaw also its opening."""
    axes = (
        f"{_title(n, fields)}={fields[n]['position']}{_opening(n, fields)} "
        f"{axis_words(fields[n]['axis_state'])}"
        for n in _axes_in(fields)
    )
    return f"status   {' '.join(axes)}"


def _opening(name: str, fields: Properties) -> str:
    # Recordings of earlier versions have no opening.
    mm = fields[name].get("opening_mm") if _title(name, fields) == JAW_NAME else None
    return "" if mm is None else f" ({float(mm):.1f} mm)"


def axis_words(state: str) -> str:
    """The state of an axis; ``-`` where it means nothing."""
    return NO_VALUE if state == NO_REQUEST else state


def command_line(fields: Properties) -> str:
    """The line for a request that was written."""
    axes = (
        f"{_title(n, fields)}={fields[n]['position']}@{fields[n]['speed']}/{fields[n]['force']}"
        for n in _axes_in(fields)
    )
    bits = f"act={fields['activate']:d} go={fields['go']:d} release={fields['release']:d}"
    return f"command  {bits} {' '.join(axes)}{'' if fields['acknowledged'] else ' NOT ACKNOWLEDGED'}"


def event_line(fields: Properties) -> str:
    """The line for the initial state, a transition, a fault, a mark, or a warning of the library."""
    if fields["kind"] == "log":
        return f"log      {fields['message']}"
    if fields["kind"] == "state":
        return f"state    {fields['target']}"
    if fields["kind"] == "mark":
        values = (f"{name}={value}" for name, value in fields["values"].items())
        return f"mark     {' '.join([fields['label'] or '(end)', *values])}"
    if fields["kind"] == "inhibit":
        return f"inhibit  {inhibit_words(fields)}"
    if fields["kind"] == "fault":
        return f"fault    0x{fields['fault_code']:02X} {fields['fault']}: {fields['description']}"
    trigger = fields["trigger"]
    why = Trigger[trigger].value if trigger in Trigger.__members__ else trigger
    return f"state    {fields['source']} -> {fields['target']} ({why})"


def brief_line(fields: Properties, contacts: dict[str, Any]) -> str:
    """The line for a state, a fault, or a change of the contacts, which it updates; empty for all else."""
    if "kind" in fields:
        return "" if is_command(fields) else event_line(fields)
    if "contacts" not in fields:
        return ""
    now = {name: fields[name]["position"] for name in fields["contacts"]}
    if now.keys() == contacts.keys():
        return ""
    contacts.clear()
    contacts.update(now)
    where = (f"{_title(n, fields)}={position}{_opening(n, fields)}" for n, position in now.items())
    return f"contact  {' '.join(where) or 'none'}"


FORMATTERS: Final[dict[str, Callable[[Properties], str]]] = {
    "/gripper/status": status_line,
    "/gripper/command": command_line,
    "/gripper/event": event_line,
}
"""The formatter of each topic."""


LINES_BUFFER: Final = 4000
"""Statuses kept for a slow reader: 20 s."""
JSON_INTERVAL_S: Final = 0.02
WATCH_INTERVAL_S: Final = 0.1
EVENT_KINDS: Final = ("transition", "fault", "inhibit", "log")

Formatter = Callable[[list[Properties]], list[str]]


async def print_objects(hand: Hand, buffer: int = LINES_BUFFER) -> None:
    """Print every status, transition and fault as a line of JSON until the hand is stopped.

    ``kind`` is the kind of the line, ``time`` is in seconds since 1970. A slow reader loses the oldest
    statuses; a line of kind ``missed`` has their number. Warnings of the library have the kind ``log``.
    """
    await _print(_History(hand, buffer), _json_lines, JSON_INTERVAL_S)


async def watch(hand: Hand) -> None:
    """Print the state; then every transition and fault, and the newest status if its line has changed."""
    await _write(f"{clock(time.time())} state    {hand.state.name}\n".encode())
    await _print(_History(hand, LINES_BUFFER), _TextLines(), WATCH_INTERVAL_S)


async def _print(history: _History, formatter: Formatter, interval: float) -> None:
    with forwarded_warnings(history.add_warning, of=history.hand.name):
        ended = False
        while not ended:
            ended = history.hand.state is State.SHUTDOWN  # then a last turn, for the last events
            if lines := formatter(list(history.new())):
                data = "".join(f"{line}\n" for line in lines).encode()
                await _write(data)
            await asyncio.sleep(interval)


async def _write(data: bytes) -> None:
    # The reader may be slow: a full pipe must not block the event loop that polls, nor the stop.
    await in_a_thread(lambda: write_all(sys.stdout.fileno(), data))


class _History:
    """The timeline of a hand as objects, with the warnings of the library."""

    def __init__(self, hand: Hand, buffer: int) -> None:
        self.hand = hand
        self._warnings: deque[tuple[float, str]] = deque(maxlen=LINES_BUFFER)
        self._timeline = Timeline(hand, buffer)
        self._state = hand.state.name
        self._missed = 0

    def add_warning(self, message: str) -> None:
        self._warnings.append((time.time(), message))

    def new(self) -> Iterator[Properties]:
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


def _json_lines(new: list[Properties]) -> list[str]:
    return [compact(each).decode() for each in new]


class _TextLines:
    def __init__(self) -> None:
        self._shown = ""

    def __call__(self, new: list[Properties]) -> list[str]:
        lines = [f"{clock(each['time'])} {event_line(each)}" for each in new if each["kind"] in EVENT_KINDS]
        newest = next((each for each in reversed(new) if each["kind"] == "status"), None)
        if newest is not None and (line := status_line(newest)) != self._shown:
            self._shown = line
            lines.append(f"{clock(newest['time'])} {line}")
        return lines
