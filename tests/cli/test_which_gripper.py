"""A command says first which gripper it is about: a forgotten address does not look like a healthy one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from robotiq_async.cli import main
from robotiq_async.simulator import SimulatorServer

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.cli.conftest import Beside, Call

SIMULATED = "Simulated gripper sim://"


@pytest.mark.usefixtures("virtually")
@pytest.mark.parametrize(
    "command",
    [["status"], ["move", "30"], ["demo"], ["doctor", "sim://"], ["record", "FILE", "--seconds", "1"]],
)
def test_a_simulated_gripper_is_called_simulated_before_anything_else(
    call: Call, command: list[str], tmp_path: Path
) -> None:
    words = [str(tmp_path / "grasp.mcap") if word == "FILE" else word for word in command]
    outcome = call(*words)
    outcome.assert_succeeded()
    assert outcome.out.splitlines()[0] == SIMULATED


@pytest.mark.usefixtures("virtually")
@pytest.mark.parametrize("what", ["speed", "force"])
def test_so_is_the_one_that_is_measured(call: Call, what: str, tmp_path: Path) -> None:
    table = str(tmp_path / "t.csv")
    options = ("--output", table, "--step", "250", "--runs", "1", "--speedup", "30", "--no-plot")
    outcome = call("measure", what, "sim://", *options)
    outcome.assert_succeeded()
    assert outcome.out.splitlines()[0] == SIMULATED


@pytest.mark.parametrize("command", [["status"], ["move", "30", "--yes"], ["doctor"]])
def test_any_other_is_named_by_its_full_address(
    call: Call, command: list[str], there: SimulatorServer
) -> None:
    outcome = call(*command, there.address.removeprefix("tcp://"))
    outcome.assert_succeeded()
    assert outcome.out.splitlines()[0] == f"Gripper {there.address}"


def test_what_programs_read_stays_what_they_can_read(call: Call, there: SimulatorServer) -> None:
    for address, words in ((there.address, f"Gripper {there.address}"), ("sim://", SIMULATED)):
        outcome = call("status", "--json", address)
        json.loads(outcome.out)
        assert outcome.err.splitlines()[0] == f"robotiq-async: {words}"


@pytest.mark.parametrize("option", ["--json", "--watch"])
def test_the_monitor_names_it_too(beside: Callable[..., Beside], option: str) -> None:
    command = beside("monitor", option)
    if option == "--json":
        assert command.read_error() == f"robotiq-async: {SIMULATED}"
        assert json.loads(command.read_line())["kind"] in (
            "status",
            "log",
        )  # of late polls, on a busy machine
    else:
        assert command.read_line() == SIMULATED


@pytest.mark.parametrize(("command", "module"), [("web", "nicegui"), ("view", "foxglove")])
def test_so_does_what_prints_the_address_of_a_page(
    beside: Callable[..., Beside], command: str, module: str
) -> None:
    pytest.importorskip(module)
    shown = beside(command, "--port", "0")
    assert shown.read_error() == f"robotiq-async: {SIMULATED}"
    assert "://127.0.0.1:" in shown.read_line()


@pytest.mark.parametrize("command", [["doctor"], ["measure", "speed"], ["measure", "force"]])
def test_what_is_about_a_real_gripper_wants_its_address(
    command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert "ADDRESS" in err
