"""Writes the SRDF that MoveIt reads beside a URDF, with a group, its states and the collisions to ignore.

The group ``gripper`` is the whole gripper, because a held part touches all of it. Joints that no motor drives
are passive: MoveIt wants a controller for the others alone. The gripper's collisions with itself are ignored,
as in the MJCF: links overlap at their joints, pads meet, and no position does harm.

An end effector is not in it: it names the link of the arm, and that is in another URDF.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from itertools import combinations
from typing import Final

from .model import HandModel
from .urdf_writer import as_text, numbers

GROUP: Final = "gripper"
_COMMENT: Final = (
    " Every collision between links of the gripper is disabled. With an arm, say which link carries it:"
    ' <end_effector name="NAME" parent_link="LINK OF THE ARM" group="{group}" /> '
)


def write_srdf(model: HandModel, states: Mapping[str, Mapping[str, float]], prefix: str = "") -> str:
    """The SRDF as text.

    Args:
        model: the gripper.
        states: the values of joints by the name of the state.
        prefix: stands before the names of links, joints and the group.
    """
    group = prefix + GROUP
    robot = ET.Element("robot", name=model.name)
    robot.append(ET.Comment(_COMMENT.format(group=group)))
    links = ET.SubElement(robot, "group", name=group)
    for link in model.links:
        ET.SubElement(links, "link", name=prefix + link)
    for name, values in states.items():
        state = ET.SubElement(robot, "group_state", name=name, group=group)
        for joint, value in values.items():
            ET.SubElement(state, "joint", name=prefix + joint, value=numbers([value]))
    for name in passive(model):
        ET.SubElement(robot, "passive_joint", name=prefix + name)
    neighbours = {frozenset((joint.parent, joint.child)) for joint in model.joints}
    for one, other in combinations(model.links, 2):
        reason = "Adjacent" if {one, other} in neighbours else "User"
        ET.SubElement(robot, "disable_collisions", link1=prefix + one, link2=prefix + other, reason=reason)
    return as_text(robot)


def passive(model: HandModel) -> list[str]:
    """The joints that move and that no motor drives."""
    tendons = {tendon.name: tendon.joints for tendon in model.tendons}
    driven = {joint for drive in model.drives.values() for joint in tendons.get(drive, (drive,))}
    return [joint.name for joint in model.moving if joint.name not in driven]
