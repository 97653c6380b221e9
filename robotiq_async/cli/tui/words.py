"""What happens to a hand, for a person at the monitor: words and keys, in place of states and methods."""

from __future__ import annotations

import re
from typing import Final

from ...enums import State
from ...errors import GripperFaultError, InvalidStateError, NotActivatedError, RobotiqError
from ...session.streams import Transition
from ...telemetry.state_words import STATE_WORDS

KEYS: Final = """\
o open  c close  1 wide  2 normal  3 pinch  SPACE halt  + - speed  ] [ force
a activate  r reset  l release  v recover  p position of axes         q quit"""

HINTS: Final = {
    State.FAULT: "v does what it needs",
    State.ATR_DONE: "r resets it",
    State.RESET: "a activates it",
}
"""The key that helps in a state."""
_METHOD: Final = re.compile(r"\b([a-z_]+)\(\)")
_ACTIONS: Final = {"atr": "release", "start": "the start", "stop": "the end"}


def transition_words(transition: Transition) -> str | None:
    """What has become of the hand, and why; None where there is nothing to tell.

    States that a person calls the same are one: those between which a request is sent and acknowledged.
    """
    before, after = STATE_WORDS[transition.source], STATE_WORDS[transition.target]
    return None if before == after else f"{after} ({_plain(transition.trigger.value)})"


def refusal_words(error: RobotiqError) -> str:
    """Why something that was asked for by a key was not done, and which key helps."""
    if isinstance(error, NotActivatedError):
        return f"{_plain(error.message.partition(': call ')[0])}; {HINTS[State.RESET]}"
    if isinstance(error, GripperFaultError):
        return f"{error.message}; {HINTS[State.FAULT]}"
    if isinstance(error, InvalidStateError) and error.allowed:
        now = STATE_WORDS[error.state]
        allowed = sorted({STATE_WORDS[state] for state in error.allowed if state is not State.RUNNING_CC})
        return f"not now, as it is {now!r}; only when {' or '.join(map(repr, allowed))}"
    return _plain(error.message)


def _plain(words: str) -> str:
    """Without the brackets of methods, and with the keys' names for them."""
    return _METHOD.sub(lambda found: _ACTIONS.get(found[1], found[1]), words)
