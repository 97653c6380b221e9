"""Descriptions and colours for the state of a hand."""

from __future__ import annotations

from datetime import datetime
from time import time
from typing import Any, Final

from .....values import JAW, NO_REQUEST, Fault, Finger, Severity, State
from ....description.palette import AXIS_COLORS
from ....wording import AXIS_WORDS, JAW_NAME, STATE_WORDS, holding_words, inhibit_shown, inhibit_words
from ..mirror import HandMirror

NAMES: Final = tuple("scissor" if axis is Finger.SCISSOR else str(axis.name) for axis in Finger.ALL)
COLORS: Final = tuple(AXIS_COLORS.values())
"""Colours of A, B, C and the scissor, for light and dark pages."""


def axis_title(hand: HandMirror, index: int) -> str:
    """The name of an axis, in the order of the model's."""
    return JAW_NAME if len(hand.model.axes) == 1 else NAMES[index]


def opening_words(hand: HandMirror, axis: Finger = JAW) -> str:
    """The opening at an axis, of a jaw with the source of the figure; empty for the scissor."""
    status = hand.status
    if status is None or axis is Finger.SCISSOR:
        return ""
    source = f" ({status.stroke.source})" if len(status.model.axes) == 1 else ""
    return f"{status.opening_mm(axis):.1f} mm{source}"


def state_words(hand: HandMirror, *, is_quiet: bool) -> tuple[str, str]:
    """A description of the state, and a colour of Quasar."""
    if is_quiet:
        return "the program that watches the gripper is silent", "negative"
    if hand.problem:
        return "not reached", "negative"
    words = STATE_WORDS[hand.state]
    if hand.inhibited is not None and hand.state in (State.RUNNING_IDLE, State.RUNNING_CC):
        holding = "" if hand.status is None else holding_words(hand.status)
        return ", ".join(filter(None, ("inhibited", holding))), "negative"
    if hand.state in (State.DISCONNECTED, State.FAULT):
        return words, "negative"
    if hand.state in (State.RUNNING_IDLE, State.RUNNING_CC):
        if hand.status is not None and hand.status.is_moving:
            return "moving", "primary"
        holding = "" if hand.status is None else holding_words(hand.status)
        return holding or words, "positive"
    return words, "warning"


def fault_words(hand: HandMirror) -> tuple[str, bool]:
    """A description of the fault, and whether it is serious."""
    if hand.problem:
        return hand.problem, True
    if hand.is_lost:
        seconds = f", last heard {hand.age:.1f} s ago" if hand.status is not None else ""
        return f"no connection to the gripper{seconds}: what is shown is old", True
    assert hand.status is not None
    fault = hand.status.fault
    if hand.status.controller_fault:
        return hand.status.controller_fault_text, True
    if fault is Fault.NONE:
        return "no fault", False
    return (
        f"0x{int(fault):02X} {fault.severity.value}: {fault.description}",
        fault.severity is not Severity.PRIORITY,
    )


def banner_words(hand: HandMirror) -> str:
    """The call for a person, in a sentence: an inhibit, a fault, a reset."""
    if hand.inhibited is not None:
        return inhibit_shown(hand.inhibited)
    if hand.state is State.RESET:
        return "The gripper is not active: an activation moves its fingers to their stops."
    return fault_words(hand)[0]


def axis_words(hand: HandMirror, axis: Finger) -> str:
    """The state of an axis."""
    status = hand.status
    if hand.is_lost or status is None or hand.state is State.RESET:
        return AXIS_WORDS[NO_REQUEST]
    return AXIS_WORDS[status.axis_state(axis)]


def event_words(event: dict[str, Any]) -> str:
    """An event as a line."""
    if event["kind"] == "fault":
        return timed(f"fault 0x{event['fault_code']:02X}: {event['description']}", event["time"])
    if event["kind"] == "inhibit":
        return timed(inhibit_words(event), event["time"])
    words = STATE_WORDS[State[event["target"]]]
    return timed(f"{words}  ({event['source']} to {event['target']})", event["time"])


def timed(words: str, at: float | None = None) -> str:
    """Text after the time of day; ``at`` in seconds since 1970, None for now."""
    clock = datetime.fromtimestamp(time() if at is None else at).astimezone()
    return f"{clock:%H:%M:%S.%f}"[:-4] + f"  {words}"
