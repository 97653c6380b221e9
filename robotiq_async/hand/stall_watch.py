"""Notices a gripper that waits for its activation and gets nowhere, as after an emergency stop."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Self

import anyio

from ..control.state_machine import StateMachine
from ..enums import Severity, State
from ..session.listeners import Listeners
from ..wire.registers import Registers
from ..wire.status import RobotiqStatus


class StallWatch:
    """Listens to statuses while it is entered, and ends a wait when nothing new has shown for some time.

    The fault must be a priority code: an action waits for an activation that does not go on. Without one a
    gripper may well activate, and show nothing of it.
    """

    def __init__(self, listeners: Listeners, machine: StateMachine, seconds: float) -> None:
        """Listen beside others to a hand in the state of a machine; so long nothing new makes a stall."""
        self._listeners = listeners
        self._machine = machine
        self._seconds = seconds
        self._shown: Registers | None = None
        self._since = 0.0
        self._scope: anyio.CancelScope | None = None
        self._remove: Callable[[], None] = lambda: None

    def __enter__(self) -> Self:
        """Begin to listen."""
        self._remove = self._listeners.add(self._see)
        return self

    def __exit__(self, *_: object) -> None:
        """End it."""
        self._remove()

    @contextmanager
    def ends_early(self) -> Iterator[anyio.CancelScope]:
        """A scope that is cancelled at a stall."""
        with anyio.CancelScope() as self._scope:
            yield self._scope
        self._scope = None

    def _see(self, item: object) -> None:
        if not isinstance(item, RobotiqStatus):
            return
        waits = self._machine.state is State.WF_ACTIVATION
        if not waits or item.fault.severity is not Severity.PRIORITY or item.registers != self._shown:
            self._shown, self._since = item.registers, item.timestamp
        elif item.timestamp - self._since >= self._seconds and self._scope is not None:
            self._scope.cancel()
