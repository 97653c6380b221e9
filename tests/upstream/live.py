"""Programs of labs, unchanged but for the line: make test-upstream SOURCES=FOLDER.

Nothing of theirs is in this repository. What a program needs beside the gripper (an arm, torch, inverse
kinematics) is a stub here, and says so.
"""

from __future__ import annotations

import asyncio
import os
import sys
import types
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robotiq_async import JAW, TWO_FINGER_85
from robotiq_async.simulator import RtuOverTcpSimulatorServer, SimulatorServer, UrcapSimulatorServer
from tests.dropins.test_polymetis import program
from tests.grippers import active_gripper, until

SOURCES = Path(os.environ["SOURCES"]).resolve()
GELLO = SOURCES / "gello_software" / "gello" / "robots" / "ur.py"
PROTO = SOURCES / "fairo" / "polymetis" / "polymetis" / "protos" / "polymetis.proto"
INTERFACE = SOURCES / "fairo" / "polymetis" / "polymetis" / "python" / "polymetis" / "gripper_interface.py"
DROID = SOURCES / "droid" / "droid" / "franka" / "robot.py"


def needs(*files: Path) -> pytest.MarkDecorator:
    missing = [str(file.relative_to(SOURCES)) for file in files if not file.is_file()]
    return pytest.mark.skipif(bool(missing), reason=f"{SOURCES} has no {', '.join(missing)}")


def stub(name: str, **members: Any) -> types.ModuleType:
    """A module that a program imports, in the place of one that is not about the gripper."""
    module = types.ModuleType(name)
    vars(module).update(members)
    sys.modules[name] = module
    return module


# -- GELLO -------------------------------------------------------------------------------------------------


class Arm:
    """The part of ur_rtde that ur.py uses."""

    def __init__(self, *_: Any) -> None: ...

    def getActualQ(self) -> list[float]:  # noqa: N802  # ur_rtde's
        return [0.0] * 6

    def __getattr__(self, name: str) -> Callable[..., Any]:
        return lambda *_: 0.0


@needs(GELLO)
@pytest.mark.parametrize("kind", [UrcapSimulatorServer, SimulatorServer, RtuOverTcpSimulatorServer])
async def test_gellos_robot_with_one_line_changed(kind: type[SimulatorServer]) -> None:
    stub("rtde_control", RTDEControlInterface=Arm)
    stub("rtde_receive", RTDEReceiveInterface=Arm)
    stub("gello")
    stub("gello.robots")
    stub("gello.robots.robot", Robot=object)
    theirs = "from gello.robots.robotiq_gripper import RobotiqGripper"
    ours = "from robotiq_async.dropins.ur import RobotiqGripper"
    text = GELLO.read_text(encoding="utf-8")
    assert text.count(theirs) == 1
    gripper = active_gripper(4, model=TWO_FINGER_85)
    async with kind(gripper) as server:
        text = text.replace(theirs, ours).replace("port=63352", f"port={getattr(server, 'port', 1)}")
        names: dict[str, Any] = {}
        exec(compile(text, str(GELLO), "exec"), names)
        address = "127.0.0.1" if kind is UrcapSimulatorServer else server.address

        def use() -> float:
            robot = names["URRobot"](address)
            robot.command_joint_state(np.array([0.0] * 6 + [1.0]))
            while (seen := robot.get_observations()["gripper_position"][0]) < 220 / 255:
                robot.command_joint_state(np.array([0.0] * 6 + [1.0]))
            robot.gripper.disconnect()
            return float(seen)

        seen = await asyncio.to_thread(use)
        assert seen <= 228 / 255 + 0.01, "an empty closed 2F-85 reads 0.89, as GELLO has it"
        await until(lambda: gripper.position(JAW) > 220)


# -- polymetis and DROID -------------------------------------------------------------------------------------


@asynccontextmanager
async def polymetis(folder: Path, port: int) -> AsyncIterator[Any]:
    """Polymetis' own client, with code made from its own .proto."""
    from grpc_tools import protoc  # noqa: PLC0415  # of this environment

    where = (f"-I{PROTO.parent}", f"-I{Path(protoc.__file__).parent / '_proto'}")
    made = (f"--python_out={folder}", f"--grpc_python_out={folder}")
    assert not protoc.main(["protoc", *where, *made, str(PROTO)])
    sys.path.insert(0, str(folder))
    names: dict[str, Any] = {"__name__": "polymetis.gripper_interface"}
    exec(compile(INTERFACE.read_text(encoding="utf-8"), str(INTERFACE), "exec"), names)
    try:
        yield lambda: names["GripperInterface"](port=port)
    finally:
        sys.path.remove(str(folder))


@needs(PROTO, INTERFACE)
async def test_polymetis_own_client_at_our_server(tmp_path: Path) -> None:
    gripper = active_gripper(4, model=TWO_FINGER_85)
    async with SimulatorServer(gripper) as server, program("--yes", server.address) as (_, port, call):
        await call("GetState")
        async with polymetis(tmp_path, port) as connect:
            await asyncio.to_thread(drive, connect())
        assert gripper.position(JAW) == pytest.approx((3 + 228) / 2, abs=2)


def drive(client: Any) -> None:
    """Drive it as DROID does: half closed, in steps, blocking and not."""
    assert client.metadata.max_width == pytest.approx(0.085)
    client.goto(width=0.0425, speed=0.05, force=0.1, blocking=False)
    client.goto(width=0.0425, speed=0.1, force=0.1)
    while client.get_state().is_moving:
        pass
    state = client.get_state()
    assert state.width == pytest.approx(0.0425, abs=0.001)
    assert state.prev_command_successful
    assert not state.is_grasped
    assert not state.error_code


@needs(PROTO, INTERFACE, DROID)
async def test_droids_robot_unchanged_at_our_server(tmp_path: Path) -> None:
    gripper = active_gripper(4, model=TWO_FINGER_85)
    async with SimulatorServer(gripper) as server, program("--yes", server.address) as (_, port, call):
        await call("GetState")
        async with polymetis(tmp_path, port) as connect:
            client = connect()
            for name in ("droid", "droid.misc", "droid.robot_ik"):
                stub(name)
            stub("torch")
            stub("polymetis", GripperInterface=lambda **_: client, RobotInterface=lambda **_: None)
            stub("droid.misc.parameters", sudo_password="")
            stub("droid.misc.subprocess_utils", run_terminal_command=None, run_threaded_command=None)
            rotations = ("add_poses", "euler_to_quat", "pose_diff", "quat_to_euler")
            stub("droid.misc.transformations", **dict.fromkeys(rotations))
            stub("droid.robot_ik.robot_ik_solver", RobotIKSolver=lambda: None)
            names: dict[str, Any] = {"__file__": str(DROID)}
            exec(compile(DROID.read_text(encoding="utf-8"), str(DROID), "exec"), names)

            def use() -> float:
                robot = names["FrankaRobot"]()
                robot.launch_robot()
                robot.update_gripper(1.0, velocity=False, blocking=True)
                while robot.get_gripper_position() < 0.99:
                    pass
                robot.update_gripper(0.0, velocity=False, blocking=True)
                while robot.get_gripper_position() > 0.01:
                    pass
                return float(robot.get_gripper_position())

            assert await asyncio.to_thread(use) == pytest.approx(0, abs=0.01)
        assert gripper.position(JAW) == pytest.approx(3, abs=2)
