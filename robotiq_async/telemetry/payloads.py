"""What happens to a hand as JSON objects, for files and for other programs, and their schemas."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Final

from ..enums import AXES, Finger, State
from ..errors import NotStartedError
from ..kinematics import PREFIX
from ..protocol import Hand
from ..session.streams import SentRequest, Transition
from ..wire.status import RobotiqStatus

Fields = dict[str, Any]

_INTEGER: Final = {"type": "integer"}
_NUMBER: Final = {"type": "number"}
_STRING: Final = {"type": "string"}
_BOOLEAN: Final = {"type": "boolean"}


def _object(**properties: object) -> dict[str, object]:
    return {"type": "object", "properties": properties}


_AXES_NAMES: Final = {axis: str(axis.name) for axis in AXES}
SCHEMAS: Final = {
    "status": _object(
        sequence=_INTEGER,
        monotonic=_NUMBER,
        registers={"type": "array", "items": _INTEGER},
        fault=_INTEGER,
        activated=_BOOLEAN,
        go=_BOOLEAN,
        moving=_BOOLEAN,
        **{
            name: _object(position=_INTEGER, requested=_INTEGER, current_ma=_INTEGER, status=_STRING)
            for name in _AXES_NAMES.values()
        },
    ),
    "command": _object(
        monotonic=_NUMBER,
        acknowledged=_BOOLEAN,
        activate=_BOOLEAN,
        go=_BOOLEAN,
        release=_BOOLEAN,
        registers={"type": "array", "items": _INTEGER},
        **{name: _object(position=_INTEGER, speed=_INTEGER, force=_INTEGER) for name in _AXES_NAMES.values()},
    ),
    "event": _object(
        kind={"type": "string", "enum": ["state", "transition", "fault"]},
        monotonic=_NUMBER,
        source=_STRING,
        target=_STRING,
        trigger=_STRING,
        code=_INTEGER,
        name=_STRING,
        severity=_STRING,
        description=_STRING,
    ),
    "state": _object(
        address=_STRING,
        state=_STRING,
        age=_NUMBER,
        fault=_INTEGER,
        severity=_STRING,
        description=_STRING,
        polls=_INTEGER,
        writes=_INTEGER,
        overruns=_INTEGER,
        period_p50=_NUMBER,
        period_p99=_NUMBER,
        round_trip_p50=_NUMBER,
        round_trip_p99=_NUMBER,
        longest_stall=_NUMBER,
        reconnects=_INTEGER,
        foreign_commands=_INTEGER,
        tick=_STRING,
        faults=_INTEGER,
        moves={"type": "object", "additionalProperties": _INTEGER},
    ),
}
"""A JSON Schema for each kind of object."""


def status_fields(status: RobotiqStatus) -> Fields:
    """The object for a status."""
    return {
        "monotonic": _seconds(status.timestamp),
        "sequence": status.sequence,
        "registers": status.registers,
        "fault": int(status.fault),
        "activated": status.is_activated,
        "go": status.go_echo,
        "moving": status.is_moving,
        **{
            name: {
                "position": status.position(axis),
                "requested": status.requested_position(axis),
                "current_ma": status.current_ma(axis),
                "status": status.finger_status(axis).name,
            }
            for axis, name in _AXES_NAMES.items()
        },
    }


def command_fields(sent: SentRequest) -> Fields:
    """The object for a request that was written."""
    request = sent.request
    return {
        "monotonic": _seconds(sent.timestamp),
        "acknowledged": sent.acknowledged,
        "activate": request.activate,
        "go": request.go,
        "release": request.release,
        "registers": request.registers,
        **{
            name: {"position": axis.position, "speed": axis.speed, "force": axis.force}
            for name, axis in zip(_AXES_NAMES.values(), request.axes, strict=True)
        },
    }


def initial_state_fields(state: State, now: float) -> Fields:
    """The event that opens a feed: the state the hand is in."""
    return {"monotonic": _seconds(now), "kind": "state", "target": state.name}


def transition_fields(transition: Transition) -> Fields:
    """The event for a change of state."""
    return {
        "monotonic": _seconds(transition.timestamp),
        "kind": "transition",
        "source": transition.source.name,
        "target": transition.target.name,
        "trigger": transition.trigger.value,
    }


def fault_fields(status: RobotiqStatus) -> Fields:
    """The event for a fault that has appeared, or cleared (NONE); the status is the first that shows it."""
    fault = status.fault
    return {
        "monotonic": _seconds(status.timestamp),
        "kind": "fault",
        "code": int(fault),
        "name": fault.name,
        "severity": fault.severity.value,
        "description": fault.description,
    }


def state_fields(hand: Hand, now: float) -> Fields:
    """State and statistics of a hand; the fault and the age of the last status only while they are known.

    Args:
        hand: the hand.
        now: monotonic seconds.
    """
    fields: Fields = {"address": hand.address, "state": hand.state.name, **asdict(hand.statistics)}
    try:
        status = hand.status
    except NotStartedError:
        return fields
    fields["age"] = _seconds(now - status.timestamp)
    if hand.state not in (State.DISCONNECTED, State.SHUTDOWN):
        fields["fault"] = int(status.fault)
        fields["severity"] = status.fault.severity.value
        fields["description"] = status.fault.description
    return fields


def efforts(status: RobotiqStatus) -> list[float]:
    """Motor currents in ampere, each at the joint its motor drives first; torques are not known."""
    scissor = status.current_ma(Finger.SCISSOR) / 1000
    one, two, middle = (status.current_ma(finger) / 1000 for finger in PREFIX)
    return [scissor, one, 0.0, 0.0, scissor, two, 0.0, 0.0, middle, 0.0, 0.0]


def _seconds(timestamp: float) -> float:
    return round(timestamp, 6)
