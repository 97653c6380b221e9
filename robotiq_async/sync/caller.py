"""How calls get to the event loop of a hand; what Ctrl-C, a fork and the program's end do to it."""

from __future__ import annotations

import asyncio
import atexit
import contextlib
import os
import weakref
from collections.abc import Callable, Coroutine
from typing import Any, Final, TypeVar

from ..enums import State
from ..errors import NotStartedError, RobotiqError
from ..hand import RobotiqHand as AsyncRobotiqHand
from ..log import log
from .loop_thread import LOOP_THREAD, LateError

T = TypeVar("T")
Function = Callable[[], Coroutine[Any, Any, T]]

EXIT_S: Final = 4.0
"""How long the end of the program waits for hands that were not stopped: stop() takes up to 2 s."""


class Caller:
    """Makes the calls of one hand, from any thread.

    Attributes:
        hand: the hand, in its event loop.
        has_asked: whether it has been told to do anything. Of one that has only been looked at, nothing is
            written when the program is interrupted or ends.
    """

    def __init__(self, hand: AsyncRobotiqHand) -> None:
        """Keep the hand; nothing runs yet."""
        self.hand: Final = hand
        self.has_asked = False
        self._is_left_behind = False
        _CALLERS.add(self)

    def ask(self, function: Function[T]) -> T:
        """Make a call that commands, and wait for it.

        Raises:
            BaseException: whatever it raises, or strikes this thread meanwhile.
        """
        self.has_asked = True
        return self.wait(function)

    def wait(self, function: Function[T]) -> T:
        """Make a call that only waits, and wait for it.

        Raises:
            BaseException: as :meth:`ask`.
        """
        return LOOP_THREAD.call(function, interrupted=self._hold if self.has_asked else None)

    def tell(self, function: Callable[[], T]) -> T:
        """Make a call that commands and does not wait. Listeners may do so, too.

        Raises:
            Exception: whatever it raises.
        """
        self.has_asked = True
        return self.look(function)

    def look(self, function: Callable[[], T]) -> T:
        """Make a call that neither commands nor waits.

        Raises:
            Exception: whatever it raises.
        """
        if LOOP_THREAD.is_here:
            return function()

        async def call() -> T:
            return function()

        return self.wait(call)

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
        try:
            self.hand.is_activated  # noqa: B018  # asked for what it raises
        except NotStartedError:
            return False
        except RobotiqError:
            return True
        return True

    def after_fork(self) -> None:
        """This is the child; a hand that ran goes on in the parent."""
        self._is_left_behind = self._is_left_behind or self.is_running

    async def _hold(self) -> None:
        """Let nothing move after Ctrl-C. A grip stays. A release goes on: it frees what may be trapped."""
        with contextlib.suppress(RobotiqError):
            if self.hand.state in (State.DO_ACTIVATION, State.WF_ACTIVATION):
                await self.hand.halt()
            else:
                await self.hand.hold()


_CALLERS: Final[weakref.WeakSet[Caller]] = weakref.WeakSet()


def _stop_all() -> None:
    """The program ends: what it has set going must not go on."""
    running = [each for each in list(_CALLERS) if each.is_running]
    for each in running:
        log.warning("%s: not stopped before the program ends; it is now", each.hand.address)

    async def stop() -> None:
        await asyncio.gather(
            *(each.hand.stop(halt=each.has_asked) for each in running), return_exceptions=True
        )

    if running and LOOP_THREAD.is_running:
        with contextlib.suppress(LateError):
            LOOP_THREAD.call(stop, limit=EXIT_S)


def _after_fork() -> None:
    LOOP_THREAD.forget()
    for each in list(_CALLERS):
        each.after_fork()


# Threads that are daemons still run then: it comes before the interpreter ends.
atexit.register(_stop_all)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)
