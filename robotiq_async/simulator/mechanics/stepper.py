"""Steps a world in real time, in a separate thread, for a gripper that stands in an event loop.

The loop waits for nothing here. It reads single numbers that the thread leaves behind, and gives orders that
the thread takes up before its next step. MuJoCo lets go of Python's lock in a step; the Python code of the
thread takes some ten microseconds of each.

An error ends the thread and stays in the world: the next call of :class:`Physics` raises it.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Final

from robotiq_async.values.enums import ObjectStatus

if TYPE_CHECKING:
    from ..physics.driven_axis import Drive, Way
    from .world import World

_WAKES_S: Final = 0.004
_STEPS_AT_ONCE: Final = 50
_MOST_BEHIND_S: Final = 0.1
"""Behind the clock by so much, it lets simulated time go rather than hurry after it."""


class Stepper:
    """A world and its thread.

    Attributes:
        steps: number of steps it has made.
        seen: places of joints and parts after them.
        orders: changes that are due before the next step.
    """

    def __init__(
        self, world: World, lock: threading.Lock, clock: Callable[[], float], speedup: float
    ) -> None:
        self.steps: int = 0
        self.seen = world.look()
        self.orders: deque[Callable[[], None]] = deque()
        self._world = world
        self._lock = lock
        self._clock = clock
        self._speedup = speedup
        self._ends = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to step; time that has passed without a thread is let go."""
        if self._thread is None:
            self._ends.clear()
            self._thread = threading.Thread(target=self._work, name="robotiq_async physics", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """End the thread, and wait for it: one step at most. Bodies stand still until it starts again."""
        self._ends.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
            self.seen = self._world.look()

    def end(self) -> None:
        """End the thread without waiting for it."""
        self._ends.set()

    def _work(self) -> None:
        world, let_go = self._world, 0.0
        due, began = world.time, self._clock() - world.time / self._speedup
        try:
            while not self._ends.wait(_WAKES_S if world.time + world.step_s > due else 0):
                due = (self._clock() - began) * self._speedup - let_go
                late = max(due - world.time - _MOST_BEHIND_S * self._speedup, 0.0)
                let_go, due = let_go + late, due - late
                self._catch_up(due)
                self.seen = world.look()
        except Exception as error:  # noqa: BLE001  # raised by the next call
            self._world.fail(error)

    def _catch_up(self, due: float) -> None:
        """Make steps that are due, but not so many that readers would miss events between them."""
        for _ in range(_STEPS_AT_ONCE):
            if self._world.time + self._world.step_s > due or self._ends.is_set():
                return
            while self.orders:
                self.orders.popleft()()
            with self._lock:
                self._world.step(due)
            self.steps += 1


class OrderedDrive:
    """The motor of an axis, for a gripper in another thread than the world: neither waits for the other.

    An order is taken up before the next step. Until then the motor counts as in motion, because its report is
    about the goal before.

    Attributes:
        taken: how many orders the thread of the world has taken up.
    """

    def __init__(self, drive: Drive, orders: deque[Callable[[], None]]) -> None:
        self.taken: int = 0
        self._given = 0
        self._drive = drive
        self._orders = orders

    @property
    def position(self) -> float:
        return self._drive.position

    @property
    def travel(self) -> float:
        return self._drive.travel

    @property
    def outcome(self) -> ObjectStatus:
        return self._drive.outcome if self.taken == self._given else ObjectStatus.IN_MOTION

    @property
    def is_pressing(self) -> bool:
        return self.taken == self._given and self._drive.is_pressing

    def go(self, target: float, way: Way, force: int, *, clears: bool) -> None:
        self._order(partial(self._drive.go, target, way, force, clears=clears))

    def hold(self) -> None:
        self._order(self._drive.hold)

    def release(self) -> None:
        self._order(self._drive.release)

    def _order(self, what: Callable[[], None]) -> None:
        self._given += 1
        self._orders.append(partial(self._take_up, what))

    def _take_up(self, what: Callable[[], None]) -> None:
        what()
        self.taken += 1
