"""``robotiq-async view``."""

from __future__ import annotations

import json
import signal
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from websockets.asyncio.client import connect
from websockets.typing import Subprotocol

from docs import make_layout
from robotiq_async import RobotiqHand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.cli.conftest import WITHOUT

if TYPE_CHECKING:
    from tests.cli.conftest import Shell


async def first_words(url: str) -> list[str]:
    """The operations of the first frames."""
    async with connect(url, subprotocols=[Subprotocol("foxglove.sdk.v1")]) as socket:
        return [str(json.loads(await socket.recv())["op"]) for _ in range(2)]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
async def test_it_prints_where_to_look_and_leaves_the_fingers_alone(
    shell: Shell, number: signal.Signals
) -> None:
    gripper = SimulatedGripper(speedup=20)
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address) as hand:
        await hand.move(50)
        before = gripper.request_registers
        process = await shell.start("view", "--port", "0", server.address)
        url = await shell.read_line(process)
        assert url.startswith("ws://127.0.0.1:")
        assert await first_words(url) == ["serverInfo", "advertise"]
        process.send_signal(number)
        outcome = await shell.finish(process)
        assert (outcome.code, outcome.out) == (0, "")
        assert (
            outcome.err == "robotiq-async: The fingers were left as they are: nothing here has moved them.\n"
        )
        assert gripper.request_registers == before


async def test_another_interface_is_warned_about(shell: Shell) -> None:
    # An address for documentation (RFC 5737): no machine has it, so nothing is opened to a network.
    outcome = await shell.run("view", "--host", "192.0.2.1", "--port", "0")
    assert outcome.code == 1
    assert "anyone who reaches 192.0.2.1 can see this gripper and COMMAND it" in outcome.err
    outcome = await shell.run("view", "--host", "192.0.2.1", "--port", "0", "--read-only")
    assert "anyone who reaches 192.0.2.1 can see this gripper: there is no password" in outcome.err


async def test_the_layout_is_handed_out(shell: Shell, tmp_path: Path) -> None:
    file = tmp_path / "gripper.json"
    outcome = await shell.run("view", "--layout", str(file))
    assert (outcome.code, outcome.out) == (0, f"{file}\n")
    assert file.read_text() == make_layout.draw()
    (await shell.run("view", "--layout", str(file))).assert_failed(1, "exists")


async def test_without_the_sdk_one_line_names_the_extra(shell: Shell) -> None:
    code = WITHOUT.format("foxglove", ["view"])
    outcome = await shell.finish(await shell.python("-c", code))
    outcome.assert_failed(1, "pip install 'robotiq-async[view]'")
