"""Agents: the agents that announce themselves for one gripper."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Final

from ...runtime import Log
from ..errors import AgentError
from ..limited_log import LimitedLog
from ..network.bus import Bus, Undo
from ..wire.names import GripperName

LOOK_S: Final = 0.5  # seconds to look for the tokens of agents
TWO_AGENTS: Final = "two agents serve it, perhaps different grippers under one name: stop one of them"


class Agents:
    """The agents that serve one gripper. With two of them, only a person can say which one is the mistake."""

    def __init__(self, name: GripperName, bus: Bus, two: Callable[[], None]) -> None:
        self._name = name
        self._bus = bus
        self._two = two
        self._tokens: set[str] = set()
        self._log = LimitedLog(Log(str(name)))
        self.end: Undo = bus.watch(name.key("alive", "*"), self._update_token)

    @property
    def are_several(self) -> bool:
        return len(self._tokens) > 1

    async def check_one(self) -> None:
        if self.are_several:  # one may be gone, and its sign-off lost
            self._tokens = set(await self._bus.announced(self._name.key("alive", "*"), timeout=LOOK_S))
        if self.are_several:
            raise AgentError(f"{self._name}: {TWO_AGENTS}; nothing was done")

    def _update_token(self, token: str, is_there: bool) -> None:
        before = len(self._tokens)
        (self._tokens.add if is_there else self._tokens.discard)(token)
        if before < 2 <= len(self._tokens):
            self._log.warn("%s", TWO_AGENTS, level=logging.ERROR)
            self._two()
