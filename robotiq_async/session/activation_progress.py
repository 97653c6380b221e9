"""Logs the progress of an activation, which may take half a minute on a real gripper."""

from __future__ import annotations

import asyncio
from typing import Final

from ..runtime.log import Log
from ..values.enums import State

TOLD_EVERY_S: Final = 4.0
ACTIVATING: Final = frozenset({State.DO_ACTIVATION, State.WF_ACTIVATION})


class ActivationProgress:
    """Logs how long an activation has taken so far, whichever client began it."""

    def __init__(self, loop: asyncio.AbstractEventLoop, log: Log) -> None:
        self._loop = loop
        self._log = log
        self._since = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def reached(self, state: State) -> None:
        if state in ACTIVATING:
            if self._timer is None:
                self._since = self._loop.time()
                self._wait()
        elif self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _wait(self) -> None:
        self._timer = self._loop.call_later(TOLD_EVERY_S, self._tell)

    def _tell(self) -> None:
        self._log.info("activating, %.0f s so far", self._loop.time() - self._since)
        self._wait()
