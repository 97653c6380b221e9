"""The commands of a holder, and the values in them: a position, a speed or a force of an axis.

Speeds and forces are the settings of an axis.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from ...values import Finger, SentRequest, check_byte
from .values import Fields

COMMANDS: Final[Mapping[str, frozenset[str]]] = {
    "set_position": frozenset({"value", "fingers"}),
    "set_speed": frozenset({"value", "fingers"}),
    "set_force": frozenset({"value", "fingers"}),
    "command": frozenset({"axes"}),
    "move": frozenset({"position", "fingers", "speed", "force", "timeout"}),
    "hold": frozenset({"fingers"}),
    "activate": frozenset(),
    "reset": frozenset(),
    "atr": frozenset(),
    "recover": frozenset({"timeout"}),
}
"""The methods of a hand that the holder of a lease may call, and ``command`` for several axes at once, with
their arguments. Clients convert other amounts to counts: the agent restores the counts that it saw."""
NEEDED_ARGUMENTS: Final[Mapping[str, str]] = {
    "set_position": "value",
    "set_speed": "value",
    "set_force": "value",
    "command": "axes",
    "move": "position",
}
"""The argument that a command does not do without."""
SETTINGS: Final = ("speed", "force")
_SETTABLE: Final = ("position", *SETTINGS)
Setting = tuple[Finger, str]
"""One axis, and "position", "speed" or "force"."""
_USUAL_FINGERS: Final = {"move": 7}  # the axes of a command that names no axes; 15 for all other commands


def asked_of(name: str, arguments: Mapping[str, Any]) -> dict[Setting, int]:
    """The values that a command carries, named without ``cmd/``; empty if its arguments are malformed."""
    if name == "command":
        changes = arguments.get("axes", {})
    else:
        what = name.removeprefix("set_")
        settings = (
            arguments if name == "move" else {what: arguments.get("value")} if what in _SETTABLE else {}
        )
        changes = {str(arguments.get("fingers", _USUAL_FINGERS.get(name, 15))): settings}
    try:
        return dict(_by_axis(changes, _SETTABLE))
    except (AttributeError, TypeError, ValueError):
        return {}


def check_changes(changes: Mapping[str, Any]) -> Mapping[str, int]:
    """The changes of an axis: TypeError or ValueError unless they are some of _SETTABLE in counts."""
    if not changes or changes.keys() - {*_SETTABLE}:
        raise TypeError(f"requests are in counts, got {', '.join(changes) or 'none'}")
    return {what: check_byte(what, value) for what, value in changes.items()}


def moved_by(settings: Mapping[Setting, int]) -> Finger:
    """The axes that are sent to a position."""
    return Finger(sum({axis for axis, what in settings if what == "position"}))


def settings_of(settings: Mapping[Setting, int]) -> dict[Setting, int]:
    return {each: value for each, value in settings.items() if each[1] in SETTINGS}


def settings_in(sent: SentRequest) -> dict[Setting, int]:
    axes = sent.request.by_axis
    return {(axis, what): getattr(settings, what) for axis, settings in axes for what in SETTINGS}


def is_in(settings: Mapping[Setting, int], sent: SentRequest) -> bool:
    """Whether a written image has all of these settings, for the axes that the gripper has."""
    axes = dict(sent.request.by_axis)
    return all(
        axis not in axes or getattr(axes[axis], what) == value for (axis, what), value in settings.items()
    )


def _by_axis(changed: Mapping[str, Any], which: tuple[str, ...]) -> Iterator[tuple[Setting, int]]:
    for mask, changes in changed.items():
        if not 0 < int(mask) <= Finger.ALL:
            raise ValueError(f"a mask must be 1..15, got {mask!r:.100}")
        fingers = Finger(int(mask))
        for what in which:
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
    return dict(_by_axis(fields, SETTINGS))
