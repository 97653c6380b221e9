"""A gripper for viewers: its description, and where its links are, encoded as ROS 2 does (CDR), without ROS.

Foxglove and Rerun draw a gripper from these two. Rerun takes transforms as tf2_msgs, and not as JSON.
"""

from __future__ import annotations

from collections.abc import Mapping
from struct import Struct, pack
from types import MappingProxyType
from typing import Final

from ...values import Model, RobotiqStatus
from . import hand_model, urdf
from .joint_states import ENCAPSULATION, HEADER_DEFINITION, RULE, STAMP, add_string, align
from .kinematics import joint_angles, joint_names

STRING_SCHEMA_NAME: Final = "std_msgs/msg/String"
STRING_SCHEMA: Final = "string data\n"
TRANSFORMS_SCHEMA_NAME: Final = "tf2_msgs/msg/TFMessage"
TRANSFORMS_SCHEMA: Final = f"""geometry_msgs/TransformStamped[] transforms
{RULE}
MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
Transform transform
{RULE}
MSG: geometry_msgs/Transform
Vector3 translation
Quaternion rotation
{RULE}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{RULE}
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
{HEADER_DEFINITION}"""
_POSE: Final = Struct("<3d4d")


def encode_description(model: Model) -> bytes:
    """The URDF of a model as a string of ROS 2."""
    body = bytearray()
    add_string(body, urdf(model))
    return ENCAPSULATION + bytes(body)


def encode_transforms(
    status: RobotiqStatus, nanoseconds: int, known: Mapping[str, float] = MappingProxyType({})
) -> bytes:
    """The transform of every joint, from its parent link to its child, at a time since 1970.

    ``known`` has the values of joints that are known otherwise than by the positions of the status.
    """
    model = hand_model(status.model)
    values = model.completed(dict(zip(joint_names(status.model), joint_angles(status), strict=True)))
    values.update(known)
    stamp = STAMP.pack(*divmod(nanoseconds, 1_000_000_000))
    body = bytearray(pack("<I", len(model.joints)))
    for joint in model.joints:
        align(body, 4)
        body += stamp
        add_string(body, joint.parent)
        align(body, 4)
        add_string(body, joint.child)
        align(body, 8)
        pose = joint.pose(values.get(joint.name, 0.0))
        body += _POSE.pack(*pose.position, *pose.quaternion)
    return ENCAPSULATION + bytes(body)
