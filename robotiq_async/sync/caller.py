"""How calls get to the event loop of a hand; what Ctrl-C, a fork and the program's end do to it."""

from __future__ import annotations

import asyncio
import atexit
import contextlib
import os
import sys
from collections.abc import Callable, Coroutine
from typing import Any, Final, TypeVar

from ..hand.robotiq_hand import RobotiqHand as AsyncRobotiqHand
from ..runtime.concurrency import LateError
from ..runtime.log import Log, log
from ..values.enums import State
from ..values.errors import NotStartedError, RobotiqError
from .loop_thread import LOOP_THREAD

T = TypeVar("T")
Function = Callable[[], Coroutine[Any, Any, T]]

EXIT_S: Final = 4.0
"""How long the end of the program waits for hands that were not stopped: stop() takes up to 2 s."""


class Caller:
    """Makes the calls of one hand, from any thread.

    Attributes:
        hand: the hand, in its event loop.
    """

    def __init__(self, hand: AsyncRobotiqHand) -> None:
        """Keep the hand; nothing runs yet."""
        self.hand: Final = hand
        self._calls: set[object] = set()
        """Those that are being made: what they do cannot be told yet."""
        self._is_left_behind = False
        self._has_warned = False

    def wait(self, function: Function[T]) -> T:
        """Make a call, and wait for it.

        Raises:
            BaseException: whatever it raises, or strikes this thread meanwhile.
        """
        self._warn_of_a_running_loop()
        call = object()
        self._calls.add(call)
        _IN_USE.add(self)  # also when the program drops it: it runs on
        try:
            return LOOP_THREAD.call(function, interrupted=self._hold)
        finally:
            self._calls.discard(call)
            if not self._calls and not self.is_running:
                _IN_USE.discard(self)

    def tell(self, function: Callable[[], T]) -> T:
        """Make a call that does not wait. Listeners may do so, too.

        Raises:
            Exception: whatever it raises.
        """
        if LOOP_THREAD.is_here:
            return function()

        async def call() -> T:
            return function()

        return self.wait(call)

    def start(self, function: Function[None]) -> None:
        """Make the call that starts the hand, unless the program ends.

        Raises:
            RuntimeError: it ends.
            BaseException: as :meth:`wait`.
        """

        async def start() -> None:
            # In the loop: what begins before the end there is in use, and stopped after it has begun.
            LOOP_THREAD.check_begins()
            await function()

        self.wait(start)

    def stop(self, function: Function[None]) -> None:
        """Make the call that stops the hand; of one that does not run, without the event loop.

        Once the interpreter ends no thread can begin, and objects that are deleted then stop their hands.

        Raises:
            BaseException: as :meth:`wait`.
        """
        if self._calls or self.is_running:
            self.wait(function)
            return
        stopping = function()
        try:
            stopping.send(None)  # there is nothing to wait for
        except StopIteration:
            return
        finally:
            stopping.close()

    @property
    def has_commanded(self) -> bool:
        """Whether the hand has written to the gripper since its start, or is about to.

        Of one that only looks nothing is written when the program is interrupted or ends.
        """
        return self.hand._has_commanded  # noqa: SLF001  # both are the hand

    def _warn_of_a_running_loop(self) -> None:
        """Once: the loop stands still during each call, and whatever else runs in it, as other hands do."""
        if self._has_warned or LOOP_THREAD.is_here or "ipykernel" in sys.modules:
            return  # the cells of a notebook run in its kernel's loop, and are meant to hold it up
        with contextlib.suppress(RuntimeError):
            asyncio.get_running_loop()
            self._has_warned = True
            Log(self.hand.name).warning(
                "an event loop runs in this thread, and stands still at every call of the blocking hand: in "
                "coroutines use robotiq_async.RobotiqHand, or call this one with asyncio.to_thread()"
            )

    def check_process(self) -> None:
        """Refuse a hand that runs in the process that this one was forked from.

        Raises:
            RuntimeError: it does.
        """
        if self._is_left_behind:
            raise RuntimeError(
                "the hand ran when this process was forked, and stays with the parent; what it shows here "
                "is old: make another hand after the fork"
            )

    @property
    def is_running(self) -> bool:
        """Whether the hand has been started, and not stopped."""
        if self._is_left_behind or self.hand.state is State.SHUTDOWN:
            return False
        try:
            self.hand.is_activated  # noqa: B018  # asked for what it raises
        except NotStartedError:
            return False
        except RobotiqError:
            return True
        return True

    def after_fork(self) -> None:
        """This is the child; a hand that ran goes on in the parent, and so do the calls of its threads."""
        self._is_left_behind = self._is_left_behind or self.is_running
        self._calls.clear()

    async def _hold(self) -> None:
        """Let nothing move after Ctrl-C. A grip stays. A release goes on: it frees what may be trapped."""
        if not self.has_commanded:
            return
        with contextlib.suppress(RobotiqError):
            if self.hand.state in (State.DO_ACTIVATION, State.WF_ACTIVATION):
                await self.hand.halt()
            else:
                await self.hand.hold()


_IN_USE: Final[set[Caller]] = set()
"""Those of hands that run, and of those that are called at this moment."""


def _stop_all() -> None:
    """The program ends: what it has set going must not go on."""
    left = list(_IN_USE)
    for each in left:
        log.warning("%s still running at exit: stopping it", each.hand.address)

    async def stop_one(caller: Caller) -> None:
        # Whether it has commanded is asked in the turn that ends its requests.
        await caller.hand.stop(halt=caller.has_commanded)

    async def stop() -> None:
        await asyncio.gather(*map(stop_one, left), return_exceptions=True)

    if left and LOOP_THREAD.is_running:
        with contextlib.suppress(LateError):
            LOOP_THREAD.call(stop, limit=EXIT_S)
    _IN_USE.difference_update(left)


def _after_fork() -> None:
    LOOP_THREAD.forget()
    for each in _IN_USE:
        each.after_fork()
    _IN_USE.clear()


def _at_exit() -> None:
    LOOP_THREAD.begins_no_more = True
    _stop_all()


# Threads that are daemons still run then: it comes before the interpreter ends.
atexit.register(_at_exit)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)
