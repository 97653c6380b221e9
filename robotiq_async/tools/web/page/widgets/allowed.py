"""Which buttons of the page may be pressed now, and why not: a table of state, inhibit and link. Pure.

The state machine's own table decides which calls a state refuses, so a button never differs from the hand.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

from .....values import MOVES, RUNNING, TABLE, State, Trigger, Verdict
from ....wording import STATE_WORDS
from ..mirror import HandMirror

MOTION_BUTTONS: Final = ("open", "close", "wide", "normal", "pinch", "move", "force", "speed")
"""The buttons that are a command for the state machine."""
TRIGGERS: Final = MappingProxyType(
    {
        **dict.fromkeys(MOTION_BUTTONS, Trigger.ASK_COMMAND),
        "activate": Trigger.ASK_ACTIVATE,
        "reset": Trigger.ASK_RESET,
        "release": Trigger.ASK_RELEASE,
    }
)
"""The trigger of each button. Recover consists of several steps, and permit has no trigger."""
HELPS: Final = MappingProxyType(
    {State.FAULT: "recover", State.ATR_DONE: "reset", State.RESET: "activate"},
)
"""The button that helps in a state: it stands first."""
QUIET: Final = "the program that watches the gripper is silent"
NO_CONNECTION: Final = "no connection to the gripper"
INHIBITED: Final = "motion is inhibited: permit it first"
_IDLE: Final = {"activate": "it is active", "recover": "there is nothing to recover from"}


def why_not(name: str, hand: HandMirror, *, is_quiet: bool) -> str:
    """The reason that a button cannot be pressed now; empty if it can. A halt always can."""
    if is_quiet:
        return QUIET
    if name == "permit":
        return "" if hand.inhibited is not None else "motion is not inhibited"
    if hand.problem or hand.is_lost:
        return NO_CONNECTION
    trigger, state = TRIGGERS.get(name), hand.state
    if hand.inhibited is not None and name != "speed" and (name == "recover" or trigger in MOVES):
        return INHIBITED
    if state in RUNNING:
        return _IDLE.get(name, "") or ("only in a fault" if name == "release" else "")
    if trigger is None or isinstance(verdict := TABLE[state][trigger], State):
        return ""
    if verdict is Verdict.IGNORED:
        return "it is under way"
    helps = HELPS.get(state)
    return f"not while it is {STATE_WORDS[state]!r}" + (f": press {helps}" if helps else "")


def what_helps(hand: HandMirror, *, is_quiet: bool) -> str:
    """The button that helps now: permit, recover, reset or activate; empty if no button does."""
    if not is_quiet and hand.inhibited is not None:
        return "permit"
    return "" if is_quiet or hand.problem or hand.is_lost else HELPS.get(hand.state, "")
