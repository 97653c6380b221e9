"""Passes calls to the event loop of a hand, through Ctrl-C, a fork and the end of the program."""

# Theory of operation
#
# A hand lives in the event loop of LOOP_THREAD. Each call runs there, while the caller's thread waits. A
# caller is in _IN_USE while a call or its hand runs: this set, and not the program's references, decides
# which hands the end of the program stops. Three events may come between:
#
#   Ctrl-C   cancels the call and waits for its end. Then _hold() stops motion: by halt() in an activation,
#            else by hold(). The exception is raised after that.
#   exit     refuses further starts, then stops every hand in _IN_USE, for at most EXIT_S. Starts are checked
#            in the loop, so none comes between the two.
#   fork     leaves hands that run to the parent, which has the link and the thread. In the child each of
#            their calls raises RuntimeError; hands that did not run may start there.
#
# A hand that has written nothing since its start is stopped without a write: another client may command.

from __future__ import annotations

import asyncio
import atexit
import contextlib
import os
import sys
from collections.abc import Callable
from typing import Final, TypeVar

from ..local.robotiq_hand import RobotiqHand as AsyncRobotiqHand
from ..runtime.concurrency import LateError
from ..runtime.logger import Log, log
from ..values.enums import State
from ..values.errors import RobotiqError
from .loop_thread import LOOP_THREAD, Function

T = TypeVar("T")

EXIT_S: Final = 4.0  # the end of the program waits so long for running hands: stop() takes up to 2 s


class Caller:
    """Makes the calls of one hand, from any thread."""

    def __init__(self, hand: AsyncRobotiqHand) -> None:
        self.hand: Final = hand  # in its event loop
        self._calls: set[object] = set()  # the running calls: the hand may be about to start
        self._is_left_behind = False
        self._has_warned = False

    def wait(self, function: Function[T]) -> T:
        """Make a call and wait for its result."""
        self._warn_of_a_running_loop()
        call = object()
        self._calls.add(call)
        _IN_USE.add(self)  # a hand that the program drops still runs
        try:
            return LOOP_THREAD.call(function, interrupted=self._hold)
        finally:
            self._calls.discard(call)
            if not self.is_in_use:
                _IN_USE.discard(self)
                if self.is_in_use:  # another thread began a call in between
                    _IN_USE.add(self)

    def tell(self, function: Callable[[], T]) -> T:
        """Make a call that does not wait. Listeners may call this, too."""
        if LOOP_THREAD.is_here:
            return function()

        async def call() -> T:
            return function()

        return self.wait(call)

    def start(self, function: Function[None]) -> None:
        """Make the call that starts the hand; raises RuntimeError while the program ends."""

        async def start() -> None:
            # Checked in the loop: a start that passes is in use, and stopped at the end of the program.
            LOOP_THREAD.check_open()
            await function()

        self.wait(start)

    def stop(self, function: Function[None]) -> None:
        """Make the call that stops the hand; without the event loop if the hand does not run.

        Objects that are deleted while the interpreter ends stop their hands, and no thread can start then.
        """
        if self.is_in_use:
            self.wait(function)
            return
        _IN_USE.discard(self)  # it may have given up between two calls
        stopping = function()
        try:
            stopping.send(None)  # a hand that does not run stops without waiting
        except StopIteration:
            return
        finally:
            stopping.close()

    @property
    def has_commanded(self) -> bool:
        """Whether the hand has written to the gripper since its start, or is about to.

        If it has only read, an interruption and the end of the program write nothing, either.
        """
        return self.hand._local.has_commanded  # noqa: SLF001  # both are the hand

    def _warn_of_a_running_loop(self) -> None:
        """Warn once that each call blocks a loop that runs in this thread, and everything in that loop."""
        if self._has_warned or LOOP_THREAD.is_here or "ipykernel" in sys.modules:
            return  # the cells of a notebook run in its kernel's loop, and may block it
        with contextlib.suppress(RuntimeError):
            asyncio.get_running_loop()
            self._has_warned = True
            Log(self.hand.name).warning(
                "an event loop runs in this thread, and every call of the blocking hand blocks it: in "
                "coroutines use robotiq_async.RobotiqHand, or call this one with asyncio.to_thread()"
            )

    def check_process(self) -> None:
        """Raise RuntimeError if the hand runs in the process from which this one was forked."""
        if self._is_left_behind:
            raise RuntimeError(
                "the hand ran when this process was forked, and stays with the parent; its state here "
                "is old: make another hand after the fork"
            )

    @property
    def is_running(self) -> bool:
        """Whether the hand was started, and has neither been stopped nor given up on its link."""
        session = self.hand._local.session  # noqa: SLF001  # both are the hand
        return not (self._is_left_behind or session is None or session.is_over)

    @property
    def is_in_use(self) -> bool:
        """Whether the hand runs, or is being called."""
        return bool(self._calls) or self.is_running

    def after_fork(self) -> None:
        """Called in the child: a running hand, and its calls, stay with the parent."""
        self._is_left_behind = self._is_left_behind or self.is_running
        self._calls.clear()

    async def _hold(self) -> None:
        """Stop motion after Ctrl-C. A grip stays; a release continues, because something may be trapped."""
        if not self.has_commanded:
            return
        with contextlib.suppress(RobotiqError):
            if self.hand.state in (State.DO_ACTIVATION, State.WF_ACTIVATION):
                await self.hand.halt()
            else:
                await self.hand.hold()


_IN_USE: Final[set[Caller]] = set()  # the callers of hands that run, or are being called


def _stop_all() -> None:
    """Stop every hand at the end of the program."""
    left = [each for each in list(_IN_USE) if each.is_in_use]
    for each in left:
        log.warning("%s still running at exit: stopping it", each.hand.address)

    async def stop_one(caller: Caller) -> None:
        # has_commanded is read in the turn in which the stop refuses further requests.
        await caller.hand.stop(halt=caller.has_commanded)

    async def stop() -> None:
        await asyncio.gather(*map(stop_one, left), return_exceptions=True)

    if left and LOOP_THREAD.is_running:
        with contextlib.suppress(LateError):
            LOOP_THREAD.call(stop, limit=EXIT_S)
    _IN_USE.clear()


def _after_fork() -> None:
    LOOP_THREAD.forget()
    for each in _IN_USE:
        each.after_fork()
    _IN_USE.clear()


def _at_exit() -> None:
    LOOP_THREAD.close()
    _stop_all()


# atexit runs before the interpreter ends, while daemon threads still run.
atexit.register(_at_exit)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)
