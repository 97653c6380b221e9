"""Stops: halts and cancellations of one run, until they are acknowledged."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any, Final, Protocol

from ...session.ending import Ending
from ...values.errors import RobotiqError
from ..network.bus import Urgency
from ..wire.envelope import Call
from ..wire.values import Fields
from .lease_keeper import LeaseKeeper
from .persistence import HALT_S, until_answered
from .requests import label

TRIES: Final = 2
"""Attempts to cancel a command, within one window."""
CONTINUES: Final = frozenset({"activate", "reset", "atr", "recover"})
"""Commands that continue when their call is cancelled, as with a hand of this process."""


class AgentClient(Protocol):
    """The part of a run that stops use."""

    keeper: LeaseKeeper
    is_over: bool
    window: float

    async def ask(self, verb: str, arguments: Fields | None = None, **how: Any) -> Any:  # noqa: ANN401
        ...

    def spawn(self, work: Coroutine[Any, Any, Any]) -> asyncio.Task[Any]: ...


class Stops:
    """Halts and cancellations of one run."""

    def __init__(self, run: AgentClient) -> None:
        self._run = run
        self._halts: set[asyncio.Task[Any]] = set()
        self._cancels: set[asyncio.Task[Any]] = set()

    @property
    def undelivered(self) -> Ending:
        """The ending that a run needs at least, because of stops that are not acknowledged yet."""
        if self._halts:
            return Ending.HALT
        return Ending.KEEP if self._cancels else Ending.LEAVE

    def halt(self) -> asyncio.Task[Any]:
        """Halt; repeated until it is answered."""
        return self._begin(self._halts, until_answered(self._halt_once, HALT_S))

    async def halted(self) -> None:
        """Wait until halts under way have ended, successfully or not."""
        await asyncio.gather(*self._halts, return_exceptions=True)

    def cancel_command(self, name: str, call: Call) -> asyncio.Task[Any] | None:
        """The call of a command was cancelled: hold what it set in motion, unless the command continues."""
        if not self._run.keeper.is_in_control or self._run.is_over:
            return None
        if name in CONTINUES:
            return self._run.spawn(self._cancel_command(call))
        return self._begin(self._cancels, self._cancel_command(call))

    async def _halt_once(self, left: float) -> None:
        await self._run.ask("halt", {"label": label()}, timeout=left, urgency=Urgency.STOP)

    async def _cancel_command(self, call: Call) -> None:
        for _ in range(TRIES):
            try:
                await self._run.ask("cmd/cancel", {"number": call.number}, timeout=self._run.window / TRIES)
            except RobotiqError as error:
                if getattr(error, "reason", "late") == "late":
                    continue
            return  # acknowledged; or the lease has ended, and the agent cancelled all
        # Without renewals the lease ends, and the agent holds what moves.
        self._run.keeper.lose("expired", "a command could not be cancelled")

    def _begin(self, others: set[asyncio.Task[Any]], work: Coroutine[Any, Any, Any]) -> asyncio.Task[Any]:
        task = self._run.spawn(work)
        others.add(task)
        task.add_done_callback(others.discard)
        return task
