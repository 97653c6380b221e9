"""status and move, against a simulated gripper of this process."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import sys
import time
from asyncio.subprocess import Process
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from serial.tools.list_ports_common import ListPortInfo

from robotiq_async import JAW, TWO_FINGER_85, Fault, Finger, RobotiqStatus
from robotiq_async.calibration.csv_tables import write_stroke
from robotiq_async.cli.commands.demo import _program
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values import registers as reg
from robotiq_async.values.request import Request
from tests.cli.conftest import CLOSED, Outcome, served
from tests.patience import patience

if TYPE_CHECKING:
    from tests.cli.conftest import Call, Shell

ACTIVATE = (0x0100, 0, 0, 0, 0, 0, 0, 0)


class WatchedGripper(SimulatedGripper):
    """Notes the time of each request to go, and can be made older at once."""

    def __init__(self) -> None:
        self.age = 0.0
        self.went = asyncio.Event()
        super().__init__(clock=lambda: time.monotonic() + self.age)

    def write(self, address_offset: int, registers: Sequence[int]) -> None:
        super().write(address_offset, registers)
        if reg.rGTO.read(self.request_registers):
            self.went.set()

    def activate(self) -> None:
        self.write(0, ACTIVATE)
        self.age += 60.0


def test_status_as_json(call: Call, there: SimulatorServer) -> None:
    there.gripper.write(0, ACTIVATE)
    outcome = call("status", "--json", there.address)
    outcome.assert_succeeded()
    reading = json.loads(outcome.out)
    status = RobotiqStatus.from_registers(
        reading["registers"], timestamp=reading["timestamp"], sequence=reading["sequence"]
    )
    # It may still be activating.
    assert reading["state"] in ("RUNNING_IDLE", "WF_ACTIVATION")
    hand = {
        "name": there.address,
        "address": there.address,
        "state": reading["state"],
        "inhibited": "",
    }
    assert reading == hand | {"severity": "NONE", "description": "no fault"} | status.as_dict()
    assert reading["A"]["axis_state"] == "NO_REQUEST", "it was never asked for anything"


def test_status_of_a_gripper_at_rest_and_in_words(call: Call, there: SimulatorServer) -> None:
    outcome = call("status", there.address)
    outcome.assert_succeeded()
    assert outcome.out.splitlines()[1] == "RESET: reset, not moving"
    assert "SCISSOR" in outcome.out


def test_no_number_is_cut_in_a_narrow_window(
    call: Call, there: SimulatorServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "30")
    outcome = call("status", there.address)
    outcome.assert_succeeded()
    assert "…" not in outcome.out
    assert re.search(r"SCISSOR +137 ", outcome.out)


def test_status_shows_a_fault(call: Call, there: SimulatorServer) -> None:
    there.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    outcome = call("status", there.address)
    assert outcome.code == 0
    assert "FAULT" in outcome.out
    assert "major fault 0x0E: interference on the scissor for more than 20 s" in outcome.out
    reading = json.loads(call("status", "--json", there.address).out)
    assert (reading["fault"], reading["fault_code"]) == ("SCISSOR_BLOCKED", 14)
    assert (reading["severity"], reading["description"]) == ("MAJOR", Fault.SCISSOR_BLOCKED.description)


def test_move_activates_and_closes(call: Call, there: SimulatorServer) -> None:
    outcome = call("move", "255", "--yes", there.address)
    outcome.assert_succeeded()
    assert outcome.out.splitlines()[1] == "Activating: the fingers open and close."
    assert outcome.out.count("AT_POSITION") == 3
    assert "no contact" in outcome.out
    assert there.gripper.position(Finger.A) >= 240


def test_move_takes_fingers_speed_and_force(call: Call, there: SimulatorServer) -> None:
    arguments = ["--fingers", "a,scissor", "--speed", "200", "--force", "10", "--timeout", "20"]
    outcome = call("move", "100", "--yes", there.address, *arguments)
    assert outcome.code == 0
    assert abs(there.gripper.position(Finger.A) - 100) <= 2
    assert abs(there.gripper.position(Finger.SCISSOR) - 100) <= 2
    assert there.gripper.position(Finger.B) < 10
    last = [write.registers for write in there.gripper.writes if reg.rGTO.read(write.registers)][-1]
    assert (reg.rSP[0].read(last), reg.rFR[0].read(last)) == (200, 10)


JAW_ADDRESS = "sim://?model=2f85&speedup=20"


def test_move_takes_millimetres_and_shows_them(call: Call) -> None:
    outcome = call("move", "40mm", JAW_ADDRESS, "--speed", "80mm/s", "--force", "60.5N")
    outcome.assert_succeeded()
    (row,) = re.findall(r"^ +jaw +(\d+) +([\d.]+) +AT_POSITION", outcome.out, re.MULTILINE)
    position, mm = int(row[0]), float(row[1])
    assert "nominal mm" in outcome.out
    assert position == pytest.approx(TWO_FINGER_85.stroke.position_of(40), abs=2)
    assert mm == round(TWO_FINGER_85.stroke.opening_mm(position), 1)


def test_millimetres_follow_a_file_of_measured_points(call: Call, tmp_path: Path) -> None:
    file = tmp_path / "left.csv"
    write_stroke(file, ((3, 60.0), (228, 10.0)))
    outcome = call("move", "60mm", JAW_ADDRESS, "--stroke", str(file))
    outcome.assert_succeeded()
    assert "measured mm" in outcome.out
    outcome = call("move", "85mm", JAW_ADDRESS, "--stroke", str(file))
    outcome.assert_failed(2, "mm must be millimetres in 10.0..60.0, got 85.0")
    call("move", "3", JAW_ADDRESS, "--stroke", str(tmp_path / "none.csv")).assert_failed(2, "cannot be read")


def test_millimetres_out_of_range_are_wrong_usage_and_move_nothing(call: Call) -> None:
    outcome = call("move", "90mm", JAW_ADDRESS)
    outcome.assert_failed(2, "mm must be millimetres in 0.0..85.0, got 90.0")
    assert "Activating" not in outcome.out
    call("move", "40mm", "sim://?speedup=20", "--fingers", "all").assert_failed(
        2, "the scissor has no opening"
    )


def test_status_says_what_is_held_and_how_wide_it_is(call: Call) -> None:
    gripper = SimulatedGripper(speedup=20, model="2f85")
    gripper.place_object(JAW, position=150)
    with served(gripper) as server:
        call("move", "255", "--keep", "--yes", server.address).assert_succeeded()
        outcome = call("status", server.address)
        outcome.assert_succeeded()
    found = re.search(r"^a part is held, ([\d.]+) mm wide \(nominal\)$", outcome.out, re.MULTILINE)
    assert found
    assert float(found[1]) == pytest.approx(TWO_FINGER_85.stroke.opening_mm(150), abs=2)


def test_an_axis_that_the_model_lacks_is_wrong_usage_and_moves_nothing(call: Call) -> None:
    outcome = call("move", "100", "sim://?model=hand-e&speedup=20", "--fingers", "B", "--yes")
    outcome.assert_failed(2, "fingers must be axes of a Hand-E (A), got B")
    assert "Activating" not in outcome.out


def test_a_grip_is_kept_from_one_move_to_the_next(call: Call, there: SimulatorServer) -> None:
    held = Finger.B | Finger.C
    call("move", "0", "--yes", there.address).assert_succeeded()
    there.gripper.place_object(held, position=120)
    outcome = call("move", "255", "--keep", "--yes", there.address)
    outcome.assert_succeeded()
    assert outcome.out.count("CONTACT_CLOSING") == 2
    assert "an object is in the way" in outcome.out
    assert "the grip is in force" in outcome.out
    assert there.gripper.grips == held
    outcome = call("move", "60", "--fingers", "A", "--keep", "--yes", there.address)
    outcome.assert_succeeded()
    assert "rGTO" not in outcome.err
    assert "the grip is in force" in outcome.out
    assert there.gripper.grips == held
    outcome = call("move", "9", "--fingers", "A", "-y", there.address)
    assert "the vendor says that a held part stays held; that is not measured. With --keep" in outcome.out
    assert not there.gripper.grips
    call("move", "60", "--fingers", "A", "--yes", there.address).assert_succeeded()
    assert not there.gripper.grips


class InterruptingGripper(SimulatedGripper):
    """Sends Ctrl-C when an axis gets a request for a position."""

    at = -1

    def write(self, address_offset: int, registers: Sequence[int]) -> None:
        super().write(address_offset, registers)
        if Request.from_registers(registers).position(Finger.A) == self.at:
            os.kill(os.getpid(), signal.SIGINT)


def test_ctrl_c_keeps_a_grip_and_holds_what_moves(call: Call) -> None:
    gripper, held = InterruptingGripper(speedup=20), Finger.B | Finger.C
    gripper.place_object(held, position=120)
    with served(gripper) as server:
        call("move", "255", "--fingers", "B,C", "--keep", "--yes", server.address).assert_succeeded()
        gripper.at = 200
        outcome = call("move", "200", "--fingers", "A", "--speed", "0", "--keep", "--yes", server.address)
        outcome.assert_failed(130, "interrupted")
        assert not gripper.is_moving
        assert gripper.position(Finger.A) < 150
        assert gripper.grips == held


def test_move_in_fault_fails(call: Call, there: SimulatorServer) -> None:
    there.gripper.inject_fault(Fault.ACTIVATION_FAULT)
    call("move", "255", "--yes", there.address).assert_failed(1, "fault")


@pytest.mark.parametrize("command", ["status", "monitor", "move 3 --yes", "demo --yes"])
def test_nothing_answers(call: Call, refusing: str, command: str) -> None:
    call(*command.split(), refusing).assert_failed(1, refusing)


@asynccontextmanager
async def moving(shell: Shell) -> AsyncIterator[tuple[SimulatorServer, WatchedGripper, Process]]:
    """A command that moves an active gripper slowly."""
    gripper = WatchedGripper()
    gripper.activate()
    async with SimulatorServer(gripper) as server:
        process = await shell.start("move", "255", "--yes", server.address, "--speed", "0")
        async with asyncio.timeout(patience(20)):
            await gripper.went.wait()
        yield server, gripper, process


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
async def test_a_signal_stops_the_fingers(shell: Shell, number: signal.Signals, code: int) -> None:
    async with moving(shell) as (_, gripper, process):
        process.send_signal(number)
        (await shell.finish(process)).assert_failed(code, "interrupted")
    assert not gripper.is_moving
    assert not reg.rGTO.read(gripper.request_registers)
    assert reg.rACT.read(gripper.request_registers)
    assert gripper.position(Finger.A) < 200


async def test_a_link_that_goes_down_under_a_move(shell: Shell) -> None:
    async with moving(shell) as (server, _, process):
        await server.stop()
        (await shell.finish(process)).assert_failed(1, server.address, "the stop was not delivered")


async def test_a_reader_that_has_had_enough(shell: Shell, server: SimulatorServer) -> None:
    process = await shell.start("status", "--json", server.address)
    assert process.stdout is not None
    process.stdout._transport.close()  # type: ignore[attr-defined]  # asyncio has no other way
    outcome = await shell.finish(process)
    assert outcome.code == 1
    assert "Error" not in outcome.err


@pytest.mark.parametrize(
    "command",
    [
        *("--help", "move 30", "status", "doctor sim://", "monitor --watch", "simulate --port 0", "demo"),
        *("simulate --troubles", "monitor --json", "status --json"),
    ],
)
def test_no_command_complains_when_its_reader_has_gone(command: str, call: Call, virtually: None) -> None:
    """Those whose output is for programs name the gripper on standard error."""
    named = "robotiq-async: Simulated gripper sim://\n" if "--json" in command else ""
    with output_is_not_read():
        assert call(*command.split()) == Outcome(1, "", named)


def test_the_demo_without_the_command_line_does_not_either(
    virtually: None, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["demo.py"])
    handler = signal.getsignal(signal.SIGTERM)
    try:
        with output_is_not_read():
            assert _program().main() == 1
    finally:
        signal.signal(signal.SIGTERM, handler)
    assert capfd.readouterr() == ("", "")


@contextmanager
def output_is_not_read() -> Iterator[None]:
    """Standard output is a pipe whose other end has been closed."""
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as stream, redirect_stdout(stream):
        yield


@pytest.mark.parametrize("closed", [0, 1, 2])
async def test_a_closed_standard_stream_does_no_harm(
    shell: Shell, server: SimulatorServer, closed: int
) -> None:
    process = await shell.forked("-c", CLOSED.format(closed, ["status", server.address]))
    (await shell.finish(process)).assert_succeeded()


# -- ports -------------------------------------------------------------------------------------------------


def listed(*ports: tuple[str, str]) -> list[ListPortInfo]:
    found = []
    for device, description in ports:
        port = ListPortInfo(device)
        port.description = description
        found.append(port)
    return found


def test_ports_are_listed_as_addresses(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    ports = listed(("/dev/ttyUSB1", "FT232R USB UART"), ("/dev/ttyS0", "n/a"))
    # pyserial is below what is tested.
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: ports)
    outcome = call("ports")
    assert outcome.code == 0
    assert outcome.out.splitlines() == ["rtu:///dev/ttyS0", "rtu:///dev/ttyUSB1  FT232R USB UART"]


@pytest.mark.parametrize("command", ["status", "monitor"])
def test_the_error_for_a_missing_port_names_those_that_there_are(
    call: Call, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    ports = listed(("COM7", "USB Serial Port"), ("COM3", "n/a"))
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: ports)
    outcome = call(command, "rtu:///dev/ttyNOWHERE?model=2f85")
    assert outcome.code == 1
    assert "there is no such device; is it plugged in? These are: COM3, COM7" in outcome.err


def test_a_machine_without_ports(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("serial.tools.list_ports.comports", list)
    outcome = call("ports")
    assert outcome.code == 1
    assert "no serial port: is the adapter plugged in?" in outcome.err


@pytest.mark.parametrize("error", [OSError(5, "driver"), TypeError("NoneType"), RuntimeError()], ids=repr)
def test_a_machine_that_cannot_list_its_ports(
    call: Call, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    """It raises what its system's drivers make it raise."""

    def fail() -> None:
        raise error

    monkeypatch.setattr("serial.tools.list_ports.comports", fail)
    call("ports").assert_failed(1, f"the serial ports of this machine cannot be listed: {error!r}")
    outcome = call("status", "rtu:///dev/ttyNOWHERE")
    outcome.assert_failed(1, "there is no such device")


# -- doctor ------------------------------------------------------------------------------------------------


def test_doctor_finds_nothing_wrong_with_the_simulator(call: Call) -> None:
    outcome = call("doctor", "sim://")
    outcome.assert_succeeded()
    lines = outcome.out.splitlines()
    assert lines[1].split()[:2] == ["ok", "Modbus"]
    assert not any(line.startswith("FAIL") for line in lines)
    # All but two are the simulator's; how quick it answers is the machine's, which may be busy.
    assert {line[6:20].strip() for line in lines if line.startswith("warn")} <= {"round trip", "rate"}


@pytest.mark.skipif(sys.platform == "win32", reason="it has no such terminal")
async def test_doctor_keeps_its_columns_on_a_terminal() -> None:
    from tests.cli.terminal import Terminal  # noqa: PLC0415  # not on Windows

    terminal = Terminal("-m", "robotiq_async", "doctor", "tcp://127.0.0.1:1")
    await terminal.shows(b": see above")
    assert await terminal.end() == 1
    _, *found = terminal.out.decode().split("port           1: ")[1].splitlines()
    assert found[0].startswith(" " * 21), "longer than the 100 columns, and hung"


@pytest.mark.parametrize(
    ("address", "why", "found"),
    [
        ("nowhere.invalid", "tcp://nowhere.invalid:502: name", "\nFAIL  name"),
        (
            "zenoh://lab/cell/left?connect=tcp/127.0.0.1:1",
            "zenoh://lab/cell/left: port",
            "\nFAIL  port           tcp/127.0.0.1:1: nothing listens",
        ),
    ],
)
def test_doctor_fails_when_something_is_broken(call: Call, address: str, why: str, found: str) -> None:
    outcome = call("doctor", address)
    outcome.assert_failed(1, f"{why}: see above")
    assert found in outcome.out
