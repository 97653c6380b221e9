"""The 3-Finger out of boxes, cylinders and spheres. Nothing of it was measured on a gripper.

Frames. palm: y points out of the palm, x towards finger A, z along the axis on which B and C stand side by
side. link_0 of a finger: x out of the palm, y to the other side of the hand; a finger closes with positive
angles about z. The joints have the names, the frames and the order that ROS users of the hand know;
``kinematics`` turns positions into their angles. Which finger has which name: docs/decisions/finger-names.md.

Sources of the lengths:

(ROS)    the joint origins of the public ROS description of the hand (robotiq_3f_gripper_visualization of
         ros-industrial, BSD): where the fingers stand on the palm (45.5, 21.4 and 36 mm), link_0 20 mm,
         link_1 50 mm out and 28 mm sideways, link_2 39 mm, the 30 degrees between link_1 and link_2 and back
         at the tip (written 0.52 there). Its palm frame lies 45 mm above the face that is bolted on.
(REPORT) the limits of the joints: see ``kinematics``. The ROS description has joint_1 from 0.0495 and joint_3
         to -1.2217.
(MANUAL) 2.3 kg; 155 mm between open fingertips; readings of about 113 where the tips meet in the pinch mode.
         With the origins above the second wants pads 15.5 mm from the axis of joint_3, the third 4 mm. Here
         they are 10 mm from it, in between: open tips are 166 mm apart, and overlap a little when a pinch is
         closed.
(ESTIMATE) every thickness and width, the length of the tip (41 mm and its rounding), the whole shape of the
         palm, the share of the mass in each link, and all springs.

One motor drives a finger. The sum that it moves, in degrees of the base joint, is base + 5/9 middle: 140
counts turn the base by 70 degrees and 100 counts the middle joint by 90. A spring holds the middle joint back
until the base is at its stop or meets something; then the middle joint turns, and the finger wraps around
the part. A spring keeps the tip parallel to itself, and a stop keeps it from bending backwards from there.
"""

from __future__ import annotations

from functools import cache
from math import ceil, copysign, pi, radians
from typing import Final

from ...values import Finger
from .geometry import Pose, from_rpy
from .kinematics import BASE, FINGER_NAMES, MIDDLE, PALM, TIP
from .model import HandModel, Joint, Mimic, RigidLink, Shape, Tendon
from .shapes import box, cylinder, pad, sphere

_THREE_FINGER_KG: Final = 2.3
_LINK_MASSES: Final = (0.06, 0.10, 0.06, 0.05)
"""Masses of link_0 to link_3 of a finger; the palm has the rest (ESTIMATE)."""
_OUT: Final = (pi / 2, 0.0, 0.0)
"""A cylinder that stands along y, out of the palm."""
_BENT: Final = pi / 6
_EFFORT: Final = 60.0
_VELOCITY: Final = 2.0
_MIDDLE_SPRING: Final = (0.1, -3.0)
"""Stiffness in N m/rad and rest angle: holds the joint with 0.3 N m, below the torque of the least force."""
_TIP_STIFFNESS: Final = 1.0
_PULL: Final = (BASE[1][1] / BASE[1][0]) / (MIDDLE[1][1] / (MIDDLE[1][0] - MIDDLE[0][0]))
"""Degrees of the base that cost the motor as much as one degree of the middle joint: 5/9."""


def _palm() -> tuple[Shape, ...]:
    # ESTIMATE, but for the 45 mm between its faces (ROS): a bridge under B and C, and a tongue under A.
    return (
        cylinder(0.040, 0.012, (0, -0.039, 0), "plate", _OUT),
        box((0.050, 0.045, 0.076), (-0.0415, -0.0105, 0), "body"),
        cylinder(0.025, 0.045, (-0.0415, -0.0105, 0.038), "body", _OUT),
        cylinder(0.025, 0.045, (-0.0415, -0.0105, -0.038), "body", _OUT),
        box((0.070, 0.045, 0.060), (0.011, -0.0105, 0), "body"),
        cylinder(0.030, 0.045, (0.0405, -0.0105, 0), "body", _OUT),
        box((0.056, 0.005, 0.052), (-0.003, 0.0135, 0), "plate"),
    )


_FINGER: Final = (
    (box((0.030, 0.024, 0.030), (0.007, -0.002, 0), "body"),),
    (
        cylinder(0.013, 0.032, (0, 0, 0), "joint"),
        box((0.05731, 0.019, 0.024), (0.025, -0.014, 0), "finger", (0, 0, -0.51048)),
    ),
    (
        cylinder(0.011, 0.028, (0, 0, 0), "joint"),
        box((0.039, 0.017, 0.022), (0.0195, 0, 0), "finger"),
    ),
    (
        cylinder(0.009, 0.025, (0, 0, 0), "joint"),
        box((0.042, 0.013, 0.022), (0.01707, 0.01043, 0), "finger", (0, 0, _BENT)),
        sphere(0.0075, (0.03526, 0.02093, 0), "finger"),
        pad((0.036, 0.003, 0.020), (0.01567, 0.01886, 0), (0, 0, _BENT)),
    ),
)
"""The shapes of link_0 to link_3."""
_ORIGINS: Final = (
    Pose((0.020, 0.0, 0.0)),
    from_rpy((0.050, -0.028, 0.0), (0, 0, -_BENT)),
    Pose((0.039, 0.0, 0.0)),
)
_FEET: Final = {
    Finger.C: from_rpy((-0.0455, 0.0214, 0.036), (0, pi, -pi / 2)),
    Finger.B: from_rpy((-0.0455, 0.0214, -0.036), (0, pi, -pi / 2)),
    Finger.A: from_rpy((0.0455, 0.0214, 0), (0, 0, pi / 2)),
}


@cache
def three_finger() -> HandModel:
    """The description of the 3-Finger."""
    links = {"palm": RigidLink("palm", _THREE_FINGER_KG - 3 * sum(_LINK_MASSES), _palm())}
    joints: list[Joint] = []
    for finger, name in FINGER_NAMES.items():
        parts = zip(_LINK_MASSES, _FINGER, strict=True)
        links |= {
            f"{name}_link_{n}": RigidLink(f"{name}_link_{n}", mass, shapes)
            for n, (mass, shapes) in enumerate(parts)
        }
        joints += [_foot(finger, name), *_phalanges(name)]
    tips = {finger: (f"{name}_link_2", f"{name}_link_3") for finger, name in FINGER_NAMES.items()}
    return HandModel(
        name="robotiq_3f",
        root="palm",
        links=links,
        joints=tuple(joints),
        stand=from_rpy((0, 0, 0.045), (pi / 2, 0, 0)),
        fingers={finger: (f"{name}_link_0",) for finger, name in FINGER_NAMES.items()},
        touching=tips,
        drives={**FINGER_NAMES, Finger.SCISSOR: "palm_finger_1_joint"},
        tendons=tuple(tendon for name in FINGER_NAMES.values() for tendon in _tendons(name)),
        springs={f"{name}_joint_2": _MIDDLE_SPRING for name in FINGER_NAMES.values()},
        couplings={"palm_finger_2_joint": Mimic("palm_finger_1_joint", -1.0)},
    )


def _foot(finger: Finger, name: str) -> Joint:
    joint, child = f"palm_{name}_joint", f"{name}_link_0"
    if finger is Finger.A:  # it stands still
        return Joint(joint, "palm", child, _FEET[finger])
    most = _limit(PALM[0][1])
    return Joint(
        joint,
        "palm",
        child,
        _FEET[finger],
        (0.0, 1.0, 0.0),
        -most,
        most,
        effort=_EFFORT,
        velocity=_VELOCITY,
    )


def _phalanges(name: str) -> list[Joint]:
    limits = ((0.0, BASE[1][1]), (0.0, MIDDLE[1][1]), (TIP[1][1], 0.0))
    return [
        Joint(
            f"{name}_joint_{n}",
            f"{name}_link_{n - 1}",
            f"{name}_link_{n}",
            origin,
            (0.0, 0.0, 1.0),
            _limit(lower),
            _limit(upper),
            effort=_EFFORT,
            velocity=_VELOCITY,
        )
        for n, (origin, (lower, upper)) in enumerate(zip(_ORIGINS, limits, strict=True), 1)
    ]


def _limit(degrees: float) -> float:
    """A limit in radians, rounded outwards to five digits: no angle is beyond it by a rounding."""
    return copysign(ceil(abs(radians(degrees)) * 1e5) / 1e5, degrees)


def _tendons(name: str) -> tuple[Tendon, Tendon]:
    base, middle, tip = (f"{name}_joint_{n}" for n in (1, 2, 3))
    motor = Tendon(name, {base: 1.0, middle: _PULL})
    # From parallel inwards alone: a part that presses the tip outwards meets the stop.
    parallel = Tendon(f"{name}_parallel", {base: 1.0, tip: 1.0}, 0.0, pi, _TIP_STIFFNESS)
    return motor, parallel
