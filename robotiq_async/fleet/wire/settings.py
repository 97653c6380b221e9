"""Speeds and forces: those that a request sets, and those that a client sends to a restarted agent."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from ...values.checks import check_byte, check_mask
from ...values.enums import Finger
from .values import Fields

SETTINGS: Final = ("speed", "force")
Setting = tuple[Finger, str]
"""One axis, and "speed" or "force"."""
_SETTERS: Final = {"set_speed": "speed", "set_force": "force"}


def settings_of(name: str, arguments: Mapping[str, Any]) -> dict[Setting, int]:
    """Speeds and forces that a command sets, named without ``cmd/``; empty if its arguments are malformed."""
    try:
        return dict(_settings(name, arguments))
    except (AttributeError, TypeError, ValueError):
        return {}


def _settings(name: str, arguments: Mapping[str, Any]) -> Iterator[tuple[Setting, int]]:
    if name == "command":
        changed: Mapping[str, Any] = arguments.get("axes", {})
    elif name in _SETTERS:
        changed = {str(arguments.get("fingers", 15)): {_SETTERS[name]: arguments.get("value")}}
    elif name == "move":
        changed = {str(arguments.get("fingers", 7)): arguments}
    else:
        return
    yield from _by_axis(changed)


def _by_axis(changed: Mapping[str, Any]) -> Iterator[tuple[Setting, int]]:
    for mask, changes in changed.items():
        fingers = check_mask(int(mask))
        for what in SETTINGS:
            if changes.get(what) is not None:
                value = check_byte(what, changes[what])
                yield from (((axis, what), value) for axis in fingers)


def settings_fields(settings: Mapping[Setting, int]) -> Fields:
    fields: Fields = {}
    for (axis, what), value in settings.items():
        fields.setdefault(str(int(axis)), {})[what] = value
    return fields


def read_settings(fields: object) -> dict[Setting, int]:
    """Parse settings: TypeError or ValueError if they are malformed."""
    if not isinstance(fields, dict) or not all(isinstance(each, dict) for each in fields.values()):
        raise TypeError(f"settings must be an object of objects, got {fields!r:.200}")
    return dict(_by_axis(fields))
