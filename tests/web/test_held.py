"""The part that the page draws between the fingers, and their pose around it: compared with the URDF."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from math import hypot

import pytest

from robotiq_async import Finger, RobotiqStatus
from robotiq_async.tools.description import Pose, hand_model
from robotiq_async.tools.description.geometry import Vector
from robotiq_async.tools.description.kinematics import FINGER_NAMES, JOINTS, joint_angles
from robotiq_async.tools.web.page.widgets.held import Thing, grasp, pads
from robotiq_async.values.model import MODELS
from tests.register_words import status_of

MODEL = hand_model()
HOLDING = 0xB9
ABC_CLOSING, NOTHING = 0xEA, 0xFF
PLATE_M = 0.016
"""Height of the palm's face."""


def holding(*positions: int, met: int = ABC_CLOSING, scissor: int = 100) -> RobotiqStatus:
    a, b, c = positions if len(positions) == 3 else positions * 3
    return status_of(HOLDING, met, position=(a, b, c, scissor))


def drawn(status: RobotiqStatus) -> tuple[dict[str, Pose], Thing]:
    angles, thing = grasp(MODEL, status)
    for joint in MODEL.moving:
        assert joint.lower - 1e-3 <= angles[joint.name] <= joint.upper + 1e-3, joint.name
    assert thing is not None
    return MODEL.link_poses(angles), thing


def surface(poses: dict[str, Pose], name: str) -> Iterator[Vector]:
    """Points of the boxes of a finger's moving links."""
    shares = [number / 12 - 0.5 for number in range(13)]
    for link in (f"{name}_link_{number}" for number in (1, 2, 3)):
        for shape in MODEL.links[link].shapes:
            if shape.kind == "box":
                x, y, z = shape.size
                for share, side, end in product(shares, (-0.5, 0.5), (-0.5, 0.0, 0.5)):
                    yield poses[link].apply(shape.origin.apply((x * share, y * side, z * end)))


def from_axis(point: Vector, bar: Thing) -> float:
    return hypot(point[0] - bar.middle[0], point[1] - bar.middle[1])


@pytest.mark.parametrize("position", [30, 60, 85, 96, 100, 103, 110, 120, 130, 150, 170, 190, 210, 225])
@pytest.mark.parametrize(("scissor", "off"), [(0, 5e-3), (100, 2e-3), (137, 2e-3)])
def test_fingers_stand_around_what_they_hold(position: int, scissor: int, off: float) -> None:
    """An object at 150: the fingers had crossed each other, and a ball was drawn behind their backs."""
    poses, bar = drawn(holding(position, scissor=scissor))
    assert bar.length > 0.05
    assert bar.middle[1] - bar.radius >= PLATE_M - 1e-3, "above the palm"
    for finger, name in FINGER_NAMES.items():
        face = pads(MODEL, poses)[finger]
        to_it = [a - b for a, b in zip(bar.middle, face.position, strict=True)]
        assert sum(to_it[n] * face.rotation[n][1] for n in (0, 1)) > 0, f"{finger} has it before its pad"
        near = min(from_axis(point, bar) for point in surface(poses, name))
        assert near >= bar.radius - off, f"{finger} is not inside of it"
        assert near <= bar.radius + off, f"{finger} touches it"


@pytest.mark.parametrize("position", [30, 85, 96])
def test_fingertips_that_hold_something_stand_where_their_positions_say(position: int) -> None:
    status = holding(position)
    angles, thing = grasp(MODEL, status)
    assert tuple(angles[name] for name in JOINTS) == joint_angles(status)
    assert thing is not None
    faces = pads(MODEL, MODEL.link_poses(angles))
    assert from_axis(faces[Finger.A].position, thing) == pytest.approx(thing.radius)


def test_the_further_the_fingers_closed_the_deeper_it_lies() -> None:
    heights = [drawn(holding(position))[1].middle[1] for position in range(105, 235, 5)]
    assert heights == sorted(heights, reverse=True)
    assert heights[0] - heights[-1] > 0.03


def test_a_finger_that_met_nothing_stands_where_its_position_says() -> None:
    status = holding(150, 150, 240, met=0b11_11_10_10)
    angles, thing = grasp(MODEL, status)
    free = dict(zip(JOINTS, joint_angles(status), strict=True))
    name = FINGER_NAMES[Finger.C]
    assert all(angles[f"{name}_joint_{number}"] == free[f"{name}_joint_{number}"] for number in (1, 2, 3))
    assert angles[f"{FINGER_NAMES[Finger.B]}_joint_2"] > free[f"{FINGER_NAMES[Finger.B]}_joint_2"]
    assert thing is not None
    assert thing.middle[2] == pytest.approx(-0.02, abs=0.005), "between A and B"


@pytest.mark.parametrize(
    ("met", "is_bar"), [(0b11_11_11_10, False), (0b11_10_10_11, True), (0b10_11_11_11, False)]
)
def test_a_part_met_on_one_side_is_drawn_before_it(met: int, is_bar: bool) -> None:
    status = holding(70, met=met)
    angles, thing = grasp(MODEL, status)
    assert tuple(angles[name] for name in JOINTS) == joint_angles(status)
    assert thing is not None
    assert bool(thing.length) is is_bar


@pytest.mark.parametrize("name", ["2f85", "2f140", "hand-e"])
def test_a_jaw_holds_a_bar_between_its_pads(name: str) -> None:
    model, radii = hand_model(name), []
    for position in (60, 120, 180):
        registers = (0xB900, 0x00FF, position << 8, 0, 0, 0, 0, 0)
        status = RobotiqStatus.from_registers(registers, timestamp=0.0, sequence=0, model=MODELS[name])
        angles, thing = grasp(model, status)
        assert thing is not None
        poses = model.link_poses(angles)
        for link in model.touching[Finger.A]:
            pad = poses[link].apply(model.pad(link).origin.position)
            assert abs(pad[0]) == pytest.approx(thing.radius + 0.0025), "the face of the pad touches it"
            assert pad[1:] == pytest.approx(thing.middle[1:])
        radii.append(thing.radius)
    assert radii == sorted(radii, reverse=True)


def test_nothing_is_held() -> None:
    status = holding(240, met=NOTHING)
    angles, thing = grasp(MODEL, status)
    assert thing is None
    assert tuple(angles[name] for name in JOINTS) == joint_angles(status)


def test_a_part_met_while_opening_is_not_held() -> None:
    assert grasp(MODEL, holding(60, met=0b11_01_01_01))[1] is None
