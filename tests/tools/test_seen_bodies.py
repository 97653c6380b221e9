"""The places of bodies, for a drawing."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="needs the extra physics")

from robotiq_async.simulator import Bodies, Physics, SimulatedGripper
from robotiq_async.tools.description import Pose, Shape, hand_model
from robotiq_async.tools.description.simulated import joints_and_parts
from robotiq_async.values.enums import JAW
from robotiq_async.values.model import THREE_FINGER, TWO_FINGER_85
from tests.patience import patience
from tests.simulator.test_mechanics import BOX, Bench, active

ROBOT = """
<mujoco><worldbody>
 <geom type="plane" size="1 1 1"/>
 <body name="robot" pos="0 0 0.4"><freejoint/><geom type="box" size="0.2 0.2 0.02" mass="50"/>
  <geom type="box" size="0.05 0.05 0.19" pos="0.15 0 -0.2"/>
  <geom type="box" size="0.05 0.05 0.19" pos="-0.15 0 -0.2"/>
  <site name="gripper" pos="0 0 0.02"/></body>
 <body name="hammer" pos="1 0 0.1"><freejoint/><geom type="box" size="0.01 0.02 0.03"/>
  <body pos="0 0 0.07"><joint type="hinge" axis="0 1 0" stiffness="100" damping="1"/>
   <geom type="cylinder" size="0.01 0.04"/><geom type="capsule" size="0.01 0.02" pos="0 0 0.1"/></body></body>
</worldbody></mujoco>
"""


def told(gripper: SimulatedGripper) -> Bodies:
    bodies = gripper.bodies
    assert bodies is not None
    return bodies


def pads_mm(bench: Bench) -> list[float]:
    """The distance of the face of each pad of a jaw from the middle of the part, towards it."""
    hand = hand_model(bench.gripper.model)
    joints, (part,) = joints_and_parts(told(bench.gripper))
    assert joints.keys() == {joint.name for joint in hand.moving}
    chain = {hand.root: Pose()}
    for joint in hand.joints:
        chain[joint.child] = chain[joint.parent] @ joint.pose(joints.get(joint.name, 0.0))
    faces = []
    for link, inwards in zip(hand.touching[JAW], (-1, 1), strict=True):
        pad = hand.pad(link)
        face = (chain[link] @ pad.origin).apply((inwards * pad.size[0] / 2, 0, 0))
        faces.append(-1000 * inwards * (face[0] - part.origin.position[0]))
    return faces


def test_a_part_stands_between_the_pads_and_is_as_large_as_it_is() -> None:
    bench = active(BOX)
    _, (part,) = joints_and_parts(told(bench.gripper))
    assert (part.kind, part.size) == ("box", pytest.approx((0.03, 0.04, 0.06)))
    assert part.origin.position[:2] == pytest.approx((0, 0), abs=1e-3)
    assert pads_mm(bench) == pytest.approx([42.5, 42.5], abs=0.5), "open by 85 mm"
    bench.move(255)
    assert pads_mm(bench) == pytest.approx([15, 15], abs=0.8), "each pad at its side of the box"
    z = part.origin.position[2]
    bench.physics.lift(50)
    bench.run(2)
    (held,) = told(bench.gripper).parts
    assert held.position[2] == pytest.approx(z, abs=3e-3), "what is held stays where the fingers are"


@pytest.mark.parametrize(
    ("scene", "kind", "size"),
    [
        ("cylinder:40x60,0.2", "cylinder", (0.02, 0.06)),
        ("rod:60x140,0.3", "cylinder", (0.03, 0.14)),
        ("sphere:50,0.1", "sphere", (0.025,)),
    ],
)
def test_each_kind_of_part_is_told(scene: str, kind: str, size: tuple[float, ...]) -> None:
    (part,) = told(Bench(scene).gripper).parts
    assert (part.kind, part.size) == (kind, pytest.approx(size))
    along = [row[2] for row in part.rotation]
    assert along == pytest.approx([0, 1, 0] if scene.startswith("rod") else [0, 0, -1], abs=1e-6), "z of it"


def test_what_is_out_of_the_way_is_not_told() -> None:
    bench = Bench(BOX)
    bench.ask(0, go=False)
    bench.run(1)
    assert told(bench.gripper).parts == (), "in an activation"
    bench.run(5)
    assert len(told(bench.gripper).parts) == 1
    bench.physics.take_away()
    bench.run(0.1)
    assert told(bench.gripper).parts == ()
    bench.physics.put_back()
    bench.run(0.1)
    assert len(told(bench.gripper).parts) == 1


def test_a_table_has_no_parts_and_a_gripper_without_physics_tells_nothing() -> None:
    assert told(Bench("table", THREE_FINGER).gripper).parts == ()
    assert SimulatedGripper().bodies is None


def test_a_thread_leaves_behind_where_everything_is() -> None:
    physics = Physics(BOX, threaded=True)
    gripper = SimulatedGripper(model=TWO_FINGER_85, physics=physics)
    assert len(told(gripper).parts) == 1
    gripper.write(0, [0x0100, 0, 0])  # an activation closes the fingers, without the part
    ends = time.monotonic() + patience(10)
    while physics.opening_mm > 20 and time.monotonic() < ends:
        gripper.status_registers()
        time.sleep(0.01)
    assert told(gripper).parts == ()
    assert told(gripper).joints["robotiq_85_left_knuckle_joint"] > 0.4


def test_a_part_of_a_world_of_ones_own_and_a_robot_that_drives_about(tmp_path: Path) -> None:
    """A free body that carries the gripper is no part: an activation had put it back where it began."""
    file = tmp_path / "robot.xml"
    file.write_text(ROBOT)
    bench = Bench(str(file))
    bench.ask(0, go=False)
    bench.run(1)
    assert told(bench.gripper).parts == ()
    bench.run(5)
    shapes: tuple[Shape, ...]
    _, shapes = joints_and_parts(told(bench.gripper))
    assert [(each.kind, each.size) for each in shapes] == [
        ("box", pytest.approx((0.02, 0.04, 0.06))),
        ("cylinder", pytest.approx((0.01, 0.08))),
    ]
    part = bench.physics.part
    assert part is not None
    assert part[0] == pytest.approx(1000, abs=1)
