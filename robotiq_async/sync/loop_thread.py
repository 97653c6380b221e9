"""The event loop of all blocking hands, in a thread that is there while something runs in it.

Ctrl-C strikes between any two steps of the main thread. So that thread takes no lock that the loop's thread
may need, and holds nothing that must be given back: the loop would stand still, and nobody would watch the
fingers. It leaves calls with :meth:`~asyncio.loop.call_soon_threadsafe` and waits at a queue written in C.
"""

from __future__ import annotations

import asyncio
import contextlib
import sys
import threading
import time
from collections.abc import Callable, Coroutine
from queue import Empty, SimpleQueue
from typing import Any, Final, Generic, TypeVar

from ..runtime.concurrency import LateError
from ..runtime.log import log

T = TypeVar("T")
Function = Callable[[], Coroutine[Any, Any, T]]

NAME: Final = "robotiq_async"
"""Of the thread."""
LOOK_S: Final = 0.1
"""Who waits looks so often whether the loop is still there. Windows tells of Ctrl-C no sooner."""
GIVE_UP_S: Final = 3.0
"""What a call that was interrupted may take to end: stop() takes up to 2 s, a hold up to 1 s."""


class LoopThread:
    """Makes calls in an event loop of its own, for any number of other threads.

    The thread begins with the first call, and ends when neither a call nor a hand runs in it any more.
    """

    def __init__(self) -> None:
        """Begin without a thread."""
        self.forget()

    def forget(self) -> None:
        """There is no thread: that of a parent process is not ours."""
        self.begins_no_more = False
        """Whether the program ends: see :meth:`check_begins`."""
        self._beginning = threading.Lock()
        """Only threads that Ctrl-C cannot strike take it."""
        self._server: _Server | None = None

    @property
    def is_running(self) -> bool:
        """Whether there is a loop at this moment."""
        return self._server is not None and not self._server.loop.is_closed()

    @property
    def is_here(self) -> bool:
        """Whether this is called in the loop."""
        with contextlib.suppress(RuntimeError):  # no loop runs in this thread
            return self._server is not None and asyncio.get_running_loop() is self._server.loop
        return False

    def check_begins(self) -> None:
        """Refuse what begins while the program ends: a hand that starts now would not be stopped at its end.

        Raises:
            RuntimeError: it ends.
        """
        if self.begins_no_more:
            raise RuntimeError("the program is ending: a blocking hand that starts now would not be stopped")

    def call(
        self, function: Function[T], *, interrupted: Function[None] | None = None, limit: float | None = None
    ) -> T:
        """Make a call, and wait for it.

        An exception that strikes the waiting thread, as Ctrl-C does, cancels the call; it is raised when the
        call has ended, or after 3 s.

        Args:
            function: what to call.
            interrupted: what to call after a call that was cancelled so.
            limit: seconds to wait for it; None for as long as it takes.

        Raises:
            RuntimeError: called in the loop's own thread, which would wait for itself; or there is no thread,
                or the program ends.
            LateError: not done within the limit; it goes on.
            BaseException: whatever the call raises.
        """
        if self.is_here:
            raise RuntimeError(
                "a blocking call in the hand's own event loop, as from a listener, would wait for itself: "
                "make it from another thread, or use the async robotiq_async.RobotiqHand"
            )
        if sys.is_finalizing():
            # The thread does not run any more, and another one would never begin: this call would never end.
            raise RuntimeError("the interpreter is ending: a blocking hand takes no calls now")
        call = _Call(function)
        try:
            task = self._made(call, limit)
        except LateError:
            raise
        except BaseException:
            self._give_up(call, interrupted)
            raise
        try:
            return task.result()
        finally:
            del call, task  # whoever keeps what it raises is not to keep the call with it

    def _made(self, call: _Call[T], limit: float | None) -> asyncio.Task[T]:
        """Have a call made; again if the loop came to its end before it had begun with it."""
        until = None if limit is None else time.monotonic() + limit
        while True:
            server = self._server
            if server is None or server.loop.is_closed():
                server = self._serving(call)
            else:
                with contextlib.suppress(RuntimeError):  # closed at this moment
                    server.loop.call_soon_threadsafe(server.begin, call)
            task = call.wait(server.loop, until)
            if task is not None:
                return task
            if call.has_begun:  # and is not made again, whatever became of it
                raise RuntimeError("the event loop of the hand has ended")

    def _serving(self, call: _Call[Any]) -> _Server:
        """Begin a thread with a call, unless another thread does so at this moment."""
        self.check_begins()
        answer: SimpleQueue[_Server | OSError] = SimpleQueue()
        threading.Thread(target=self._serve, args=(call, answer), name=NAME, daemon=True).start()
        server = answer.get()
        if isinstance(server, OSError):
            raise RuntimeError(f"the event loop of the hand cannot be started: {server}") from server
        return server

    def _serve(self, call: _Call[Any], answer: SimpleQueue[_Server | OSError]) -> None:
        with self._beginning:
            server, is_new = self._server, False
            if server is None or server.loop.is_closed():
                try:
                    self._server = server = _Server(self._ends)
                except OSError as error:
                    answer.put(error)
                    return
                is_new = True
            with contextlib.suppress(RuntimeError):  # closed at this moment
                server.loop.call_soon_threadsafe(server.begin, call)
            answer.put(server)
        if is_new:
            server.run()

    def _ends(self, server: _Server) -> None:
        """A loop ends, and begins with nothing any more."""
        if self._server is server:  # as long as it runs nobody else puts another in its place
            self._server = None

    def _give_up(self, call: _Call[Any], interrupted: Function[None] | None) -> None:
        """Cancel a call that nobody waits for any more, and wait for that."""
        call.is_given_up = True
        server, settled = self._server, SimpleQueue[None]()
        if server is None:
            return
        try:
            server.loop.call_soon_threadsafe(server.give_up, call, interrupted, settled)
        except RuntimeError:
            return  # the loop has ended, and the call with it
        try:
            settled.get(timeout=GIVE_UP_S)
        except Empty:
            log.warning("a call that was interrupted did not end within %g s, and goes on", GIVE_UP_S)


class _Server:
    """One event loop, from the first call to the end of the last. All but the constructor runs in it."""

    def __init__(self, ends: Callable[[_Server], None]) -> None:
        """Make the loop.

        Args:
            ends: is told when nothing runs in it any more.

        Raises:
            OSError: there are no descriptors left.
        """
        self.loop: Final = asyncio.new_event_loop()
        self._ends = ends
        self._is_ending = False
        self._giving_up: set[asyncio.Task[None]] = set()

    def run(self) -> None:
        """Run the loop until nothing runs in it any more."""
        with asyncio.Runner(loop_factory=lambda: self.loop) as runner:
            runner.run(self._until_idle())

    async def _until_idle(self) -> None:
        here = {asyncio.current_task()}
        while others := asyncio.all_tasks() - here:
            await asyncio.wait(others)
        self._is_ending = True
        self._ends(self)

    def begin(self, call: _Call[Any]) -> None:
        """Begin with a call, or say that it is too late for that."""
        if self._is_ending:
            call.refuse()
        elif not call.is_given_up:
            call.begin()

    def give_up(self, call: _Call[Any], then: Function[None] | None, settled: SimpleQueue[None]) -> None:
        """Cancel a call if it has begun; do something else, and tell."""

        async def give_up() -> None:
            try:
                await call.cancelled()
                if then is not None:
                    await then()
            finally:
                settled.put(None)

        task = self.loop.create_task(give_up())
        self._giving_up.add(task)
        task.add_done_callback(self._giving_up.discard)


class _Call(Generic[T]):
    """A call, and what comes of it."""

    def __init__(self, function: Function[T]) -> None:
        self._function = function
        self._task: asyncio.Task[T] | None = None
        self._ended: SimpleQueue[asyncio.Task[T] | None] = SimpleQueue()
        self.is_given_up = False
        """Whether nobody waits for it any more."""

    @property
    def has_begun(self) -> bool:
        return self._task is not None

    def begin(self) -> None:
        self._task = asyncio.get_running_loop().create_task(self._run())
        self._task.add_done_callback(self._ended.put)

    def refuse(self) -> None:
        """The loop ends before it begins."""
        self._ended.put(None)

    async def _run(self) -> T:
        return await self._function()

    async def cancelled(self) -> None:
        """Cancel it, and wait until it has ended; what it raises is nobody's."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.wait({self._task})
            if not self._task.cancelled():
                self._task.exception()

    def wait(self, loop: asyncio.AbstractEventLoop, until: float | None) -> asyncio.Task[T] | None:
        """Wait in another thread until it has ended; None if the loop ended before.

        Raises:
            LateError: it is late.
        """
        while True:
            is_closed = loop.is_closed()
            with contextlib.suppress(Empty):
                return self._ended.get(timeout=0 if is_closed else LOOK_S)
            if is_closed:
                return None
            if until is not None and time.monotonic() > until:
                raise LateError("the call goes on")


LOOP_THREAD: Final = LoopThread()
"""That of all hands of this process."""
