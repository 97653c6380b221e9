"""Physics: bodies and contacts behind a simulated gripper, stepped by its user or in a separate thread."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Self

from robotiq_async.values.checks import check_number

from .mechanism import BodyMechanism
from .scene import parse_scene

if TYPE_CHECKING:
    from ..physics.bodies import Bodies

_HIGHEST_MM: Final = 1000.0


class Physics:
    """Motion of a gripper and of the parts before it, by MuJoCo (extra ``physics``).

    Hand it to one :class:`SimulatedGripper`. Registers, habits, troubles and timing are the gripper's own;
    motions and contacts come from bodies. Without ``threaded`` every read of the gripper makes the steps that
    are due: the same clock gives the same result to the last bit. With it a thread steps in real time, and a
    read only takes the present state: for servers, as their event loop must not wait.

    The thread begins with the first read or write of the gripper, and ends with a ``with`` block of the
    physics. A server starts it and stops it with itself, and so does a hand with a ``sim://`` address.
    Without the thread bodies stand still.

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
        self._mechanism = BodyMechanism(parse_scene(scene), threaded=threaded)

    def __enter__(self) -> Self:
        """Let it have its thread during a block, which ends it."""
        return self

    def __exit__(self, *_: object) -> None:
        self._mechanism.end()

    @property
    def time(self) -> float:
        """The time it has reached, in simulated seconds."""
        return self._mechanism.time

    def bodies(self) -> Bodies:
        """Places of joints and parts; with a thread, after its last steps: it does not wait for the next."""
        return self._mechanism.bodies()

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
        with self._mechanism.lock:
            self._mechanism.world.lift(height)

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
        with self._mechanism.lock:
            self._mechanism.world.control(actuator, value)

    def joint(self, name: str) -> float:
        """The place of a hinge or slide of the scene's file, in radians or metres.

        Raises:
            ValueError: the file has none of this name.
            RuntimeError: the scene is not a file.
        """
        with self._mechanism.lock:
            return self._mechanism.world.joint(name)

    def take_away(self) -> None:
        """Take the parts away, out of the fingers too."""
        with self._mechanism.lock:
            self._mechanism.world.take_away()

    def put_back(self) -> None:
        """Put the parts back to their first places."""
        with self._mechanism.lock:
            self._mechanism.world.put_back()

    @property
    def part(self) -> tuple[float, float, float] | None:
        """The middle of the part in millimetres, z above the table; None without a part."""
        with self._mechanism.lock:
            return self._mechanism.world.part()

    @property
    def grip_force(self) -> float:
        """The force of the finger that presses most, in newtons: see :attr:`forces`. 0 without a contact."""
        with self._mechanism.lock:
            forces, palm = self._mechanism.world.forces(), self._mechanism.world.root
        return max((force for link, force in forces.items() if link != palm), default=0.0)

    @property
    def forces(self) -> dict[str, float]:
        """The force of each finger and of the palm on the bodies that it touches, in newtons.

        Each is the sum of the normal forces at all contacts: of pads, phalanges and cranks. The names are the
        links that hang on the root link, and the root link for the palm. Without a touch there is no entry.
        """
        with self._mechanism.lock:
            return self._mechanism.world.forces()

    @property
    def opening_mm(self) -> float:
        """Distance between the faces of the pads in millimetres.

        Of a 3-Finger, from the pad of A to the middle between the pads of B and C. Between tips that are not
        at one height it is too large.
        """
        with self._mechanism.lock:
            return self._mechanism.world.opening_mm()
