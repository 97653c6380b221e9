"""States and refusals for a person at the monitor or the page, who does not know the API."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Any, Final

from ..values import (
    NO_REQUEST,
    Finger,
    GripperFaultError,
    Inhibit,
    InvalidStateError,
    Model,
    MotionInhibitedError,
    NotActivatedError,
    ObjectStatus,
    RobotiqError,
    RobotiqStatus,
    State,
    Trigger,
)

STATE_WORDS: Final = {
    State.DISCONNECTED: "lost",
    State.DO_ACTIVATION: "activating: the fingers move",
    State.WF_ACTIVATION: "activating: the fingers move",
    State.RUNNING_IDLE: "ready",
    State.RUNNING_CC: "ready",
    State.FAULT: "fault",
    State.DO_ATR: "releasing: the fingers open",
    State.WF_ATR: "releasing: the fingers open",
    State.ATR_DONE: "released: reset it",
    State.DO_RESET: "resetting",
    State.WF_RESET: "resetting",
    State.RESET: "reset: not active",
    State.DO_SHUTDOWN: "stopping",
    State.SHUTDOWN: "stopped",
}
"""A description of each state."""

AXIS_WORDS: Final = {
    NO_REQUEST: "-",
    ObjectStatus.IN_MOTION.name: "moving",
    ObjectStatus.CONTACT_OPENING.name: "contact while opening",
    ObjectStatus.CONTACT_CLOSING.name: "contact while closing",
    ObjectStatus.AT_POSITION.name: "there",
}
"""A description of each ``axis_state()``."""

TRIGGER_WORDS: Final = {each: each.value.removesuffix("()") for each in Trigger} | {
    Trigger.ASK_RELEASE: "release",
    Trigger.ASK_START: "the start",
    Trigger.ASK_STOP: "the end",
    Trigger.HALT_RESETS: "halt, by a reset",
}
"""A description of each trigger."""

JAW_NAME: Final = "jaw"
"""The name for people of the one axis of a 2F or a Hand-E; in programs and files it is A."""


def axis_name(axis: Finger, model: Model) -> str:
    """The names for people of axes of a model."""
    return JAW_NAME if len(model.axes) == 1 else str(axis.name)


def holding_words(status: RobotiqStatus) -> str:
    """The part that is held: ``holding 43 mm``, of a 3-Finger ``holding``; empty without a part."""
    part = status.part
    if part is None:
        return ""
    return "holding" if part.width_mm is None else f"holding {part.width_mm:.0f} mm"


def inhibit_shown(inhibit: Inhibit) -> str:
    """An inhibit that is in force, and since when, for a person who may permit motion."""
    since = f"{datetime.fromtimestamp(inhibit.since).astimezone():%H:%M:%S}"
    return f"{inhibit}, since {since}" + (f", {inhibit.halts} halts" if inhibit.halts > 1 else "")


def inhibit_words(fields: Mapping[str, Any]) -> str:
    """The event of an inhibit that was set or lifted."""
    by = f" ({fields['who']})" if fields["who"] else ""
    what = "motion is refused" if fields["inhibited"] else "motion is permitted again, after"
    return f"{what}: {fields['reason']}{by}"


def refusal_words(error: RobotiqError, hints: Mapping[State, str]) -> str:
    """The reason for a refusal, and the key or button that helps: the hint of the state.

    The advice of the error is for programs, and left out.
    """
    if isinstance(error, MotionInhibitedError):
        return f"{error.message}; permit it first"
    if isinstance(error, NotActivatedError):
        return f"{error.message}; {hints[State.RESET]}"
    if isinstance(error, GripperFaultError):
        return f"{error.message}; {hints[State.FAULT]}"
    if isinstance(error, InvalidStateError) and error.allowed:
        now = STATE_WORDS[error.state]
        allowed = sorted({STATE_WORDS[state] for state in error.allowed if state is not State.RUNNING_CC})
        return f"not now, as it is {now!r}; only when {' or '.join(map(repr, allowed))}"
    return error.message
