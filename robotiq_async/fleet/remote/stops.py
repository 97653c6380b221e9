"""Stops: halts and cancellations of one run, repeated until they are acknowledged."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any, Final, TypeVar

from ...runtime.clock import now
from ...values.enums import StopLevel
from ...values.errors import AgentError, NotAllowedError, ProtocolError, RobotiqError
from ..network.bus import Urgency
from ..wire.envelope import Call
from .client import Client
from .requests import NoAnswerError, label

TRIES: Final = 2  # attempts to cancel a command, within one window
CONTINUES: Final = frozenset({"activate", "reset", "atr", "recover"})
"""Commands that continue when their call is cancelled, as with a hand of this process."""
HALT_S: Final = 2.0  # seconds for which a halt is repeated
ATTEMPT_S: Final = 0.3  # seconds from one attempt to the next
RETRY_S: Final = 0.05  # the same after an attempt that failed at once, as no agent was reached
_RETRIED: Final = (NoAnswerError, NotAllowedError, AgentError, ProtocolError)
"""No answer, or one to another request: the next attempt may get through."""
T = TypeVar("T")


class Stops:
    """Halts and cancellations of one run."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._halts: set[asyncio.Task[Any]] = set()
        self._cancels: set[asyncio.Task[Any]] = set()

    @property
    def undelivered(self) -> StopLevel:
        """The ending that a run needs at least, because of stops that are not acknowledged yet."""
        if self._halts:
            return StopLevel.SHUTDOWN
        return StopLevel.KEEP if self._cancels else StopLevel.LEAVE

    def halt(self) -> asyncio.Task[Any]:
        return self._begin(self._halts, until_answered(self._halt_once, HALT_S))

    async def halted(self) -> None:
        """Wait until the present halts have ended, successfully or not."""
        await asyncio.gather(*self._halts, return_exceptions=True)

    def cancel_command(self, name: str, call: Call) -> asyncio.Task[Any] | None:
        """The call of a command was cancelled: hold what it set in motion, unless the command continues."""
        if not self._client.lease.is_held or self._client.is_over:
            return None
        if name in CONTINUES:
            return self._client.spawn(self._cancel_command(call))
        return self._begin(self._cancels, self._cancel_command(call))

    async def _halt_once(self, left: float) -> None:
        await self._client.ask("halt", {"label": label()}, timeout=left, urgency=Urgency.STOP)

    async def _cancel_command(self, call: Call) -> None:
        for _ in range(TRIES):
            try:
                await self._client.ask(
                    "cmd/cancel", {"number": call.number}, timeout=self._client.window / TRIES
                )
            except RobotiqError as error:
                if getattr(error, "reason", "late") == "late":
                    continue
            return  # acknowledged; or the lease has ended, and the agent cancelled all
        # Without renewals the lease ends, and the agent holds what moves.
        self._client.lose_lease("expired", "a command could not be cancelled")

    def _begin(self, others: set[asyncio.Task[Any]], work: Coroutine[Any, Any, Any]) -> asyncio.Task[Any]:
        task = self._client.spawn(work)
        others.add(task)
        task.add_done_callback(others.discard)
        return task


async def until_answered(attempt: Callable[[float], Awaitable[T]], limit: float) -> T:
    """Repeat an attempt; return the result of the first that succeeds.

    Earlier attempts stay open: on a slow link an answer may take longer than the time between two attempts.

    The argument of an attempt is the seconds that are left.

    Raises:
        NotAllowedError: access was denied, and no attempt succeeded.
        RobotiqError: the agent's answer; after the time limit, why there was none.
    """
    begun, deadline = now(), now() + limit
    under_way: set[asyncio.Future[T]] = set()
    failure: Exception | None = None
    try:
        while begun < deadline:
            under_way.add(asyncio.ensure_future(attempt(deadline - begun)))
            due = min(deadline, begun + ATTEMPT_S)
            while under_way and now() < due:
                done, under_way = await asyncio.wait(
                    under_way, timeout=due - now(), return_when=asyncio.FIRST_COMPLETED
                )
                for each in done:
                    each.exception()  # retrieved, or asyncio would log the error of a second one in this turn
                for each in done:
                    try:
                        return each.result()
                    except _RETRIED as error:
                        failure = _more_telling(failure, error)
            if not under_way:
                await asyncio.sleep(max(0.0, min(begun + RETRY_S, deadline) - now()))
            begun = now()
        return await _last(under_way, failure)
    finally:
        for each in under_way:
            each.cancel()
        await asyncio.gather(*under_way, return_exceptions=True)


async def _last(under_way: set[asyncio.Future[T]], failure: Exception | None) -> T:
    # The time of the attempts that are still open is over as well.
    for each in await asyncio.gather(*under_way, return_exceptions=True):
        if not isinstance(each, BaseException):
            return each
        if isinstance(each, Exception):
            failure = _more_telling(failure, each)
    raise failure or NoAnswerError("no answer in time")


def _more_telling(failure: Exception | None, later: Exception) -> Exception:
    # The last attempt has little time, so it may end without an answer where all before it were denied.
    return failure if isinstance(failure, NotAllowedError) and isinstance(later, NoAnswerError) else later
