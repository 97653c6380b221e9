"""Makes the model that MuJoCo compiles: the packaged gripper above a table, or in a user's world."""

from __future__ import annotations

from importlib.resources import files
from math import cos, pi, sin
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import mujoco
import numpy as np

from .scene import Scene

if TYPE_CHECKING:
    from robotiq_async.values.model import Model

    from .scene import ScenePart

OURS: Final = "gripper/"
"""Before the names of all that belongs to the gripper."""
_TIMESTEP: Final = 0.002
_TIMESTEPS: Final = (0.0001, 0.004)
"""Timesteps that a user's world may have: with 10 ms no motion ends, with 20 ms a gripper flies apart."""
_NEEDED: Final = {
    "constraint": mujoco.mjtDisableBit.mjDSBL_CONSTRAINT,
    "equality": mujoco.mjtDisableBit.mjDSBL_EQUALITY,
    "limit": mujoco.mjtDisableBit.mjDSBL_LIMIT,
    "contact": mujoco.mjtDisableBit.mjDSBL_CONTACT,
    "actuation": mujoco.mjtDisableBit.mjDSBL_ACTUATION,
}
"""Flags that a file must not disable: no finger would move, or nothing would be met."""
_CLEARANCE: Final = 0.006
"""Distance in metres between the table and the lowest point that the fingertips reach."""
_FRICTION: Final = (0.6, 0.005, 0.0001)
_MOUNT: Final = (30_000.0, 1500.0)
"""Stiffness and damping of the mount."""


def packaged(model: Model) -> str:
    """The MJCF of a model."""
    name = f"robotiq_{model.name.replace('-', '_')}.xml"
    return (files("robotiq_async") / "data" / name).read_text(encoding="utf-8")


def above_table(text: str, reach: float, part: ScenePart | None) -> Any:
    """The gripper upside down above a table, on a mount that moves up, with a part between its fingers."""
    spec = mujoco.MjSpec()
    spec.option.timestep = _TIMESTEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10
    spec.visual.headlight.ambient = [0.5, 0.5, 0.5]
    spec.worldbody.add_geom(
        name="table",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0.5, 0.5, 0.1],
        friction=list(_FRICTION),
        rgba=[0.73, 0.76, 0.81, 1],
    )
    height = reach + _CLEARANCE
    if part is not None:
        _add_part(spec, part, height)
    mount = spec.worldbody.add_body(name="mount", pos=[0, 0, height])
    mount.add_joint(name="mount", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    mount.mass, mount.inertia, mount.explicitinertial = 1.0, [0.001] * 3, True
    frame = mount.add_frame(quat=[0, 1, 0, 0])
    spec.attach(mujoco.MjSpec.from_string(text), frame=frame, prefix=OURS)
    drive = spec.add_actuator(name="mount", target="mount", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    drive.set_to_position(kp=_MOUNT[0], kv=_MOUNT[1])
    return spec


def in_own_world(text: str, file: str) -> Any:
    """The gripper at the site ``gripper`` of a file.

    Raises:
        ValueError: there is no such file, MuJoCo cannot read it, it has no such site, it disables effects
            that a gripper needs, or its timestep is too long or too short.
    """
    if not Path(file).is_file():
        raise ValueError(f"physics: there is no file {file!r:.100}")
    try:
        spec = mujoco.MjSpec.from_file(file)
    except ValueError as error:
        raise ValueError(f"physics: MuJoCo cannot read {file!r:.100}: {_in_one_line(error)}") from error
    _check_fit(spec, file)
    gripper = mujoco.MjSpec.from_string(text)
    for option in ("timestep", "integrator", "cone", "impratio"):  # as the file has them, without a complaint
        setattr(gripper.option, option, getattr(spec.option, option))
    spec.attach(gripper, site="gripper", prefix=OURS)
    return spec


def _check_fit(spec: Any, file: str) -> None:
    """Refuse a world in which the gripper has no place, or would not work."""
    if not any(site.name == "gripper" for site in spec.sites):
        raise ValueError(f"physics: {file!r:.100} has no site named gripper, where the gripper is mounted")
    shortest, longest = _TIMESTEPS
    if not shortest <= spec.option.timestep <= longest:
        raise ValueError(
            f"physics: the timestep of {file!r:.100} must be in {shortest:g}..{longest:g} s, with which a"
            f" gripper is stable, got {spec.option.timestep:g}"
        )
    for what, flag in _NEEDED.items():
        if spec.option.disableflags & int(flag):
            raise ValueError(f"physics: {file!r:.100} disables {what}, without which a gripper does not grip")
    if spec.keys:  # MuJoCo would leave out one that is too short or too long, without a word
        places = compiled(spec.copy(), Scene(file=file)).nq
        for key in spec.keys:
            if len(key.qpos) not in (0, places):
                got = len(key.qpos)
                raise ValueError(f"physics: a keyframe of {file!r:.100} must have {places} qpos, got {got}")


def compiled(spec: Any, scene: Scene) -> Any:
    """The model of a world.

    Raises:
        ValueError: MuJoCo refuses it: a size that is not above 0, a moving body without a mass, a name twice.
    """
    try:
        return spec.compile()
    except ValueError as error:
        what = scene.part if scene.file is None else repr(scene.file)
        raise ValueError(f"physics: MuJoCo cannot make {what}: {_in_one_line(error)}") from error


def _in_one_line(error: ValueError) -> str:
    return " ".join(str(error).split())


def _add_part(spec: Any, part: ScenePart, height: float) -> None:
    size = [each / 1000 for each in part.size]
    middle = part.height / 2000 if part.at is None else height - part.at / 1000
    if middle <= 0:
        raise ValueError(
            f"physics: the table is {1000 * height:.0f} mm from the mounting face: no {part} at {part.at:g}"
        )
    body = spec.worldbody.add_body(name="part", pos=[0, 0, middle])
    body.add_freejoint(name="part")
    kinds = mujoco.mjtGeom
    shape: dict[str, Any] = {
        "box": {"type": kinds.mjGEOM_BOX, "size": [each / 2 for each in size]},
        "cylinder": {"type": kinds.mjGEOM_CYLINDER, "size": [size[0] / 2, size[-1] / 2, 0]},
        "rod": {
            "type": kinds.mjGEOM_CYLINDER,
            "size": [size[0] / 2, size[-1] / 2, 0],
            "quat": [cos(pi / 4), sin(pi / 4), 0, 0],
        },
        "sphere": {"type": kinds.mjGEOM_SPHERE, "size": [size[0] / 2, 0, 0]},
    }[part.kind]
    yellow = [0.95, 0.76, 0.19, 1]
    body.add_geom(name="part", mass=part.mass, friction=list(_FRICTION), rgba=yellow, **shape)
    if part.at is not None:
        weld = spec.add_equality(type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY)
        weld.name1, weld.name2 = "part", "world"
        weld.data = np.array([0] * 10 + [1, 0], dtype=float)  # at its present place
        # A hand gives way: the fingers may push the part into their middle.
        weld.solref = [-5000.0, -150.0]
