"""Joint angles of a gripper from the positions of its axes, as ROS's joint states name them.

A 3-Finger has eleven joints, a sibling the one that drives its jaw.

Each finger has three phalanges and one motor: up to about 110 counts the base turns and the tip stays
parallel to itself, to 140 the base turns alone, from there to 240 the middle one, and beyond nothing moves
(Indiana University, technical report 711). The scissor turns the bases of B and C against each other.

The slopes and limits below come from the joint state publisher for ROS 1 (robotiq_3f_gripper_joint_states
of ros-industrial), which cites that report for the fingers; its author measured the scissor. They are one
formula, and no second source confirms them: public recordings of real hands, also by TAMS, have joint angles
which that same publisher computed from the positions.

Angles are of a mechanism without load and play: a finger that closes around something bends
earlier. Nothing here has been checked on a real hand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache, lru_cache
from math import radians
from types import MappingProxyType
from typing import Final, NamedTuple

from ...values import (
    HAND_E,
    JAW,
    THREE_FINGER,
    TWO_FINGER_85,
    TWO_FINGER_140,
    Finger,
    Model,
    RobotiqStatus,
    Stroke,
)

AngleTable = tuple[tuple[int, float], ...]
"""Position in counts, rising, and angle in degrees; straight in between, level beyond the ends."""

BASE: Final[AngleTable] = ((0, 0.0), (140, 70.0))
"""joint_1. The ROS node has a slope of 70/148 with a jump at 140; a straight line to 70 degrees is meant."""
MIDDLE: Final[AngleTable] = ((140, 0.0), (240, 90.0))
"""joint_2: still until the base stops, then up to its own stop."""
TIP: Final[AngleTable] = ((0, 0.0), (110, -55.0))
"""joint_3: against the base, because the tip stays parallel, until its stop."""
PALM: Final[AngleTable] = ((15, 11.0), (240, -11.0))
"""The palm joint of finger_1 against the scissor; finger_2 has its negative. The publisher's author
measured about 11 degrees to each side, where the manual has 32 in all; the source of 15 and 240 is not
given."""

FINGER_NAMES: Final = MappingProxyType(
    {Finger.C: "finger_1", Finger.B: "finger_2", Finger.A: "finger_middle"}
)
"""The names of the fingers in the public ROS description of the hand, in the order of its joints.

Joint states, goals, the URDF and every drawing take them from here. Sources disagree about
B and C, and a person has not looked yet: docs/decisions/finger-names.md.
"""


def _joints() -> Iterator[str]:
    for name in FINGER_NAMES.values():
        if name != "finger_middle":  # it has no palm joint
            yield f"palm_{name}_joint"
        yield from (f"{name}_joint_{number}" for number in (1, 2, 3))


JOINTS: Final = tuple(_joints())
"""The eleven names, in the order of :func:`joint_angles`: the palm joint of a finger before its own three."""


class JawJoint(NamedTuple):
    """The joint of a two-finger gripper that the others of its description follow.

    Attributes:
        name: in the public description.
        open: radians, or metres of one finger, of an open jaw.
        closed: the same of a closed one.
    """

    name: str
    open: float
    closed: float

    def at(self, stroke: Stroke, position: int) -> float:
        """Radians or metres at a position in counts; linear in between, as PickNik's driver has it."""
        return self.closed + (self.open - self.closed) * stroke.open_fraction(position)


JAW_JOINTS: Final = MappingProxyType(
    {
        # PickNik, ros2_robotiq_gripper: the closed position of the driver. The limit of the joint is 0.8.
        TWO_FINGER_85: JawJoint("robotiq_85_left_knuckle_joint", 0.0, 0.7929),
        # ros-industrial, robotiq_2f_140: the limit of the joint.
        TWO_FINGER_140: JawJoint("finger_joint", 0.0, 0.7),
        # AGH-CEAI, robotiq_hande_description: each finger travels half of the stroke.
        HAND_E: JawJoint("robotiq_hande_left_finger_joint", 0.025, 0.0),
    }
)


def joint_names(model: Model) -> tuple[str, ...]:
    """The names of a model's joints, in the order of :func:`joint_angles`."""
    return JOINTS if model is THREE_FINGER else (JAW_JOINTS[model].name,)


@cache
def finger_angles(position: int) -> tuple[float, float, float]:
    """The three joints of a finger in radians, from the palm on, at a position in counts."""
    # Cached, 256 of them: a recording needs nine fingers at every poll.
    base, middle, tip = (radians(_between(position, points)) for points in (BASE, MIDDLE, TIP))
    return base, middle, tip


def palm_angle(scissor: int) -> float:
    """The palm joint of finger_1 in radians at a position of the scissor; finger_2 has the negative."""
    return radians(_between(scissor, PALM))


def named_states(model: Model) -> dict[str, dict[str, float]]:
    """The joints of an open and of a closed gripper, by name; B and C of a 3-Finger are parallel."""
    if model is not THREE_FINGER:
        jaw = JAW_JOINTS[model]
        return {"open": {jaw.name: jaw.open}, "closed": {jaw.name: jaw.closed}}
    return {
        name: dict(zip(JOINTS, (0.0, *finger, 0.0, *finger, *finger), strict=True))
        for name, finger in (("open", finger_angles(0)), ("closed", finger_angles(255)))
    }


def joint_angles(status: RobotiqStatus) -> tuple[float, ...]:
    """The joints in radians, or a Hand-E's in metres, in the order of :func:`joint_names`."""
    return _angles_at(status.model, status.position)


def requested_angles(status: RobotiqStatus) -> tuple[float, ...]:
    """The same at the positions that the gripper echoes as requested."""
    return _angles_at(status.model, status.requested_position)


def _angles_at(model: Model, position: Callable[[Finger], int]) -> tuple[float, ...]:
    if model is not THREE_FINGER:
        return (JAW_JOINTS[model].at(model.stroke, position(JAW)),)
    return _joint_angles(*(position(axis) for axis in (Finger.SCISSOR, *FINGER_NAMES)))


@lru_cache(maxsize=16)
def _joint_angles(scissor: int, *fingers: int) -> tuple[float, ...]:
    # Cached, because the fingers rest most of the time.
    palm = palm_angle(scissor)
    one, two, middle = map(finger_angles, fingers)
    return (palm, *one, -palm, *two, *middle)


def joint_velocities(before: RobotiqStatus, after: RobotiqStatus) -> tuple[float, ...]:
    """Joint velocities between two statuses in rad/s, or m/s, in the order of :func:`joint_names`.

    A count is 0.5 degrees, so that between two polls this is either nothing or a lot: take statuses that are
    some tens of milliseconds apart.

    Raises:
        ValueError: the second is not later than the first.
    """
    seconds = after.timestamp - before.timestamp
    if seconds <= 0:
        raise ValueError(f"after must be later than before, got {seconds} s")
    return tuple(
        (new - old) / seconds for old, new in zip(joint_angles(before), joint_angles(after), strict=True)
    )


def _between(counts: int, points: Sequence[tuple[int, float]]) -> float:
    (first, at_first), (last, at_last) = points
    if counts <= first:
        return at_first
    if counts >= last:
        return at_last
    return at_first + (at_last - at_first) * (counts - first) / (last - first)
