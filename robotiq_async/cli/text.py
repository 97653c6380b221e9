"""What happens to a hand as lines of text."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from typing import Final

from ..enums import AXES, ObjectStatus
from ..telemetry.payloads import Fields

NOTHING: Final = "-"
"""Stands for an object status that means nothing."""
_NAMES: Final = [str(axis.name) for axis in AXES]


def clock(seconds: float) -> str:
    """The local time of day, to the millisecond, of seconds since 1970."""
    return f"{datetime.fromtimestamp(seconds).astimezone():%H:%M:%S.%f}"[:-3]


def status_line(fields: Fields) -> str:
    """The line for a status: position and object status of every axis."""
    axes = (f"{name}={fields[name]['position']} {_object_status(fields, name)}" for name in _NAMES)
    return f"status   {' '.join(axes)}"


def _object_status(fields: Fields, name: str) -> str:
    return object_status(str(fields[name]["status"]), is_moving=fields["moving"])


def object_status(reported: str, *, is_moving: bool) -> str:
    """The object status of an axis, or ``-`` where it means nothing.

    The gripper reports IN_MOTION also of an axis that was never told to go.

    Args:
        reported: its object status, by name.
        is_moving: whether it moves, as the whole status shows.
    """
    return NOTHING if reported == ObjectStatus.IN_MOTION.name and not is_moving else reported


def command_line(fields: Fields) -> str:
    """The line for a request that was written."""
    axes = (f"{n}={fields[n]['position']}@{fields[n]['speed']}/{fields[n]['force']}" for n in _NAMES)
    bits = f"act={fields['activate']:d} go={fields['go']:d} release={fields['release']:d}"
    return f"command  {bits} {' '.join(axes)}{'' if fields['acknowledged'] else ' NOT ACKNOWLEDGED'}"


def event_line(fields: Fields) -> str:
    """The line for the initial state, a transition, a fault, or a warning of the library."""
    if fields["kind"] == "log":
        return f"log      {fields['message']}"
    if fields["kind"] == "state":
        return f"state    {fields['target']}"
    if fields["kind"] == "fault":
        return f"fault    0x{fields['code']:02X} {fields['name']}: {fields['description']}"
    return f"state    {fields['source']} -> {fields['target']} ({fields['trigger']})"


FORMATTERS: Final[dict[str, Callable[[Fields], str]]] = {
    "/gripper/status": status_line,
    "/gripper/command": command_line,
    "/gripper/event": event_line,
}
"""What makes a line of a message, by topic."""
