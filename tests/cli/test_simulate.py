"""The simulate command."""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import resource
import signal
import socket
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from robotiq_async import RobotiqHand
from robotiq_async.simulator.troubles.trouble import KINDS
from robotiq_async.values.model import THREE_FINGER
from tests.cli.conftest import Outcome
from tests.grippers import shows
from tests.patience import patience
from tests.serial_line import SerialLine

if TYPE_CHECKING:
    from asyncio.subprocess import Process

    from tests.cli.conftest import Beside, Call, Shell


async def next_line(process: Process) -> str:
    """The next line on its standard error."""
    assert process.stderr is not None
    async with asyncio.timeout(patience(30)):
        return (await process.stderr.readline()).decode().rstrip("\n")


@pytest.mark.parametrize(
    ("number", "options", "position"), [(signal.SIGINT, (), 7), (signal.SIGTERM, ("--exact",), 6)]
)
def test_it_prints_its_address_serves_ends_cleanly_and_is_exact_only_on_request(
    call: Call,
    beside: Callable[..., Beside],
    number: signal.Signals,
    options: tuple[str, ...],
    position: int,
) -> None:
    process = beside("simulate", "--port", "0", *options)
    address = process.read_line()
    assert address.startswith("tcp://127.0.0.1:")
    reading = json.loads(call("status", "--json", address).out)
    assert reading["is_reset"] is True
    assert reading["A"]["position"] == position
    assert process.finish(number) == Outcome(0, "", "")


def test_something_may_be_in_the_way_and_the_gripper_stays_active_between_clients(
    call: Call, beside: Callable[..., Beside]
) -> None:
    options = ("--speedup", "20", "--object", "150", "--exact", "--plain")
    address = beside("simulate", "--port", "0", *options).read_line()
    assert call("move", "255", "--yes", address).code == 0
    reading = json.loads(call("status", "--json", address).out)
    assert [reading[name]["position"] for name in ("A", "B", "C")] == [150] * 3
    assert "Activating" not in call("move", "0", "--yes", address).out


def test_something_fixed_fails_an_activation(call: Call, beside: Callable[..., Beside]) -> None:
    options = ("--speedup", "20", "--object", "150", "--fixed", "--plain")
    address = beside("simulate", "--port", "0", *options).read_line()
    call("move", "255", "--yes", address).assert_failed(1, "0x0D")


@pytest.mark.parametrize(
    ("options", "second_status", "seconds"),
    [((), [9, 0], 12), (("--like-hardware",), [9, 0], 12), (("--plain",), [0, 0], 4.2)],
)
async def test_the_habits_of_real_grippers_unless_it_is_plain(
    shell: Shell, options: tuple[str, ...], second_status: list[int], seconds: float
) -> None:
    process = await shell.start("simulate", "--port", "0", "--speedup", "4", *options)
    port = int((await shell.read_line(process)).rpartition(":")[2])
    reader, writer = await asyncio.open_connection("127.0.0.1", port)

    async def ask(pdu: str) -> bytes:
        request = bytes.fromhex(pdu)
        writer.write(b"\0\1\0\0" + (len(request) + 1).to_bytes(2) + b"\2" + request)
        header = await reader.readexactly(7)
        return await reader.readexactly(int.from_bytes(header[4:6]) - 1)

    async with asyncio.timeout(patience(30)):
        await asyncio.sleep(1.1)
        faults = [(await ask("04 0001 0001"))[2] & 0x0F for _ in range(2)]
        assert faults == second_status
        began = asyncio.get_running_loop().time()
        await ask("10 0000 0001 02 0100")
        while (await ask("04 0000 0001"))[2] & 0x30 != 0x30:  # noqa: ASYNC110  # a client can only poll
            await asyncio.sleep(0.02)
        took = 4 * (asyncio.get_running_loop().time() - began)
    assert seconds - 0.1 <= took <= seconds + 2
    writer.close()


def test_a_line_that_cannot_be_opened(call: Call) -> None:
    for device, why in (("/dev/ttyNOWHERE", "no such device"), ("/dev/null", "it is not a serial port")):
        call("simulate", "--serial", device).assert_failed(1, f"cannot listen on {device}: ", why)


def test_a_port_in_use(call: Call) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        call("simulate", "--port", str(port)).assert_failed(1, f"127.0.0.1:{port}", "in use")


@pytest.mark.parametrize(("said", "unit", "other"), [((), "9", "12"), (("--device-id", "12"), "12", "9")])
async def test_the_unit_id_on_a_serial_line(
    shell: Shell, tmp_path: Path, said: tuple[str, ...], unit: str, other: str
) -> None:
    with SerialLine(tmp_path) as line:
        process = await shell.start("simulate", "--serial", line.far, *said)
        assert await shell.read_line(process) == f"rtu://{line.far}"
        address = f"rtu://{line.near}"
        (await shell.run("status", "--device-id", other, address)).assert_failed(1, "no device answers")
        (await shell.run("status", "--device-id", unit, address)).assert_succeeded()
        process.send_signal(signal.SIGINT)
        (await shell.finish(process)).assert_succeeded()


def test_the_unit_id_over_tcp(call: Call, beside: Callable[..., Beside]) -> None:
    address = beside("simulate", "--port", "0", "--device-id", "7").read_line()
    call("status", "--device-id", "7", address).assert_succeeded()
    call("status", address).assert_failed(1, "no device answers")


def test_rtu_over_tcp(call: Call, beside: Callable[..., Beside]) -> None:
    address = beside("simulate", "--rtu-over-tcp", "--port", "0").read_line()
    assert address.startswith("rtu+tcp://127.0.0.1:")
    call("status", address).assert_succeeded()
    call("status", "--read-function", "4", address).assert_succeeded()
    call("status", "--device-id", "12", address).assert_failed(1, "no device answers")
    call("status", address.removeprefix("rtu+")).assert_failed(1, "no device answers")


def test_urcap(call: Call, beside: Callable[..., Beside], tmp_path: Path) -> None:
    address = beside("simulate", "--urcap", "--model", "2f85", "--port", "0").read_line()
    assert re.fullmatch(r"urcap://127\.0\.0\.1:[0-9]+\?model=2f85", address)
    shown = call("status", address)
    shown.assert_succeeded()
    assert re.search(r"\bmA\b", shown.out)
    assert json.loads(call("status", "--json", address).out)["A"]["current_ma"] == 0, "COU, of a jaw at rest"
    call("status", "--device-id", "9", address).assert_succeeded()
    call("status", "--device-id", "2", address).assert_failed(1, "the URCap does not choose gripper 2")
    call("status", "--read-function", "3", address).assert_failed(2, "read_function is an option of Modbus")
    call("status", address.removesuffix("?model=2f85")).assert_failed(2, "name it, as in urcap://")
    verify = ("--up-to", "0", "--yes-to", "0", "--report", str(tmp_path / "report"))
    call("verify", address, *verify).assert_succeeded()
    call("verify", address.removesuffix("?model=2f85"), *verify).assert_failed(2, "name it, as in urcap://")


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (("--urcap",), "a URCap has a 2F or a Hand-E: --model 2f85, 2f140 or hand-e"),
        (("--urcap", "--rtu-over-tcp", "--model", "2f85"), "cannot be combined"),
        (("--urcap", "--model", "2f85", "--unpaced"), "--unpaced is for a serial line"),
        (
            ("--urcap", "--model", "2f85", "--trouble", "wrong-unit"),
            "wrong-unit does not fit a simulator on urcap",
        ),
    ],
)
def test_what_does_not_fit_a_urcap(call: Call, options: tuple[str, ...], why: str) -> None:
    call("simulate", "--port", "0", *options).assert_failed(2, why)


@pytest.mark.parametrize(
    ("command", "can", "why"),
    [
        ("simulate", "command this gripper", "cannot listen on 192.0.2.1:0"),
        ("view", "see this gripper: there is no password", "ws://192.0.2.1:0: "),
    ],
)
def test_other_than_loopback_is_warned_about(call: Call, command: str, can: str, why: str) -> None:
    # An address for documentation (RFC 5737): no machine has it, so nothing is opened to a network.
    outcome = call(command, "--host", "192.0.2.1", "--port", "0")
    assert outcome.code == 1
    assert f"anyone who reaches 192.0.2.1 can {can}" in outcome.err.splitlines()[0]
    assert why in outcome.err.splitlines()[-1]


# Troubles.


async def test_troubles_of_several_options(shell: Shell) -> None:
    words = ("--trouble", "delay 0.01; release", "--trouble", "foreign 200")
    process = await shell.start("simulate", "--port", "0", *words)
    address = await shell.read_line(process)
    lines = [await next_line(process) for _ in range(3)]
    assert lines == [f"robotiq-async: trouble: {each}" for each in ("delay 0.01", "release", "foreign 200")]
    hand = RobotiqHand(address)
    await hand.start(activate=False)
    await shows(hand, lambda it: [*map(it.requested_position, THREE_FINGER.axes)] == [200] * 4)
    await hand.stop()


@pytest.mark.parametrize(
    ("words", "begins", "number"),
    [
        ("power-cut", "power-cut", signal.SIGTERM),
        ("silence for 1000 every 2000", "silence for 1000 every 2000", signal.SIGINT),
        ("drop at 1000; fault 14 at 0.1 for 0.1", "fault 14 at 0.1 for 0.1", signal.SIGINT),
    ],
)
async def test_it_ends_cleanly_while_a_plan_runs(
    shell: Shell, words: str, begins: str, number: signal.Signals
) -> None:
    process = await shell.start("simulate", "--port", "0", "--trouble", words)
    await shell.read_line(process)
    assert await next_line(process) == f"robotiq-async: trouble: {begins}"
    process.send_signal(number)
    outcome = await shell.finish(process)
    assert (outcome.code, outcome.out, outcome.err) == (0, "", "")


def test_it_serves_on_when_the_plan_is_over(call: Call, beside: Callable[..., Beside]) -> None:
    process = beside("simulate", "--port", "0", "--trouble", "close")
    address = process.read_line()
    assert process.read_error() == "robotiq-async: trouble: close"
    call("status", address).assert_succeeded()


def test_the_list_of_troubles(call: Call) -> None:
    outcome = call("simulate", "--troubles")
    assert (outcome.code, outcome.err) == (0, "")
    lines = outcome.out.splitlines()
    assert [line.split()[0] for line in lines] == list(KINDS)
    for line, kind in zip(lines, KINDS.values(), strict=True):
        assert kind.meaning in line
        assert ("VALUE: " in line) == (kind.value is not None)
        assert ("; over " in line) == (len(kind.links) < 4)
        assert ("lasts for ever" in line) == (kind.lasts > 0)
    (refuse,) = (line for line in lines if line.startswith("refuse "))
    assert refuse.endswith("; over tcp, rtu+tcp, urcap"), "where there are connections"


@pytest.mark.skipif(not hasattr(resource, "prlimit"), reason="no way here to take files away from a process")
def test_without_files_for_more_connections_it_says_one_sentence(beside: Callable[..., Beside]) -> None:
    """Each connection that could not be accepted was reported with a traceback of asyncio."""
    process = beside("simulate", "--port", "0")
    port = int(process.read_line().rpartition(":")[2])
    number = process.process.pid
    most = len(list(Path(f"/proc/{number}/fd").iterdir())) + 2
    resource.prlimit(number, resource.RLIMIT_NOFILE, (most, most))
    with contextlib.ExitStack() as clients:
        for _ in range(10):
            clients.enter_context(socket.create_connection(("127.0.0.1", port)))
        said = process.read_error()
    assert "no further connection can be accepted: Too many open files" in said
    assert process.finish(signal.SIGTERM) == Outcome(0, "", "")
