"""Jobs: the work of an agent for its clients, and its outcome, also for repetitions."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Coroutine
from typing import Any, Final, TypeVar

from ...runtime import Log
from ...values import Finger, RobotiqError, SentRequest
from ..errors import AgentError, ControlLostError
from ..network.bus import Query
from ..wire.envelope import AgentAnswer, AgentCall, failure
from ..wire.settings import Setting, asked_of, is_in, moved_by
from ..wire.values import Fields
from .publisher import HandPublisher

JOBS_KEPT: Final = 512
"""Jobs that are kept for repetitions, also after the end of their lease: 2.5 s of a loop at 200 Hz."""
JOBS_END_S: Final = 0.5
"""Seconds for jobs to end after the hand has been stopped, before they are cancelled."""
T = TypeVar("T")
Work = Coroutine[Any, Any, Fields]
"""Carries out a request, and returns the value of its answer."""
Key = tuple[str, int, int]  # client, lease, number


class Job:
    """A request that is being carried out, or is answered.

    Attributes:
        reason: of its cancellation by the agent; empty if it was not cancelled, or by its client.
        carries: its positions, speeds and forces.
        is_shown: whether the gripper has acknowledged an image with all of them.
        was_refused: whether the hand raised at once, before anything could be written.
    """

    def __init__(self, name: str, call: AgentCall, query: Query) -> None:
        self.name = name
        self.call = call
        self.queries: list[Query] = [query]
        self.answer: bytes | None = None
        self.task: asyncio.Task[Fields] | None = None
        self.reason: str = ""
        self.carries: dict[Setting, int] = asked_of(name, call.arguments)
        self.is_shown: bool = False
        self.was_refused: bool = False

    @property
    def key(self) -> Key:
        return self.call.client, self.call.lease, self.call.number

    @property
    def has_failed(self) -> bool:
        """Whether it has ended in an error, and was not cancelled."""
        task = self.task
        return task is not None and task.done() and not task.cancelled() and task.exception() is not None

    def run(self, task: asyncio.Task[Fields]) -> None:
        """Its task has begun."""
        self.task = task
        # Right after the first step of the task, before anything can be written.
        asyncio.get_running_loop().call_soon(self._look_whether_refused)

    def _look_whether_refused(self) -> None:
        self.was_refused = self.has_failed

    def observe(self, sent: SentRequest) -> None:
        """An image was acknowledged."""
        self.is_shown = self.is_shown or (bool(self.carries) and is_in(self.carries, sent))

    def reply(self, answer: bytes, status: bytes) -> None:
        """Answer it, and each of its repetitions."""
        self.answer = answer
        for query in self.queries:
            query.reply(answer, status)
        self.queries.clear()

    def cancel(self, reason: str = "") -> None:
        if self.task is not None and not self.task.done():
            self.reason = reason
            self.task.cancel()


class Jobs:
    """The jobs of one hand, found by client, lease and number.

    The outcome of a job follows from observations. It was *carried out* if it has a result, or the gripper
    acknowledged an image with all its values. It was *not begun* if the hand refused it at once. In
    between it is unknown: an image may be on the wire.
    """

    def __init__(
        self, publisher: HandPublisher, epoch: int, log: Log, ended: Callable[[Job, bool], None]
    ) -> None:
        """``ended`` is called with each job, and whether it was carried out."""
        self._publisher = publisher
        self._epoch = epoch
        self._log = log
        self._ended = ended
        self._kept: dict[Key, Job] = {}
        self._open: dict[Key, Job] = {}  # of these, the jobs without an answer
        self._forgotten = -math.inf
        """The newest stamp that a request, which is no longer kept, had seen."""
        self._followed: dict[Finger, Job] = {}  # by axis, the newest that sends it to a position
        self._tasks: set[asyncio.Task[Any]] = set()

    def find(self, call: AgentCall, number: object = None) -> Job | None:
        """The job of a request, or of another one of its sender's lease."""
        return self._kept.get((call.client, call.lease, call.number if number is None else number))  # type: ignore[arg-type]

    def may_have_been(self, call: AgentCall) -> bool:
        """Whether a request that is not found may have been a job. Repetitions keep their stamp."""
        return call.seen <= self._forgotten

    def begin(self, job: Job, work: Work) -> None:
        """Carry out a request once, and keep it for repetitions."""
        self._kept[job.key] = self._open[job.key] = job
        self._followed.update(dict.fromkeys(moved_by(job.carries), job))
        self.start(job, work)
        if len(self._kept) > JOBS_KEPT:
            self._forget()

    def start(self, job: Job, work: Work) -> None:
        """Carry out a request without keeping it: each repetition is carried out, too."""
        task = self.spawn(work)
        # Not in the task itself: a task that is cancelled before its first turn never runs.
        task.add_done_callback(lambda task: self._finish(job, task))
        job.run(task)

    def repeat(self, job: Job, query: Query) -> None:
        self._log.debug("request %d was repeated", job.call.number)
        if job.answer is None:
            job.queries.append(query)
        else:
            query.reply(job.answer, self._publisher.status_message())

    def left_of(self, number: object) -> Finger:
        """The axes that still follow a job that has failed, for example as another axis was superseded."""
        jobs = self._followed.items()
        return Finger(sum(axis for axis, job in jobs if job.call.number == number and job.has_failed))

    def cancel_all(self, lease: int, reason: str, *, leaves: bool = False) -> None:
        """A lease has ended. With ``leaves`` its moves continue."""
        for job in self._open.values():
            is_of_it = job.call.lease == lease and job.name != "release"
            if is_of_it and not (leaves and job.name == "move"):
                job.cancel(reason)
        self._followed.clear()

    def observe(self, what: object) -> None:
        if isinstance(what, SentRequest) and what.acknowledged:
            for job in self._open.values():
                job.observe(what)

    def spawn(self, work: Coroutine[Any, Any, T]) -> asyncio.Task[T]:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def end(self) -> None:
        """Wait until all jobs have been answered, END_S at most."""
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=JOBS_END_S)
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _finish(self, job: Job, task: asyncio.Task[Fields]) -> None:
        if self._open.get(job.key) is job:  # not a halt with the number of a move
            del self._open[job.key]
        call, error = job.call, None if task.cancelled() else task.exception()
        if task.cancelled():
            error = ControlLostError(f"cancelled: {job.reason or 'by the caller'}", job.reason or "released")
        elif error is not None and not isinstance(error, RobotiqError | TypeError | ValueError):
            self._log.error("%s failed", job.name, exc_info=error)
            error = AgentError(f"the agent failed: {error!r}")
        # A command of a loop is answered before it is written.
        is_done = error is None and job.name != "command"
        begun = True if is_done or job.is_shown else False if job.was_refused else None
        if isinstance(error, Exception):
            answer = failure(call, self._epoch, error, begun)
        else:
            answer = AgentAnswer(call.to, call.number, self._epoch, task.result(), begun=begun)
        if error is not None or is_done:
            self._ended(job, error is None)
        job.reply(answer.pack(), self._publisher.status_message())

    def _forget(self) -> None:
        # The oldest answered job: a repetition of a running job must not be carried out twice.
        for key, job in self._kept.items():
            if job.answer is not None:
                self._forgotten = max(self._forgotten, job.call.seen)
                del self._kept[key]
                return
