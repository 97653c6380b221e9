"""Where the links are that a viewer draws, and where they should be: computed from the URDF alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np
import numpy.typing as npt
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
Matrix = npt.NDArray[np.float64]


class Placed(NamedTuple):
    """A link in the frame of its parent."""

    parent: str
    pose: Matrix  # 4 x 4


def decoded(data: bytes, schema: str) -> Any:
    """A message of ROS 2, read by another implementation."""
    return STORE.deserialize_cdr(data, schema)


def placed(data: bytes) -> dict[str, Placed]:
    """The links of a message on /tf, by name."""
    found = {}
    for each in decoded(data, "tf2_msgs/msg/TFMessage").transforms:
        moved, turned = each.transform.translation, each.transform.rotation
        pose = np.eye(4)
        pose[:3, :3] = rotation(turned.x, turned.y, turned.z, turned.w)
        pose[:3, 3] = moved.x, moved.y, moved.z
        found[each.child_frame_id] = Placed(each.header.frame_id, pose)
    return found


def of_urdf(text: str, values: Mapping[str, float]) -> dict[str, Placed]:
    """The same by a URDF, where its joints have these values; those that mimic one follow it."""
    joints = ET.fromstring(text).findall("joint")
    return {_link(joint, "child"): Placed(_link(joint, "parent"), _pose(joint, values)) for joint in joints}


def _link(joint: ET.Element, role: str) -> str:
    found = joint.find(role)
    assert found is not None
    return found.attrib["link"]


def _pose(joint: ET.Element, values: Mapping[str, float]) -> Matrix:
    pose, origin, axis = np.eye(4), joint.find("origin"), joint.find("axis")
    if origin is not None:
        roll, pitch, yaw = _numbers(origin.get("rpy", "0 0 0"))
        pose[:3, :3] = _about((0, 0, 1), yaw) @ _about((0, 1, 0), pitch) @ _about((1, 0, 0), roll)
        pose[:3, 3] = _numbers(origin.get("xyz", "0 0 0"))
    if axis is None:
        return pose
    along, moved, value = _numbers(axis.attrib["xyz"]), np.eye(4), _value(joint, values)
    if joint.attrib["type"] == "prismatic":
        moved[:3, 3] = np.array(along) * value
    else:
        moved[:3, :3] = _about(along, value)
    result: Matrix = pose @ moved
    return result


def _value(joint: ET.Element, values: Mapping[str, float]) -> float:
    mimic = joint.find("mimic")
    if mimic is None:
        return values[joint.attrib["name"]]
    factor, shift = float(mimic.get("multiplier", 1)), float(mimic.get("offset", 0))
    return factor * values[mimic.attrib["joint"]] + shift


def _numbers(text: str) -> tuple[float, float, float]:
    x, y, z = map(float, text.split())
    return x, y, z


def _about(axis: tuple[float, float, float], angle: float) -> Matrix:
    x, y, z = np.array(axis) / np.linalg.norm(axis) * np.sin(angle / 2)
    return rotation(x, y, z, np.cos(angle / 2))


def rotation(x: float, y: float, z: float, w: float) -> Matrix:
    """The matrix of a unit quaternion."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
