"""The bodies: a gripper above a table, or in a world of the user's own, in MuJoCo.

The gripper is the packaged MJCF. Over a table it points downwards, on a mount that :meth:`World.lift` raises.
One step is 2 ms, or as long as the user's file says. Nothing here knows a clock.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import inf, isnan
from typing import TYPE_CHECKING, Any, Final

from robotiq_async.runtime.extras import install

try:
    import mujoco
except ModuleNotFoundError as error:
    raise ImportError(f"physics needs mujoco: {install('physics')}") from error

import numpy as np

from robotiq_async.values.checks import check_number
from robotiq_async.values.enums import Finger

from .alone import levers_of, pads, put_at, reach
from .building import OURS, above_table, compiled, in_own_world, packaged
from .drive import MotorDrive
from .watch import Look, Watch, links_of, root_of

if TYPE_CHECKING:
    from robotiq_async.values.model import Model

    from ..physics.bodies import Bodies
    from .scene import Scene

_LIFTING: Final = 0.1
"""Speed of the mount, in m/s: slow for an arm."""
_INSIDE: Final = 0.0005
"""Depth in metres from which a part is in the gripper, and does not only touch it."""
_ROUNDING_SHARE: Final = 1e-6
"""Share of a step that rounding may take from a time."""
_OUT_OF_SIGHT_M: Final = 100.0
"""Height in metres of a part that was taken away."""


class World:
    """A gripper and its surroundings.

    Attributes:
        drives: the motor of each axis.
        time: simulated seconds since it was made.
        step_s: seconds of a step.
        root: the name of the gripper's root link.
        failure: the error that has ended it, if one has.
    """

    def __init__(self, model: Model, scene: Scene) -> None:
        text = packaged(model)
        if scene.file is None:
            spec = above_table(text, reach(text), scene.part)
        else:
            spec = in_own_world(text, scene.file)
        self._model: Any = compiled(spec, scene)
        self.failure: Exception | None = None
        self._data: Any = mujoco.MjData(self._model)
        # Views of MuJoCo's own numbers, as plain floats: each look at an attribute makes an array.
        self._controls, self._lengths = _floats(self._data.ctrl), _floats(self._data.actuator_length)
        self._limits = _floats(self._model.actuator_forcerange)
        is_ours = scene.file is None
        self._mount: int | None = self._model.actuator("mount").id if is_ours else None
        self._lifted = self._height = 0.0
        self._is_aside = self._is_taken = False
        if self._model.nkey:
            mujoco.mj_resetDataKeyframe(self._model, self._data, 0)
        self.drives: dict[Finger, MotorDrive] = {axis: self._drive(model, axis) for axis in model.axes}
        self._motors = tuple(self.drives.values())
        for drive in self._motors:
            put_at(self._model, self._data, [drive.index], drive.share)
        mujoco.mj_forward(self._model, self._data)
        if not (np.isfinite(self._data.qpos).all() and np.isfinite(self._data.qacc).all()):
            raise ValueError(f"physics: {scene.file!r:.100} has a place or a mass that is not finite")
        self.time: float = float(self._data.time)
        root = root_of(self._model)
        self.root: str = self._model.body(root).name.removeprefix(OURS)
        base = self._model.body_rootid[root]  # of a robot that drives about, perhaps
        self._parts = [
            joint
            for joint in range(self._model.njnt)
            if self._model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE
            and self._model.jnt_bodyid[joint] != base
        ]
        self._places = [self._place_of(joint) for joint in self._parts]
        bodies = {int(self._model.jnt_bodyid[joint]) for joint in self._parts}
        self._part_geoms = [
            geom
            for geom in range(self._model.ngeom)
            if self._model.body_rootid[self._model.geom_bodyid[geom]] in bodies
        ]
        self._watch = Watch(self._model, self._part_geoms)
        self._links = links_of(self._model, root)
        for body in self._jammed():
            what = f"a {scene.part}" if is_ours else f"the part {self._model.body(body).name!r}"
            raise ValueError(f"physics: there is no room for {what} between the open fingers")
        self._sleeps = is_ours and not self._parts
        """Whether nothing moves while the motors rest: no part, and not a user's world."""
        self._collides = self._model.geom_contype.copy(), self._model.geom_conaffinity.copy()
        welds = np.flatnonzero(self._model.eq_type == mujoco.mjtEq.mjEQ_WELD)
        self._hands: list[int] = [int(each) for each in welds] if is_ours else []
        """Supports that hold a part: constraints that end when the gripper holds it."""
        self.step_s: float = self._model.opt.timestep

    def fail(self, error: Exception) -> None:
        """Note the error that has ended it."""
        self.failure = error

    def step(self, until: float) -> None:
        """Let one step pass, or all that are due until a time while nothing moves."""
        motors, step_s = self._motors, self.step_s
        if self._sleeps and self._lifted == self._height and all(motor.is_still for motor in motors):
            self.time += int((until - self.time) / step_s + _ROUNDING_SHARE) * step_s
            self._data.time = self.time
            return
        if self._parts:
            self._set_aside(self._is_taken or any(motor.clears for motor in motors))
        self._command_motors()
        self._raise_mount()
        lengths = self._pass_step()
        for motor, length in zip(motors, lengths, strict=True):
            motor.see(length, step_s)
        if self._hands:
            fingers = [motor for axis, motor in self.drives.items() if axis is not Finger.SCISSOR]
            if all(motor.outcome.is_contact for motor in fingers):
                self._let_go()

    def _command_motors(self) -> None:
        for motor in self._motors:
            index = motor.index
            self._controls[index], limit = motor.command(self.step_s)
            self._limits[2 * index], self._limits[2 * index + 1] = -limit, limit

    def _raise_mount(self) -> None:
        if self._mount is not None and self._lifted != self._height:
            most = _LIFTING * self.step_s
            self._lifted += min(max(self._height - self._lifted, -most), most)
            self._controls[self._mount] = self._lifted

    def _pass_step(self) -> list[float]:
        """Let one step pass; the places of the motors after it."""
        mujoco.mj_step(self._model, self._data)
        before, self.time = self.time, self._data.time
        lengths = [self._lengths[motor.index] for motor in self._motors]
        # MuJoCo begins again at 0 with bodies that have become unstable, unless a file forbids it.
        if not self.time > before or any(map(isnan, lengths)):
            raise RuntimeError(
                f"they became unstable after {before:.3f} s (timestep {self.step_s:g} s): smaller steps,"
                " softer contacts or parts of a sensible size and mass help"
            )
        return lengths

    def lift(self, millimetres: float) -> None:
        """Begin to raise the gripper to so many millimetres above its first place."""
        if self._mount is None:
            raise RuntimeError(
                "physics: a gripper in a scene of a file is not lifted: it is where the site is"
            )
        self._height = millimetres / 1000

    def control(self, actuator: str, value: float) -> None:
        """Set the control of an actuator of the user's world."""
        model = self._model
        names = self._own(model.actuator(number).name for number in range(model.nu))
        if actuator not in names:
            raise ValueError(f"physics: actuator must be one of {names}, got {actuator!r:.100}")
        index = model.actuator(actuator).id
        low, high = model.actuator_ctrlrange[index] if model.actuator_ctrllimited[index] else (-inf, inf)
        self._controls[index] = check_number(f"the control of {actuator!r}", value, low, high)

    def joint(self, name: str) -> float:
        """The place of a hinge or slide of the user's world."""
        model = self._model
        single = np.flatnonzero(model.jnt_type >= int(mujoco.mjtJoint.mjJNT_SLIDE))  # or hinge
        names = self._own(model.joint(each).name for each in single)
        if name not in names:
            raise ValueError(f"physics: joint must be one of {names}, got {name!r:.100}")
        return float(self._data.joint(name).qpos[0])

    def _own(self, names: Iterable[str]) -> list[str]:
        """The names that come from the user's file."""
        if self._mount is not None:
            raise RuntimeError("physics: only a scene from a file has actuators and joints to set or read")
        return [name for name in names if name and not name.startswith(OURS)]

    def take_away(self) -> None:
        """Take the parts away, out of the fingers too."""
        self._is_taken = True

    def put_back(self) -> None:
        """Put the parts back to their first places."""
        self._is_taken = False
        self._put()

    def part(self) -> tuple[float, float, float] | None:
        """The middle of the first part in millimetres, with z upwards from the table; None for no part."""
        if not self._parts:
            return None
        at = self._model.jnt_qposadr[self._parts[0]]
        x, y, z = (1000 * float(each) for each in self._data.qpos[at : at + 3])
        return x, y, z

    def look(self) -> Look:
        """Copy where everything is: quick, for :meth:`told`."""
        return self._watch.look(self._data, is_aside=self._is_aside)

    def told(self, look: Look) -> Bodies:
        """Joints and parts as they were seen; for any thread."""
        return self._watch.told(look)

    def forces(self) -> dict[str, float]:
        """The sum of the normal forces at the contacts of each finger and of the palm, in newtons."""
        forces: dict[str, float] = {}
        found = np.zeros(6)
        for number in range(self._data.ncon):
            mujoco.mj_contactForce(self._model, self._data, number, found)
            for geom in self._data.contact[number].geom:
                link = self._links.get(int(self._model.geom_bodyid[geom]))
                if link is not None:
                    forces[link] = forces.get(link, 0.0) + float(found[0])
        return forces

    def opening_mm(self) -> float:
        """Distance between the faces of the pads; of a 3-Finger from A to the middle of the others."""
        *others, last = pads(self._model)
        places, sizes = self._data.geom_xpos, self._model.geom_size
        apart = np.linalg.norm(places[others].mean(axis=0) - places[last])
        return 1000 * float(apart - min(sizes[others[0]]) - min(sizes[last]))

    def _jammed(self) -> Iterator[int]:
        """Bodies of parts that reach into the gripper."""
        parts = set(self._part_geoms)
        for contact in self._data.contact:
            for geom, other in (contact.geom, contact.geom[::-1]):
                is_inside = contact.dist < -_INSIDE and int(self._model.geom_bodyid[other]) in self._links
                if is_inside and int(geom) in parts:
                    yield int(self._model.geom_bodyid[geom])

    def _place_of(self, joint: int) -> tuple[Any, Any, Any]:
        """Views of the place and of the speed of a part, and between them a copy of its first place."""
        at, speed = self._model.jnt_qposadr[joint], self._model.jnt_dofadr[joint]
        place = self._data.qpos[at : at + 7]
        return place, place.copy(), self._data.qvel[speed : speed + 6]

    def _put(self, z: float = 0.0) -> None:
        for place, first, speed in self._places:
            place[:] = first
            place[2] += z
            speed[:] = 0

    def _set_aside(self, aside: bool) -> None:
        # For an activation, or taken away: parts stay where they are put, and nothing meets them.
        if aside != self._is_aside:
            self._is_aside = aside
            contype, conaffinity = self._collides
            geoms = self._part_geoms
            self._model.geom_contype[geoms] = 0 if aside else contype[geoms]
            self._model.geom_conaffinity[geoms] = 0 if aside else conaffinity[geoms]
            if not aside:
                self._put()
        if aside:
            self._put(_OUT_OF_SIGHT_M if self._is_taken else 0.0)

    def _let_go(self) -> None:
        for each in self._hands:
            self._data.eq_active[each] = 0
        self._hands = []

    def _drive(self, model: Model, axis: Finger) -> MotorDrive:
        index = self._model.actuator(f"{OURS}{axis.name}").id
        self._model.actuator_ctrllimited[index] = 0  # a motor presses its axis against a stop
        levers = levers_of(packaged(model), axis)
        gain, damping = self._model.actuator_gainprm[index][0], -self._model.actuator_biasprm[index][2]
        return MotorDrive(model, axis, index, levers, (float(gain), float(damping)))


def _floats(array: Any) -> memoryview[float]:
    """All numbers of an array, one after the other."""
    return memoryview(array).cast("B").cast("d")
