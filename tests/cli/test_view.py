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
from websockets.exceptions import InvalidStatus
from websockets.typing import Origin, Subprotocol

from docs import make_layout
from robotiq_async import RobotiqHand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.viewer.gate import is_loopback
from robotiq_async.tools.viewer.services import SERVICES
from tests.foxglove_client import Client
from tests.grippers import active_gripper

if TYPE_CHECKING:
    from tests.cli.conftest import Call, Shell


@asynccontextmanager
async def met(url: str, *, services: bool) -> AsyncIterator[Client]:
    async with connect(url, subprotocols=[Subprotocol("foxglove.sdk.v1")], max_queue=None) as socket:
        client = Client(socket)
        await client.meet(services=services)
        yield client


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
async def test_it_prints_where_to_look_and_leaves_the_fingers_alone(
    shell: Shell, server: SimulatorServer, gripper: SimulatedGripper, number: signal.Signals
) -> None:
    async with RobotiqHand(server.address) as hand:
        await hand.move(50)
        before = gripper.request_registers
        process = await shell.start("view", "--control", "--port", "0", server.address)
        url = await shell.read_line(process)
        assert url.startswith("ws://127.0.0.1:")
        async with met(url, services=True) as client:
            assert set(client.services) == set(SERVICES)
        process.send_signal(number)
        outcome = await shell.finish(process)
        assert (outcome.code, outcome.out) == (0, "")
        assert "The fingers were left as they are: nothing here has moved them." in outcome.err
        assert gripper.request_registers == before


async def test_what_a_viewer_moved_is_stopped_although_another_says_nothing(shell: Shell) -> None:
    gripper = active_gripper()
    async with SimulatorServer(gripper) as server:
        process = await shell.start("view", "--control", "--port", "0", server.address)
        url = await shell.read_line(process)
        _, silent = await asyncio.open_connection("127.0.0.1", int(url.rpartition(":")[2]))
        async with met(url, services=True) as client:
            await client.ask(1, "close", {})
            async with asyncio.timeout(20):
                while not gripper.is_moving:  # noqa: ASYNC110  # another process tells it
                    await asyncio.sleep(0.01)
            process.send_signal(signal.SIGTERM)
            outcome = await shell.finish(process)
        silent.close()
        assert outcome.code == 0
        assert "The fingers were stopped" in outcome.err
        assert not gripper.request_registers[0] & 0x0800


async def test_without_control_there_are_no_commands(shell: Shell, server: SimulatorServer) -> None:
    process = await shell.start("view", "--port", "0", server.address)
    url = await shell.read_line(process)
    async with met(url, services=False) as client:
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


@pytest.mark.parametrize(
    ("host", "inside"),
    [
        ("127.0.0.1", True),
        ("127.1.2.3", True),
        ("::1", True),
        ("localhost", True),
        ("LOCALHOST", True),
        ("127.evil.example", False),
        ("localhost.example.com", False),
        ("::1234", False),
        ("0.0.0.0", False),
    ],
)
def test_who_is_outside(host: str, inside: bool) -> None:
    assert is_loopback(host) is inside


def test_another_interface_is_warned_about(call: Call) -> None:
    # An address for documentation (RFC 5737): no machine has it, so nothing is opened to a network.
    outcome = call("view", "--host", "192.0.2.1", "--port", "0")
    assert outcome.code == 1
    assert "anyone who reaches 192.0.2.1 can see this gripper: there is no password" in outcome.err


def test_commands_come_from_this_machine_only(call: Call) -> None:
    outcome = call("view", "--host", "192.0.2.1", "--port", "0", "--control")
    outcome.assert_failed(2, "--control needs 127.0.0.1", "ssh -L")


async def test_a_page_of_another_site_is_refused_and_named(shell: Shell, server: SimulatorServer) -> None:
    process = await shell.start("view", "--port", "0", "--origin", "http://lab.example", server.address)
    url = await shell.read_line(process)
    with pytest.raises(InvalidStatus, match="403"):
        await connect(
            url, subprotocols=[Subprotocol("foxglove.sdk.v1")], origin=Origin("http://evil.example")
        )
    assert process.stderr is not None
    async with asyncio.timeout(20):
        while b"--origin http://evil.example" not in (line := await process.stderr.readline()):
            assert line
    ours = Origin("http://lab.example")
    async with connect(
        url, subprotocols=[Subprotocol("foxglove.sdk.v1")], origin=ours, max_queue=None
    ) as socket:
        await Client(socket).meet(services=False)


def test_the_layout_is_handed_out(call: Call, tmp_path: Path) -> None:
    file = tmp_path / "gripper.json"
    outcome = call("view", "--layout", str(file))
    assert (outcome.code, outcome.out) == (0, f"{file}\n")
    assert file.read_text() == make_layout.draw()
    call("view", "--layout", str(file)).assert_failed(1, "exists")


def test_without_the_sdk_one_line_names_the_extra(call: Call, without: Callable[[str], None]) -> None:
    without("foxglove")
    call("view").assert_failed(1, "pip install 'foxglove-sdk")
