"""Why something was refused, for a person who does not read the API: at the monitor, on the page."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

from ...values.enums import State
from ...values.errors import GripperFaultError, InvalidStateError, NotActivatedError, RobotiqError
from .state_words import STATE_WORDS

_METHOD: Final = re.compile(r"\b([a-z_]+)\(\)")
_ADVICE: Final = re.compile(r": [^:]*(?:\b[a-z_]+\(\)|'async with').*")
_ACTIONS: Final = {"atr": "release", "start": "the start", "stop": "the end"}


def refusal_words(error: RobotiqError, hints: Mapping[State, str]) -> str:
    """Why something that was asked for was not done, and what helps.

    Args:
        error: what it ended with.
        hints: what helps in a state, as this person does it: a key, a button.
    """
    if isinstance(error, NotActivatedError):
        return f"{_told(error)}; {hints[State.RESET]}"
    if isinstance(error, GripperFaultError):
        return f"{error.message}; {hints[State.FAULT]}"
    if isinstance(error, InvalidStateError) and error.allowed:
        now = STATE_WORDS[error.state]
        allowed = sorted({STATE_WORDS[state] for state in error.allowed if state is not State.RUNNING_CC})
        return f"not now, as it is {now!r}; only when {' or '.join(map(repr, allowed))}"
    return _told(error)


def _told(error: RobotiqError) -> str:
    """What it says, without what it advises programs."""
    return without_methods(_ADVICE.sub("", error.message))


def without_methods(words: str) -> str:
    """Without the brackets of methods, and with a person's names for them."""
    return _METHOD.sub(lambda found: _ACTIONS.get(found[1], found[1]), words)
