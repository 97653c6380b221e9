"""The bodies of a mechanism: places of the joints, and of the parts before the gripper.

For people who look at it. No register has any of this, and no real gripper reports it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

Vector = tuple[float, float, float]


class Body(NamedTuple):
    """A box, a cylinder (along z) or a sphere, in the frame of the gripper's root link.

    Attributes:
        kind: ``box``, ``cylinder`` or ``sphere``.
        size: in metres: of a box the three edges; of a cylinder radius and length; of a sphere the radius.
        position: its middle, in metres.
        rotation: the rows of a matrix whose columns are its axes.
    """

    kind: str
    size: tuple[float, ...]
    position: Vector
    rotation: tuple[Vector, Vector, Vector]


class Bodies(NamedTuple):
    """The places of all bodies at one moment.

    Attributes:
        joints: radians, or metres for a sliding joint, by the names of the description.
        parts: the shapes of the parts; empty while they are out of the way, as in an activation.
    """

    joints: Mapping[str, float]
    parts: tuple[Body, ...]
