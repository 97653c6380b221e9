"""``robotiq-async view``."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from websockets.asyncio.client import connect
from websockets.typing import Subprotocol

from docs import make_layout
from robotiq_async import RobotiqHand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.foxglove_client import Client

if TYPE_CHECKING:
    from tests.cli.conftest import Call, Shell


@asynccontextmanager
async def met(url: str) -> AsyncIterator[Client]:
    async with connect(url, subprotocols=[Subprotocol("foxglove.sdk.v1")], max_queue=None) as socket:
        client = Client(socket)
        await client.meet()
        yield client


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
async def test_it_prints_where_to_look_and_leaves_the_fingers_alone(
    shell: Shell, server: SimulatorServer, gripper: SimulatedGripper, number: signal.Signals
) -> None:
    async with RobotiqHand(server.address) as hand:
        await hand.move(50)
        before = gripper.request_registers
        process = await shell.start("view", "--port", "0", server.address)
        url = await shell.read_line(process)
        assert url.startswith("ws://127.0.0.1:")
        async with met(url):
            pass
        process.send_signal(number)
        outcome = await shell.finish(process)
        assert (outcome.code, outcome.out) == (0, "")
        assert gripper.request_registers == before


async def test_viewers_get_statuses_and_nothing_to_call(shell: Shell, server: SimulatorServer) -> None:
    process = await shell.start("view", "--port", "0", server.address)
    url = await shell.read_line(process)
    async with met(url) as client:
        await client.subscribe("/gripper/status")
        while len(client.received) < 20:
            await client.read()
        assert client.services == {}
        assert client.told[0]["capabilities"] == []


async def test_a_lost_gripper_is_told_at_once(shell: Shell, server: SimulatorServer) -> None:
    process = await shell.start("view", "--port", "0", server.address)
    await shell.read_line(process)
    server.cut()
    assert process.stderr is not None
    async with asyncio.timeout(20):
        while b"link lost" not in (line := await process.stderr.readline()):
            assert line


def test_another_interface_is_warned_about(call: Call) -> None:
    # An address for documentation (RFC 5737): no machine has it, so nothing is opened to a network.
    outcome = call("view", "--host", "192.0.2.1", "--port", "0")
    assert outcome.code == 1
    assert "anyone who reaches 192.0.2.1 can see this gripper: there is no password" in outcome.err


def test_the_layout_is_handed_out(call: Call, tmp_path: Path) -> None:
    file = tmp_path / "gripper.json"
    outcome = call("view", "--layout", str(file))
    assert (outcome.code, outcome.out) == (0, f"{file}\n")
    assert file.read_text() == make_layout.draw()
    call("view", "--layout", str(file)).assert_failed(1, "exists")


def test_without_the_sdk_one_line_names_the_extra(call: Call, without: Callable[[str], None]) -> None:
    without("foxglove")
    call("view").assert_failed(1, "pip install 'foxglove-sdk")
