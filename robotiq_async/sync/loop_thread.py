"""The event loop of all blocking hands, in a thread that exists while the loop has work.

Ctrl-C can interrupt the main thread between any two steps. So that thread takes no lock that the loop thread
may need, and holds nothing that it must release: otherwise the loop could stop, and nothing would watch the
fingers. It passes calls with :meth:`~asyncio.loop.call_soon_threadsafe` and waits at a queue written in C.
"""

# Theory of operation
#
# There is at most one loop (_ServingLoop): a thread that wants to start one takes _starting, and finds one
# that came first. A call is passed to the loop, and then one of three things happens:
#
#   it begins      as a task, whose end wakes its caller
#   it is refused  the loop has just run out of tasks: the caller starts the next one
#   it is lost     the loop was closed, as its caller notices within LOOK_S: the call is made again, unless
#                  it had begun. So no call is made twice
#
# A caller that is interrupted gives its call up. If it has not begun, it never does; else it is cancelled.
# Then ``interrupted`` runs, which holds the fingers. The caller waits for both, GIVE_UP_S at most.

from __future__ import annotations

import asyncio
import contextlib
import sys
import threading
import time
from collections.abc import Callable, Coroutine
from queue import Empty, SimpleQueue
from typing import Any, Final, Generic, TypeVar

from ..runtime.concurrency import LateError, green_threads
from ..runtime.logger import log

T = TypeVar("T")
Function = Callable[[], Coroutine[Any, Any, T]]

THREAD_NAME: Final = "robotiq_async"  # of the thread
HOLD_AFTER_S: Final = 0.1
"""Seconds that an interrupted call has to end before the fingers are held: most calls hold their axes
themselves, and one that waits for a disk does not keep them moving."""
LOOP_LOOK_S: Final = 0.1  # between two checks that the loop still exists; on Windows Ctrl-C arrives only then
GIVE_UP_S: Final = 3.0  # for an interrupted call to end: stop() takes up to 2 s, a hold up to 1 s


class LoopThread:
    """Makes calls in a separate event loop, for any number of other threads.

    The thread starts with the first call and ends when no call and no hand is left in it.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Start without a thread; also after a fork, because the parent's thread is not in this process."""
        self.is_closing = False  # whether the program ends
        self._starting = threading.Lock()  # taken only by loop threads, which Ctrl-C cannot interrupt
        self._server: _ServingLoop | None = None

    def close(self) -> None:
        """The program ends: no hand may start any more."""
        self.is_closing = True

    @property
    def is_running(self) -> bool:
        """Whether there is a loop now."""
        return self._server is not None and not self._server.loop.is_closed()

    @property
    def is_here(self) -> bool:
        """Whether this is called in the loop."""
        with contextlib.suppress(RuntimeError):  # no loop runs in this thread
            return self._server is not None and asyncio.get_running_loop() is self._server.loop
        return False

    def check_open(self) -> None:
        """Raise RuntimeError while the program ends: a hand that starts now would not be stopped."""
        if self.is_closing:
            raise RuntimeError("the program is ending: a blocking hand that starts now would not be stopped")

    def call(
        self, function: Function[T], *, interrupted: Function[None] | None = None, limit: float | None = None
    ) -> T:
        """Make a call and wait for its result.

        An exception in the waiting thread, such as Ctrl-C, cancels the call; it is raised once the call has
        ended, or after 3 s.

        Args:
            function: makes the coroutine.
            interrupted: called after a call that was cancelled in this way.
            limit: seconds to wait; None for as long as it takes.

        Raises:
            RuntimeError: called in the loop's own thread, which would wait for itself; or the thread cannot
                start, or the program ends.
            LateError: not done within the limit; the call continues.
            BaseException: raised by the call.
        """
        if self.is_here:
            raise RuntimeError(
                "a blocking call in the hand's own event loop, as from a listener, would wait for itself: "
                "make it from another thread, or use the async robotiq_async.RobotiqHand"
            )
        if sys.is_finalizing():
            # The thread has stopped and no other can start: this call would never end.
            raise RuntimeError("the interpreter is ending: a blocking hand takes no calls now")
        call = _ThreadedCall(function)
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
            del call, task  # a kept exception must not keep the call alive

    def _made(self, call: _ThreadedCall[T], limit: float | None) -> asyncio.Task[T]:
        """Make a call; again if the loop ended before the call began."""
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
            if call.has_begun:  # do not make it twice
                raise RuntimeError("the event loop of the hand has ended")

    def _serving(self, call: _ThreadedCall[Any]) -> _ServingLoop:
        """Start the loop thread with a call, unless another thread starts it at this moment."""
        self.check_open()
        if patched := green_threads():
            raise RuntimeError(
                f"{patched} has replaced Python's threads, and a blocking hand needs a real one; nothing was "
                "sent: use the hand in a process that is not patched, such as robotiq-async agent"
            )
        answer: SimpleQueue[_ServingLoop | OSError] = SimpleQueue()
        try:
            threading.Thread(target=self._serve, args=(call, answer), name=THREAD_NAME, daemon=True).start()
        except RuntimeError as error:
            raise RuntimeError(f"the event loop of the hand cannot be started: {error}") from error
        server = answer.get()
        if isinstance(server, OSError):
            raise RuntimeError(f"the event loop of the hand cannot be started: {server}") from server
        return server

    def _serve(self, call: _ThreadedCall[Any], answer: SimpleQueue[_ServingLoop | OSError]) -> None:
        with self._starting:
            server, is_new = self._server, False
            if server is None or server.loop.is_closed():
                try:
                    self._server = server = _ServingLoop(self._ended)
                except OSError as error:
                    answer.put(error)
                    return
                is_new = True
            with contextlib.suppress(RuntimeError):  # closed at this moment
                server.loop.call_soon_threadsafe(server.begin, call)
            answer.put(server)
        if is_new:
            server.run()

    def _ended(self, server: _ServingLoop) -> None:
        if self._server is server:  # another thread replaces only a loop that has ended
            self._server = None

    def _give_up(self, call: _ThreadedCall[Any], interrupted: Function[None] | None) -> None:
        """Cancel a call whose caller was interrupted, and wait for its end."""
        call.give_up()
        server, settled = self._server, SimpleQueue[None]()
        if server is None:
            call.forget()
            return
        try:
            server.loop.call_soon_threadsafe(server.give_up, call, interrupted, settled)
        except RuntimeError:
            call.forget()
            return  # the loop has ended, and the call with it
        try:
            settled.get(timeout=GIVE_UP_S)
        except Empty:
            log.warning("a call that was interrupted did not end within %g s, and still runs", GIVE_UP_S)


class _ServingLoop:
    """One event loop, from its first call to the end of its last. All its methods run in the loop.

    ``ended`` is called when no task is left.

    Raises:
        OSError: no file descriptors are left.
    """

    def __init__(self, ended: Callable[[_ServingLoop], None]) -> None:
        self.loop: Final = asyncio.new_event_loop()
        self._ended = ended
        self._is_ending = False
        self._giving_up: set[asyncio.Task[None]] = set()

    def run(self) -> None:
        """Run the loop until no task is left."""
        with asyncio.Runner(loop_factory=lambda: self.loop) as runner:
            runner.run(self._until_idle())

    async def _until_idle(self) -> None:
        here = {asyncio.current_task()}
        while others := asyncio.all_tasks() - here:
            await asyncio.wait(others)
        self._is_ending = True
        self._ended(self)

    def begin(self, call: _ThreadedCall[Any]) -> None:
        """Begin a call, or refuse it if the loop is ending."""
        if self._is_ending:
            call.refuse()
        elif not call.is_given_up:
            call.begin()

    def give_up(
        self, call: _ThreadedCall[Any], then: Function[None] | None, settled: SimpleQueue[None]
    ) -> None:
        """Cancel a call if it has begun, call ``then``, and signal ``settled`` when both have ended."""

        async def give_up() -> None:
            call.cancel()
            try:
                await call.ended(HOLD_AFTER_S)
                if then is not None:
                    await then()
                await call.ended()
            finally:
                settled.put(None)

        task = self.loop.create_task(give_up())
        self._giving_up.add(task)
        task.add_done_callback(self._giving_up.discard)


class _ThreadedCall(Generic[T]):
    """A call and its result."""

    def __init__(self, function: Function[T]) -> None:
        self._function = function
        self._task: asyncio.Task[T] | None = None
        self._ended: SimpleQueue[asyncio.Task[T] | None] = SimpleQueue()
        self.is_given_up = False  # whether its caller was interrupted

    @property
    def has_begun(self) -> bool:
        return self._task is not None

    def begin(self) -> None:
        self._task = asyncio.get_running_loop().create_task(self._run())
        self._task.add_done_callback(self._ended.put)

    def give_up(self) -> None:
        """Its caller was interrupted."""
        self.is_given_up = True

    def refuse(self) -> None:
        self._ended.put(None)

    async def _run(self) -> T:
        return await self._function()

    def cancel(self) -> None:
        if self._task is not None:
            self._task.cancel()

    def forget(self) -> None:
        """Drop the exception of its task, if any: asyncio would log that it was never retrieved."""
        if self._task is not None and self._task.done() and not self._task.cancelled():
            self._task.exception()

    async def ended(self, timeout: float | None = None) -> None:
        """Wait for its end; its exception is dropped."""
        if self._task is not None:
            done, _ = await asyncio.wait({self._task}, timeout=timeout)
            if done and not self._task.cancelled():
                self._task.exception()

    def wait(self, loop: asyncio.AbstractEventLoop, until: float | None) -> asyncio.Task[T] | None:
        """Wait in another thread for its end; None if the loop ended before.

        Raises:
            LateError: it has not ended by ``until``.
        """
        while True:
            is_closed = loop.is_closed()
            with contextlib.suppress(Empty):
                return self._ended.get(timeout=0 if is_closed else LOOP_LOOK_S)
            if is_closed:
                return None
            if until is not None and time.monotonic() > until:
                raise LateError("the call continues")


LOOP_THREAD: Final = LoopThread()  # the one of this process
