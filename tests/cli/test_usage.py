"""Help, versions and wrong usage: what every command refuses in one line, before anything is opened."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import robotiq_async
from robotiq_async.cli import main
from robotiq_async.cli.app import SUBCOMMANDS as FUNCTIONS
from robotiq_async.cli.commands.fleet import fleet, halt, keys
from robotiq_async.cli.commands.measure import speed
from robotiq_async.cli.commands.measure_force import force
from robotiq_async.cli.commands.measure_stroke import stroke
from robotiq_async.hands.options import LATE_POLLS
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.cli.conftest import FORGETTING, WITHOUT

if TYPE_CHECKING:
    from tests.cli.conftest import Beside, Call, Shell

COMMANDS = ("demo", "simulate", "status", "move", "monitor", "view", "doctor")
EVERY = {each.__name__: each for each in FUNCTIONS} | {
    "fleet": fleet,
    "fleet halt": halt,
    "fleet keys": keys,
    "measure speed": speed,
    "measure force": force,
    "measure stroke": stroke,
}
MOVE = {"demo", "move", "measure speed", "measure force", "measure stroke"}
SIMULATED = "Simulated gripper sim://"


# -- help --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("arguments", [[], ["--help"]])
def test_help_lists_every_command_and_the_addresses(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 0
    out = capsys.readouterr().out
    for word in ("Usage: robotiq-async COMMAND", *COMMANDS, "tcp://", "rtu://", "sim://", "real hardware"):
        assert word in out


@pytest.mark.parametrize(("command", "width"), [*((each, 60) for each in EVERY), ("move", 120)])
def test_the_help_of_a_command(
    command: str, width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    assert main([*command.split(), "--help"]) == 0
    out = capsys.readouterr().out
    words, _, examples = out.partition("\n\n")[2].partition("For example:")
    assert_wrapped_once(words.splitlines(), width)
    assert f"\n    robotiq-async {command}" in examples, "an example keeps its line"
    assert command not in COMMANDS or "address" in out.lower()
    assert command not in MOVE or "FINGERS MOVE" in " ".join(out.split())


def assert_wrapped_once(lines: list[str], width: int) -> None:
    assert max(map(len, lines)) <= width
    for line, following in pairwise(lines):
        if line.strip() and following.strip() and not line.startswith(" "):
            assert len(f"{line.rstrip()} {following.split()[0]}") > width, f"{line!r} has room"


def test_the_help_of_an_option_is_one_line_of_the_source() -> None:
    for command in EVERY.values():
        assert command.__doc__
        for line in inspect.cleandoc(command.__doc__).partition("Args:\n")[2].splitlines():
            assert re.match(r"    [a-z0-9_]+: ", line), f"it would break there in any terminal: {line}"


def test_the_default_of_an_option_is_said_once_if_no_wire_has_another(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "300")
    assert main(["status", "--help"]) == 0
    out = capsys.readouterr().out
    assert "default: 16)" in out
    assert "default: 4 on TCP, 3 serial)" in out


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip() == robotiq_async.__version__


# -- wrong usage -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("mvoe 3", ["mvoe", "move"]),
        ("move", ["POSITION"]),
        ("move 256", ["POSITION", "256", "0..255"]),
        ("move -1", ["POSITION", "-1", "0..255"]),
        ("move 1.5", ["POSITION", "1.5", "0..255"]),
        ("move ten", ["POSITION", "ten", "0..255"]),
        ("move 40 mm sim://?model=2f85", ["a number and its unit are one word: 40mm"]),
        ("move 40 mm", ["a number and its unit are one word: 40mm"]),
        ("move -1 mm", ["a number and its unit are one word: -1mm"]),
        ("move -1mm", ["an amount must be 0 or more, got '-1mm'"]),
        ("move 40mm --speed -5mm/s", ["an amount must be 0 or more, got '-5mm/s'"]),
        ("move 156mm tcp://127.0.0.1:1 --yes", ["mm must be millimetres in 0.0..155.0, got 156.0"]),
        ("move 40mm tcp://127.0.0.1:1 --yes --fingers scissor", ["the scissor has no opening"]),
        ("move 40mm tcp://127.0.0.1:1 --yes --stroke none.csv", ["none.csv: cannot be read: No such file"]),
        ("move 40mm tcp://127.0.0.1:1 --yes --model 2f85 --fingers B", ["B"]),
        ("move 40mm sim://?model=2f85 --speed 80 mm/s", ["a number and its unit are one word: 80mm/s"]),
        ("move 3 --speed 256", ["--speed", "256", "0..255"]),
        ("move 3 --force -1", ["--force", "-1", "0..255"]),
        ("move 3 --fingers A,,B", ["--fingers", "''"]),
        ("move 3 --timeout 0", ["timeout", "0", "above 0"]),
        ("move 3 --timeout soon", ["--timeout", "soon"]),
        ("move 3 --wrong 4", ["--wrong"]),
        ("move 3 ftp://gripper", ["ftp://gripper", "tcp://", "rtu://", "sim://"]),
        ("move 3 sim:// 4", ["4"]),
        ("status [/b]", ["[/b]"]),
        ("demo gripper:port", ["gripper:port", "tcp://"]),
        ("doctor", ["ADDRESS"]),
        ("doctor zenoh://lab/cell", ["zenoh://SITE/HOST/GRIPPER"]),
        ("doctor zenoh://lab/cell/left --device-id 3", ["its agent's file has device_id"]),
        ("move 3 --yes zenoh://lab/cell/left --device-id 3", ["a gripper on another host is set up there"]),
        ("monitor --watch --json", ["cannot be combined"]),
        ("simulate --port 65536", ["--port", "65536", "0..65535"]),
        ("simulate --speedup 0", ["speedup", "0"]),
        ("simulate --speedup nan", ["speedup must be a number in 0..1000000000.0, got nan"]),
        ("simulate --object 256", ["--object must be an integer in 0..255"]),
        ("simulate --fixed", ["--fixed is about an object"]),
        (
            "simulate --serial /dev/no --device-id=9.5",
            ["--device-id must be an integer in 0..255"],
        ),
        ("simulate --serial /dev/no --device-id 248", ["device_id must be in 1..247, got 248"]),
        ("simulate --rtu-over-tcp --device-id 0", ["device_id must be in 1..247, got 0"]),
        ("simulate --serial /dev/ttyS0 --rtu-over-tcp", ["--rtu-over-tcp"]),
        ("simulate --unpaced", ["--unpaced"]),
        ("simulate --trouble drop --trouble dorp", ["unknown trouble 'dorp'; known are: delay, late, drop"]),
        ("simulate --trouble wrong-checksum", ["wrong-checksum does not fit a simulator on tcp"]),
        ("simulate --serial /dev/no --trouble refuse", ["refuse does not fit a simulator on rtu"]),
        ("simulate --model 2f85 --trouble interference", ["does not fit a 2F-85: it has no scissor"]),
        ("record x.mcap --seconds 0", ["--seconds"]),
        ("record x.mcap --seconds nan", ["--seconds"]),
        ("record x.mcap --csv", ["name the file .csv"]),
        ("record x.csv --ros2", ["--ros2 records an MCAP file"]),
        ("export x.mcap out.txt --convention COUNTS", ["must be a file named .csv, got out.txt"]),
        ("export x.csv --convention COUNTS", ["x.csv is the table itself"]),
        ("export x.mcap --of everything", ["everything"]),
        ("measure speed", ["ADDRESS"]),
        ("measure speed sim:// --runs 0", ["--runs must be an integer in 1..100, got '0'"]),
        ("measure speed sim:// --step 0", ["--step must be an integer in 1..255, got '0'"]),
        ("measure speed sim:// --speedup 51", ["--speedup must be a number in 1..50, got 51"]),
        ("measure speed 192.168.1.11 --speedup 2", ["--speedup is for sim:// only"]),
        ("measure speed sim://?speedup=2", ["takes no option but ?model=; there is --speedup"]),
        ("measure speed sim:// --output mine.png", ["--output must be a file named .csv, got 'mine.png'"]),
        ("measure stroke sim://", ["between the fingertips of a jaw; sim:// names a 3-Finger"]),
        ("measure speed sim:// --runs 1.5", ["--runs must be an integer in 1..100, got '1.5'"]),
        (
            "measure stroke sim://?model=2f85 --points 5.5",
            ["--points must be an integer in 2..50, got '5.5'"],
        ),
        ("measure stroke sim://?model=2f85 --points 1", ["--points must be an integer in 2..50, got '1'"]),
        ("measure speed sim:// --fingers scissor", ["--fingers takes A, B and C only"]),
        ("measure force", ["ADDRESS"]),
        ("measure force sim://?model=2f85", ["with three fingers; sim://?model=2f85 names a 2F-85"]),
        ("measure force sim:// --output a.csv --scale a.csv", ["--scale must be another file than"]),
        ("measure force sim:// --surface wood", ["wood"]),
        ("measure force sim:// --speed 256", ["--speed", "256", "0..255"]),
        ("verify", ["ADDRESS"]),
        ("verify 127.0.0.1", ["without a terminal"]),
        ("verify 127.0.0.1 --yes-to 2", ["without a terminal"]),
        ("verify 127.0.0.1 --up-to 3 --yes-to 3", ["without a terminal"]),
        ("verify 127.0.0.1 --up-to 2 --yes-to 1", ["without a terminal"]),
        ("verify 127.0.0.1 --up-to 1 --yes-to 2 --from 2", ["--from"]),
        ("verify 127.0.0.1 --up-to 2 --yes-to 9", ["--yes-to"]),
        ("verify 127.0.0.1 --up-to 10", ["0..9"]),
        ("verify 300.1.1.1 --up-to 2 --yes-to 2", ["300.1.1.1"]),
        ("verify zenoh://lab/cell/left --up-to 2 --yes-to 2", ["agent"]),
        ("fleet keys", ["FOLDER"]),
        ("fleet keys keys --read a/b", ["'a/b'", "A-Z"]),
        ("fleet keys keys --agent cell-1=", ["''", "host"]),
        ("fleet keys keys --agent a --agent a=b", ["named twice"]),
        ("fleet keys keys --read bob --days 0", ["--days", "1..36500", "0"]),
        ("fleet keys keys --wirte bob", ["--wirte"]),
    ],
)
def test_wrong_usage_is_one_line_and_opens_nothing(
    arguments: str,
    words: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments.split()) == 2
    out, err = capsys.readouterr()
    assert re.fullmatch(r"(Gripper .*\n)?", out)
    assert err.count("\n") == 1
    for word in words:
        assert word in err
    assert not list(tmp_path.iterdir())


# -- extras ------------------------------------------------------------------------------------------------


async def test_without_the_extra_one_line_names_it(shell: Shell) -> None:
    outcome = await shell.finish(await shell.forked("-c", FORGETTING + WITHOUT.format("cyclopts", [])))
    outcome.assert_failed(1, "cyclopts", 'pip install "cyclopts')


@pytest.mark.parametrize("command", ["status", "doctor", "agent"])
async def test_a_simulation_with_physics_names_the_extra_that_it_needs(
    shell: Shell, command: str, tmp_path: Path
) -> None:
    """The doctor and the agent ended with a traceback."""
    address, file = "sim://?physics=box:30x40x60,0.3", tmp_path / "FLEET.toml"
    file.write_text(f'site = "lab"\n[grippers.left]\naddress = "{address}"\n', encoding="utf-8")
    arguments = ["agent", "--check", str(file)] if command == "agent" else [command, address]
    outcome = await shell.finish(await shell.forked("-c", WITHOUT.format("mujoco", arguments)))
    outcome.assert_failed(2 if command == "agent" else 1, 'pip install "mujoco')


async def test_another_missing_module_is_not_taken_for_the_extra(shell: Shell) -> None:
    outcome = await shell.finish(await shell.python("-c", WITHOUT.format("json", [])))
    assert outcome.code == 1
    assert "pip install" not in outcome.err


@pytest.mark.parametrize(
    ("module", "arguments", "words"),
    [
        ("cryptography", "fleet keys keys", 'pip install "cryptography'),
        ("foxglove", "view", 'pip install "foxglove-sdk'),
        ("matplotlib", "measure speed sim://", "or pass --no-plot"),
        ("matplotlib", "plot x", "(the extra plot)"),
        ("mcap", "record x.mcap", "(the extra record), or record a table, .csv"),
        ("mcap", "replay x", "(the extra record)"),
        ("nicegui", "demo --show", 'pip install "nicegui'),
        ("nicegui", "web", 'pip install "nicegui'),
    ],
)
def test_a_missing_module_is_one_line_that_names_the_extra(
    call: Call,
    without: Callable[[str], None],
    module: str,
    arguments: str,
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    without(module)
    call(*arguments.split()).assert_failed(1, words)
    assert list(tmp_path.iterdir()) == []


# -- which gripper it is -----------------------------------------------------------------------------------


@pytest.mark.usefixtures("virtually")
@pytest.mark.parametrize(
    "command",
    [
        "status",
        "move 30",
        "demo",
        "doctor sim://",
        "record grasp.mcap --seconds 1",
        "measure speed sim:// --step 250 --runs 1 --speedup 30 --no-plot",
        "measure force sim:// --step 250 --runs 1 --speedup 30 --no-plot",
    ],
)
def test_a_simulated_gripper_is_called_simulated_before_anything_else(
    call: Call, command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A forgotten address must not look like a healthy gripper."""
    monkeypatch.chdir(tmp_path)
    usual = SimulatedGripper.__init__.__kwdefaults__
    assert usual is not None
    assert "speedup" in usual
    monkeypatch.setitem(usual, "speedup", 20.0)  # the demo takes two minutes
    outcome = call(*command.split())
    outcome.assert_succeeded()
    assert outcome.out.splitlines()[0] == SIMULATED


def test_an_option_before_the_command_is_refused_with_the_names_of_all_commands(call: Call) -> None:
    outcome = call("--yes", "move", "30")
    assert outcome.code == 2
    assert "Available commands: demo, simulate, status, move" in outcome.err


@pytest.mark.parametrize("command", [["status"], ["move", "30", "--yes"], ["doctor"]])
def test_any_other_is_named_by_its_full_address(
    call: Call, command: list[str], there: SimulatorServer
) -> None:
    outcome = call(*command, there.address.removeprefix("tcp://"))
    outcome.assert_succeeded()
    assert outcome.out.splitlines()[0] == f"Gripper {there.address}"


@pytest.mark.parametrize("command", ["monitor --json", "web --port 0", "view --port 0"])
def test_output_for_programs_stays_machine_readable(beside: Callable[..., Beside], command: str) -> None:
    shown = beside(*command.split())
    named = next(line for line in iter(shown.read_error, "") if LATE_POLLS not in line)  # on a busy machine
    assert named == f"robotiq-async: {SIMULATED}"
    line = shown.read_line()
    if command.startswith("monitor"):
        assert json.loads(line)["kind"] in ("status", "log")  # of late polls, on a busy machine
    else:
        assert "://127.0.0.1:" in line
