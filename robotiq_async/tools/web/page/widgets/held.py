"""The pose of the fingers, and the object that they hold. Pure.

Only the positions are known, so this is an approximation. A jaw holds a round bar between its pads.

Fingertips that meet an object before they meet each other are drawn at their positions, with the object
between them. Beyond that, a real finger has bent around the object: its base has stopped earlier than the
position alone would suggest. The share of the counts of base and middle joint depends on the object. Here it
is a round bar. The further the fingers have closed, the deeper it lies, and beyond the palm the thinner it
is.
"""

from __future__ import annotations

import cmath
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import asin, degrees, dist, radians
from typing import Final

from .....values import JAW, THREE_FINGER, Finger, ObjectStatus, RobotiqStatus
from ....description import HandModel, Pose
from ....description.geometry import Vector
from ....description.kinematics import BASE, FINGER_NAMES, MIDDLE, TIP, joint_angles, joint_names

ALONE_M: Final = 0.02
"""Radius of an object that is held from one side only."""
THIN_M: Final = 0.004
"""Minimum radius of an object between fingertips; with less, the fingers have bent around it."""
HALF_TIP_M: Final = 0.011
"""Distance from the middle of a fingertip to its side."""
THICK_M: Final = 0.033
"""Radius of the bar: a thicker one does not fit between the bases of the fingers on the palm."""
LEAST_M: Final = 0.025
"""Minimum radius of the bar: the middle joints cannot reach around a thinner one."""

# A finger in its own plane, from the URDF, in complex numbers. The origin is the foot of the finger; the real
# axis points out of the palm, the imaginary axis to the other side of the hand. A test compares it with the
# URDF.
_FOOT_M: Final = 0.0214
"""Height of the foot in the frame of the palm."""
_BASE_JOINT: Final = 0.020 + 0j
_BASE_LINK: Final = 0.050 - 0.028j
_MIDDLE_M: Final = 0.039
_BEND: Final = radians(30)
"""Angle between base and middle link, and back at the tip, when all angles are 0."""
_HALF_BASE_M: Final = 0.0095
_HALF_MIDDLE_M: Final = 0.0085
_PAD_M: Final = 0.010
"""Distance from the axis of the last joint to the face of the pad."""
_INWARDS_M: Final = 0.0455
"""Distance from the foot to the middle of the hand."""
_PALM_M: Final = -0.0054
"""Height of the palm's face."""
_HIGHEST_M: Final = 0.075
"""Height of a bar at the knees, around which the fingers hardly bend."""


@dataclass(frozen=True, slots=True)
class Thing:
    """An object between the fingers, in the frame of the root, in metres."""

    middle: Vector
    radius: float
    length: float = 0.0  # of a bar, along z for a 3-Finger and y for a jaw; 0 for a ball


def grasp(model: HandModel, status: RobotiqStatus) -> tuple[dict[str, float], Thing | None]:
    """The joint angles in radians by the names of joints, and the object; None for no object."""
    free = dict(zip(joint_names(status.model), joint_angles(status), strict=True))
    closing = _met_something_closing(status)
    if status.model is not THREE_FINGER:
        return free, _between_pads(model, free) if closing else None
    fingers = [finger for finger in FINGER_NAMES if finger & closing]
    faces = pads(model, model.link_poses(free))
    opposite = [finger for finger in fingers if finger is not Finger.A]
    if Finger.A not in fingers or not opposite:
        return free, _held_from_one_side(faces, fingers, closing)
    one, other = faces[Finger.A].position, _middle([faces[finger].position for finger in opposite])
    length = _length([faces[finger] for finger in fingers])
    if one[0] - other[0] >= 2 * THIN_M:
        x, y, _ = _middle([one, other])
        return free, Thing((x, y, length[0]), dist(one[:2], other[:2]) / 2, length[1])
    counts = (status.position(Finger.A) + sum(map(status.position, opposite)) / len(opposite)) / 2
    height, radius, bent = _around_a_bar(round(counts))
    for finger in fingers:
        names = (f"{FINGER_NAMES[finger]}_joint_{number}" for number in (1, 2, 3))
        free |= zip(names, bent, strict=True)
    return free, Thing((0.0, _FOOT_M + height, length[0]), radius, length[1])


def _between_pads(model: HandModel, free: Mapping[str, float]) -> Thing:
    poses = model.link_poses(free)
    shapes = {link: model.pad(link) for link in model.touching[JAW]}
    middles = [poses[link].apply(shape.origin.position) for link, shape in shapes.items()]
    thick, width, _ = next(iter(shapes.values())).size
    return Thing(_middle(middles), max(dist(*middles) / 2 - thick / 2, THIN_M), 2 * width)


def pads(model: HandModel, poses: Mapping[str, Pose]) -> dict[Finger, Pose]:
    """The face of each fingertip; its y axis points to the other side of the hand."""
    faces = {}
    for finger, name in FINGER_NAMES.items():
        link = f"{name}_link_3"
        pad = model.pad(link)
        face = poses[link] @ pad.origin
        faces[finger] = Pose(face.apply((0.0, pad.size[1] / 2, 0.0)), face.rotation)
    return faces


def _met_something_closing(status: RobotiqStatus) -> Finger:
    axes = Finger(0)
    for axis in status.model.axes:
        if status.finger_status(axis) is ObjectStatus.CONTACT_CLOSING:
            axes |= axis & status.contacts
    return axes


def _held_from_one_side(faces: Mapping[Finger, Pose], fingers: list[Finger], closing: Finger) -> Thing | None:
    if fingers:
        touching = [faces[finger] for finger in fingers]
        reach = _middle([face.apply((0.0, ALONE_M, 0.0)) for face in touching])
        return Thing(reach, ALONE_M, _length(touching)[1] if len(touching) > 1 else 0.0)
    if closing & Finger.SCISSOR:
        one, other = faces[Finger.B].position, faces[Finger.C].position
        return Thing(_middle([one, other]), max(dist(one, other) / 2 - HALF_TIP_M, THIN_M))
    return None


def _length(faces: list[Pose]) -> tuple[float, float]:
    """Middle and length along z of a bar that reaches beyond the fingertips."""
    places = [face.position[2] for face in faces]
    return (min(places) + max(places)) / 2, max(places) - min(places) + 4 * HALF_TIP_M


@lru_cache(maxsize=256)
def _around_a_bar(counts: int) -> tuple[float, float, tuple[float, float, float]]:
    """The bar inside a finger at this position: height above the foot, radius; and the joint angles."""
    low, high = 0.0, 2.0
    for _ in range(20):
        share = (low + high) / 2
        if _counts(_bent_around(*_bar(share))) < counts:
            low = share
        else:
            high = share
    height, radius = _bar(low)
    return height, radius, _bent_around(height, radius)


def _bar(share: float) -> tuple[float, float]:
    """Height and radius: from the highest bar (0) down to the palm (1), and there to the thinnest (2)."""
    low = _PALM_M + THICK_M
    if share < 1:
        return _HIGHEST_M + (low - _HIGHEST_M) * share, THICK_M
    radius = THICK_M + (LEAST_M - THICK_M) * (share - 1)
    return _PALM_M + radius, radius


def _bent_around(height: float, radius: float) -> tuple[float, float, float]:
    """The joint angles of a finger whose links touch the bar, within the limits of the joints."""
    bar = complex(height, _INWARDS_M)
    base = _within(_towards(bar - _BASE_JOINT, radius + _HALF_BASE_M) - cmath.phase(_BASE_LINK), BASE)
    knee = _BASE_JOINT + _BASE_LINK * cmath.exp(1j * base)
    heading = base - _BEND
    middle = _within(_towards(bar - knee, radius + _HALF_MIDDLE_M) - heading, MIDDLE)
    last = knee + cmath.rect(_MIDDLE_M, heading + middle)
    tip = _within(_towards(bar - last, radius + _PAD_M) - heading - middle - _BEND, TIP)
    return base, middle, tip


def _towards(bar: complex, apart: float) -> float:
    """The direction of a line from here that passes the bar at a distance from its axis."""
    return cmath.phase(bar) - asin(min(apart / abs(bar), 1.0))


def _within(angle: float, points: tuple[tuple[int, float], ...]) -> float:
    ends = sorted(radians(each) for _, each in points)
    return min(max(angle, ends[0]), ends[-1])


def _counts(joints: tuple[float, float, float]) -> float:
    """The motion of the motor, in counts, for these angles of base and middle joint."""
    base, middle, _ = joints
    return sum(
        degrees(angle) * (last - first) / (at_last - at_first)
        for angle, ((first, at_first), (last, at_last)) in ((base, BASE), (middle, MIDDLE))
    )


def _middle(points: list[Vector]) -> Vector:
    x, y, z = (sum(each) / len(points) for each in zip(*points, strict=True))
    return x, y, z
