"""Writes a description as URDF, for RViz, MoveIt, check_urdf and simulators.

Joints that share a motor but not a ratio (the phalanges of the 3-Finger) have no form in a URDF: each is free
there.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from math import atan2, hypot

from .geometry import Matrix, Pose
from .model import MATERIALS, HandModel, Joint, RigidLink, Shape
from .shapes import inertia


def write_urdf(model: HandModel, note: str) -> str:
    """The URDF as text, with a note as its first comment."""
    robot = ET.Element("robot", name=model.name)
    robot.append(ET.Comment(f" {note} "))
    for name, color in MATERIALS.items():
        ET.SubElement(ET.SubElement(robot, "material", name=name), "color", rgba=numbers(color))
    robot.extend(_link(link) for link in model.links.values())
    robot.extend(_joint(joint) for joint in model.joints)
    return as_text(robot)


def as_text(root: ET.Element) -> str:
    """XML with two spaces an indent."""
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def numbers(values: Sequence[float]) -> str:
    """Numbers with six digits, and no minus before a zero."""
    return " ".join(f"{value:.6g}" if abs(value) >= 1e-9 else "0" for value in values)


def _link(link: RigidLink) -> ET.Element:
    element = ET.Element("link", name=link.name)
    centre, moments, products = inertia(link)
    inertial = ET.SubElement(element, "inertial")
    ET.SubElement(inertial, "origin", xyz=numbers(centre), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=numbers([link.mass]))
    names = zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), (*moments, *products), strict=True)
    ET.SubElement(inertial, "inertia", {name: numbers([value]) for name, value in names})
    for shape in link.shapes:
        visual = _placed(ET.SubElement(element, "visual"), link, shape)
        ET.SubElement(visual, "material", name=shape.material)
    for shape in link.shapes:
        _placed(ET.SubElement(element, "collision"), link, shape)
    return element


def _placed(element: ET.Element, link: RigidLink, shape: Shape) -> ET.Element:
    if shape.name:  # MuJoCo wants it to be the only one of its name
        element.set("name", f"{link.name}_{shape.name}_{element.tag}")
    _origin(element, shape.origin)
    geometry = ET.SubElement(element, "geometry")
    if shape.kind == "box":
        ET.SubElement(geometry, "box", size=numbers(shape.size))
    elif shape.kind == "cylinder":
        radius, length = shape.size
        ET.SubElement(geometry, "cylinder", radius=numbers([radius]), length=numbers([length]))
    else:
        ET.SubElement(geometry, "sphere", radius=numbers(shape.size))
    return element


def _joint(joint: Joint) -> ET.Element:
    kind = "fixed" if joint.axis is None else "prismatic" if joint.slides else "revolute"
    element = ET.Element("joint", name=joint.name, type=kind)
    ET.SubElement(element, "parent", link=joint.parent)
    ET.SubElement(element, "child", link=joint.child)
    _origin(element, joint.origin)
    if joint.axis is not None:
        ET.SubElement(element, "axis", xyz=numbers(joint.axis))
        limit = {
            "lower": joint.lower,
            "upper": joint.upper,
            "effort": joint.effort,
            "velocity": joint.velocity,
        }
        ET.SubElement(element, "limit", {name: numbers([value]) for name, value in limit.items()})
    if joint.mimic is not None:
        multiplier = numbers([joint.mimic.multiplier])
        ET.SubElement(element, "mimic", joint=joint.mimic.joint, multiplier=multiplier, offset="0")
    return element


def _origin(element: ET.Element, pose: Pose) -> None:
    ET.SubElement(element, "origin", xyz=numbers(pose.position), rpy=numbers(_rpy(pose.rotation)))


def _rpy(rotation: Matrix) -> tuple[float, float, float]:
    """Roll, pitch and yaw. Where roll and yaw cannot be distinguished, roll is 0."""
    (a, b, _), (d, e, _), (g, h, i) = rotation
    across = hypot(a, d)
    if across < 1e-9:
        return 0.0, atan2(-g, across), atan2(-b, e)
    return atan2(h, i), atan2(-g, across), atan2(d, a)
