"""Watches of the soak run: the loop, the statuses, and the writes."""

from __future__ import annotations

import asyncio
import gc
import selectors
import time
from collections import deque
from collections.abc import Iterator

from robotiq_async.values.model import Model
from robotiq_async.values.request import AxisRequest, Request
from tests.adversity.world import LONGEST_HOLD_S, UrcapServer, World
from tests.virtual import HoldWatch, VirtualClock, VirtualLoop


class _WatchedSelector(selectors.DefaultSelector):
    """Reports to a watch the time between two waits of the loop."""

    def __init__(self, hold: HoldWatch) -> None:
        super().__init__()
        self._hold = hold

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        self._hold.turn()
        events = super().select(timeout)
        self._hold.begin()
        return events


class LoopWatch:
    """Makes the loop, and knows for how long it was held and by whom."""

    def __init__(self) -> None:
        self.hold = HoldWatch()
        self._deliberate = 0.0

    @property
    def now(self) -> float:
        """The time, in seconds."""
        return time.monotonic()

    def make_loop(self) -> asyncio.AbstractEventLoop:
        return asyncio.SelectorEventLoop(_WatchedSelector(self.hold))

    def hold_up(self, seconds: float) -> None:
        """Block the loop on purpose, as an application does."""
        self.hold.turn()
        time.sleep(seconds)
        self._deliberate += seconds
        self.hold.begin()  # this one is not the library's

    @property
    def lost(self) -> float:
        """Seconds that the application and other processes have taken so far."""
        return self._deliberate + self.hold.waiting()


class VirtualLoopWatch(LoopWatch):
    """The same of a loop in virtual time: there no one else takes any."""

    _loop: VirtualLoop

    @property
    def now(self) -> float:
        return self._loop.time()

    def make_loop(self) -> asyncio.AbstractEventLoop:
        clock = VirtualClock()
        clock.hold = self.hold
        self._loop = VirtualLoop(clock)
        return self._loop

    def hold_up(self, seconds: float) -> None:
        self._loop.hold_up(seconds)
        self._deliberate += seconds

    @property
    def lost(self) -> float:
        return self._deliberate


class WriteWatch:
    """Knows a replay when it sees one.

    Every command of the soak carries speeds and forces of its own, so the request for an axis (position,
    speed, force) never comes back once it was followed by something else.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        self._past: list[set[AxisRequest]] = []
        self._number = 0
        self._newest: deque[str] = deque(maxlen=20)
        self.forget()

    def next_settings(self) -> tuple[int, int]:
        """A speed and a force that no recent command had."""
        self._number += 1
        return self._number % 256, self._number // 256 % 256

    def forget(self) -> None:
        """Another client has written, or everything is at rest: begin again."""
        self._past = [set() for _ in self._model.axes]
        self._last: list[AxisRequest | None] = [None] * len(self._model.axes)

    def check(self, world: World) -> Iterator[str]:
        """The errors of the writes since the last look."""
        images, world.gripper.images = world.gripper.images, []
        for written in images:
            image = Request.from_registers(written.registers, self._model)
            asked = [(each.position, each.speed, each.force) for each in image.axes]
            places = f"at {written.positions}, shown at {written.shown}"
            self._newest.append(f"{written.time:.4f} go={image.go:d} {asked} {places}")
            if not image.go:
                # No request moves an axis; and the next one must not be the one that was halted.
                self._last = [None] * len(self._model.axes)
                continue
            for at, request in enumerate(image.axes):
                if request == self._last[at]:
                    continue
                # A request to stay is no motion, however often. Nor is a hold, which asks an axis to be where
                # it was last seen: while it sets off, that is where it stood, with the settings of its motion
                # if they were written before the position.
                position, shown = written.positions[at], written.shown[at]
                stays = self._model.has_reached(request.position, position) or request.position == shown
                if request in self._past[at] and not stays:
                    axis = self._model.axes[at]
                    yield f"{axis!r}, at {position}, was asked again for what it was before: {request}"
                    yield "\n".join(("after", *self._newest, world.server.told(written.time)))
                self._past[at].add(request)
                self._last[at] = request


def check(world: World, writes: WriteWatch, loop: LoopWatch) -> Iterator[str]:
    """Everything that was wrong since the last look."""
    loop.hold.turn()
    yield from writes.check(world)
    try:
        world.check_no_stale_status()
    except AssertionError as error:
        yield str(error)
    world.statuses.clear()
    world.states.clear()
    del world.gripper.stamps[:-300], world.server.heard[:-300]
    if isinstance(world.server, UrcapServer):
        del world.server.given[:-300]
    if loop.hold.longest > LONGEST_HOLD_S:
        yield f"the loop was held for {1000 * loop.hold.longest:.1f} ms"
        loop.hold.longest = 0.0
    gc.collect()
    loop.hold.begin()  # the time of this look is not the library's
