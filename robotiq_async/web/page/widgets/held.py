"""Where the thing is that the fingers hold. Pure; an idea of it, for a position is all that is known."""

from __future__ import annotations

from collections.abc import Mapping
from math import dist
from typing import Final

from ....description import HandModel, Pose
from ....description.geometry import Vector
from ....enums import Finger
from ....kinematics import FINGER_NAMES

ALONE_M: Final = 0.02
"""How far something reaches from a finger that nobody helps to hold it."""
HALF_TIP_M: Final = 0.011
"""From the middle of a fingertip to its side."""


def pads(model: HandModel, poses: Mapping[str, Pose]) -> dict[Finger, Pose]:
    """The face of each fingertip; y looks to the other side of the hand."""
    faces = {}
    for finger, prefix in FINGER_NAMES.items():
        link = f"{prefix}_link_3"
        pad = model.pad(link)
        face = poses[link] @ pad.origin
        faces[finger] = Pose(face.apply((0.0, pad.size[1] / 2, 0.0)), face.rotation)
    return faces


def held(faces: Mapping[Finger, Pose], contacts: Finger) -> tuple[Vector, float] | None:
    """Middle and radius of a ball between the fingers that met something while closing; None for nothing.

    Args:
        faces: of all fingertips.
        contacts: the axes that stopped against something; the scissor stands for B and C.
    """
    touching = [finger for finger in faces if finger & contacts]
    if not touching:
        if not contacts & Finger.SCISSOR:
            return None
        one, other = faces[Finger.B].position, faces[Finger.C].position
        return _middle([one, other]), max(dist(one, other) / 2 - HALF_TIP_M, 0.004)
    opposite = [faces[finger].position for finger in touching if finger is not Finger.A]
    if Finger.A in touching and opposite:
        one, other = faces[Finger.A].position, _middle(opposite)
        return _middle([one, other]), max(dist(one, other) / 2, 0.004)
    reach = [faces[finger].apply((0.0, ALONE_M, 0.0)) for finger in touching]
    return _middle(reach), ALONE_M


def _middle(points: list[Vector]) -> Vector:
    x, y, z = (sum(each) / len(points) for each in zip(*points, strict=True))
    return x, y, z
