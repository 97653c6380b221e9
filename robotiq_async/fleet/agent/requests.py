"""Requests that an agent carries out: their tasks, and their answers, also to those that come again."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, Final, TypeVar

from ...runtime.log import Log
from ...values.errors import AgentError, ControlLostError, RobotiqError
from ...values.move_result import MoveResult
from ..network.bus import Query
from ..wire.envelope import Answer, Call, failure
from ..wire.values import result_fields
from .publisher import HandPublisher

REMEMBERED: Final = 256
"""Requests whose answers are kept for repetitions."""
END_S: Final = 0.5
"""For what is under way when the hand has been stopped: it ends by itself."""
T = TypeVar("T")
Work = Coroutine[Any, Any, MoveResult | None]


class Request:
    """Something under way, or answered already: a repetition gets the same answer.

    Attributes:
        reason: why it was called off; empty if it was not, or by its caller.
    """

    def __init__(self, name: str, call: Call, query: Query) -> None:
        self.name = name
        self.call = call
        self.queries = [query]
        self.answer: bytes | None = None
        self.task: asyncio.Task[MoveResult | None] | None = None
        self.reason = ""

    def call_off(self, reason: str = "") -> None:
        """Cancel it, if it is still under way."""
        if self.task is not None and not self.task.done():
            self.reason = reason
            self.task.cancel()


class Requests:
    """Those of one hand. The ones under the present lease are known by their numbers."""

    def __init__(
        self, publisher: HandPublisher, epoch: int, log: Log, carried_out: Callable[[Request], None]
    ) -> None:
        self._publisher = publisher
        self._epoch = epoch
        self._log = log
        self._carried_out = carried_out
        self._known: dict[int, Request] = {}
        self._tasks: set[asyncio.Task[Any]] = set()

    def find(self, number: object) -> Request | None:
        """The request with a number, under the present lease."""
        return self._known.get(number) if isinstance(number, int) else None

    def begin(self, request: Request, work: Work) -> None:
        """Carry one out, and know it by its number from now on."""
        self._known[request.call.number] = request
        if len(self._known) > REMEMBERED:
            self._forget()
        self.start(request, work)

    def start(self, request: Request, work: Work) -> None:
        """Carry one out that comes as often as it is asked."""
        request.task = self.spawn(work)
        # Not in the task itself: one that is cancelled before it has begun never runs.
        request.task.add_done_callback(lambda task: self._finish(request, task))

    def repeat(self, request: Request, query: Query) -> None:
        """One has come again."""
        self._log.debug("request %d came again", request.call.number)
        if request.answer is None:
            request.queries.append(query)
        else:
            query.reply(request.answer, self._publisher.status_message())

    def leave_moves(self) -> None:
        """Moves go on; nobody waits for them."""
        self._known = {at: each for at, each in self._known.items() if each.name != "move"}

    def call_off_all(self, reason: str) -> None:
        """The lease has ended."""
        for request in self._known.values():
            request.call_off(reason)
        self._known.clear()

    def spawn(self, work: Coroutine[Any, Any, T]) -> asyncio.Task[T]:
        """Do something beside."""
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def end(self) -> None:
        """The hand was stopped: wait until everybody has been answered."""
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=END_S)
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _finish(self, request: Request, task: asyncio.Task[MoveResult | None]) -> None:
        call, error = request.call, None if task.cancelled() else task.exception()
        if task.cancelled():
            reason = request.reason or "released"
            error = ControlLostError(f"called off: {request.reason or 'by the caller'}", reason)
        elif isinstance(error, Exception) and not isinstance(error, RobotiqError | TypeError | ValueError):
            self._log.error("%s failed", request.name, exc_info=error)
            error = AgentError(f"the agent failed: {error!r}")
        if isinstance(error, Exception):
            answer = failure(call, self._epoch, error)
        else:
            answer = Answer(call.to, call.number, self._epoch, result_fields(task.result()) or {})
            self._carried_out(request)
        request.answer = answer.pack()
        for query in request.queries:
            query.reply(request.answer, self._publisher.status_message())
        request.queries.clear()

    def _forget(self) -> None:
        """The oldest requests that have been answered."""
        for number in sorted(self._known)[: REMEMBERED // 2]:
            if self._known[number].answer is not None:
                del self._known[number]
