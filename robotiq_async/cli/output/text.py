"""Statuses, requests and events as lines of text."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from typing import Any, Final

from ...tools.recording.payloads import Fields, is_command
from ...values.enums import Finger
from ...values.status import NO_REQUEST
from ...values.trigger import Trigger

NOTHING: Final = "-"
"""In place of a state without a meaning."""
_NAMES: Final = [str(axis.name) for axis in Finger.ALL]


def clock(seconds: float) -> str:
    """The local time of day, to the millisecond, of seconds since 1970."""
    return f"{datetime.fromtimestamp(seconds).astimezone():%H:%M:%S.%f}"[:-3]


def _axes_in(fields: Fields) -> list[str]:
    return [name for name in _NAMES if name == "A" or name in fields]  # a sibling has A alone


def status_line(fields: Fields) -> str:
    """The line for a status: position and state of every axis."""
    axes = (f"{n}={fields[n]['position']} {axis_words(fields[n]['axis_state'])}" for n in _axes_in(fields))
    return f"status   {' '.join(axes)}"


def axis_words(state: str) -> str:
    """The state of an axis; ``-`` where it means nothing."""
    return NOTHING if state == NO_REQUEST else state


def command_line(fields: Fields) -> str:
    """The line for a request that was written."""
    axes = (
        f"{n}={fields[n]['position']}@{fields[n]['speed']}/{fields[n]['force']}" for n in _axes_in(fields)
    )
    bits = f"act={fields['activate']:d} go={fields['go']:d} release={fields['release']:d}"
    return f"command  {bits} {' '.join(axes)}{'' if fields['acknowledged'] else ' NOT ACKNOWLEDGED'}"


def event_line(fields: Fields) -> str:
    """The line for the initial state, a transition, a fault, or a warning of the library."""
    if fields["kind"] == "log":
        return f"log      {fields['message']}"
    if fields["kind"] == "state":
        return f"state    {fields['target']}"
    if fields["kind"] == "fault":
        return f"fault    0x{fields['fault_code']:02X} {fields['fault']}: {fields['description']}"
    trigger = fields["trigger"]
    why = Trigger[trigger].value if trigger in Trigger.__members__ else trigger
    return f"state    {fields['source']} -> {fields['target']} ({why})"


def brief_line(fields: Fields, contacts: dict[str, Any]) -> str:
    """The line for a state, a fault, or a change of the contacts; empty for everything else.

    Args:
        fields: a status, a request, or an event.
        contacts: positions of the axes in contact as of the last status; is updated.
    """
    if "kind" in fields:
        return "" if is_command(fields) else event_line(fields)
    if "contacts" not in fields:
        return ""
    now = {name: fields[name]["position"] for name in fields["contacts"]}
    if now.keys() == contacts.keys():
        return ""
    contacts.clear()
    contacts.update(now)
    return f"contact  {' '.join(f'{name}={position}' for name, position in now.items()) or 'none'}"


FORMATTERS: Final[dict[str, Callable[[Fields], str]]] = {
    "/gripper/status": status_line,
    "/gripper/command": command_line,
    "/gripper/event": event_line,
}
"""The formatter of each topic."""
