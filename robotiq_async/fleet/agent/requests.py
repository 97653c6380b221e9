"""Requests that an agent carries out: their tasks and their answers, also to repetitions."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import suppress
from typing import Any, Final, TypeVar

from ...runtime.log import Log, printable
from ...values.enums import NO_AXES, Finger
from ...values.errors import AgentError, ControlLostError, MoveSupersededError, RobotiqError
from ...values.move_result import MoveResult
from ..network.bus import Query
from ..wire.envelope import Answer, Call, failure
from ..wire.values import Fields, result_fields
from .publisher import HandPublisher

REMEMBERED: Final = 256  # requests whose answers are kept for repetitions
END_S: Final = 0.5
"""Seconds for requests to end after the hand has been stopped, before they are cancelled."""
MOTIONS: Final = ("move", "set_position", "command")
"""Commands that may send axes to a position."""
T = TypeVar("T")
Work = Coroutine[Any, Any, MoveResult | None]
LABEL_MAX: Final = 200  # characters of a label that are shown


class Request:
    """A request that runs, or is answered: repetitions get the same answer.

    Attributes:
        reason: of its cancellation by the agent; empty if it was not cancelled, or by its client.
    """

    def __init__(self, name: str, call: Call, query: Query) -> None:
        self.name = name
        self.call = call
        self.queries = [query]
        self.answer: bytes | None = None
        self.task: asyncio.Task[MoveResult | None] | None = None
        self.reason = ""

    @property
    def was_superseded(self) -> bool:
        """Whether it is a move that has failed because something else took over an axis."""
        task = self.task if self.name == "move" else None
        if task is None or not task.done() or task.cancelled():
            return False
        return isinstance(task.exception(), MoveSupersededError)

    def cancel(self, reason: str = "") -> None:
        if self.task is not None and not self.task.done():
            self.reason = reason
            self.task.cancel()


class Requests:
    """The requests for one hand. Those under the present lease are found by their numbers."""

    def __init__(
        self, publisher: HandPublisher, epoch: int, log: Log, carried_out: Callable[[Request], None]
    ) -> None:
        self._publisher = publisher
        self._epoch = epoch
        self._log = log
        self._carried_out = carried_out
        self._known: dict[int, Request] = {}
        self._followed: dict[Finger, Request] = {}  # by axis, the newest that sends it to a position
        self._tasks: set[asyncio.Task[Any]] = set()

    def find(self, number: object) -> Request | None:
        """The request with a number, under the present lease."""
        return self._known.get(number) if isinstance(number, int) else None

    def begin(self, request: Request, work: Work) -> None:
        """Carry out a command, and keep it for repetitions."""
        self._known[request.call.number] = request
        self._followed.update(dict.fromkeys(moved_by(request.name, request.call.arguments), request))
        if len(self._known) > REMEMBERED:
            self._forget()
        self.start(request, work)

    def start(self, request: Request, work: Work) -> None:
        """Carry out a request without keeping it: each repetition is carried out, too."""
        request.task = self.spawn(work)
        # Not in the task itself: a task that is cancelled before its first turn never runs.
        request.task.add_done_callback(lambda task: self._finish(request, task))

    def repeat(self, request: Request, query: Query) -> None:
        self._log.debug("request %d was repeated", request.call.number)
        if request.answer is None:
            request.queries.append(query)
        else:
            query.reply(request.answer, self._publisher.status_message())

    def forget_moves(self) -> None:
        # The client leaves the fingers moving, so the end of its lease must not cancel the moves.
        self._known = {at: each for at, each in self._known.items() if each.name != "move"}

    def left_of(self, number: object) -> Finger:
        """The axes that still follow a move that has failed because something else took over another one."""
        left = NO_AXES
        for axis, request in self._followed.items():
            if request.call.number == number and request.was_superseded:
                left |= axis
        return left

    def cancel_all(self, reason: str) -> None:
        for request in self._known.values():
            request.cancel(reason)
        self._known.clear()
        self._followed.clear()

    def spawn(self, work: Coroutine[Any, Any, T]) -> asyncio.Task[T]:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def end(self) -> None:
        """Wait until all requests have been answered, END_S at most."""
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=END_S)
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _finish(self, request: Request, task: asyncio.Task[MoveResult | None]) -> None:
        call, error = request.call, None if task.cancelled() else task.exception()
        if task.cancelled():
            reason = request.reason or "released"
            error = ControlLostError(f"cancelled: {request.reason or 'by the caller'}", reason)
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
        # Only answered ones: a repetition of one that runs must not be carried out twice.
        for number in sorted(self._known)[: REMEMBERED // 2]:
            if self._known[number].answer is not None:
                del self._known[number]


def label_of(call: Call) -> str:
    """The label a client gives itself, made printable."""
    return printable(str(call.arguments.get("label", "unknown client"))[:LABEL_MAX])


def moved_by(name: str, arguments: Fields) -> Finger:
    """The axes that a command sends to a position."""
    axes = arguments.get("axes")
    if name == "command" and isinstance(axes, dict):
        moved = (
            mask for mask, changes in axes.items() if isinstance(changes, dict) and "position" in changes
        )
        arguments = {"axes": [*moved]}
    return axes_of(name, arguments) if name in MOTIONS else NO_AXES


def axes_of(name: str, arguments: Fields) -> Finger:
    """The axes that a command addresses; all of them by default."""
    masks = arguments.get("axes", {}) if name == "command" else [arguments.get("fingers", 15)]
    axes = NO_AXES
    for mask in masks:
        with suppress(TypeError, ValueError):
            axes |= Finger(int(mask) & 15)
    return axes
