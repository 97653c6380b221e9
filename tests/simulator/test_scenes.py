"""Scenes before a gripper with physics, in words and as files of the user's own, and the mistakes in them."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="needs the extra physics")

from robotiq_async import ObjectStatus
from robotiq_async.simulator import Physics, SimulatedGripper
from robotiq_async.simulator.mechanics.scene import Scene, ScenePart, parse_scene
from robotiq_async.values.enums import JAW
from robotiq_async.values.model import HAND_E, THREE_FINGER, TWO_FINGER_85, Model
from tests.simulator.test_mechanics import POLL_S, Bench, active

# -- in words --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "scene"),
    [
        ("table", Scene()),
        ("box:40x60x80,0.3", Scene(ScenePart("box", (40, 60, 80), 0.3))),
        ("rod:40x120,0.25@95", Scene(ScenePart("rod", (40, 120), 0.25, 95))),
        ("sphere:60,1", Scene(ScenePart("sphere", (60,), 1))),
        ("cell.xml", Scene(file="cell.xml")),
    ],
)
def test_scenes_in_words(text: str, scene: Scene) -> None:
    assert parse_scene(text) == scene


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "physics must be table"),
        ("cone:40,1", "box, cylinder, rod, sphere"),
        ("box:40x60,0.3", "a box has 3 lengths, got 40x60"),
        ("box:40x60x0,0.3", "size must be a number above 0 and at most 1000, got '0'"),
        ("sphere:60,0", "mass must be"),
        ("sphere:60,1000", "mass must be"),
    ],
)
def test_words_that_are_no_scene(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Physics(text)


def test_physics_has_one_gripper() -> None:
    bench = Bench("table")
    with pytest.raises(RuntimeError, match="one for each"):
        SimulatedGripper(physics=bench.physics)
    with pytest.raises(RuntimeError, match="no gripper yet"):
        Physics("table").lift(10)


def test_obstacles_at_a_count_are_for_grippers_without_physics() -> None:
    with pytest.raises(ValueError, match="not obstacles at a count"):
        Bench("table").gripper.place_object(JAW, 100)


OWN = """<mujoco><worldbody>
  <geom type="plane" size="1 1 0.1"/>
  <body name="arm" pos="0 0 0.17">
    <joint name="elbow" type="hinge" axis="0 0 1" damping="1"/>
    <geom type="box" size="0.02 0.02 0.02" pos="0 0 0.05" mass="1" contype="0" conaffinity="0"/>
    <site name="gripper" quat="0 1 0 0"/>
  </body>
  <body name="can" pos="0 0 0.03"><freejoint/><geom type="cylinder" size="0.02 0.03" mass="0.1"/></body>
</worldbody><actuator><position name="elbow" joint="elbow" kp="50"/></actuator></mujoco>"""


def test_the_gripper_is_mounted_in_a_world_of_ones_own(tmp_path: Path) -> None:
    file = tmp_path / "cell.xml"
    file.write_text(OWN, encoding="utf-8")
    bench = active(str(file))
    bench.move(255)
    assert bench.status.finger_status(JAW) is ObjectStatus.CONTACT_CLOSING
    assert bench.physics.opening_mm == pytest.approx(40, abs=4)


ARM = """<mujoco><worldbody>
  <geom type="plane" size="1 1 0.1"/>
  <body name="arm" pos="0 0 0.17"><joint name="z" type="slide" axis="0 0 1"/>
    <geom type="box" size="0.02 0.02 0.02" pos="0 0 0.05" mass="1" contype="0" conaffinity="0"/>
    <site name="gripper" quat="0 1 0 0"/></body>
  <body name="can" pos="0 0 0.03"><freejoint/><geom type="cylinder" size="0.02 0.03" mass="0.1"/></body>
</worldbody><actuator>
  <position name="lift" joint="z" kp="20000" kv="1000" ctrllimited="true" ctrlrange="0 0.2"/>
</actuator></mujoco>"""


def test_an_arm_of_ones_own_carries_the_gripper_and_the_part(tmp_path: Path) -> None:
    file = tmp_path / "cell.xml"
    file.write_text(ARM, encoding="utf-8")
    bench = active(str(file))
    bench.move(255, force=200)
    before = bench.physics.part
    assert before is not None
    for step in range(1, 101):
        bench.physics.control("lift", 0.001 * step)
        bench.run(0.02)
    bench.run(0.5)
    assert bench.physics.joint("z") == pytest.approx(0.1, abs=0.002)
    assert bench.physics.part == pytest.approx((before[0], before[1], before[2] + 100), abs=4)
    assert bench.status.finger_status(JAW) is ObjectStatus.CONTACT_CLOSING


def test_a_control_that_cannot_be_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "cell.xml"
    file.write_text(ARM, encoding="utf-8")
    physics = Bench(str(file)).physics
    for name in ("gripper/A", "z", ""):
        with pytest.raises(ValueError, match=r"actuator must be one of \['lift'\]"):
            physics.control(name, 0.1)
    for value in (0.3, -0.1, float("nan")):
        with pytest.raises(ValueError, match=r"the control of 'lift' must be a number in 0.0..0.2"):
            physics.control("lift", value)
    with pytest.raises(ValueError, match=r"joint must be one of \['z'\], got 'can'"):
        physics.joint("can")
    for call in (lambda: physics_of_table().control("mount", 1), lambda: physics_of_table().joint("mount")):
        with pytest.raises(RuntimeError, match="only a scene from a file"):
            call()


def physics_of_table() -> Physics:
    return Bench("table").physics


def test_a_part_of_several_bodies_is_out_of_the_way_as_a_whole(tmp_path: Path) -> None:
    file = tmp_path / "cell.xml"
    geom = '<geom type="cylinder" size="0.02 0.03" mass="0.1"/>'
    dumbbell = f'<geom size="0.01" pos="0 0.1 0" mass="0.1"/><body>{geom}</body>'
    file.write_text(OWN.replace(geom, dumbbell), encoding="utf-8")
    bench, farthest = Bench(str(file)), 0
    bench.ask(0, go=False)
    while not bench.status.is_activated:
        bench.run(POLL_S)
        farthest = max(farthest, bench.status.position(JAW))
        assert bench.now < 10, "it ends"
    assert farthest == 228, "an activation closes the fingers on nothing"
    bench.move(255)
    assert bench.status.finger_status(JAW) is ObjectStatus.CONTACT_CLOSING


# -- mistakes --------------------------------------------------------------------------------------------

CAN = '<body name="can" pos="0 0 0.03"><freejoint/><geom type="cylinder" size="0.02 0.03" mass="0.1"/></body>'
assert CAN in OWN


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<mujoco>", "MuJoCo cannot read .*cell.xml': XML"),
        ("fingers", "MuJoCo cannot read"),
        ("", "empty file"),
        ("\0\1", "MuJoCo cannot read"),
        ("<html><body/></html>", "Unrecognized XML model type"),
        ("<mujoco/>", "no site named gripper"),
        ('<robot name="r"><link name="base"/></robot>', "no site named gripper"),
        (OWN.replace('site name="gripper"', 'site name="Gripper"'), "no site named gripper"),
        (OWN.replace('mass="0.1"', 'mass="0"'), "cannot make .*cell.xml': .*mass and inertia"),
        (OWN.replace("0.02 0.03", "-0.02 0.03"), "size 0 must be positive"),
        (OWN.replace('joint="elbow" kp', 'joint="knee" kp'), "knee"),
        (OWN.replace("<worldbody>", '<option timestep="0.01"/><worldbody>'), "must be in 0.0001..0.004 s"),
        (OWN.replace("<worldbody>", '<option timestep="0"/><worldbody>'), "must be in 0.0001..0.004 s"),
        (OWN.replace(CAN, CAN.replace("0 0 0.03", "0.04 0 0.05")), "no room for the part 'can'"),
        (
            OWN.replace("</mujoco>", '<keyframe><key qpos="0 0"/></keyframe></mujoco>'),
            "must have 8 qpos, got 2",
        ),
        (OWN.replace('mass="0.1"', 'mass="inf"'), "not finite"),
        (
            OWN.replace("<worldbody>", '<option><flag actuation="disable"/></option><worldbody>'),
            "s actuation",
        ),
        (OWN.replace("<worldbody>", '<option><flag contact="disable"/></option><worldbody>'), "s contact"),
    ],
    ids=lambda each: each[:30],
)
def test_a_world_with_a_mistake_is_refused_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "cell.xml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=words) as caught:
        Bench(str(file))
    assert str(caught.value).startswith("physics: ")
    assert "\n" not in str(caught.value)


def test_a_world_that_is_not_there_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "cell.xml", tmp_path):
        with pytest.raises(ValueError, match="there is no file"):
            Bench(f"{path}/.xml")


def test_names_of_a_world_of_ones_own_are_not_those_of_the_gripper(tmp_path: Path) -> None:
    """An actuator named A was one name too many."""
    file = tmp_path / "cell.xml"
    mounted = OWN.replace('<position name="elbow"', '<position name="A"').replace('"can"', '"mount"')
    file.write_text(mounted, encoding="utf-8")
    bench = active(str(file))
    bench.move(255)
    assert bench.status.finger_status(JAW) is ObjectStatus.CONTACT_CLOSING


def test_a_world_begins_with_its_first_keyframe(tmp_path: Path) -> None:
    file = tmp_path / "cell.xml"
    key = '<keyframe><key qpos="0.5 0 0.2 0.03 1 0 0 0"/></keyframe></mujoco>'
    file.write_text(OWN.replace("</mujoco>", key), encoding="utf-8")
    assert Bench(str(file)).physics.part == pytest.approx((0, 200, 30))


def test_a_gripper_in_a_world_of_ones_own_is_not_lifted(tmp_path: Path) -> None:
    """It did nothing, without a word."""
    file = tmp_path / "cell.xml"
    file.write_text(OWN, encoding="utf-8")
    with pytest.raises(RuntimeError, match="where the site is"):
        Bench(str(file)).physics.lift(10)


@pytest.mark.parametrize("millimetres", [-1, 1001, float("nan"), "high", None])
def test_a_height_is_a_number_of_millimetres(millimetres: float) -> None:
    with pytest.raises((TypeError, ValueError), match="millimetres must be a number in 0"):
        Bench("table").physics.lift(millimetres)


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        ("box:90x40x60,0.3", "no room for a box of 90x40x60 mm"),
        ("rod:1000x1000,1", "no room"),
        ("sphere:60,0.1@1000", "the table is 167 mm from the mounting face: no sphere of 60 mm at 1000"),
        ("sphere:0.001,0.000001", "MuJoCo cannot make sphere of 0.001 mm: .*mass and inertia"),
    ],
)
def test_a_part_that_cannot_be_is_refused(scene: str, words: str) -> None:
    with pytest.raises(ValueError, match=f"physics: .*{words}"):
        Bench(scene)


@pytest.mark.parametrize(
    ("scene", "model"),
    [
        ("sphere:0.5,0.001", TWO_FINGER_85),
        ("sphere:5,0.001@135", THREE_FINGER),
        ("sphere:5,0.001@135", HAND_E),
        ("box:0.5x40x40,0.01", HAND_E),
        ("box:30x40x50,100", THREE_FINGER),
        ("box:30x40x50,100", TWO_FINGER_85),
    ],
    ids=str,
)
def test_parts_of_extreme_sizes_and_masses_leave_the_gripper_working(scene: str, model: Model) -> None:
    """The smallest, the lightest, the thinnest and the heaviest, each model with small and with large."""
    bench = active(scene, model)
    bench.move(255)
    bench.physics.lift(30)
    bench.run(0.5)
    bench.move(0)
    assert bench.status.is_activated
    assert not bench.status.contacts
