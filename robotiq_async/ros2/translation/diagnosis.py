"""Diagnoses of a hand, its state as JSON, and the reason if it takes no goals. Unknowns are left out."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum

from ...hands import Hand
from ...values import RUNNING, NotStartedError, RobotiqStatus, Severity, State


class DiagnosticLevel(IntEnum):
    """The levels of ``diagnostic_msgs/DiagnosticStatus``."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


_LEVEL_OF = {
    Severity.NONE: DiagnosticLevel.OK,
    Severity.PRIORITY: DiagnosticLevel.OK,
    Severity.MINOR: DiagnosticLevel.WARN,
    Severity.MAJOR: DiagnosticLevel.ERROR,
}


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The condition of one part."""

    what: str  # the part
    level: DiagnosticLevel  # severity of the condition
    message: str  # the condition as a text
    values: Mapping[str, str] = field(default_factory=dict)  # figures


def diagnose(hand: Hand, now: float) -> tuple[Diagnosis, Diagnosis]:
    """The diagnoses of the link and of the gripper; ``now`` is in monotonic seconds."""
    return _link(hand, now), _gripper(hand)


def _link(hand: Hand, now: float) -> Diagnosis:
    figures = hand.statistics
    values = {
        "polls": str(figures.polls),
        "overruns": str(figures.overruns),
        "period p99 [ms]": f"{figures.period_p99 * 1e3:.1f}",
        "round trip p99 [ms]": f"{figures.round_trip_p99 * 1e3:.1f}",
        "link use [%]": f"{figures.link_use * 100:.0f}",
        "status age at a write p99 [ms]": f"{figures.status_age_p99 * 1e3:.1f}",
        "reconnects": str(figures.reconnects),
        "foreign commands": str(figures.foreign_commands),
    }
    status = _newest(hand)
    if status is not None:
        values["age of the newest status [s]"] = f"{now - status.timestamp:.3f}"
    if is_connected(hand):
        return Diagnosis("link", DiagnosticLevel.OK, "connected", values)
    return Diagnosis("link", DiagnosticLevel.ERROR, "the link is down and being opened again", values)


def _gripper(hand: Hand) -> Diagnosis:
    status = _newest(hand)
    if status is None or not is_connected(hand):
        return Diagnosis("gripper", DiagnosticLevel.STALE, "unknown: the link is down")
    values = {"state": hand.state.name, "fault": f"0x{int(status.fault):02X}"}
    if not status.model.has_modes:
        values["controller fault"] = f"0x{status.controller_fault:02X}"
    for axis in status.model.axes:
        values[f"{axis.name} position"] = str(status.position(axis))
        values[f"{axis.name} state"] = status.axis_state(axis)
        if (current := status.current_ma(axis)) is not None:
            values[f"{axis.name} current [mA]"] = str(current)
    level = _LEVEL_OF[status.fault.severity]
    words = hand.state.name if level is DiagnosticLevel.OK else status.fault.description
    if text := status.controller_fault_text:
        level, words = DiagnosticLevel.ERROR, f"{words}; {text}"
    if hand.inhibited is not None:
        level, words = max(level, DiagnosticLevel.WARN), f"{words}; {hand.inhibited}"
        values["inhibited"] = hand.inhibited.reason
    return Diagnosis("gripper", level, words, values)


def status_text(hand: Hand, *, takes_commands: bool) -> str:
    """The state as a JSON object; while connected, it includes the newest status.

    The fields of the status have the names of recordings.
    """
    fields: dict[str, object] = {
        "state": hand.state.name,
        "connected": is_connected(hand),
        "takes_commands": takes_commands,
        "inhibited": None if hand.inhibited is None else hand.inhibited.as_dict(),
    }
    status = _newest(hand)
    if status is not None and is_connected(hand):
        fields |= status.as_dict()
    return json.dumps(fields)


def _newest(hand: Hand) -> RobotiqStatus | None:
    try:
        return hand.status
    except NotStartedError:
        return None


def is_connected(hand: Hand) -> bool:
    """Whether the status of the hand is current."""
    return hand.state not in (State.DISCONNECTED, State.DO_SHUTDOWN, State.SHUTDOWN)


def why_not(hand: Hand) -> str | None:
    """The reason why the hand accepts no goal now; None if it does."""
    state = hand.state
    if hand.inhibited is not None:
        return f"{hand.inhibited}: look at the gripper, then call ~/permit"
    if state in RUNNING:
        return None
    if not is_connected(hand):
        return "the link to the gripper is down"
    if state is State.RESET:
        return "the gripper is not activated: call ~/activate (its fingers MOVE)"
    if state in (State.FAULT, State.ATR_DONE):
        fault = hand.status.fault
        return f"the gripper is in fault 0x{int(fault):02X}, {fault.description}: call ~/recover"
    return f"an activation, a reset or a release is under way ({state.name})"
