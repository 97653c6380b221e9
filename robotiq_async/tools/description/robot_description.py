"""The hand for 3-D panels: its URDF and the transforms of its links as ROS 2 encodes them."""

from __future__ import annotations

from struct import pack
from typing import Any, Final

from ...values.status import RobotiqStatus
from . import hand_model, urdf
from .kinematics import JOINTS, joint_angles

SCHEMA_NAME: Final = "std_msgs/msg/String"
SCHEMA: Final = "string data\n"
TRANSFORMS_NAME: Final = "foxglove.FrameTransforms"
"""The schema name that viewers expect."""
_TIME: Final = {
    "type": "object",
    "title": "time",
    "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
}


def _numbers(*names: str) -> dict[str, object]:
    return {"type": "object", "properties": {name: {"type": "number"} for name in names}}


TRANSFORMS_SCHEMA: Final = {
    "type": "object",
    "properties": {
        "transforms": {
            "type": "array",
            "items": {
                "type": "object",
                "properties": {
                    "timestamp": _TIME,
                    "parent_frame_id": {"type": "string"},
                    "child_frame_id": {"type": "string"},
                    "translation": _numbers("x", "y", "z"),
                    "rotation": _numbers("x", "y", "z", "w"),
                },
            },
        }
    },
}


def description_message() -> bytes:
    """The URDF as a message."""
    text = urdf().encode() + b"\0"
    return b"\x00\x01\x00\x00" + pack("<I", len(text)) + text


def transforms(status: RobotiqStatus, nanoseconds: int) -> dict[str, Any]:
    """The transform of every joint, from parent to child, at the time of the status since 1970."""
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    angles = dict(zip(JOINTS, joint_angles(status), strict=True))
    found = []
    for joint in hand_model().joints:
        pose = joint.pose(angles.get(joint.name, 0.0))
        found.append(
            {
                "timestamp": {"sec": seconds, "nsec": rest},
                "parent_frame_id": joint.parent,
                "child_frame_id": joint.child,
                "translation": dict(zip("xyz", pose.position, strict=True)),
                "rotation": dict(zip("xyzw", pose.quaternion, strict=True)),
            }
        )
    return {"transforms": found}
