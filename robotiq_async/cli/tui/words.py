"""Texts of the monitor: keys, hints, and transitions for people who do not know the API."""

from __future__ import annotations

from typing import Final

from ...tools.recording.payloads import Fields
from ...tools.wording import STATE_WORDS, without_methods
from ...values.enums import State
from ...values.trigger import Trigger

KEYS: Final = """\
o open  c close  1 wide  2 normal  3 pinch  SPACE halt  + - speed  ] [ force
a activate  r reset  l release  v recover  p position of axes         q quit"""

HINTS: Final = {
    State.FAULT: "v does what it needs",
    State.ATR_DONE: "r resets it",
    State.RESET: "a activates it",
}
"""The key that helps in a state."""


def transition_words(event: Fields) -> str | None:
    """The new state and its cause; None if both states have the same description.

    That drops the transitions between sending a request and its acknowledgement.
    """
    before, after = (STATE_WORDS[State[event[end]]] for end in ("source", "target"))
    return None if before == after else f"{after} ({without_methods(Trigger[event['trigger']].value)})"
