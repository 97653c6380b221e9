"""The robot under the real LeRobot's commands, at a simulated 2F-85 behind a socket: make test-lerobot."""

from __future__ import annotations

import asyncio
import json
import os
import re
import sys
from asyncio.subprocess import PIPE, STDOUT
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pytest_asyncio
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.robots import make_robot_from_config
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

from robotiq_async import JAW, TWO_FINGER_85
from robotiq_async.dropins.lerobot.robot import RobotiqGripper, RobotiqGripperConfig
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.simulator.troubles.trouble import Trouble
from robotiq_async.values.request import Request
from tests.docs.pages import DOCS, ROOT, blocks, read
from tests.grippers import active_gripper, until
from tests.lerobot.leader.lamp import LampConfig

PATIENCE = 300.0  # a command needs 12 s to import torch, and two record and train for a minute
LEADER = ("--teleop.discover_packages_path=leader", "--teleop.type=sweep")
DATASET = ("--dataset.repo_id=me/grip", "--play_sounds=false")
EPISODE = (
    *("--dataset.num_episodes=1", "--dataset.episode_time_s=3", "--dataset.single_task=sweep"),
    *("--dataset.fps=30", "--dataset.video=false", "--dataset.push_to_hub=false"),
)


class Commands:
    """LeRobot's commands for the robot at one gripper. No hub is queried."""

    def __init__(self, server: SimulatorServer, folder: Path) -> None:
        self.server = server
        self.gripper = server.gripper
        self.folder = folder

    async def begin(self, name: str, *arguments: str) -> asyncio.subprocess.Process:
        """A command with the robot, which it finds by its type alone."""
        robot = ("--robot.type=robotiq_gripper", f"--robot.address={self.server.address}")
        return await self.start(name, *robot, *arguments)

    async def start(self, name: str, *arguments: str) -> asyncio.subprocess.Process:
        return await self._start(str(Path(sys.executable).with_name(name)), *arguments)

    async def program(self, name: str, *arguments: str) -> asyncio.subprocess.Process:
        """A program in the folder, at the gripper."""
        return await self._start(sys.executable, name, *arguments)

    async def _start(self, *words: str) -> asyncio.subprocess.Process:
        return await asyncio.create_subprocess_exec(
            *words,
            cwd=self.folder,
            env={
                **os.environ,
                "GRIPPER": self.server.address,
                "PYTHONPATH": str(ROOT / "tests" / "lerobot"),
                "HF_HOME": str(self.folder),
                "HF_HUB_OFFLINE": "1",
                "OMP_NUM_THREADS": "1",  # its threads wait by spinning, which stalls a busy machine
            },
            stdout=PIPE,
            stderr=STDOUT,
        )

    async def run(self, name: str, *arguments: str, fails: bool = False) -> str:
        """The output of a command."""
        return await ended(await self.begin(name, *arguments), fails=fails)

    def targets(self) -> list[int]:
        """Targets of the fingers in every write so far."""
        writes = [Request.from_registers(each.registers, TWO_FINGER_85) for each in self.gripper.writes]
        return [each.position(JAW) for each in writes if each.go]


async def ended(process: asyncio.subprocess.Process, *, fails: bool = False) -> str:
    try:
        async with asyncio.timeout(PATIENCE):
            printed, _ = await process.communicate()
    finally:
        if process.returncode is None:
            process.kill()
    words = printed.decode()
    assert (process.returncode != 0) == fails, words
    return words


@pytest_asyncio.fixture
async def commands(tmp_path: Path) -> AsyncIterator[Commands]:
    """The commands at a gripper that is active and open."""
    async with SimulatorServer(active_gripper(1.0, model=TWO_FINGER_85)) as server:
        yield Commands(server, tmp_path)


def sweeps(targets: list[int]) -> bool:
    """Whether the fingers were sent from one end to the other, in steps."""
    return min(targets) < 40 and max(targets) > 215 and len(set(targets)) > 20


# -- the commands --------------------------------------------------------------------------------------


async def test_teleoperate_drives_the_fingers_and_stops_them(commands: Commands) -> None:
    printed = await commands.run("lerobot-teleoperate", *LEADER, "--teleop_time_s=3")
    assert sweeps(commands.targets())
    assert not commands.gripper.is_moving
    rates = [int(line.partition("(")[2].split()[0]) for line in printed.splitlines() if "Hz)" in line]
    print(f"{len(rates)} cycles, median {sorted(rates)[len(rates) // 2]} Hz")  # noqa: T201  # a figure for the page


async def test_connecting_moves_nothing_unless_that_was_asked_for(tmp_path: Path) -> None:
    async with SimulatorServer(SimulatedGripper(speedup=10, model=TWO_FINGER_85)) as server:
        commands = Commands(server, tmp_path)
        printed = await commands.run("lerobot-teleoperate", *LEADER, "--teleop_time_s=1", fails=True)
        assert "--robot.activate=true), which MOVES the fingers" in printed
        assert not commands.gripper.writes
        printed = await commands.run(
            "lerobot-teleoperate", *LEADER, "--teleop_time_s=1", "--robot.activate=true"
        )
        assert "its fingers MOVE" in printed
        assert commands.targets()


async def test_what_is_recorded_is_replayed(commands: Commands) -> None:
    root = f"--dataset.root={commands.folder / 'data'}"
    await commands.run("lerobot-record", *LEADER, *DATASET, root, *EPISODE)
    about = json.loads((commands.folder / "data" / "meta" / "info.json").read_text())
    assert about["features"]["action"]["names"] == ["gripper.pos", "gripper.force"]
    assert about["features"]["observation.state"]["names"] == [
        "gripper.pos",
        "gripper.current",
        "gripper.contact",
    ]
    assert about["total_frames"] > 30
    recorded = len(commands.targets())
    await commands.run("lerobot-replay", *DATASET, root, "--dataset.episode=0")
    assert sweeps(commands.targets()[recorded:])


async def test_a_position_alone_is_recorded_and_cannot_be_replayed(commands: Commands) -> None:
    """This is the reason for two dimensions; when LeRobot replays one, ``action_force`` can go."""
    root = f"--dataset.root={commands.folder / 'data'}"
    alone = (*LEADER, "--teleop.force=false")
    printed = await commands.run("lerobot-record", *alone, *DATASET, root, *EPISODE, fails=True)
    assert "KeyError: 'gripper.force'" in printed
    root += "-of-one"
    without = "--robot.action_force=false"
    await commands.run("lerobot-record", *alone, without, *DATASET, root, *EPISODE)
    printed = await commands.run("lerobot-replay", without, *DATASET, root, "--dataset.episode=0", fails=True)
    assert "IndexError: invalid index of a 0-dim tensor" in printed


async def test_a_gripper_that_falls_silent_ends_the_demonstration(commands: Commands) -> None:
    process = await commands.begin("lerobot-teleoperate", *LEADER)
    await until(lambda: len(commands.targets()) > 20, within=PATIENCE)
    async with commands.server.fault_injector.making(Trouble("silence")):
        printed = await ended(process, fails=True)
    assert "ConnectionLostError" in printed


# -- what was recorded otherwise ------------------------------------------------------------------------


async def test_episodes_beside_a_camera_become_a_dataset(commands: Commands) -> None:
    """The programs of their page. The camera sees the opening, so that each picture has its true state."""
    folder, (recording, converting) = commands.folder, blocks(read(DOCS / "how-to" / "episodes.md"), "python")
    commands.gripper.place_object(JAW, 120)
    for name, block, arguments in (
        ("record_episodes.py", recording, ("today",)),
        ("to_lerobot.py", converting, ("today", "data")),
    ):
        (folder / name).write_text(block.text, encoding="utf-8")
        words = await ended(await commands.program(name, *arguments))
        assert "left out" not in words, words
    dataset = LeRobotDataset("me/grip", root=folder / "data")
    assert (dataset.num_episodes, dataset.fps) == (3, 30)
    assert dataset.num_frames > 3 * 30
    frames = [dataset[number] for number in range(dataset.num_frames)]
    assert {frame["task"] for frame in frames} == {"grip the part"}
    shown = np.array([float(frame["observation.images.front"].mean()) * 100 for frame in frames])
    states = np.array([frame["observation.state"].numpy() for frame in frames])
    # A picture arrives a moment after it was taken.
    assert np.median(np.abs(shown - states[:, 0])) < 5
    assert set(states[:, 2]) == {0, 1}, "contact"
    before = len(commands.targets())
    await commands.run("lerobot-replay", *DATASET, f"--dataset.root={folder / 'data'}", "--dataset.episode=0")
    replayed = commands.targets()[before:]
    assert min(replayed) < 10
    assert max(replayed) > 240


# -- what the data is for ------------------------------------------------------------------------------

LAMP = ("--robot.discover_packages_path=leader", "--robot.cameras={lamp: {type: lamp}}")
DEMONSTRATIONS = (
    *("--dataset.num_episodes=20", "--dataset.episode_time_s=3", "--dataset.reset_time_s=0"),
    *("--dataset.fps=15", "--dataset.video=false", "--dataset.push_to_hub=false"),
    "--dataset.single_task=grip while the lamp is lit",
)
SMALL = (  # the smallest policy that has a picture among its inputs; no weights are fetched
    *("--policy.type=act", "--policy.device=cpu", "--policy.push_to_hub=false", "--policy.use_vae=false"),
    *("--policy.pretrained_backbone_weights=null", "--policy.chunk_size=4", "--policy.n_action_steps=2"),
    *("--policy.dim_model=32", "--policy.n_heads=2", "--policy.dim_feedforward=64"),
    *("--policy.n_encoder_layers=1", "--policy.optimizer_lr=1e-3", "--policy.optimizer_lr_backbone=1e-4"),
    *("--steps=100", "--batch_size=16", "--num_workers=0", "--log_freq=50", "--env_eval_freq=0"),
)


async def test_what_is_recorded_teaches_a_policy_that_grips(commands: Commands) -> None:
    """20 demonstrations of a lamp and a part; the policy then grips and lets go by what the camera sees."""
    gripper, dataset = commands.gripper, f"--dataset.root={commands.folder / 'data'}"
    gripper.place_object(JAW, 150)
    leader = ("--teleop.discover_packages_path=leader", "--teleop.type=follow_lamp")
    await commands.run("lerobot-record", *leader, *LAMP, *DATASET, dataset, *DEMONSTRATIONS)
    about = json.loads((commands.folder / "data" / "meta" / "info.json").read_text())
    assert about["total_episodes"] == 20
    trained = commands.folder / "trained"
    train = await commands.start(
        "lerobot-train", DATASET[0], dataset, f"--output_dir={trained}", "--wandb.enable=false", *SMALL
    )
    losses = re.findall(r"loss:(\S+)", await ended(train))
    print(f"{about['total_frames']} frames, loss {' '.join(losses)}")  # noqa: T201  # figures for the page
    policy = f"--policy.path={trained / 'checkpoints' / 'last' / 'pretrained_model'}"
    rest = ("--fps=15", "--duration=20", "--return_to_initial_position=false", "--play_sounds=false")
    rollout = await commands.begin("lerobot-rollout", policy, *LAMP, "--task=grip", *rest)
    for _ in range(2):
        await until(lambda: abs(gripper.position(JAW) - 150) < 10 and not gripper.is_moving, within=PATIENCE)
        await until(lambda: gripper.position(JAW) < 100, within=PATIENCE)
    await ended(rollout)
    assert not gripper.is_moving


# -- the robot -----------------------------------------------------------------------------------------


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Any]:
    config = RobotiqGripperConfig(
        address="sim://?model=2f85&speedup=50", activate=True, calibration_dir=tmp_path
    )
    with make_robot_from_config(config) as robot:
        yield robot


def test_it_is_made_from_its_config_and_shows_what_it_promises(robot: Any) -> None:
    assert isinstance(robot, RobotiqGripper)
    assert robot.is_connected
    assert robot.get_observation().keys() == robot.observation_features.keys()
    assert {type(each) for each in robot.get_observation().values()} == {float}


def test_what_is_sent_is_returned(robot: Any) -> None:
    sent = robot.send_action({"gripper.pos": np.float32(99.5), "gripper.force": 0.0, "elbow.pos": 1e9})
    assert sent == {"gripper.pos": 99.5, "gripper.force": 0.0}
    assert robot.send_action({"gripper.pos": 40.0}) == {"gripper.pos": 40.0}


def test_what_a_policy_overshoots_is_clamped_as_lerobots_own_motors_do_and_nan_is_refused(robot: Any) -> None:
    assert robot.send_action({"gripper.pos": 103.0, "gripper.force": -2.0}) == {
        "gripper.pos": 100.0,
        "gripper.force": 0.0,
    }
    with pytest.raises(ValueError, match="must be a number of LEROBOT"):
        robot.send_action({"gripper.pos": float("nan")})


def test_without_clamping_another_scale_is_refused(tmp_path: Path) -> None:
    config = RobotiqGripperConfig(
        address="sim://?model=2f85&speedup=50", activate=True, clamp=False, calibration_dir=tmp_path
    )
    with (
        make_robot_from_config(config) as robot,
        pytest.raises(ValueError, match="must be a number of LEROBOT"),
    ):
        robot.send_action({"gripper.pos": 100.7})


def test_its_state_is_told_by_lerobots_errors(robot: Any, tmp_path: Path) -> None:
    with pytest.raises(DeviceAlreadyConnectedError):
        robot.connect()
    other = make_robot_from_config(
        RobotiqGripperConfig(address="tcp://127.0.0.1:1", calibration_dir=tmp_path)
    )
    for call in (other.get_observation, lambda: other.send_action({"gripper.pos": 5.0}), other.disconnect):
        with pytest.raises(DeviceNotConnectedError):
            call()


def test_nothing_moves_without_calibration_which_is_what_activates(tmp_path: Path) -> None:
    config = RobotiqGripperConfig(
        address="sim://?model=2f85&speedup=50", activate=True, calibration_dir=tmp_path
    )
    robot = make_robot_from_config(config)
    robot.connect(calibrate=False)
    assert not robot.is_calibrated
    before = robot.get_observation()
    robot.calibrate()
    assert robot.is_calibrated
    assert before["gripper.contact"] == 0
    robot.disconnect()


def test_over_a_urcap_the_key_of_the_current_is_left_out(tmp_path: Path) -> None:
    config = RobotiqGripperConfig(address="urcap://127.0.0.1?model=2f85", calibration_dir=tmp_path)
    assert make_robot_from_config(config).observation_features.keys() == {"gripper.pos", "gripper.contact"}


def test_cameras_are_lerobots(tmp_path: Path) -> None:
    config = RobotiqGripperConfig(
        address="sim://?model=2f85&speedup=50",
        activate=True,
        cameras={"front": LampConfig()},
        calibration_dir=tmp_path,
    )
    with make_robot_from_config(config) as robot:
        assert robot.observation_features["front"] == (32, 32, 3)
        assert robot.get_observation()["front"].shape == (32, 32, 3)
    assert not robot.cameras["front"].is_connected


def test_an_action_without_a_position_is_refused(robot: Any) -> None:
    with pytest.raises(KeyError, match=r"gripper\.pos"):
        robot.send_action({"gripper.position": 50.0})


def test_a_robot_that_was_not_connected_is_not_disconnected_when_it_goes(tmp_path: Path) -> None:
    config = RobotiqGripperConfig(address="tcp://127.0.0.1:1", calibration_dir=tmp_path)
    robot = make_robot_from_config(config)
    with pytest.raises(ConnectionError):
        robot.connect()
    assert not robot.is_connected
