"""The Hand-E out of boxes and cylinders: two fingers that slide. Nothing of it was measured on a gripper.

Frames. base: z points out of the gripper, x to the left finger, the origin is in the mounting face. A finger
slides outwards with positive values, 0 is closed, as in the public ROS description (AGH-CEAI,
robotiq_hande_description), which has the names.

Sources of the dimensions: the stroke, 50 mm, from the manual; each finger travels half of it (ROS). All
others are ESTIMATES from pictures: a body of 75 mm across and 99 mm high, fingers of 22 mm, 1.07 kg in all.
"""

from __future__ import annotations

from functools import cache
from typing import Final

from ...values import HAND_E, JAW
from .geometry import Pose
from .kinematics import JAW_JOINTS
from .model import HandModel, Joint, Mimic, RigidLink, Shape
from .shapes import box, cylinder, pad

_ROOT_LINK: Final = "robotiq_hande_link"
_HAND_E_KG: Final = 1.07
_FINGER_MASS: Final = 0.06
_HEIGHT: Final = 0.099
_SIDES: Final = {"left": 1.0, "right": -1.0}


@cache
def hand_e() -> HandModel:
    """The description of the Hand-E."""
    names = {side: f"robotiq_hande_{side}_finger" for side in _SIDES}
    links = {_ROOT_LINK: RigidLink(_ROOT_LINK, _HAND_E_KG - 2 * _FINGER_MASS, _base())}
    links |= {name: RigidLink(name, _FINGER_MASS, _finger(_SIDES[side])) for side, name in names.items()}
    return HandModel(
        name="robotiq_hande",
        root=_ROOT_LINK,
        links=links,
        joints=tuple(_joint(side, name) for side, name in names.items()),
        stand=Pose(),
        fingers={JAW: tuple(names.values())},
        touching={JAW: tuple(names.values())},
        drives={JAW: JAW_JOINTS[HAND_E].name},
    )


def _joint(side: str, child: str) -> Joint:
    jaw, name = JAW_JOINTS[HAND_E], f"{child}_joint"
    return Joint(
        name,
        _ROOT_LINK,
        child,
        Pose((0.0, 0.0, _HEIGHT)),
        (_SIDES[side], 0.0, 0.0),
        jaw.closed,
        jaw.open,
        slides=True,
        effort=2 * HAND_E.forces_n[1],  # one motor moves both
        velocity=HAND_E.speeds_mm_s[1] / 2000,
        mimic=None if name == jaw.name else Mimic(jaw.name, 1.0),
    )


def _base() -> tuple[Shape, ...]:
    return (
        cylinder(0.0375, 0.014, (0, 0, 0.007), "plate"),
        cylinder(0.0365, 0.060, (0, 0, 0.044), "body"),
        box((0.075, 0.044, 0.022), (0, 0, 0.085), "body"),
        box((0.100, 0.018, 0.004), (0, 0, 0.0965), "plate"),
    )


def _finger(sign: float) -> tuple[Shape, ...]:
    # The frame is in the face of the pad, at the top of the body.
    return (
        box((0.022, 0.034, 0.016), (sign * 0.016, 0.0, 0.009), "joint"),
        box((0.010, 0.022, 0.046), (sign * 0.010, 0.0, 0.038), "finger"),
        pad((0.005, 0.022, 0.022), (sign * 0.0025, 0.0, 0.050)),
    )
