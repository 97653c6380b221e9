"""BodyMechanism: the bodies of a physics as its gripper and the servers of that use them."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from ..physics.driven_axis import PhysicsError
from .stepper import OrderedDrive, Stepper

if TYPE_CHECKING:
    from robotiq_async.values.enums import Finger
    from robotiq_async.values.model import Model

    from ..physics.bodies import Bodies
    from ..physics.driven_axis import Drive
    from .scene import Scene
    from .world import World

_TIME_ROUNDING_S: Final = 1e-9


class BodyMechanism:
    """A world, and the thread that steps it, if there is one.

    Attributes:
        lock: held by those who look at the world or change it, because the thread steps it.
    """

    def __init__(self, scene: Scene, *, threaded: bool) -> None:
        self.lock: threading.Lock = threading.Lock()
        self._scene = scene
        self._threaded = threaded
        self._stepper: Stepper | None = None
        self._users = 0
        """The number of users that have started the thread and not stopped it."""
        self._was_stopped = False
        self._world: World | None = None
        self._seen = 0
        self._until = 0.0

    def attach(self, model: Model, clock: Callable[[], float], speedup: float) -> None:
        """Make the world for a gripper of this model; the world's time is the gripper's clock.

        Raises:
            ImportError: MuJoCo is not installed.
            RuntimeError: it has a gripper already.
            ValueError: the file of the scene is not one.
        """
        from .world import World  # noqa: PLC0415  # MuJoCo takes a quarter of a second

        if self._world is not None:
            raise RuntimeError("this physics has a gripper already: make one for each")
        self._world = World(model, self._scene)
        if self._threaded:
            self._stepper = Stepper(self._world, self.lock, clock, speedup)
            weakref.finalize(self, self._stepper.end).atexit = False

    # -- the thread --------------------------------------------------------------------------------------

    @property
    def threaded(self) -> bool:
        """Whether a thread steps it."""
        return self._threaded

    def start(self) -> None:
        """Let the thread step the bodies; without ``threaded`` they move when the gripper is read.

        It has its gripper by then. Each start needs its :meth:`stop`.
        """
        if self._stepper is not None:
            self._users += 1
            self._stepper.start()

    def stop(self) -> None:
        """End the thread when its last user stops, and wait for its end: for one step at most."""
        self._users = max(self._users - 1, 0)
        if self._stepper is not None and not self._users:
            self._was_stopped = True
            self._stepper.stop()

    def end(self) -> None:
        """End the thread for all its users."""
        self._users = 0
        self.stop()

    # -- the bodies --------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """The time it has reached, in simulated seconds."""
        return self.world.time if self._stepper is None else self._until

    def drive(self, axis: Finger) -> Drive:
        """The motor of an axis."""
        drive = self.world.drives[axis]
        return drive if self._stepper is None else OrderedDrive(drive, self._stepper.orders)

    def step(self, until: float) -> bool:
        """Make one step if it is due; return whether it was made.

        A thread makes its steps by itself: then return whether it has made any since the last call.
        """
        world = self.world
        if self._stepper is not None:
            if not self._was_stopped:
                self._stepper.start()
            self._until, before, self._seen = until, self._seen, self._stepper.steps
            return self._seen != before
        if world.time + world.step_s > until + _TIME_ROUNDING_S:
            return False
        try:
            world.step(until)
        except Exception as error:
            world.fail(error)
            raise _standing_still(error) from error
        return True

    def bodies(self) -> Bodies:
        """Places of joints and parts; with a thread, after its last steps: it does not wait for the next."""
        return self.world.told(self.world.look() if self._stepper is None else self._stepper.seen)

    @property
    def world(self) -> World:
        """The world of its gripper.

        Raises:
            RuntimeError: it has no gripper yet.
            PhysicsError: an error has ended the world.
        """
        world = self._world
        if world is None:
            raise RuntimeError("physics has no gripper yet")
        if world.failure is not None:
            raise _standing_still(world.failure) from world.failure
        return world


def _standing_still(error: Exception) -> PhysicsError:
    return PhysicsError(f"the bodies stand still: {error}")
