"""Budget: how many questions are answered. Pure: the caller says what time it is.

Questions are free, and answering one takes as long as a poll. A client that asks thousands a second would
take the polls of the gripper, and with them the statuses of everybody. Halts have no budget.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

EACH: Final = 100.0
"""Questions a second of one client; who fetches missed events asks 50."""
ALL: Final = 1000.0
"""Questions a second of all clients: who calls itself something else each time has no more."""
_CLIENTS: Final = 1000
"""Clients that are told apart."""


@dataclass(slots=True)
class _Bucket:
    left: float
    at: float

    def take(self, rate: float, now: float) -> bool:
        """Take one, if there is one; a second's worth may be saved up."""
        self.left = min(rate, self.left + (now - self.at) * rate)
        self.at = now
        if self.left < 1:
            return False
        self.left -= 1
        return True


class Budget:
    """Of one agent."""

    def __init__(self) -> None:
        self._all = _Bucket(ALL, 0.0)
        self._each: dict[str, _Bucket] = {}

    def allows(self, client: str, now: float) -> bool:
        """Whether a question of a client is answered; counts it then."""
        bucket = self._each.pop(client, None) or _Bucket(EACH, now)
        self._each[client] = bucket
        if len(self._each) > _CLIENTS:
            del self._each[next(iter(self._each))]
        return bucket.take(EACH, now) and self._all.take(ALL, now)
