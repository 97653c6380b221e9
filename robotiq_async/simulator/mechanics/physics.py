"""Physics: bodies and contacts behind a simulated gripper, stepped by its user or in a separate thread."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING, Final, Self

from robotiq_async.values.checks import check_number

from ..physics.driven_axis import PhysicsError
from .scene import parse_scene
from .stepper import OrderedDrive, Stepper

if TYPE_CHECKING:
    from robotiq_async.values.enums import Finger
    from robotiq_async.values.model import Model

    from ..physics.bodies import Bodies
    from ..physics.driven_axis import Drive
    from .world import World

_TIME_ROUNDING_S: Final = 1e-9
_HIGHEST_MM: Final = 1000.0


class Physics:
    """Motion of a gripper and of the parts before it, by MuJoCo (extra ``physics``).

    Hand it to one :class:`SimulatedGripper`. Registers, habits, troubles and timing are the gripper's own;
    motions and contacts come from bodies. Without ``threaded`` every read of the gripper makes the steps that
    are due: the same clock gives the same result to the last bit. With it a thread steps in real time, and a
    read only takes the present state: for servers, as their event loop must not wait.

    The thread begins with the first read or write of the gripper, or with :meth:`start`, and ends with
    :meth:`stop` or a ``with`` block of the physics. A server starts it and stops it with itself, and so does
    a hand with a ``sim://`` address. Without the thread bodies stand still.

    After an error in the bodies every call raises :class:`PhysicsError`, reads of the gripper too.

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
        self._stepper: Stepper | None = None
        self._users = 0
        """The number of users that have started the thread and not stopped it."""
        self._was_stopped = False
        self._lock = threading.Lock()
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
            self._stepper = Stepper(self._world, self._lock, clock, speedup)
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

    def __enter__(self) -> Self:
        """Let it have its thread during a block, which ends it."""
        return self

    def __exit__(self, *_: object) -> None:
        self._users = 0
        self.stop()

    # -- for the gripper that it moves -------------------------------------------------------------------

    @property
    def time(self) -> float:
        """The time it has reached, in simulated seconds."""
        return self._made.time if self._stepper is None else self._until

    def drive(self, axis: Finger) -> Drive:
        """The motor of an axis, for the gripper that it moves."""
        drive = self._made.drives[axis]
        return drive if self._stepper is None else OrderedDrive(drive, self._stepper.orders)

    def step(self, until: float) -> bool:
        """Make one step, or see whether the thread has; for the gripper that it moves."""
        world = self._made
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
        return self._made.told(self._made.look() if self._stepper is None else self._stepper.seen)

    # -- changes to the scene ----------------------------------------------------------------------------

    def lift(self, millimetres: float) -> None:
        """Raise the gripper to a height above its first place, at 100 mm/s.

        Args:
            millimetres: 0..1000.

        Raises:
            TypeError: not a number.
            ValueError: outside 0..1000.
            RuntimeError: the scene is a file: the gripper is mounted where its site is.
        """
        height = check_number("millimetres", millimetres, 0, _HIGHEST_MM)
        with self._lock:
            self._made.lift(height)

    def control(self, actuator: str, value: float) -> None:
        """Set the control of an actuator in the scene's file, as of an arm that carries the gripper.

        Args:
            actuator: its name in the file.
            value: in its own unit, within its range.

        Raises:
            TypeError: not a number.
            ValueError: the file has no actuator of this name, or the value is outside of its range.
            RuntimeError: the scene is not a file.
        """
        with self._lock:
            self._made.control(actuator, value)

    def joint(self, name: str) -> float:
        """The place of a hinge or slide of the scene's file, in radians or metres.

        Raises:
            ValueError: the file has none of this name.
            RuntimeError: the scene is not a file.
        """
        with self._lock:
            return self._made.joint(name)

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
        """The force of the finger that presses most, in newtons: see :attr:`forces`. 0 without a contact."""
        with self._lock:
            forces, palm = self._made.forces(), self._made.root
        return max((force for link, force in forces.items() if link != palm), default=0.0)

    @property
    def forces(self) -> dict[str, float]:
        """The force of each finger and of the palm on the bodies that it touches, in newtons.

        Each is the sum of the normal forces at all contacts: of pads, phalanges and cranks. The names are the
        links that hang on the root link, and the root link for the palm. Without a touch there is no entry.
        """
        with self._lock:
            return self._made.forces()

    @property
    def opening_mm(self) -> float:
        """Distance between the faces of the pads in millimetres.

        Of a 3-Finger, from the pad of A to the middle between the pads of B and C. Between tips that are not
        at one height it is too large.
        """
        with self._lock:
            return self._made.opening_mm()

    @property
    def _made(self) -> World:
        world = self._world
        if world is None:
            raise RuntimeError("physics has no gripper yet")
        if world.failure is not None:
            raise _standing_still(world.failure) from world.failure
        return world


def _standing_still(error: Exception) -> PhysicsError:
    return PhysicsError(f"the bodies stand still: {error}")
