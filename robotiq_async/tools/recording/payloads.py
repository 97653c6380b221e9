"""Events and states of a hand as JSON objects, for files and other programs, and their JSON Schemas.

Statuses and requests have the JSON form of their ``as_dict()``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, Final

from ...hands import Hand
from ...values import (
    JAW,
    THREE_FINGER,
    Fault,
    Finger,
    Inhibit,
    NotStartedError,
    RobotiqStatus,
    State,
    Transition,
    repr_of,
)
from ..description.kinematics import FINGER_NAMES

Properties = dict[str, Any]
LONGEST_BITS: Final = 64
"""Of an int in a mark: others who read JSON keep no more, and Python writes no more than 4,300 digits."""

INTEGER: Final = {"type": "integer"}
NUMBER: Final = {"type": "number"}
STRING: Final = {"type": "string"}
_BOOLEAN: Final = {"type": "boolean"}
_REGISTERS: Final = {"type": "array", "items": INTEGER}


def object_schema(**properties: object) -> dict[str, object]:
    """The JSON Schema of an object."""
    return {"type": "object", "properties": properties}


def _for_each_axis(
    of_fingers: Mapping[str, object] = MappingProxyType({}), **properties: object
) -> dict[str, object]:
    return {
        str(axis.name): object_schema(**properties, **(of_fingers if axis is not Finger.SCISSOR else {}))
        for axis in Finger.ALL
    }


_FAULT: Final = {"fault": STRING, "fault_code": INTEGER, "severity": STRING, "description": STRING}
SCHEMAS: Final = {
    "status": object_schema(
        registers=_REGISTERS,
        timestamp=NUMBER,
        sequence=INTEGER,
        fault=STRING,
        fault_code=INTEGER,
        controller_fault=INTEGER,
        is_activated=_BOOLEAN,
        is_reset=_BOOLEAN,
        is_moving=_BOOLEAN,
        initialization=STRING,
        mode=STRING,
        activation_echo=_BOOLEAN,
        go_echo=_BOOLEAN,
        contacts={"type": "array", "items": STRING},
        **_for_each_axis(
            position=INTEGER,
            requested_position=INTEGER,
            current_ma=INTEGER,
            axis_state=STRING,
            of_fingers={"opening_mm": NUMBER, "open_fraction": NUMBER},
        ),
    ),
    "command": object_schema(
        timestamp=NUMBER,
        acknowledged=_BOOLEAN,
        registers=_REGISTERS,
        activate=_BOOLEAN,
        go=_BOOLEAN,
        release=_BOOLEAN,
        mode=STRING,
        individual_fingers=_BOOLEAN,
        individual_scissor=_BOOLEAN,
        **_for_each_axis(position=INTEGER, speed=INTEGER, force=INTEGER),
    ),
    "event": object_schema(
        kind={"type": "string", "enum": ["state", "transition", "fault", "inhibit", "mark"]},
        timestamp=NUMBER,
        source=STRING,
        target=STRING,
        trigger=STRING,
        **_FAULT,
        inhibited=_BOOLEAN,
        reason=STRING,
        who=STRING,
        label=STRING,
        values={"type": "object", "additionalProperties": True},
    ),
    "state": object_schema(
        name=STRING,
        address=STRING,
        state=STRING,
        inhibited=STRING,
        age=NUMBER,
        **_FAULT,
        polls=INTEGER,
        writes=INTEGER,
        overruns=INTEGER,
        period_p50=NUMBER,
        period_p99=NUMBER,
        round_trip_p50=NUMBER,
        round_trip_p99=NUMBER,
        longest_stall=NUMBER,
        reconnects=INTEGER,
        foreign_commands=INTEGER,
        tick=STRING,
        faults=INTEGER,
        moves={"type": "object", "additionalProperties": INTEGER},
        passing_faults=INTEGER,
        link_use=NUMBER,
        status_age_p50=NUMBER,
        status_age_p99=NUMBER,
    ),
}
"""A JSON Schema for each kind of object."""


def title(hand: Hand) -> str:
    """The name and the address of a hand for people; the address alone if both are the same.

    A simulated hand is marked as simulated.
    """
    words = hand.address if hand.name == hand.address else f"{hand.name} ({hand.address})"
    return f"{words}, simulated" if hand.address.startswith("sim:") else words


def transition_fields(transition: Transition) -> Properties:
    """The event for a transition."""
    return {"kind": "transition", **transition.as_dict()}


def mark_fields(label: str, values: Mapping[str, object], timestamp: float) -> Properties:
    """The event for a mark of the program that records.

    Raises:
        TypeError: the label is no text, or a value no text, number or truth value.
        ValueError: a value is infinite, not a number or an int of more than 64 bits; or half a character.
    """
    if not isinstance(label, str):
        raise TypeError(f"label must be a str, got {repr_of(label)}")
    plain = {name: _plain(name, value) for name, value in values.items() if value is not None}
    return {"kind": "mark", "timestamp": timestamp, "label": _plain("label", label), "values": plain}


def _plain(name: str, given: object) -> str | int | float | bool:
    """A value of a mark. One that numpy has made becomes Python's."""
    value = given.item() if hasattr(given, "item") and getattr(given, "ndim", None) == 0 else given
    if not isinstance(value, str | int | float):
        raise TypeError(f"{name} must be a str, int, float or bool, got {repr_of(given):.100}")
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{name} must be finite, got {value}")
    if isinstance(value, int) and value.bit_length() > LONGEST_BITS:
        raise ValueError(f"{name} must have {LONGEST_BITS} bits or fewer, got {value.bit_length()}")
    # Python reads a file name that is not UTF-8 into such halves; no file of text could hold it.
    if isinstance(value, str) and not value.isascii() and any("\ud800" <= each <= "\udfff" for each in value):
        raise ValueError(f"{name} must be text without surrogates, got {value!a:.100}")
    return value


def is_command(event: Properties) -> bool:
    """Whether an event is the start or the end of a command. A control loop makes hundreds a second."""
    return State.RUNNING_CC.name in (event.get("source"), event.get("target"))


def fault_event(status: RobotiqStatus, before: RobotiqStatus | None) -> Properties | None:
    """The event for a fault that has appeared or cleared (NONE) since the status before, or None."""
    if status.fault == (Fault.NONE if before is None else before.fault):
        return None
    return {"kind": "fault", "timestamp": status.timestamp, **_in_words(status.fault)}


class InhibitEvents:
    """The events for an inhibit that a person has set or lifted."""

    def __init__(self, hand: Hand) -> None:
        self._hand = hand
        self._before: Inhibit | None = None

    def new(self, timestamp: float) -> Iterator[Properties]:
        """The event since the last look, if any; an inhibit from before the first one counts."""
        before, now = self._before, self._hand.inhibited
        if before == now:
            return
        self._before = now
        named = now or before
        assert named is not None, "one of them is"
        what = {"inhibited": now is not None, "reason": named.reason, "who": named.who}
        yield {"kind": "inhibit", "timestamp": timestamp, **what}


def _in_words(fault: Fault) -> Properties:
    return {
        "fault": fault.name,
        "fault_code": int(fault),
        "severity": fault.severity.name,
        "description": fault.description,
    }


def reading_fields(hand: Hand) -> Properties:
    """A hand and its newest status.

    Raises:
        NotStartedError: there is no status yet.
    """
    status = hand.status
    return {
        "name": hand.name,
        "address": hand.address,
        "state": hand.state.name,
        "inhibited": str(hand.inhibited or ""),
        **status.as_dict(),
        **_in_words(status.fault),
    }


def state_fields(hand: Hand, now: float) -> Properties:
    """State and statistics of a hand; fault and age of the newest status only while they are known.

    ``now`` is in monotonic seconds.
    """
    fields: Properties = {
        "name": hand.name,
        "address": hand.address,
        "state": hand.state.name,
        "inhibited": str(hand.inhibited or ""),
        **hand.statistics.as_dict(),
    }
    try:
        status = hand.status
    except NotStartedError:
        return fields
    fields["age"] = round(now - status.timestamp, 6)
    if hand.state not in (State.DISCONNECTED, State.SHUTDOWN):
        fields |= _in_words(status.fault)
    return fields


def efforts(status: RobotiqStatus) -> list[float]:
    """Motor currents in ampere, each at the first joint of its motor; torques are not known.

    NaN where the link does not carry the current.
    """

    def ampere(axis: Finger) -> float:
        current = status.current_ma(axis)
        return math.nan if current is None else current / 1000

    if status.model is not THREE_FINGER:
        return [ampere(JAW)]
    scissor = ampere(Finger.SCISSOR)
    one, two, middle = map(ampere, FINGER_NAMES)
    return [scissor, one, 0.0, 0.0, scissor, two, 0.0, 0.0, middle, 0.0, 0.0]
