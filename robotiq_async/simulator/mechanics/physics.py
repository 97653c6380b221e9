"""Physics: bodies and contacts behind a simulated gripper, stepped by its user or in a thread of its own.

A gripper with a thread stands in an event loop, which waits for nothing here. It reads single numbers that
the thread leaves behind, and gives orders that the thread takes up before its next step. MuJoCo lets go of
Python's lock in a step; what the thread does in Python takes some ten microseconds of each.
"""

from __future__ import annotations

import threading
import time
import weakref
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Final

from robotiq_async.values.enums import ObjectStatus

from .scene import parse_scene

if TYPE_CHECKING:
    from robotiq_async.values.enums import Finger
    from robotiq_async.values.model import Model

    from ..physics.bodies import Bodies
    from ..physics.driven_axis import Drive
    from .world import World

_WAKES_S: Final = 0.004
_LATE_S: Final = 0.1
"""Behind the clock by so much, it lets simulated time go rather than hurry after it."""
_SLACK: Final = 1e-9


class Physics:
    """Motion of a gripper and of the parts before it, by MuJoCo (extra ``physics``).

    Hand it to one :class:`SimulatedGripper`. Registers, habits, troubles and timing are the gripper's own;
    motions and contacts come from bodies. Without ``threaded`` every read of the gripper makes the steps that
    are due: the same clock gives the same result to the last bit. With it a thread steps in real time, and a
    read only takes the present state: for servers, as their event loop must not wait.

    Nothing of the bodies was measured on a gripper: ``tools/description`` has the source of each dimension.
    """

    def __init__(
        self,
        scene: str = "table",
        *,
        threaded: bool = False,
    ) -> None:
        """Describe a world, which is made when it gets its gripper.

        Args:
            scene: ``table``; a part on it, ``box:40x60x80,0.3``, ``cylinder:50x90,0.2``, ``rod:40x120,0.2``
                or ``sphere:60,0.1`` in millimetres and kilograms; with ``@100`` the part is held 100 mm
                from the mounting face until the gripper holds it; or the path of an MJCF with a site
                ``gripper``.
            threaded: whether a thread steps it. It keeps to the gripper's speedup where the machine can.

        Raises:
            ValueError: the scene is none of these.
        """
        self._scene = parse_scene(scene)
        self._threaded = threaded
        self._run: _Run | None = None
        self._lock = threading.Lock()
        self._world: World | None = None
        self._seen = 0
        self._until = 0.0

    def attach(self, model: Model, clock: Callable[[], float], speedup: float) -> None:
        """Make the world, for a gripper of this model, and let it run by its clock.

        Raises:
            ImportError: MuJoCo is not installed.
            RuntimeError: it has a gripper already.
            ValueError: the file of the scene is not one.
        """
        from .world import World  # noqa: PLC0415  # MuJoCo takes a quarter of a second

        if self._world is not None:
            raise RuntimeError("physics has a gripper already: make one for each")
        self._world = World(model, self._scene)
        if self._threaded:
            self._run = _Run(self._world, self._lock, clock, speedup)
            threading.Thread(
                target=self._run.while_wanted,
                args=(weakref.ref(self),),
                name="robotiq_async physics",
                daemon=True,
            ).start()

    @property
    def time(self) -> float:
        """The time it has reached, in simulated seconds."""
        return self._made.time if self._run is None else self._until

    def drive(self, axis: Finger) -> Drive:
        """The motor of an axis, for the gripper that it moves."""
        drive = self._made.drives[axis]
        return drive if self._run is None else OrderedDrive(drive, self._run.orders)

    def step(self, until: float) -> bool:
        """Make one step, or see whether the thread has; for the gripper that it moves."""
        if self._run is not None:
            self._until, before, self._seen = until, self._seen, self._run.steps
            return self._seen != before
        if self._made.time + self._made.step_s > until + _SLACK:
            return False
        self._made.step()
        return True

    def bodies(self) -> Bodies:
        """Places of joints and parts; with a thread, after its last steps: it does not wait for the next."""
        return self._made.told(self._made.look() if self._run is None else self._run.seen)

    # -- changes to the scene ----------------------------------------------------------------------------

    def lift(self, millimetres: float) -> None:
        """Raise the gripper to a height above its first place, at 100 mm/s; not in a scene of your own."""
        with self._lock:
            self._made.lift(millimetres)

    def take_away(self) -> None:
        """Take the parts away, out of the fingers too."""
        with self._lock:
            self._made.take_away()

    def put_back(self) -> None:
        """Put the parts back to their first places."""
        with self._lock:
            self._made.put_back()

    @property
    def part(self) -> tuple[float, float, float] | None:
        """The middle of the part in millimetres, z above the table; None without a part."""
        with self._lock:
            return self._made.part()

    @property
    def grip_force(self) -> float:
        """The largest force of a pad on its contacts, in newtons."""
        with self._lock:
            return self._made.grip_force()

    @property
    def opening_mm(self) -> float:
        """Distance between the faces of the first two pads, in millimetres."""
        with self._lock:
            return self._made.opening_mm()

    @property
    def _made(self) -> World:
        if self._world is None:
            raise RuntimeError("physics has no gripper yet")
        return self._world


class OrderedDrive:
    """The motor of an axis, for a gripper in another thread than the world: neither waits for the other.

    An order is taken up before the next step. Until then the motor counts as in motion, for what it tells is
    about the goal before.

    Attributes:
        taken: how many orders the thread of the world has taken up.
    """

    def __init__(self, drive: Drive, orders: deque[Callable[[], None]]) -> None:
        self.taken = 0
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

    def go(self, target: float, rate: float, force: int, *, clears: bool) -> None:
        self._order(partial(self._drive.go, target, rate, force, clears=clears))

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


class _Run:
    """Steps a world in real time, in a thread.

    Attributes:
        steps: number of steps it has made.
        seen: places of joints and parts after them.
        orders: changes that are due before the next step.
    """

    def __init__(
        self, world: World, lock: threading.Lock, clock: Callable[[], float], speedup: float
    ) -> None:
        self.steps = 0
        self.seen = world.look()
        self.orders: deque[Callable[[], None]] = deque()
        self._world = world
        self._lock = lock
        self._clock = clock
        self._speedup = speedup

    def while_wanted(self, owner: weakref.ref[Physics]) -> None:
        """Run until the physics has no owner any more."""
        began, let_go = self._clock(), 0.0
        while owner() is not None:
            let_go += self._catch_up((self._clock() - began) * self._speedup - let_go)
            self.seen = self._world.look()
            time.sleep(_WAKES_S)

    def _catch_up(self, due: float) -> float:
        """Make the steps that are due; return the seconds that were let go."""
        late = max(due - self._world.time - _LATE_S * self._speedup, 0.0)
        due -= late
        while self._world.time + self._world.step_s <= due:
            while self.orders:
                self.orders.popleft()()
            with self._lock:
                self._world.step()
            self.steps += 1
        return late
