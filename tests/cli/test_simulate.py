"""The simulate command."""

from __future__ import annotations

import json
import signal
import socket
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.cli.conftest import Shell


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
async def test_it_prints_its_address_serves_and_ends_cleanly(shell: Shell, number: signal.Signals) -> None:
    process = await shell.start("simulate", "--port", "0")
    address = await shell.read_line(process)
    assert address.startswith("tcp://127.0.0.1:")
    reading = json.loads((await shell.run("status", "--json", address)).out)
    assert reading["reset"] is True
    process.send_signal(number)
    outcome = await shell.finish(process)
    assert (outcome.code, outcome.out, outcome.err) == (0, "", "")


async def test_it_keeps_the_gripper_between_two_clients(shell: Shell) -> None:
    process = await shell.start("simulate", "--port", "0", "--speedup", "20")
    address = await shell.read_line(process)
    assert (await shell.run("move", "255", address)).code == 0
    assert json.loads((await shell.run("status", "--json", address)).out)["axes"]["C"]["position"] >= 240
    assert "Activating" not in (await shell.run("move", "0", address)).out


async def test_a_port_in_use(shell: Shell) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        (await shell.run("simulate", "--port", str(port))).assert_failed(1, f"127.0.0.1:{port}", "in use")


async def test_no_such_serial_device(shell: Shell) -> None:
    (await shell.run("simulate", "--serial", "/dev/no-such-port")).assert_failed(1, "/dev/no-such-port")


async def test_other_than_loopback_is_warned_about(shell: Shell) -> None:
    # An address for documentation (RFC 5737): no machine has it, so nothing is opened to a network.
    outcome = await shell.run("simulate", "--host", "192.0.2.1", "--port", "0")
    assert outcome.code == 1
    warning, failure = outcome.err.splitlines()
    assert "anyone who reaches 192.0.2.1 can command this gripper" in warning
    assert "cannot listen on 192.0.2.1:0" in failure
