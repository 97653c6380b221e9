"""The gripper alone: its reach, and the motion of its pads by each motor. No forces, no time."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any, Final

import mujoco
import numpy as np

from robotiq_async.values.enums import Finger

Levers = tuple[tuple[float, float], list[float]]

_GRID: Final = 48
"""Positions from open to closed at which a motion is sampled."""


def pads(model: Any) -> list[int]:
    return [geom for geom in range(model.ngeom) if model.geom(geom).name.endswith("_pad")]


@cache
def reach(text: str) -> float:
    """The greatest distance of a fingertip from the mounting face, in metres."""
    model = mujoco.MjModel.from_xml_string(text)
    data, most = mujoco.MjData(model), 0.0
    for share in np.linspace(0, 1, _GRID):
        put_at(model, data, range(model.nu), share)
        for geom in range(model.ngeom):
            half = np.abs(data.geom_xmat[geom].reshape(3, 3)[2]) @ _half(model, geom)
            most = max(most, float(data.geom_xpos[geom][2] + half))
    return most


def _half(model: Any, geom: int) -> Any:
    size, kind = model.geom_size[geom], model.geom_type[geom]
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return size
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return np.array([size[0], size[0], size[1]])
    return np.full(3, size[0])


@cache
def levers_of(text: str, axis: Finger) -> Levers:
    """The ends of an axis, and at even places between them the motion of all pads by a small motion of it.

    They convert newtons at the pads to the force of the motor.
    """
    model = mujoco.MjModel.from_xml_string(text)
    data, index = mujoco.MjData(model), model.actuator(str(axis.name)).id
    faces, shares, places = pads(model), np.linspace(0, 1, _GRID), []
    for share in shares:
        put_at(model, data, [index], share)
        normals = [data.geom_xmat[pad].reshape(3, 3)[:, np.argmin(model.geom_size[pad])] for pad in faces]
        places.append((data.geom_xpos[faces].copy(), np.array(normals)))
    low, high = model.actuator_ctrlrange[index]
    values, levers = low + (high - low) * shares, []
    for number in range(_GRID):
        before, after = places[max(number - 1, 0)], places[min(number + 1, _GRID - 1)]
        moved = after[0] - before[0]
        along = moved if axis is Finger.SCISSOR else (moved * places[number][1]).sum(axis=1, keepdims=True)
        way = values[min(number + 1, _GRID - 1)] - values[max(number - 1, 0)]
        levers.append(float(np.linalg.norm(along, axis=1).sum() / way))
    return (float(low), float(high)), levers


def put_at(model: Any, data: Any, drives: Iterable[int], share: float) -> None:
    """Move the joints to their places with free drives at a share of their ranges."""
    for index in drives:
        low, high = model.actuator_ctrlrange[index]
        value, target = low + (high - low) * share, model.actuator_trnid[index][0]
        if model.actuator_trntype[index] == mujoco.mjtTrn.mjTRN_JOINT:
            data.qpos[model.jnt_qposadr[target]] = value
            continue
        first = model.tendon_adr[target]
        for wrap in range(
            first, first + model.tendon_num[target]
        ):  # the base as far as it goes, then the next
            joint, weight = model.wrap_objid[wrap], model.wrap_prm[wrap]
            turned = min(value / weight, model.jnt_range[joint][1])
            data.qpos[model.jnt_qposadr[joint]] = turned
            value -= turned * weight
    for number in np.flatnonzero(model.eq_type == mujoco.mjtEq.mjEQ_JOINT):
        follower, leader = model.eq_obj1id[number], model.eq_obj2id[number]
        if leader >= 0:
            led = data.qpos[model.jnt_qposadr[leader]]
            data.qpos[model.jnt_qposadr[follower]] = model.eq_data[number][1] * led
    _keep_tips_parallel(model, data)
    mujoco.mj_kinematics(model, data)


def _keep_tips_parallel(model: Any, data: Any) -> None:
    for tendon in range(model.ntendon):
        if model.tendon(tendon).name.endswith("_parallel"):
            first = model.tendon_adr[tendon]
            base, tip = model.wrap_objid[first : first + 2]
            turned = data.qpos[model.jnt_qposadr[base]]
            data.qpos[model.jnt_qposadr[tip]] = max(-turned, model.jnt_range[tip][0])
