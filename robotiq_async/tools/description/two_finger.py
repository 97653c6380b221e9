"""The 2F-85 and the 2F-140 out of boxes and cylinders. Nothing of it was measured on a gripper.

Frames. base: z points out of the gripper, x to the left finger, the origin is in the mounting face. Each
finger is a parallelogram: a crank (knuckle) and a thinner one beside it (inner knuckle) carry the fingertip,
which so stays parallel to itself. The joint of the left crank has the name that public ROS descriptions give
it, and positive angles close; the others follow it. A simulator drives the four-bar by these couplings. The
real fingers also bend around a part that touches them low (the encompassing grip): these do not.

Sources of the lengths:

(ROS)   the pivots of the cranks, 30.6 and 12.7 mm from the middle, 54.9 and 61.4 mm high, and the angles at
        which the joints are closed (``kinematics``): public descriptions of the 2F-85 (PickNik,
        ros2_robotiq_gripper) and the 2F-140 (ros-industrial, robotiq_2f_140). Both have the same pivots.
(CURVE) the crank of the 2F-85, 57.7 mm: fitted to the distance of the pads in the public model of MuJoCo
        Menagerie, over the angle at which its pads meet. At most 0.5 mm off; that model is open at 85.5 mm.
(MANUAL) the strokes, 85 and 140 mm, and so the angle of an open crank and the depth of the pads.
(ESTIMATE) the crank of the 2F-140, 108.7 mm: the public description has 100 mm, with which its 0.7 rad close
        only 129 mm. All thicknesses and widths, the length of the fingertips, the body, and the masses: 0.93
        and 1.03 kg in all.
"""

from __future__ import annotations

from functools import cache
from math import acos, cos, pi, sin
from typing import Final, NamedTuple

from ...values import JAW, TWO_FINGER_85, TWO_FINGER_140, Model
from .geometry import Pose, Vector
from .kinematics import JAW_JOINTS
from .model import HandModel, Joint, Mimic, RigidLink, Shape
from .shapes import box, cylinder, pad

_PIVOT: Final = (0.0306, 0.0549)
_INNER_PIVOT: Final = (0.0127, 0.0614)
"""Distances from the middle, and above the mounting face."""
_ALONG_Y: Final = (pi / 2, 0.0, 0.0)
_SIDES: Final = {"left": 1.0, "right": -1.0}


class Linkage(NamedTuple):
    """The dimensions of one model, in metres, radians and kilograms.

    Attributes:
        crank: from pivot to pivot.
        tip: height of the fingertip above its pivot.
        pad: width and height of its pad.
        mass: of the gripper.
        names: of the base, of a side's crank, inner crank and tip, and of the joints of the last two.
    """

    crank: float
    tip: float
    pad: tuple[float, float]
    mass: float
    names: tuple[str, str, str, str]

    def open_angle(self, model: Model) -> float:
        """The angle of an open crank to the gripper's axis: closing to the end then moves half a stroke."""
        half = JAW_JOINTS[model].closed / 2
        return half + acos(model.stroke.mm / 1000 / 4 / self.crank / sin(half))

    def depth(self, model: Model) -> float:
        """The distance from the pivot of a fingertip inwards to the face of its pad."""
        return _PIVOT[0] + self.crank * sin(self.open_angle(model)) - model.stroke.mm / 2000


LINKAGES: Final = {
    TWO_FINGER_85: Linkage(
        0.0577,
        0.048,
        (0.022, 0.0375),
        0.93,
        (
            "robotiq_85_base_link",
            "robotiq_85_{}_knuckle",
            "robotiq_85_{}_inner_knuckle",
            "robotiq_85_{}_finger_tip",
        ),
    ),
    TWO_FINGER_140: Linkage(
        0.1087,
        0.070,
        (0.027, 0.060),
        1.03,
        ("robotiq_arg2f_base_link", "{}_outer_knuckle", "{}_inner_knuckle", "{}_inner_finger"),
    ),
}
_SHARES: Final = (0.05, 0.02, 0.05)
"""Shares of the mass in a crank, an inner crank and a fingertip (ESTIMATE)."""


@cache
def two_finger(model: Model) -> HandModel:
    """The description of a 2F-85 or a 2F-140.

    Raises:
        KeyError: another model.
    """
    linkage, driver = LINKAGES[model], JAW_JOINTS[model].name
    root, *names = linkage.names
    links = {root: RigidLink(root, linkage.mass * (1 - 2 * sum(_SHARES)), _base())}
    joints: list[Joint] = []
    for side in _SIDES:
        crank, inner, tip = (_link_name(name, side) for name in names)
        shapes = (_crank(model, side), _inner(model, side), _tip(model, side))
        masses = (linkage.mass * share for share in _SHARES)
        links |= {
            name: RigidLink(name, mass, parts)
            for name, mass, parts in zip((crank, inner, tip), masses, shapes, strict=True)
        }
        joints += _joints(model, side, root, (crank, inner, tip))
    return HandModel(
        name=f"robotiq_{model.name}",
        root=root,
        links=links,
        joints=tuple(joints),
        stand=Pose(),
        fingers={JAW: tuple(joint.child for joint in joints if joint.parent == root)},
        touching={JAW: tuple(_link_name(names[2], side) for side in _SIDES)},
        drives={JAW: driver},
    )


def _link_name(name: str, side: str) -> str:
    # PickNik's links end in _link, the links of ros-industrial's 2F-140 do not.
    return name.format(side) + ("_link" if name.startswith("robotiq_85") else "")


def _joints(model: Model, side: str, root: str, links: tuple[str, str, str]) -> list[Joint]:
    linkage, jaw, sign = LINKAGES[model], JAW_JOINTS[model], _SIDES[side]
    _, crank_name, inner_name, tip_name = linkage.names
    crank, inner, tip = links
    # PickNik has all axes alike, so that the right side turns the other way.
    end_of_crank = _at(sign, linkage.crank, linkage.open_angle(model))

    def turning(name: str, parent: str, child: str, at: Vector, multiplier: float) -> Joint:
        ends = sorted((jaw.open * multiplier, jaw.closed * multiplier))
        mimic = None if name == jaw.name else Mimic(jaw.name, multiplier)
        effort, velocity = _torque(model), _rate(model)
        axis = (0.0, -1.0, 0.0)
        return Joint(
            name,
            parent,
            child,
            Pose(at),
            axis,
            ends[0],
            ends[1],
            effort=effort,
            velocity=velocity,
            mimic=mimic,
        )

    is_driver = side == "left"
    name = jaw.name if is_driver else f"{crank_name.format(side)}_joint"
    return [
        turning(name, root, crank, (sign * _PIVOT[0], 0.0, _PIVOT[1]), sign),
        turning(
            f"{inner_name.format(side)}_joint",
            root,
            inner,
            (sign * _INNER_PIVOT[0], 0.0, _INNER_PIVOT[1]),
            sign,
        ),
        turning(f"{tip_name.format(side)}_joint", crank, tip, end_of_crank, -sign),
    ]


def _torque(model: Model) -> float:
    """The driver's torque at full force: both pads move, and a crank across the axis has its full length."""
    return 2 * model.forces_n[1] * LINKAGES[model].crank


def _rate(model: Model) -> float:
    """The rate of the driver at full speed, by the nominal speed of the stroke."""
    return JAW_JOINTS[model].closed * model.speeds_mm_s[1] / model.stroke.mm


def _at(sign: float, length: float, angle: float) -> Vector:
    return sign * length * sin(angle), 0.0, length * cos(angle)


def _base() -> tuple[Shape, ...]:
    return (
        cylinder(0.0375, 0.014, (0, 0, 0.007), "plate"),
        box((0.068, 0.046, 0.034), (0, 0, 0.031), "body"),
        box((0.044, 0.036, 0.022), (0, 0, 0.059), "body"),
    )


def _crank(model: Model, side: str) -> tuple[Shape, ...]:
    length, angle, sign = LINKAGES[model].crank, LINKAGES[model].open_angle(model), _SIDES[side]
    middle, end = _at(sign, length / 2, angle), _at(sign, length, angle)
    return (
        cylinder(0.009, 0.030, (0, 0, 0), "joint", _ALONG_Y),
        box((0.012, 0.024, length), middle, "body", (0, sign * angle, 0)),
        cylinder(0.008, 0.028, end, "joint", _ALONG_Y),
    )


def _inner(model: Model, side: str) -> tuple[Shape, ...]:
    length, angle, sign = LINKAGES[model].crank, LINKAGES[model].open_angle(model), _SIDES[side]
    return (
        cylinder(0.006, 0.032, (0, 0, 0), "joint", _ALONG_Y),
        box((0.007, 0.018, length), _at(sign, length / 2, angle), "finger", (0, sign * angle, 0)),
    )


def _tip(model: Model, side: str) -> tuple[Shape, ...]:
    linkage, sign = LINKAGES[model], _SIDES[side]
    width, height = linkage.pad
    across, up = _INNER_PIVOT[0] - _PIVOT[0], _INNER_PIVOT[1] - _PIVOT[1]
    face, top = linkage.depth(model), linkage.tip
    thick = 0.012
    behind = face - 0.005 - thick / 2
    foot = up - 0.010
    return (
        # From the crank to the inner crank, and the finger on it.
        box(
            (-across + 0.004, 0.020, 0.012),
            (sign * across / 2, 0.0, up / 2),
            "body",
            (0, -sign * _slope(across, up), 0),
        ),
        box((thick, 0.022, top - foot), (-sign * behind, 0.0, (top + foot) / 2), "finger"),
        pad((0.005, width, height), (-sign * (face - 0.0025), 0.0, top - height / 2)),
    )


def _slope(across: float, up: float) -> float:
    return -up / across  # small enough to stand for its angle
