"""Client: the calls of one run to its agent, under the present lease, and the tasks that make them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import suppress
from typing import Any, Final

from ...values.checks import check_seconds
from ...values.errors import AgentError, ControlLostError, MoveTimeoutError, NotStartedError, RobotiqError
from ..control.lease import WINDOW_MAX_S, WINDOW_MIN_S, WINDOW_S
from ..wire.envelope import Call
from ..wire.names import GripperName
from ..wire.values import Fields
from .lease_state import ClientLease
from .mirror import Mirror
from .pending_request import PendingRequest
from .requests import NoAnswerError, Requests

OWN: Final = ("info", "lease", "halt", "cmd/cancel")
"""Requests whose arguments come from this library: a TypeError in the answer is not the user's."""


class Client:
    """Calls to the agent in one run. It belongs to the event loop that it was made in.

    Attributes:
        name, loop, log, mirror, requests, lease: of this run.
        window: of the leases, in seconds.
        is_over: whether the run has ended, or is ending.
        has_ended: whether all of it has ended.
    """

    def __init__(
        self,
        name: GripperName,
        requests: Requests,
        mirror: Mirror,
        lease: ClientLease,
        *,
        receive: Callable[[bytes, float], object],
    ) -> None:
        """``receive`` takes the status that comes with an answer, and the time of the question."""
        self.name = name
        self.loop = asyncio.get_running_loop()
        self.log = mirror.log
        self.mirror = mirror
        self.lease = lease
        self.requests = requests
        self.window = WINDOW_S
        self.is_over = False
        self.has_ended = False
        self._receive = receive
        self._tasks: set[asyncio.Task[Any]] = set()

    def set_window(self, seconds: float) -> None:
        self.window = check_seconds("window", seconds, WINDOW_MIN_S, WINDOW_MAX_S)

    # -- calls -----------------------------------------------------------------------------------------

    async def ask(self, verb: str, arguments: Fields | None = None, **how: Any) -> Any:  # noqa: ANN401
        return await self.send(self.call(arguments), verb, **how)

    async def ask_quietly(self, verb: str, arguments: Fields, timeout: float) -> None:
        """Ask, and ignore errors: the answer itself has the effect."""
        with suppress(RobotiqError):
            await self.ask(verb, arguments, timeout=timeout)

    def call(self, arguments: Fields | None = None) -> Call:
        return self.requests.make(self.mirror, self.lease.number, arguments or {})

    async def send(self, call: Call, verb: str, **how: Any) -> Any:  # noqa: ANN401
        return await self.answer(self.requests.post(call, verb, **how))

    async def answer(self, posted: PendingRequest) -> Any:  # noqa: ANN401
        """As :meth:`Requests.answer`, with the outcome of the answer, and NotStartedError after the end."""
        try:
            answer, status = await self.requests.answer(posted)
        except NoAnswerError:
            if not posted.is_allowed_after_stop:
                self.check_running()
            raise
        if status:
            self._receive(status, posted.asked_at)
        try:
            return answer.outcome(self.mirror.clock)
        except (TypeError, ValueError) as error:
            if posted.verb not in OWN:
                raise
            raise AgentError(f"{self.name}: its agent does not understand {posted.verb}: {error}") from error
        except MoveTimeoutError as error:
            error.status = self.mirror.renumbered(error.status)
            raise
        except ControlLostError as error:
            if posted.verb != "lease":
                self.check_running()  # the lease was given back at the end of the run
            if posted.verb != "halt" and error.reason != "late" and posted.call.lease == self.lease.number:
                self.lose_lease(error.reason, str(error))
            raise

    def lose_lease(self, reason: str, why: str) -> None:
        """The lease has ended: no command under it will be answered."""
        if self.lease.lose(reason, why):
            self.requests.lose_lease(self.lease.number, reason)
            self.log.warning("lost control: %s", why)

    def release_lease(self) -> None:
        if self.lease.is_held:
            self.requests.lose_lease(self.lease.number, "released")
        self.lease.release()

    # -- the end ---------------------------------------------------------------------------------------

    def end(self) -> None:
        """The run ends: from now on only requests that end motion are sent."""
        self.is_over = True
        self.requests.end()

    async def close(self) -> None:
        """End the requests and tasks that :meth:`end` has left."""
        for task in self._tasks:
            task.cancel()
        await self.requests.close()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def finish(self) -> None:
        """All of the run has ended."""
        self.is_over = self.has_ended = True

    def check_running(self) -> None:
        if self.is_over and not self.has_ended:
            raise NotStartedError("the hand was stopped")
        if self.is_over:
            raise NotStartedError("the hand is not started: use 'async with' or start()")
        if self.loop.is_closed():
            raise NotStartedError("the event loop that the hand ran in was closed: start() it again")

    def spawn(self, work: Coroutine[Any, Any, Any]) -> asyncio.Task[Any]:
        task = self.loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task
