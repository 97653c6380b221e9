"""Converts joints in radians, or of a Hand-E in metres, for ROS, from and to axes in counts.

A finger has one motor for three joints, so a goal for a finger is a goal for one of them: the base joint
(``joint_1``) as far as it turns alone, the middle one (``joint_2``) beyond that. The third joint and the
second palm joint only follow. The source of the angles is :mod:`robotiq_async.tools.description.kinematics`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import degrees, radians
from types import MappingProxyType
from typing import Final

from ...tools.description import kinematics
from ...tools.description.kinematics import (
    BASE,
    FINGER_NAMES,
    JAW_JOINTS,
    JOINTS,
    MIDDLE,
    PALM,
    AngleTable,
    joint_angles,
)
from ...values import HAND_E, JAW, THREE_FINGER, Finger, Model, RobotiqStatus

FINGERS_JOINT: Final = "fingers"
"""Name for all three fingers in a goal: one angle, the sum of base and middle joint."""
_PALM_JOINT: Final = "palm_finger_1_joint"
_BASE_LIMITS: Final = (0.0495, 1.2217)
_MIDDLE_LIMITS: Final = (0.0, 1.5708)
_TIP_LIMITS: Final = (-0.9599, -0.0523)

JOINT_LIMITS: Final = MappingProxyType(
    {name: _BASE_LIMITS for name in JOINTS if name.endswith("_joint_1")}
    | {name: _MIDDLE_LIMITS for name in JOINTS if name.endswith("_joint_2")}
    | {name: _TIP_LIMITS for name in JOINTS if name.endswith("_joint_3")}
    | {_PALM_JOINT: (-0.1784, 0.1919), "palm_finger_2_joint": (-0.1919, 0.1784)}
)
"""Lower and upper limit of each joint in radians. Within the limits of the packaged URDF, and of the one in
ros-industrial (robotiq_3f_gripper_visualization), which are narrower for open fingers and for the pinching
scissor.

The angles exceed them at the ends: a finger below 6 counts, a scissor above 232. Consumers reject a joint
outside its limits, so published angles are clamped.
"""
_RANGES: Final = tuple(JOINT_LIMITS[name] for name in JOINTS)

CLOSING_END: Final = 2.8
"""End of the closing angle of all fingers: 70 degrees of the base and 90 of the middle joint, rounded up."""
GOAL_TOLERANCE: Final = 1e-3  # radians that a goal may be outside its range, because clients round
JAW_TOLERANCE: Final = 0.01
"""Share of its range that a goal for a jaw may be outside. Clients round, and close a 2F-85 to 0.8, the limit
of its joint in public descriptions."""
_STOP_TOLERANCE: Final = 0.1
"""Radians that the base joint of a goal may be off its stop while the middle one bends."""

LONGEST_JOINT_NAME: Final = 80  # characters of an unknown name in an error

JOINT_VELOCITY_S: Final = (
    0.04  # seconds over which a velocity is computed, at least: one count is half a degree
)


class GoalError(ValueError):
    """A goal that names an unknown joint, or cannot be reached."""


@dataclass(frozen=True, slots=True)
class Targets:
    """Target positions of axes."""

    counts: tuple[tuple[int, Finger], ...]  # each position, 0..255, with the axes that move there; none twice

    @property
    def axes(self) -> Finger:
        return Finger(sum(int(axes) for _, axes in self.counts))


def joint_names(prefix: str = "", model: Model = THREE_FINGER) -> list[str]:
    """The names of the joints, with the prefix."""
    return [prefix + name for name in kinematics.joint_names(model)]


def positions(status: RobotiqStatus) -> tuple[float, ...]:
    """The joints in radians, or a Hand-E's in metres, within their limits."""
    angles = joint_angles(status)
    return _inside(angles) if status.model is THREE_FINGER else angles


@lru_cache(maxsize=16)
def _inside(angles: tuple[float, ...]) -> tuple[float, ...]:
    # Cached, because the fingers are still most of the time.
    return tuple(min(max(angle, low), high) for angle, (low, high) in zip(angles, _RANGES, strict=True))


class Motion:
    """Positions and velocities of the joints over consecutive statuses."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, Sequence[float]]] = deque()

    def of(self, status: RobotiqStatus) -> tuple[Sequence[float], Sequence[float]]:
        """Positions, and velocities per second over the last VELOCITY_S; these are 0 at first."""
        seen, at, there = self._seen, status.timestamp, positions(status)
        if not seen or at > seen[-1][0]:
            seen.append((at, there))
        while len(seen) > 2 and at - seen[1][0] >= JOINT_VELOCITY_S:
            seen.popleft()
        before, past = seen[0]
        if past is there or before >= at:
            return there, (0.0,) * len(there)
        return there, [(new - old) / (at - before) for old, new in zip(past, there, strict=True)]

    def forget(self) -> None:
        # After a lost link the next position is not a motion since the last one.
        self._seen.clear()


def targets(
    names: Sequence[str], angles: Sequence[float], prefix: str = "", model: Model = THREE_FINGER
) -> Targets:
    """The targets of a goal.

    The names of joints have the prefix; without names there is one angle for all fingers, or for the jaw.
    Angles are in radians, or in metres for a Hand-E.

    Raises:
        GoalError: the goal is invalid; angles are never adjusted to fit.
    """
    if model is not THREE_FINGER:
        return _jaw_targets(names, angles, prefix, model)
    given = _pairs(names, angles, prefix, _COMMANDED)
    counts: dict[Finger, int] = {}
    for name, angle in given.items():
        if name == FINGERS_JOINT:
            for finger in FINGER_NAMES:
                counts[finger] = _closing_counts(angle)
        elif name == _PALM_JOINT:
            counts[Finger.SCISSOR] = _counts(name, angle, JOINT_LIMITS[name], PALM)
    for finger, name in FINGER_NAMES.items():
        base, middle = given.get(f"{name}_joint_1"), given.get(f"{name}_joint_2")
        if base is None and middle is None:
            continue
        if finger in counts:
            raise GoalError(f"two positions for one finger: {FINGERS_JOINT!r} and {name!r}")
        counts[finger] = _finger_counts(name, base, middle)
    return Targets(
        tuple(
            (position, Finger(sum(axis for axis, each in counts.items() if each == position)))
            for position in dict.fromkeys(counts.values())
        )
    )


def _jaw_targets(names: Sequence[str], values: Sequence[float], prefix: str, model: Model) -> Targets:
    joint = JAW_JOINTS[model]
    (value,) = _pairs(names, values, prefix, (joint.name,)).values()
    low, high = sorted((joint.open, joint.closed))
    reached = min(max(value, low), high)
    if abs(value - reached) > JAW_TOLERANCE * high:
        unit = "m" if model is HAND_E else "rad"
        raise GoalError(f"{joint.name!r} must be in {low}..{high} {unit}, got {value:.4f}")
    opening = (reached - joint.closed) / (joint.open - joint.closed)
    return Targets(((round(model.stroke.closed_reading - opening * model.stroke.counts), JAW),))


def _pairs(
    names: Sequence[str], angles: Sequence[float], prefix: str, commanded: Sequence[str]
) -> dict[str, float]:
    if not names and len(angles) == 1:
        names = [prefix + commanded[-1]]
    if not names:
        raise GoalError(f"no joint is named, so one position is needed, got {len(angles)}")
    if len(names) != len(angles):
        raise GoalError(f"{len(names)} joints and {len(angles)} positions")
    given: dict[str, float] = {}
    for name, angle in zip(names, angles, strict=True):
        plain = _plain_name(name, prefix, commanded)
        if plain in given:
            raise GoalError(f"two positions for one joint: {name!r}")
        if not math.isfinite(angle):
            raise GoalError(f"the position of {name!r} is {angle}")
        given[plain] = angle
    return given


def _plain_name(name: str, prefix: str, commanded: Sequence[str]) -> str:
    plain = name.removeprefix(prefix)
    if name.startswith(prefix) and plain in commanded:
        return plain
    these = ", ".join(prefix + each for each in commanded)
    if name.startswith(prefix) and plain in JOINTS and FINGERS_JOINT in commanded:
        raise GoalError(f"{name!r} follows other joints and takes no goal; these do: {these}")
    shown = name if len(name) <= LONGEST_JOINT_NAME else f"{name[:LONGEST_JOINT_NAME]}..."  # of any length
    raise GoalError(f"there is no joint {shown!r}; these take goals: {these}")


def _finger_counts(name: str, base: float | None, middle: float | None) -> int:
    # One motor turns both: the base joint up to its stop, the middle one beyond that.
    if middle is not None:
        counts = _counts(f"{name}_joint_2", middle, _MIDDLE_LIMITS, MIDDLE)
        if middle > GOAL_TOLERANCE:
            if base is not None and base < radians(BASE[-1][1]) - _STOP_TOLERANCE:
                raise GoalError(
                    f"two positions for one finger: {name}_joint_2 bends only once {name}_joint_1 is at its "
                    f"stop ({radians(BASE[-1][1]):.2f} rad), not at {base:.2f} rad"
                )
            if base is not None:
                _counts(f"{name}_joint_1", base, _BASE_RANGE, BASE)
            return counts
        if base is None:
            return counts
    assert base is not None
    return _counts(f"{name}_joint_1", base, _BASE_RANGE, BASE)


def _closing_counts(angle: float) -> int:
    if not -GOAL_TOLERANCE <= angle <= CLOSING_END + GOAL_TOLERANCE:
        raise GoalError(f"{FINGERS_JOINT!r} must be in 0..{CLOSING_END} rad, got {angle:.4f}")
    stop = radians(BASE[-1][1])
    return _between(angle, BASE) if angle <= stop else _between(angle - stop, MIDDLE)


def _counts(name: str, angle: float, limits: tuple[float, float], points: AngleTable) -> int:
    low, high = limits
    if not low - GOAL_TOLERANCE <= angle <= high + GOAL_TOLERANCE:
        raise GoalError(f"{name!r} must be in {low}..{high} rad, got {angle:.4f}")
    return _between(angle, points)


def _between(angle: float, points: AngleTable) -> int:
    (first, at_first), (last, at_last) = points
    share = (degrees(angle) - at_first) / (at_last - at_first)
    return round(first + (last - first) * min(max(share, 0.0), 1.0))


_BASE_RANGE: Final = (0.0, _BASE_LIMITS[1])
"""Range of goals: people write 0 for an open finger, although it reads a little more."""
_COMMANDED: Final = (
    *(f"{name}_joint_{number}" for name in FINGER_NAMES.values() for number in (1, 2)),
    _PALM_JOINT,
    FINGERS_JOINT,
)
