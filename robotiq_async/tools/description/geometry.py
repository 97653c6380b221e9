"""Poses: position and rotation. Pure arithmetic on tuples, for a dozen links."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, hypot, sin, sqrt

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]
"""Rows."""

UNTURNED: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, slots=True)
class Pose:
    """A frame, expressed in its parent frame.

    Attributes:
        position: the origin, in metres.
        rotation: a matrix whose columns are the axes.
    """

    position: Vector = (0.0, 0.0, 0.0)
    rotation: Matrix = UNTURNED

    def __matmul__(self, inner: Pose) -> Pose:
        columns = tuple(zip(*inner.rotation, strict=True))
        rows = [tuple(_dot(row, column) for column in columns) for row in self.rotation]
        return Pose(self.apply(inner.position), (_vector(rows[0]), _vector(rows[1]), _vector(rows[2])))

    def apply(self, point: Vector) -> Vector:
        """Transform a point of this frame to the parent frame."""
        turned = [_dot(row, point) for row in self.rotation]
        return _vector([a + b for a, b in zip(self.position, turned, strict=True)])

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """The rotation as x, y, z, w, with w >= 0."""
        (a, b, c), (d, e, f), (g, h, i) = self.rotation
        # Of the four formulas, the one with the largest root loses no digits.
        squares = (1 + a - e - i, 1 - a + e - i, 1 - a - e + i, 1 + a + e + i)
        largest = max(range(4), key=squares.__getitem__)
        rows = (
            (squares[0], b + d, c + g, h - f),
            (b + d, squares[1], f + h, c - g),
            (c + g, f + h, squares[2], d - b),
            (h - f, c - g, d - b, squares[3]),
        )
        x, y, z, w = (each / (2 * sqrt(squares[largest])) for each in rows[largest])
        return (-x, -y, -z, -w) if w < 0 else (x, y, z, w)


def from_rpy(position: Vector, rpy: Vector) -> Pose:
    """A pose in URDF's form: rotations about the fixed axes x, y and z, in this order."""
    roll, pitch, yaw = rpy
    turn = turned((0, 0, 1), yaw) @ turned((0, 1, 0), pitch) @ turned((1, 0, 0), roll)
    return Pose(position, turn.rotation)


def turned(axis: Vector, angle: float) -> Pose:
    """A rotation in radians about an axis of any length through the origin, by the right-hand rule.

    Raises:
        ValueError: the axis has no length.
    """
    length = hypot(*axis)
    if length == 0:
        raise ValueError("axis must have a length, got (0, 0, 0)")
    x, y, z = (each / length for each in axis)
    c, s = cos(angle), sin(angle)
    d = 1 - c
    return Pose(
        rotation=(
            (c + x * x * d, x * y * d - z * s, x * z * d + y * s),
            (y * x * d + z * s, c + y * y * d, y * z * d - x * s),
            (z * x * d - y * s, z * y * d + x * s, c + z * z * d),
        )
    )


def _dot(one: tuple[float, ...], other: tuple[float, ...]) -> float:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


def _vector(values: list[float] | tuple[float, ...]) -> Vector:
    x, y, z = values
    return x, y, z
