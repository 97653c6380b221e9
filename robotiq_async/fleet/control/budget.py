"""Budget: limits the rate of questions. Pure: the caller passes the time.

Questions need no lease. All of them together get no more than a share of the agent's loop (mailbox.py), and
the budget keeps one client from using up what the others need. Halts have none.
"""

from __future__ import annotations

from typing import Final

EACH: Final = 100.0  # questions a second of one client; fetching missed events takes 50
_CLIENTS: Final = 1000  # Clients with a budget of their own. The least recent one is forgotten


class Budget:
    """Questions that one agent may still answer each client. At most those of one second accumulate."""

    def __init__(self) -> None:
        self._left: dict[str, tuple[float, float]] = {}  # by client: how many, and when that was so

    def allows(self, client: str, now: float) -> bool:
        """Whether to answer a question of a client; if so, it is counted."""
        left, at = self._left.pop(client, (EACH, now))
        left = min(EACH, left + (now - at) * EACH)
        is_allowed = left >= 1
        self._left[client] = left - is_allowed, now
        if len(self._left) > _CLIENTS:
            del self._left[next(iter(self._left))]
        return is_allowed
