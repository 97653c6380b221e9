"""Questions: limits the requests for information that an agent reads."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable
from typing import Final

from ...runtime.log import log
from ..control.budget import Budget
from ..limited_log import EVERY_S

_CLIENT: Final = re.compile(rb'"client": ?"([^"\\]{1,64})"')


class Questions:
    """Admits a question before anything else is done with it, in any thread and in a few microseconds.

    A dropped question gets no answer, not even a refusal, which would take as long as the answer.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._budget = Budget()
        self._lock = threading.Lock()
        self._dropped = 0
        self._report_due = 0.0

    def allow(self, payload: bytes) -> bool:
        """Whether to read a question. Clients without an identification share one budget."""
        found = _CLIENT.search(payload)
        client, now = found[1].decode("ascii", "replace") if found else "", self._clock()
        with self._lock:
            if self._budget.allows(client, now):
                return True
            self._dropped += 1
            if now >= self._report_due:
                log.warning("%d questions were dropped: a client asks too many", self._dropped)
                self._dropped, self._report_due = 0, now + EVERY_S
            return False
