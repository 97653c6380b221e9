"""Inhibits: whether motion of one hand is inhibited, as halts request it, and as a record has it."""

from __future__ import annotations

import time
from typing import Final

from ...local import RobotiqHand
from ...runtime import now
from ...values import Inhibit
from ..wire.envelope import AgentCall
from ..wire.values import LABEL_MAX, Fields, label_of

_NONE: Final = Inhibit("none", "", 0.0)
_UNREADABLE_RECORD: Final = Inhibit("the record of an inhibit cannot be read", "", 0.0)


class Inhibits:
    """The inhibit of one hand. A permit lifts the halt that it names, and no later one."""

    def __init__(self, hand: RobotiqHand) -> None:
        self._hand = hand

    @property
    def record(self) -> Fields | None:
        """The present inhibit for the next run of the agent."""
        inhibit = self._hand.inhibited
        return None if inhibit is None else inhibit.as_dict()

    def resume(self, record: object) -> None:
        """Continue an inhibit of the run before. One that cannot be read counts as well."""
        self._hand.resume_inhibit(_read(record, _UNREADABLE_RECORD))

    def halted(self, call: AgentCall) -> Inhibit | None:
        """Inhibit motion in this turn, if a halt requests it. Nothing malformed keeps it from halting."""
        reason = call.arguments.get("inhibit")
        if reason is None:
            return None
        inhibit = Inhibit(label_of(reason) or "a halt", _signed(call), time.time())
        self._hand.resume_inhibit(inhibit)  # of several reasons the first one stays
        return inhibit

    async def permit(self, call: AgentCall) -> None:
        """Permit motion after the halt that a client names. A permit that names no halt lifts none."""
        seen = _read(call.arguments.get("inhibited"), _NONE)
        await self._hand.permit(who=_signed(call), seen=seen)

    def told(self) -> Fields:
        """Whether motion is inhibited, and when that was so."""
        return {"stamp": now(), "inhibited": self.record}


def _read(fields: object, otherwise: Inhibit) -> Inhibit:
    try:
        return Inhibit.from_dict(fields)  # type: ignore[arg-type]
    except (AttributeError, KeyError, TypeError, ValueError):
        return otherwise


def _signed(call: AgentCall) -> str:
    """The person who made the request, in the client's words, and the label of the client."""
    who = label_of(call.arguments.get("who", ""))
    return f"{who}, {call.label}"[:LABEL_MAX] if who else call.label
