"""The bodies of a gripper that is simulated with physics, for drawings.

How they get there: the simulated gripper stands in the program of its hand. A viewer of that hand calls
:func:`bodies_of` at each update, and sends the answer beside the status. It is no part of the status, because
no gripper reports it. A page gets it as JSON.

A real gripper has no bodies, and neither has one without physics, in another program (``robotiq-async
simulate``) or on another host, or while the link is lost: a drawing then follows the positions alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from ...link import simulated
from .geometry import Pose
from .model import Shape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...hands import Hand
    from ...simulator import Bodies

PART: Final = "part"
"""Material of the shapes of a part: no link has it."""


def bodies_of(hand: Hand) -> Bodies | None:
    """Places of joints and parts of a hand, if a simulation in this program knows them."""
    gripper = simulated(hand.address)
    return None if gripper is None else gripper.bodies


def joints_and_parts(bodies: Bodies) -> tuple[dict[str, float], tuple[Shape, ...]]:
    """The values of the joints by name, and the shapes of the parts, in the frame of the root link.

    ``bodies`` are as :func:`bodies_of` gives them, or read from JSON.
    """
    joints, parts = bodies
    return dict(joints), tuple(
        Shape(kind, tuple(size), _pose(position, *rotation), PART) for kind, size, position, rotation in parts
    )


def _pose(position: Sequence[float], *rows: Sequence[float]) -> Pose:
    (x, y, z), ((a, b, c), (d, e, f), (g, h, i)) = position, rows
    return Pose((x, y, z), ((a, b, c), (d, e, f), (g, h, i)))
