"""Callers that wait for a state."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager

from ..values.enums import State
from ..values.errors import RobotiqError

_Waiter = tuple[Collection[State], Mapping[State, Callable[[], RobotiqError]], asyncio.Future[State]]


def check_states(states: Collection[object]) -> None:
    """Refuse what cannot be waited for.

    Raises:
        TypeError: not a State.
        ValueError: no state.
    """
    if not states:
        raise ValueError("states must name at least one State, got none")
    for state in states:
        if not isinstance(state, State):
            raise TypeError(f"states must be State members, got {state!r}")


class StateWaiters:
    """Tells callers of the states they wait for, however short these last."""

    def __init__(self) -> None:
        """Begin with nobody waiting."""
        self._waiters: list[_Waiter] = []

    @contextmanager
    def watching(
        self, states: Collection[State], failing: Mapping[State, Callable[[], RobotiqError]]
    ) -> Iterator[asyncio.Future[State]]:
        """Watch from here on: a future that is done with one of the states, or fails with an error.

        Args:
            states: what is waited for.
            failing: states that mean it will not come, each with the error that says so.
        """
        reached: asyncio.Future[State] = asyncio.get_running_loop().create_future()
        waiter = (states, failing, reached)
        self._waiters.append(waiter)
        try:
            yield reached
        finally:
            self._waiters.remove(waiter)
            if reached.done() and not reached.cancelled():
                reached.exception()  # it counts as seen, also when the caller was cancelled meanwhile

    def reached(self, state: State) -> None:
        """The hand is in a state."""
        for states, failing, future in self._waiters:
            if future.done():
                continue
            if state in states:
                future.set_result(state)
            elif state in failing:
                future.set_exception(failing[state]())

    def fail(self, failure: Callable[[], RobotiqError]) -> None:
        """Nothing more will happen."""
        for _, _, future in self._waiters:
            if not future.done():
                future.set_exception(failure())
