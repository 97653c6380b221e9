"""Inhibits of motion: as a halt asks for one, and as the record of the run before has it."""

from __future__ import annotations

import time
from typing import Final

from ...values import LONGEST_REASON, Inhibit
from ..wire.envelope import AgentCall
from ..wire.values import words
from .jobs import label_of


def inhibit_asked(call: AgentCall) -> Inhibit | None:
    """The inhibit that a halt asks for; None for a halt alone. Nothing malformed keeps it from halting."""
    reason = call.arguments.get("inhibit")
    if reason is None:
        return None
    return Inhibit(_short(reason) or "a halt", signed(call), time.time())


def inhibit_kept(record: object) -> Inhibit:
    """An inhibit of the run before. One that cannot be read counts as well."""
    try:
        return Inhibit.from_dict(record)  # type: ignore[arg-type]
    except (AttributeError, KeyError, TypeError, ValueError):
        return _UNREADABLE


_UNREADABLE: Final = Inhibit("the record of an inhibit cannot be read", "", 0.0)


def signed(call: AgentCall) -> str:
    """Who asks: what the client says, and its label."""
    who = _short(call.arguments.get("who", ""))
    return _short(f"{who}, {label_of(call)}" if who else label_of(call))


def _short(text: object) -> str:
    return words(str(text))[:LONGEST_REASON]
