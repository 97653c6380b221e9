"""MissedEvents: fetches events that the network dropped. The agent keeps the last ones."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, Final

from ...values.errors import RobotiqError
from ..wire.values import reading
from .mirror import Mirror

PAUSE_S: Final = 0.02
"""Seconds between two questions: 50 a second, half of what an agent answers to one client."""


class MissedEvents:
    """Fetches them, one question at a time."""

    def __init__(
        self,
        mirror: Mirror,
        ask: Callable[[int], Coroutine[Any, Any, Any]],
        spawn: Callable[[Coroutine[Any, Any, Any]], object],
    ) -> None:
        self._mirror = mirror
        self._ask = ask
        self._spawn = spawn
        self._is_fetching = False

    def fetch(self) -> None:
        """Fetch them, unless that is under way."""
        if not self._is_fetching:
            self._is_fetching = True
            self._spawn(self._fetch())

    async def _fetch(self) -> None:
        mirror = self._mirror
        try:
            while mirror.has_missed():
                info = await self._ask(mirror.events)
                with reading("events"):
                    events = info["events"]
                    if info["epoch"] == mirror.epoch and events:
                        mirror.skip_events(events[0]["index"] - 1)
                        mirror.receive_events(events)
                await asyncio.sleep(PAUSE_S)
        except RobotiqError as error:
            mirror.log.info("missed events could not be fetched: %s", error)
        finally:
            self._is_fetching = False
