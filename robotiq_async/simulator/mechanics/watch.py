"""Sees where the bodies of a world are.

A look copies some numbers, so that a thread can leave one behind after its steps; :meth:`Watch.told` turns
it, later and elsewhere, into :class:`Bodies`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

from ..physics.bodies import Bodies, Body, Vector
from .building import OURS

_GEOMETRIES: Final = {
    int(mujoco.mjtGeom.mjGEOM_BOX): ("box", (2.0, 2.0, 2.0)),
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): ("cylinder", (1.0, 2.0)),
    int(mujoco.mjtGeom.mjGEOM_SPHERE): ("sphere", (1.0,)),
}
"""The geoms that are reported, and by how much each of MuJoCo's sizes is too small. Others are left out."""


class Look(NamedTuple):
    """Copies of numbers: of the joints, of the root and of the geoms of parts."""

    joints: Any
    root: tuple[Any, Any]
    parts: tuple[Any, Any]
    is_aside: bool


class Watch:
    """Knows which numbers of a world belong to the gripper and to the parts."""

    def __init__(self, model: Any, parts: Sequence[int]) -> None:
        """``parts`` are the geoms of all parts."""
        joints = [number for number in range(model.njnt) if model.joint(number).name.startswith(OURS)]
        self._names = [model.joint(number).name.removeprefix(OURS) for number in joints]
        self._at = [int(model.jnt_qposadr[number]) for number in joints]
        self._root = root_of(model)
        self._geoms = [geom for geom in parts if int(model.geom_type[geom]) in _GEOMETRIES]
        self._shapes = [_shape(model, geom) for geom in self._geoms]

    def look(self, data: Any, *, is_aside: bool) -> Look:
        """Copy the places of everything as they are now."""
        root = data.xpos[self._root].copy(), data.xmat[self._root].copy()
        parts = data.geom_xpos[self._geoms], data.geom_xmat[self._geoms]
        return Look(data.qpos[self._at], root, parts, is_aside)

    def told(self, look: Look) -> Bodies:
        """Joints and parts as they were seen, in the frame of the gripper's root link."""
        joints = dict(zip(self._names, look.joints.tolist(), strict=True))
        if look.is_aside:
            return Bodies(joints, ())
        place, turn = look.root[0], look.root[1].reshape(3, 3)
        parts = []
        for (kind, size), at, way in zip(self._shapes, *look.parts, strict=True):
            x, y, z = (turn.T @ way.reshape(3, 3)).tolist()
            rotation: tuple[Vector, Vector, Vector] = (tuple(x), tuple(y), tuple(z))
            parts.append(Body(kind, size, tuple((turn.T @ (at - place)).tolist()), rotation))
        return Bodies(joints, tuple(parts))


def root_of(model: Any) -> int:
    """The body of the gripper that all others of it hang on."""
    return next(body for body in range(model.nbody) if model.body(body).name.startswith(OURS))


def links_of(model: Any, root: int) -> dict[int, str]:
    """The name of the root link, or of the link on it that a body hangs on, for each body of the gripper."""
    links = {root: root}
    for body in range(root + 1, model.nbody):
        parent = int(model.body_parentid[body])
        if parent in links:
            links[body] = body if parent == root else links[parent]
    return {body: model.body(link).name.removeprefix(OURS) for body, link in links.items()}


def _shape(model: Any, geom: int) -> tuple[str, tuple[float, ...]]:
    kind, factors = _GEOMETRIES[int(model.geom_type[geom])]
    size = model.geom_size[geom][: len(factors)] * np.array(factors)
    return kind, tuple(size.tolist())
