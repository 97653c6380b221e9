"""Questions: which of them an agent reads. They need no lease, so anybody may send any number."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Final

from ..limited_log import LimitedLog
from ..network.bus import MessageKind

EACH: Final = 100.0  # questions a second of one client; fetching missed events takes 50
_MOST_CLIENTS: Final = 1000  # Clients with their own budget. The least recent is forgotten


class AgentQuestions:
    """Admits a question before anything else is done with it, in any thread and in a few microseconds.

    Each client has a budget, so that none uses up the share of others; the rest of a second is not saved up.
    A dropped question gets no answer, not even a refusal, which would take as long as one.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._left: dict[str, tuple[float, float]] = {}  # by client: how many, and when that was so
        self._dropped = LimitedLog(clock=clock)

    def sort(self, key: str, _read: Callable[[], bytes] = bytes) -> MessageKind | None:
        """Whether to read a question. Its key ends in the client's name: with keys, its certificate's."""
        # Of each gripper, unless the key names several.
        client, now = key.rpartition("/")[2] if "*" in key else key, self._clock()
        left, at = self._left.get(client, (EACH, now))
        # One that is dropped changes nothing, so a flood takes no lock and writes nothing.
        if left + (now - at) * EACH >= 1:
            with self._lock:
                if self._is_within_budget(client, now):
                    return MessageKind.QUESTION
        self._dropped.warn("a request for information was dropped: a client sends too many")
        return None

    def _is_within_budget(self, client: str, now: float) -> bool:
        left, at = self._left.pop(client, (EACH, now))
        left = min(EACH, left + (now - at) * EACH)
        is_within = left >= 1
        self._left[client] = left - is_within, now
        if len(self._left) > _MOST_CLIENTS:
            del self._left[next(iter(self._left))]
        return is_within
