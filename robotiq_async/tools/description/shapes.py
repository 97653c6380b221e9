"""Boxes, cylinders and spheres of a link, and the inertia that follows from them."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import NamedTuple

from .geometry import Pose, Vector, from_rpy
from .model import PAD, RigidLink, Shape


def box(size: Vector, at: Vector, material: str, rpy: Vector = (0.0, 0.0, 0.0), name: str = "") -> Shape:
    return Shape("box", size, from_rpy(at, rpy), material, name)


def pad(size: Vector, at: Vector, rpy: Vector = (0.0, 0.0, 0.0)) -> Shape:
    return box(size, at, "pad", rpy, PAD)


def cylinder(radius: float, length: float, at: Vector, material: str, rpy: Vector = (0.0, 0.0, 0.0)) -> Shape:
    return Shape("cylinder", (radius, length), from_rpy(at, rpy), material)


def sphere(radius: float, at: Vector, material: str) -> Shape:
    return Shape("sphere", (radius,), Pose(at), material)


class Inertia(NamedTuple):
    """The inertia of a link about its centre of mass, along the axes of its frame.

    Attributes:
        centre: of mass, in metres.
        moments: ixx, iyy, izz in kg m2.
        products: ixy, ixz, iyz.
    """

    centre: Vector
    moments: Vector
    products: Vector


def inertia(link: RigidLink) -> Inertia:
    """The inertia of a link's mass, spread evenly over its shapes; where they overlap it counts twice."""
    volumes = [_volume(shape) for shape in link.shapes]
    masses = [link.mass * volume / sum(volumes) for volume in volumes]
    places = [shape.origin.position for shape in link.shapes]
    centre = _weighted(places, masses)
    total = [[0.0] * 3 for _ in range(3)]
    for shape, mass, place in zip(link.shapes, masses, places, strict=True):
        own, turn = _own_moments(shape), shape.origin.rotation
        away = [a - b for a, b in zip(place, centre, strict=True)]
        square = sum(each * each for each in away)
        for i in range(3):
            for j in range(3):
                turned = sum(turn[i][k] * own[k] * turn[j][k] for k in range(3))
                total[i][j] += mass * (turned + square * (i == j) - away[i] * away[j])
    moments = (total[0][0], total[1][1], total[2][2])
    return Inertia(centre, moments, (total[0][1], total[0][2], total[1][2]))


def _weighted(places: Sequence[Vector], masses: Sequence[float]) -> Vector:
    x, y, z = (
        sum(mass * each for mass, each in zip(masses, along, strict=True)) / sum(masses)
        for along in zip(*places, strict=True)
    )
    return x, y, z


def _volume(shape: Shape) -> float:
    if shape.kind == "box":
        return shape.size[0] * shape.size[1] * shape.size[2]
    if shape.kind == "cylinder":
        return pi * shape.size[0] ** 2 * shape.size[1]
    return 4 / 3 * pi * shape.size[0] ** 3


def _own_moments(shape: Shape) -> Vector:
    """The moments of one kilogram, about the axes of the shape."""
    if shape.kind == "box":
        x, y, z = (each * each / 12 for each in shape.size)
        return y + z, x + z, x + y
    if shape.kind == "cylinder":
        radius, length = shape.size
        across = radius * radius / 4 + length * length / 12
        return across, across, radius * radius / 2
    moment = 2 / 5 * shape.size[0] ** 2
    return moment, moment, moment
