"""One description of each model: what it weighs, how its pads move, and the files written from it."""

from __future__ import annotations

import shutil
import subprocess
import xml.etree.ElementTree as ET
from math import dist, pi

import pytest

from robotiq_async.tools.description import HandModel, Pose, RigidLink, hand_model, mjcf, urdf
from robotiq_async.tools.description.__main__ import DATA, written
from robotiq_async.tools.description.kinematics import JAW_JOINTS, joint_names
from robotiq_async.tools.description.shapes import box, inertia, sphere
from robotiq_async.values.enums import JAW
from robotiq_async.values.model import HAND_E, MODELS, TWO_FINGER_85, TWO_FINGER_140, Model

ALL = pytest.mark.parametrize("name", MODELS)
JAWS = pytest.mark.parametrize("model", [TWO_FINGER_85, TWO_FINGER_140, HAND_E], ids=str)
# Driver's angle against the distance of the pads in the public 2F-85 of MuJoCo Menagerie, whose pads meet at
# 0.778 rad by the last two points.
MENAGERIE_CLOSED = 0.778
MENAGERIE = (
    *((0.003, 85.2), (0.065, 79.3), (0.128, 73.1), (0.191, 66.8), (0.253, 60.1), (0.316, 53.3)),
    *((0.379, 46.4), (0.441, 39.2), (0.504, 32.0), (0.567, 24.7), (0.629, 17.2), (0.692, 9.8), (0.755, 2.3)),
)


def at(model: Model, share: float) -> dict[str, float]:
    """The values of a jaw that is closed by a share of its way."""
    jaw = JAW_JOINTS[model]
    return {jaw.name: jaw.open + (jaw.closed - jaw.open) * share}


def faces(model: Model, share: float) -> list[Pose]:
    """The middle of each pad's face."""
    hand = hand_model(model)
    poses, found = hand.link_poses(at(model, share)), []
    for link, inwards in zip(hand.touching[JAW], (-1, 1), strict=True):
        pad = hand.pad(link)
        found.append(poses[link] @ pad.origin @ Pose((inwards * pad.size[0] / 2, 0.0, 0.0)))
    return found


def apart_mm(model: Model, share: float) -> float:
    one, other = (face.position[0] for face in faces(model, share))
    return 1000 * (one - other)


# -- how pads move ---------------------------------------------------------------------------------------


def test_the_pads_of_a_2f85_are_as_far_apart_as_the_public_model_has_them() -> None:
    for angle, mm in MENAGERIE:
        assert apart_mm(TWO_FINGER_85, angle / MENAGERIE_CLOSED) == pytest.approx(mm, abs=0.5)


@JAWS
def test_an_open_jaw_is_open_by_its_stroke_and_a_closed_one_is_closed(model: Model) -> None:
    assert apart_mm(model, 0) == pytest.approx(model.stroke.mm, abs=1e-6)
    assert apart_mm(model, 1) == pytest.approx(0, abs=1e-6)


def test_the_hand_e_is_linear_and_stays_level() -> None:
    for share in (0.1, 0.5, 0.9):
        assert apart_mm(HAND_E, share) == pytest.approx(50 * (1 - share))
        assert {round(face.position[2], 9) for face in faces(HAND_E, share)} == {0.149}


@JAWS
def test_pads_look_at_each_other_at_every_opening(model: Model) -> None:
    for share in (0.0, 0.3, 0.7, 1.0):
        left, right = faces(model, share)
        for face in (left, right):
            assert face.quaternion == pytest.approx((0, 0, 0, 1), abs=1e-9)
        assert left.position == pytest.approx((-right.position[0], *right.position[1:]), abs=1e-9)


@pytest.mark.parametrize("model", [TWO_FINGER_85, TWO_FINGER_140], ids=str)
def test_pads_of_a_2f_move_away_from_the_base_as_they_close(model: Model) -> None:
    """They do until the cranks stand upright, shortly before the end."""
    heights = [faces(model, share / 10)[0].position[2] for share in range(10)]
    assert heights[:9] == sorted(heights[:9])
    assert heights[-1] - heights[0] > 0.01


@pytest.mark.parametrize("model", [TWO_FINGER_85, TWO_FINGER_140], ids=str)
def test_the_four_bar_closes(model: Model) -> None:
    """The end of the inner crank is one point of the fingertip, at every opening."""
    hand = hand_model(model)
    for side in ("left", "right"):
        chain = [joint for joint in hand.moving if side in joint.child]
        outer, inner, tip = (joint.child for joint in chain)
        crank = chain[2].origin.position
        points = []
        for share in (0.0, 0.25, 0.5, 1.0):
            poses = hand.link_poses(at(model, share))
            end = poses[inner].apply(crank)
            points.append([a - b for a, b in zip(end, poses[tip].position, strict=True)])
            assert dist(end, poses[inner].position) == pytest.approx(
                dist(poses[tip].position, poses[outer].position)
            )
        for point in points[1:]:
            assert point == pytest.approx(points[0], abs=1e-9)


# -- what it weighs --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "kilograms"), [("3f", 2.3), ("2f85", 0.93), ("2f140", 1.03), ("hand-e", 1.07)]
)
def test_the_links_weigh_what_the_gripper_weighs(name: str, kilograms: float) -> None:
    hand = hand_model(name)
    assert hand.mass == pytest.approx(kilograms)
    for link in hand.links.values():
        one, two, three = sorted(inertia(link).moments)
        assert 0 < one <= two <= three < one + two, link.name


def test_inertia_is_that_of_the_textbook() -> None:
    turned = RigidLink("bar", 2.0, (box((0.1, 0.02, 0.04), (1, 2, 3), "body", (0, 0, pi / 2)),))
    centre, moments, products = inertia(turned)
    assert centre == pytest.approx((1, 2, 3))
    x, y, z = 0.02, 0.1, 0.04
    assert moments == pytest.approx([(y * y + z * z) / 6, (x * x + z * z) / 6, (x * x + y * y) / 6])
    assert products == pytest.approx((0, 0, 0), abs=1e-12)
    dumbbell = RigidLink("dumbbell", 2.0, (sphere(0.1, (1, 1, 0), "body"), sphere(0.1, (-1, -1, 0), "body")))
    own = 2 * 2 / 5 * 0.01
    assert inertia(dumbbell).moments == pytest.approx((2 + own, 2 + own, 4 + own))
    assert inertia(dumbbell).products == pytest.approx((-2, 0, 0))


# -- the tree --------------------------------------------------------------------------------------------


@ALL
def test_one_tree_whose_free_joints_joint_states_name(name: str) -> None:
    hand = hand_model(name)
    children = [joint.child for joint in hand.joints]
    assert {hand.root, *children} == hand.links.keys()
    assert len(set(children)) == len(children)
    free = {joint.name for joint in hand.moving if joint.mimic is None}
    assert free == set(joint_names(MODELS[name]))
    assert hand.fingers.keys() == hand.touching.keys()
    assert {*hand.drives} == {*MODELS[name].axes}


@ALL
def test_what_follows_another_joint_stays_within_its_limits(name: str) -> None:
    hand = hand_model(name)
    for joint in hand.moving:
        if joint.mimic is not None:
            leader = next(each for each in hand.moving if each.name == joint.mimic.joint)
            ends = sorted(joint.mimic.multiplier * end for end in (leader.lower, leader.upper))
            assert ends == pytest.approx([joint.lower, joint.upper])


# -- the files -------------------------------------------------------------------------------------------


@ALL
def test_the_packaged_files_are_those_of_the_description(name: str) -> None:
    """``python -m robotiq_async.tools.description`` writes them."""
    files = written(MODELS[name])
    assert {file: (DATA / file).read_text(encoding="utf-8") for file in files} == files
    assert {urdf(name), mjcf(MODELS[name])} == set(files.values())


@ALL
def test_every_link_of_a_urdf_is_drawn_and_has_mass_and_collision(name: str) -> None:
    robot = ET.fromstring(urdf(name))
    named = {each.attrib["name"] for each in robot.findall("material")}
    for link in robot.findall("link"):
        tags = [each.tag for each in link]
        assert tags.count("inertial") == 1
        assert tags.count("visual") == tags.count("collision") >= 1
        assert {each.attrib["name"] for each in link.iterfind("visual/material")} <= named


@ALL
@pytest.mark.skipif(shutil.which("check_urdf") is None, reason="apt-get install liburdfdom-tools")
def test_the_parser_of_ros_takes_the_urdf(name: str) -> None:
    """The library that MoveIt and robot_state_publisher read a URDF with."""
    file = DATA / f"robotiq_{name.replace('-', '_')}.urdf"
    answer = subprocess.run(["check_urdf", str(file)], capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stdout + answer.stderr
    assert "Successfully Parsed" in answer.stdout
    assert not answer.stderr


@ALL
@pytest.mark.parametrize("form", ["urdf", "mjcf"])
def test_mujoco_puts_every_link_where_the_description_has_it(name: str, form: str) -> None:
    mujoco = pytest.importorskip("mujoco", reason="needs the extra physics")
    hand = hand_model(name)
    model = mujoco.MjModel.from_xml_string({"urdf": urdf, "mjcf": mjcf}[form](name))
    data = mujoco.MjData(model)
    if form == "mjcf":
        assert sum(model.body_mass) == pytest.approx(hand.mass, rel=1e-4)
        assert model.nu == len(hand.drives)
    values = hand.completed({joint.name: (joint.lower + 3 * joint.upper) / 4 for joint in hand.moving})
    for joint, value in values.items():
        data.joint(joint).qpos[0] = value
    mujoco.mj_kinematics(model, data)
    root = hand.stand if form == "mjcf" else Pose()
    for link, pose in hand.link_poses(values).items():
        if form == "mjcf" or link in bodies(hand):
            assert tuple(data.body(link).xpos) == pytest.approx((root @ pose).position, abs=1e-5), link


def bodies(hand: HandModel) -> set[str]:
    """The links that MuJoCo does not merge into the world: it does with what stands still in a URDF."""
    return {joint.child for joint in hand.moving}


def test_a_model_that_does_not_exist_has_no_description() -> None:
    with pytest.raises(ValueError, match="one of 3f, 2f85"):
        hand_model("4f")
    with pytest.raises(TypeError):
        urdf(85)  # type: ignore[arg-type]
