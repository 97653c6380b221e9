"""Reads links and joints of a URDF, and computes the poses of the links at given joint angles."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Self

from .geometry import Pose, Vector, from_rpy, turned

Color = tuple[float, float, float, float]
"""Red, green, blue and opacity, 0..1."""

PAD: Final = "pad"
"""Name of the shape of a fingertip's pad."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A box, a cylinder (along z) or a sphere of a link.

    Attributes:
        kind: ``box``, ``cylinder`` or ``sphere``.
        size: of a box the three edges; of a cylinder radius and length; of a sphere the radius.
        origin: in the frame of the link.
        color: of its material.
        name: of the shape; empty if it has none.
    """

    kind: str
    size: tuple[float, ...]
    origin: Pose
    color: Color
    name: str = ""


@dataclass(frozen=True, slots=True)
class Link:
    """A rigid part.

    Attributes:
        name: of the link, which is the name of its frame.
        shapes: what it looks like.
    """

    name: str
    shapes: tuple[Shape, ...]


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint between two links.

    Attributes:
        name: as joint states name it.
        parent: name of the parent link.
        child: name of the child link.
        origin: the frame of the child at angle 0, in the frame of the parent.
        axis: in the frame of the child; None when the joint is fixed.
        lower: the smallest angle in radians.
        upper: the largest angle in radians.
    """

    name: str
    parent: str
    child: str
    origin: Pose
    axis: Vector | None = None
    lower: float = 0.0
    upper: float = 0.0

    def pose(self, angle: float = 0.0) -> Pose:
        """The frame of the child in the frame of the parent."""
        return self.origin if self.axis is None else self.origin @ turned(self.axis, angle)


@dataclass(frozen=True, slots=True)
class HandModel:
    """A tree of links.

    Attributes:
        root: name of the root link.
        links: by name.
        joints: every parent before its children.
    """

    root: str
    links: Mapping[str, Link]
    joints: tuple[Joint, ...]

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read a URDF with boxes, cylinders, spheres, fixed joints and revolute joints, as ours has.

        Raises:
            ValueError: the text is not XML, or the links do not form a single tree.
        """
        try:
            robot = ET.fromstring(text)
        except ET.ParseError as error:
            raise ValueError(f"the description is not XML: {error}") from error
        colors = {each.attrib["name"]: _color(each) for each in robot.findall("material")}
        links = {each.attrib["name"]: _link(each, colors) for each in robot.findall("link")}
        joints = [_joint(each) for each in robot.findall("joint")]
        roots = links.keys() - {joint.child for joint in joints}
        if len(roots) != 1:
            raise ValueError(f"the description must have one root link, got {sorted(roots)}")
        root = roots.pop()
        return cls(root, links, _ordered(root, joints))

    @property
    def moving(self) -> tuple[Joint, ...]:
        """The joints that are not fixed."""
        return tuple(joint for joint in self.joints if joint.axis is not None)

    def link_poses(self, angles: Mapping[str, float]) -> dict[str, Pose]:
        """The pose of every link in the frame of the root.

        Args:
            angles: radians by the names of joints; missing joints are at 0, unknown ones are ignored.
        """
        poses = {self.root: Pose()}
        for joint in self.joints:
            poses[joint.child] = poses[joint.parent] @ joint.pose(angles.get(joint.name, 0.0))
        return poses

    def pad(self, link: str) -> Shape:
        """The shape of the pad of a fingertip.

        Raises:
            KeyError: there is no such link, or it has no pad.
        """
        for shape in self.links[link].shapes:
            if shape.name == PAD:
                return shape
        raise KeyError(f"{link} has no {PAD}")


def _ordered(root: str, joints: list[Joint]) -> tuple[Joint, ...]:
    placed, ordered = {root}, []
    while waiting := [joint for joint in joints if joint.child not in placed]:
        ready = [joint for joint in waiting if joint.parent in placed]
        if not ready:
            raise ValueError(f"the joint {waiting[0].name} is not connected to the root")
        ordered += ready
        placed |= {joint.child for joint in ready}
    return tuple(ordered)


def _link(element: ET.Element, colors: Mapping[str, Color]) -> Link:
    return Link(element.attrib["name"], tuple(_shape(each, colors) for each in element.findall("visual")))


def _shape(element: ET.Element, colors: Mapping[str, Color]) -> Shape:
    geometry = _child(_child(element, "geometry"), "*")
    if geometry.tag == "box":
        size = _numbers(geometry.attrib["size"])
    elif geometry.tag == "cylinder":
        size = (float(geometry.attrib["radius"]), float(geometry.attrib["length"]))
    else:
        size = (float(geometry.attrib["radius"]),)
    color = colors[_child(element, "material").attrib["name"]]
    return Shape(geometry.tag, size, _origin(element), color, element.get("name", ""))


def _joint(element: ET.Element) -> Joint:
    name, origin = element.attrib["name"], _origin(element)
    parent, child = (_child(element, each).attrib["link"] for each in ("parent", "child"))
    if element.attrib["type"] == "fixed":
        return Joint(name, parent, child, origin)
    limit = _child(element, "limit").attrib
    axis = _vector(_child(element, "axis").attrib["xyz"])
    return Joint(name, parent, child, origin, axis, float(limit["lower"]), float(limit["upper"]))


def _origin(element: ET.Element) -> Pose:
    attributes = _child(element, "origin").attrib
    return from_rpy(_vector(attributes["xyz"]), _vector(attributes["rpy"]))


def _color(element: ET.Element) -> Color:
    red, green, blue, opacity = _numbers(_child(element, "color").attrib["rgba"])
    return red, green, blue, opacity


def _child(element: ET.Element, tag: str) -> ET.Element:
    found = element.find(tag)
    if found is None:
        raise ValueError(f"the description has a {element.tag} without {tag}")
    return found


def _vector(text: str) -> Vector:
    x, y, z = _numbers(text)
    return x, y, z


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(float(each) for each in text.split())
