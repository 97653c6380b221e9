"""The thread behind a gripper with physics: when it begins and ends, and how its errors reach the caller."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import pytest

pytest.importorskip("mujoco", reason="needs the extra physics")

from robotiq_async import RobotiqHand, sync
from robotiq_async.simulator import Physics, PhysicsError, SimulatedGripper, SimulatorServer
from robotiq_async.simulator.physics.driven_axis import Way, mechanism_of
from robotiq_async.values.enums import JAW
from robotiq_async.values.errors import RobotiqConnectionError
from robotiq_async.values.model import TWO_FINGER_85
from tests.forked import forking
from tests.patience import patience

BOX = "box:30x40x60,0.3"
NAME = "robotiq_async physics"


def threads() -> int:
    return sum(thread.name == NAME for thread in threading.enumerate())


def until(condition: Callable[[], bool]) -> None:
    ends = time.monotonic() + patience(10)
    while not condition():
        assert time.monotonic() < ends, "in vain"
        time.sleep(0.005)


def threaded(scene: str = BOX) -> tuple[Physics, SimulatedGripper]:
    physics = Physics(scene, threaded=True)
    return physics, SimulatedGripper(model=TWO_FINGER_85, physics=physics, speedup=10)


def activated(gripper: SimulatedGripper) -> bool:
    return gripper.status_registers()[0] & 0x3000 == 0x3000


# -- its life --------------------------------------------------------------------------------------------


def test_it_begins_with_the_first_read_and_ends_with_the_block() -> None:
    physics, gripper = threaded()
    with physics:
        assert not threads()
        gripper.write(0, [0x0100, 0, 0])
        assert threads() == 1
        until(lambda: activated(gripper))
    assert not threads()


def test_bodies_stand_still_after_its_end_until_it_begins_again() -> None:
    physics, gripper = threaded()
    with physics:
        gripper.write(0, [0x0100, 0, 0])
        until(lambda: activated(gripper))
        gripper.write(0, [0x0900, 255, 0])  # 4 s of slow closing, in 0.4 s
        until(lambda: gripper.position(JAW) > 20)
        mechanism_of(physics).stop()
        stopped_at = gripper.position(JAW)
        time.sleep(0.1)
        assert gripper.position(JAW) == stopped_at
        assert not threads(), "a read does not start it"
        mechanism_of(physics).start()
        until(lambda: not gripper.is_moving)
        assert gripper.holds == JAW


def test_without_a_thread_start_and_stop_do_nothing() -> None:
    physics = Physics(BOX)
    SimulatedGripper(lambda: 0.0, model=TWO_FINGER_85, physics=physics)
    mechanism_of(physics).start()
    assert not threads()
    mechanism_of(physics).stop()


def test_one_that_was_dropped_ends_although_nobody_stopped_it() -> None:
    physics, gripper = threaded()
    gripper.status_registers()
    assert threads() == 1
    del physics, gripper
    gc.collect()
    until(lambda: not threads())


async def test_it_ends_with_the_last_server_of_the_gripper() -> None:
    _, gripper = threaded()
    one, other = SimulatorServer(gripper), SimulatorServer(gripper)
    async with one:
        async with other:
            assert threads() == 1
        assert threads() == 1
    assert not threads()
    async with one:
        assert threads() == 1
    assert not threads()


async def test_a_hand_has_one_while_it_is_connected() -> None:
    hand = RobotiqHand(f"sim://?model=2f85&speedup=10&physics={BOX}")
    assert not threads(), "it is not opened yet"
    for _ in range(2):
        async with hand:
            assert threads() == 1
            await hand.activate()
            assert (await hand.close()).object_detected
        assert not threads()


# -- its errors ------------------------------------------------------------------------------------------

UNSTABLE = """<mujoco><worldbody>
  <body pos="0 0 0.4"><joint type="hinge" axis="0 1 0" stiffness="1e9" springref="1"/>
  <geom size="0.01"/><site name="gripper" quat="0 1 0 0"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def unstable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)  # MuJoCo leaves a MUJOCO_LOG.TXT behind
    Path("cell.xml").write_text(UNSTABLE, encoding="utf-8")
    return "cell.xml"


def test_an_order_that_cannot_be_carried_out_is_raised_by_the_next_call() -> None:
    physics, gripper = threaded()
    with physics:
        gripper.status_registers()
        mechanism_of(physics).drive(JAW).go(cast("Any", "far away"), Way(100.0), 255, clears=False)
        until(lambda: not threads())
        for call in (
            gripper.status_registers,
            lambda: gripper.write(0, [0x0100]),
            lambda: physics.part,
            lambda: physics.lift(10),
        ):
            with pytest.raises(PhysicsError, match=r"the bodies stand still: .*'str'") as caught:
                cast("Any", call)()
            assert isinstance(caught.value.__cause__, TypeError)
        assert gripper.bodies is None, "those who draw have nothing to draw"


def test_bodies_that_become_unstable_are_an_error_and_not_a_new_beginning(unstable: str) -> None:
    now = 0.0
    gripper = SimulatedGripper(lambda: now, model=TWO_FINGER_85, physics=Physics(unstable))
    gripper.write(0, [0x0100, 0, 0])
    now = 6.0
    for _ in range(2):
        with pytest.raises(PhysicsError, match=r"still: they became unstable after .* s"):
            gripper.status_registers()


async def test_a_hand_says_why_its_simulated_gripper_answers_no_more(unstable: str) -> None:
    with pytest.raises(RobotiqConnectionError, match=r"the simulated gripper: .* unstable after"):
        async with RobotiqHand(f"sim://?model=2f85&physics={unstable}") as hand:
            await hand.activate()


def test_the_command_ends_with_the_error(unstable: str) -> None:
    command = [sys.executable, "-m", "robotiq_async", "simulate", "--model", "2f85", "--port", "0"]
    with (
        forking(),
        subprocess.Popen(
            [*command, "--physics", unstable],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=os.environ,
            text=True,
        ) as run,
    ):
        try:
            assert run.stdout is not None
            address = run.stdout.readline().strip()
            if address:  # on a busy machine they are unstable before anybody can connect
                with (
                    pytest.raises(RobotiqConnectionError),
                    sync.RobotiqHand(address, reconnect=False) as hand,
                ):
                    hand.activate()
            _, complaint = run.communicate(timeout=patience(30))
        finally:
            run.kill()
    assert run.returncode == 1
    assert "unstable after" in complaint
    assert "Traceback" not in complaint
