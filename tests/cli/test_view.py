"""``robotiq-async view``."""

from __future__ import annotations

import asyncio
import signal
from pathlib import Path
from typing import TYPE_CHECKING

from docs import make_layout
from robotiq_async import RobotiqHand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.patience import patience

if TYPE_CHECKING:
    from tests.cli.conftest import Call, Shell


async def test_it_prints_where_to_look_and_leaves_the_fingers_alone(
    shell: Shell, server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    async with RobotiqHand(server.address) as hand:
        await hand.move(50)
        before = gripper.request_registers
        process = await shell.start("view", "--port", "0", server.address)
        assert (await shell.read_line(process)).startswith("ws://127.0.0.1:")
        process.send_signal(signal.SIGTERM)
        outcome = await shell.finish(process)
        assert (outcome.code, outcome.out) == (0, "")
        assert gripper.request_registers == before


async def test_a_lost_gripper_is_reported_at_once(shell: Shell, server: SimulatorServer) -> None:
    process = await shell.start("view", "--port", "0", server.address)
    await shell.read_line(process)
    server.cut()
    assert process.stderr is not None
    async with asyncio.timeout(patience(20)):
        while b"link lost" not in (line := await process.stderr.readline()):
            assert line


def test_the_layout_is_handed_out(call: Call, tmp_path: Path) -> None:
    file = tmp_path / "gripper.json"
    outcome = call("view", "--layout", str(file))
    assert (outcome.code, outcome.out) == (0, f"{file}\n")
    assert file.read_text() == make_layout.draw()
    call("view", "--layout", str(file)).assert_failed(1, "exists")
