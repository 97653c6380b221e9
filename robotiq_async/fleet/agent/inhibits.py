"""Inhibits: whether motion of one hand is inhibited, as halts ask for it, and as a record has it."""

from __future__ import annotations

import time
from typing import Final

from ...local import RobotiqHand
from ...runtime import now
from ...values import Inhibit
from ..errors import AgentError
from ..wire.envelope import AgentCall
from ..wire.values import LABEL_MAX, Fields, label_of

_UNREADABLE: Final = Inhibit("the record of an inhibit cannot be read", "", 0.0)


class Inhibits:
    """The inhibit of one hand. Each halt that inhibits has a number, and a permit lifts what it names."""

    def __init__(self, hand: RobotiqHand) -> None:
        self._hand = hand
        self._number = 0  # of the newest halt that has inhibited motion, in this run of the agent

    @property
    def record(self) -> Fields | None:
        """The present inhibit for the next run of the agent."""
        inhibit = self._hand.inhibited
        return None if inhibit is None else inhibit.as_dict()

    def resume(self, record: object) -> None:
        """Continue an inhibit of the run before. One that cannot be read counts as well."""
        try:
            inhibit = Inhibit.from_dict(record)  # type: ignore[arg-type]
        except (AttributeError, KeyError, TypeError, ValueError):
            inhibit = _UNREADABLE
        self._hand.resume_inhibit(inhibit)

    def halted(self, call: AgentCall) -> Inhibit | None:
        """Inhibit motion in this turn, if a halt asks for it. Nothing malformed keeps it from halting."""
        reason = call.arguments.get("inhibit")
        if reason is None:
            return None
        inhibit = Inhibit(label_of(reason) or "a halt", _signed(call), time.time())
        self._hand.resume_inhibit(inhibit)  # of several reasons the first one stays
        self._number += 1  # a permit of an earlier one does not lift it
        return inhibit

    async def permit(self, call: AgentCall) -> None:
        number = call.arguments.get("inhibit_number")
        if type(number) is not int or number != self._number:
            raise AgentError(
                "a halt has inhibited motion that this permit does not name: look at the gripper, then "
                "permit it again"
            )
        await self._hand.permit(who=_signed(call))  # in the turn of the check: no halt comes between

    def told(self) -> Fields:
        """Whether motion is inhibited, the number that a permit of it names, and when that was so."""
        return {"stamp": now(), "inhibited": self.record, "inhibit_number": self._number}


def _signed(call: AgentCall) -> str:
    """Who asks: what the client says, and its label."""
    who = label_of(call.arguments.get("who", ""))
    return f"{who}, {call.label}"[:LABEL_MAX] if who else call.label
