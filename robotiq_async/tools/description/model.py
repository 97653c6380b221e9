"""Rigid links, the joints between them and their drives: the form of every description.

A description is data. The drawing, the URDF and the MJCF are made from it, so they cannot disagree. Metres,
radians, kilograms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from ...values import Finger
from .geometry import Pose, Vector, turned

Color = tuple[float, float, float, float]
"""Red, green, blue and opacity, 0..1."""

PAD: Final = "pad"
"""Name of the shape of a fingertip's pad."""

MATERIALS: Final[Mapping[str, Color]] = MappingProxyType(
    {
        "body": (0.16, 0.17, 0.19, 1.0),
        "plate": (0.55, 0.58, 0.62, 1.0),
        "finger": (0.62, 0.65, 0.70, 1.0),
        "joint": (0.22, 0.24, 0.27, 1.0),
        "pad": (0.09, 0.09, 0.10, 1.0),
    }
)
"""The colours by name."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A box, a cylinder (along z) or a sphere of a link: drawn, and used for contacts.

    Attributes:
        kind: ``box``, ``cylinder`` or ``sphere``.
        size: of a box the three edges; of a cylinder radius and length; of a sphere the radius.
        origin: in the frame of the link.
        material: one of :data:`MATERIALS`.
        name: of the shape; may be empty.
    """

    kind: str
    size: tuple[float, ...]
    origin: Pose
    material: str
    name: str = ""

    @property
    def color(self) -> Color:
        """The colour of its material."""
        return MATERIALS[self.material]


@dataclass(frozen=True, slots=True)
class RigidLink:
    """A rigid part.

    Attributes:
        name: of the link, which is the name of its frame.
        mass: in kilograms, spread evenly over its shapes.
        shapes: its parts.
    """

    name: str
    mass: float
    shapes: tuple[Shape, ...]


@dataclass(frozen=True, slots=True)
class Mimic:
    """A joint that follows another: its value is the other's, times a factor.

    Attributes:
        joint: the name of the other.
        multiplier: the factor.
    """

    joint: str
    multiplier: float


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint between two links.

    Attributes:
        name: as in joint states.
        parent: name of the parent link.
        child: name of the child link.
        origin: the frame of the child at 0, in the frame of the parent.
        axis: in the frame of the child; None when the joint is fixed.
        lower: the smallest value, in radians, or in metres if it slides.
        upper: the largest.
        slides: it moves along its axis, and does not turn about it.
        effort: the most its drive gives, in N m, or in N if it slides.
        velocity: the fastest it moves, in rad/s, or m/s.
        mimic: the joint it follows; None if it is free.
    """

    name: str
    parent: str
    child: str
    origin: Pose
    axis: Vector | None = None
    lower: float = 0.0
    upper: float = 0.0
    slides: bool = False
    effort: float = 0.0
    velocity: float = 0.0
    mimic: Mimic | None = None

    def pose(self, value: float = 0.0) -> Pose:
        """The frame of the child in the frame of the parent."""
        if self.axis is None:
            return self.origin
        if self.slides:
            x, y, z = self.axis
            return self.origin @ Pose((x * value, y * value, z * value))
        return self.origin @ turned(self.axis, value)


@dataclass(frozen=True, slots=True)
class Tendon:
    """A weighted sum of joints. A simulator drives it as one motor drives several joints.

    Attributes:
        name: of the tendon.
        joints: the weight of each joint, by name.
        lower: the smallest value of the sum; None for no limit.
        upper: the largest.
        stiffness: of a spring that pulls the sum to 0, in N m/rad; 0 without a spring.
    """

    name: str
    joints: Mapping[str, float]
    lower: float | None = None
    upper: float | None = None
    stiffness: float = 0.0


@dataclass(frozen=True, slots=True)
class HandModel:
    """A tree of links, with their drives.

    Attributes:
        name: of the robot in a URDF.
        root: name of the root link.
        links: by name.
        joints: every parent before its children.
        stand: the root where the gripper stands on its mounting face and opens upwards.
        fingers: by axis, the first of the links that it moves.
        touching: by axis, the links that touch a part.
        drives: by axis, the joint or the tendon that its motor drives.
        tendons: joints that one motor shares, and springs.
        springs: stiffness and rest angle of joints with a spring, in N m/rad and rad.
        couplings: joints that follow another although joint states name both.
    """

    name: str
    root: str
    links: Mapping[str, RigidLink]
    joints: tuple[Joint, ...]
    stand: Pose
    fingers: Mapping[Finger, tuple[str, ...]]
    touching: Mapping[Finger, tuple[str, ...]]
    drives: Mapping[Finger, str]
    tendons: tuple[Tendon, ...] = ()
    springs: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    couplings: Mapping[str, Mimic] = field(default_factory=dict)

    @property
    def moving(self) -> tuple[Joint, ...]:
        """The joints that are not fixed."""
        return tuple(joint for joint in self.joints if joint.axis is not None)

    @property
    def mass(self) -> float:
        """The mass of all links, in kilograms."""
        return sum(link.mass for link in self.links.values())

    def completed(self, values: Mapping[str, float]) -> dict[str, float]:
        """The value of every joint that moves, also of joints that follow another.

        Args:
            values: radians or metres by the names of joints; missing ones are at 0, unknown ones are ignored.
        """
        own = {joint.name: values.get(joint.name, 0.0) for joint in self.moving}
        for joint in self.moving:
            if joint.mimic is not None:
                own[joint.name] = joint.mimic.multiplier * own[joint.mimic.joint]
        return own

    def link_poses(self, values: Mapping[str, float]) -> dict[str, Pose]:
        """The pose of every link in the frame of the root, at values as :meth:`completed` takes."""
        all_values = self.completed(values)
        poses = {self.root: Pose()}
        for joint in self.joints:
            poses[joint.child] = poses[joint.parent] @ joint.pose(all_values.get(joint.name, 0.0))
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
