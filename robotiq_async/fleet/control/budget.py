"""Budget: limits the rate of questions. Pure: the caller passes the time.

Questions need no lease, and answering one takes as long as a poll. A client that sends thousands a second
would slow the polling of the gripper, and with it the statuses of all clients. Halts have no budget.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

EACH: Final = 100.0  # questions a second of one client; fetching missed events takes 50
ALL: Final = 1000.0
"""Questions a second of all clients together: limits a program that changes its client name each time."""
_CLIENTS: Final = 1000  # Clients with a budget of their own. The least recent one is forgotten


@dataclass(slots=True)
class _Bucket:
    left: float
    at: float

    def take(self, rate: float, now: float) -> bool:
        # At most the tokens of one second accumulate.
        self.left = min(rate, self.left + (now - self.at) * rate)
        self.at = now
        if self.left < 1:
            return False
        self.left -= 1
        return True


class Budget:
    """Questions that one agent may still answer, in all and of each client."""

    def __init__(self) -> None:
        self._all = _Bucket(ALL, 0.0)
        self._each: dict[str, _Bucket] = {}

    def allows(self, client: str, now: float) -> bool:
        """Whether to answer a question of a client; if so, it is counted."""
        bucket = self._each.pop(client, None) or _Bucket(EACH, now)
        self._each[client] = bucket
        if len(self._each) > _CLIENTS:
            del self._each[next(iter(self._each))]
        return bucket.take(EACH, now) and self._all.take(ALL, now)
