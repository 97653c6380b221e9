"""Waits of callers: futures for a state, and the end of a wait for an activation without progress."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Final, Self

from ..control.state_machine import StateMachine
from ..runtime.limit import Limit
from ..runtime.logger import Log
from ..values.checks import repr_of
from ..values.enums import Severity, State
from ..values.errors import RobotiqError, StateTimeoutError
from ..values.registers import Registers
from ..values.states import RUNNING
from ..values.status import RobotiqStatus
from .streams import Listeners

STALLED_S: Final = 5.0
"""A gripper that waits for its activation (gFLT 0x05 to 0x07), has not begun it (gIMC = 0) or releases, and
shows nothing new for this time while the event loop runs, makes no progress. While it moves, its currents
and positions change. No figure is published."""
TOLD_EVERY_S: Final = 4.0  # an activation may take half a minute on a real gripper
ACTIVATING: Final = frozenset({State.DO_ACTIVATION, State.WF_ACTIVATION})
_StateWaiter = tuple[Collection[State], Mapping[State, Callable[[], RobotiqError]], asyncio.Future[State]]


def check_states(states: Collection[object]) -> None:
    """Raise ValueError for no state, and TypeError for anything but a State."""
    if not states:
        raise ValueError("states must name at least one State, got none")
    for state in states:
        if not isinstance(state, State):
            raise TypeError(f"states must be State members, got {repr_of(state)}")


class StateWaiters:
    """Wakes callers for the states that they wait for, also for a state that lasts only a moment."""

    def __init__(self) -> None:
        self._waiters: list[_StateWaiter] = []

    @contextmanager
    def watching(
        self, states: Collection[State], failing: Mapping[State, Callable[[], RobotiqError]]
    ) -> Iterator[asyncio.Future[State]]:
        """Yield a future for the first of some states from now on."""
        reached: asyncio.Future[State] = asyncio.get_running_loop().create_future()
        waiter = (states, failing, reached)
        self._waiters.append(waiter)
        try:
            yield reached
        finally:
            self._waiters.remove(waiter)
            if reached.done() and not reached.cancelled():
                reached.exception()  # retrieved: the caller may have been cancelled, and asyncio would log it

    def reached(self, state: State) -> None:
        """Wake the callers that wait for a state."""
        if (wake := self.woken_by(state)) is not None:
            wake()

    def woken_by(self, state: State) -> Callable[[], None] | None:
        """Make the function that wakes the present waiters for a state; None if nobody waits for it."""
        waiting = [each for each in self._waiters if state in each[0] or state in each[1]]
        if not waiting:
            return None  # a control loop goes to RUNNING_CC and back with every command

        def wake() -> None:
            for states, failing, future in waiting:
                if future.done():
                    continue
                if state in states:
                    future.set_result(state)
                else:
                    future.set_exception(failing[state]())

        return wake

    @staticmethod
    def late(what: str, seconds: float | None, state: State) -> StateTimeoutError:
        """The error of a wait that took longer than some seconds; ``state`` is the present one."""
        assert seconds is not None, "a wait without a limit is never late"
        return StateTimeoutError(f"{what} within {seconds:g} s (now {state.name})")

    def fail(self, failure: Callable[[], RobotiqError]) -> None:
        for _, _, future in self._waiters:
            if not future.done():
                future.set_exception(failure())


class StallWatch:
    """A context manager that follows the statuses, and cancels a wait when they stop changing.

    During an activation this needs a priority fault, with which the gripper waits for the activation, or
    gIMC = 0; without them a gripper may activate and show nothing new. A release always shows: it opens the
    fingers.
    """

    def __init__(self, listeners: Listeners, machine: StateMachine) -> None:
        self._listeners = listeners
        self._machine = machine
        self._limit = Limit()
        self._shown: Registers | None = None
        self._remove: Callable[[], None] = lambda: None

    def __enter__(self) -> Self:
        self._remove = self._listeners.add(self._see)
        return self

    def __exit__(self, *_: object) -> None:
        self._remove()
        self._limit.stop()

    def ends_early(self) -> Limit:
        """A block that ends at a stall."""
        return self._limit

    def _see(self, item: object) -> None:
        if not isinstance(item, RobotiqStatus):
            return
        state, has_begun = self._machine.state, not item.is_reset
        is_at_work = has_begun and item.fault.severity is not Severity.PRIORITY
        waits = state is State.WF_ATR or (state is State.WF_ACTIVATION and not is_at_work)
        first, fault, *middle, last = item.registers
        shown = (first, fault & 0x0FFF, *middle, last >> 8)  # without the reserved bits
        if not waits or shown != self._shown:
            self._shown = shown
            self._limit.restart(STALLED_S if waits else None)


class ActivationProgress:
    """Logs how long an activation has taken so far, no matter which client began it."""

    def __init__(self, loop: asyncio.AbstractEventLoop, log: Log) -> None:
        self._loop = loop
        self._log = log
        self._since = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def reached(self, state: State) -> None:
        if state in ACTIVATING:
            if self._timer is None:
                self._since = self._loop.time()
                self._wait()
        elif self._timer is not None:
            self._timer.cancel()
            self._timer = None
            if state in RUNNING:
                self._log.info("activated in %.1f s", self._loop.time() - self._since)

    def _wait(self) -> None:
        self._timer = self._loop.call_later(TOLD_EVERY_S, self._tell)

    def _tell(self) -> None:
        self._log.info("activating, %.0f s so far", self._loop.time() - self._since)
        self._wait()
