"""Futures for callers that wait for a state."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager

from ..values.enums import State
from ..values.errors import RobotiqError

_Waiter = tuple[Collection[State], Mapping[State, Callable[[], RobotiqError]], asyncio.Future[State]]


def check_states(states: Collection[object]) -> None:
    """Raise ValueError for no state, and TypeError for anything but a State."""
    if not states:
        raise ValueError("states must name at least one State, got none")
    for state in states:
        if not isinstance(state, State):
            raise TypeError(f"states must be State members, got {state!r}")


class StateWaiters:
    """Wakes callers for the states that they wait for, however short these last."""

    def __init__(self) -> None:
        self._waiters: list[_Waiter] = []

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
        for states, failing, future in self._waiters:
            if future.done():
                continue
            if state in states:
                future.set_result(state)
            elif state in failing:
                future.set_exception(failing[state]())

    def fail(self, failure: Callable[[], RobotiqError]) -> None:
        for _, _, future in self._waiters:
            if not future.done():
                future.set_exception(failure())
