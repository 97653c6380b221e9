"""The demo, end to end and faster than the clock."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from robotiq_async.cli.commands.demo import _program
from robotiq_async.simulator import SimulatedGripper, SimulatorServer

if TYPE_CHECKING:
    from tests.cli.conftest import Shell

PARTS = ("1. Basic movements", "2. Speeds", "3. Forces", "4. Status and faults")
SPEEDUP = 20.0


@pytest.mark.parametrize("address", ["sim://", "sim://?model=hand-e"])
async def test_on_a_simulated_gripper(
    address: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    program = _program()
    monkeypatch.setattr(program, "SimulatedGripper", partial(SimulatedGripper, speedup=SPEEDUP))
    await program.run(address)
    out = capsys.readouterr().out
    for words in (*PARTS, "place_object", "contact", "inject_fault", "FAULT -> DO_RESET", "-> SHUTDOWN"):
        assert words in out
    assert [line for line in out.splitlines() if len(line) > 80] == []


@pytest.mark.parametrize("form", [["-m", "robotiq_async", "demo"], ["demo/demo.py"]])
async def test_at_an_address(shell: Shell, form: list[str]) -> None:
    root = Path(__file__).parents[2]
    arguments = [str(root / form[0]) if form[0].endswith(".py") else form[0], *form[1:]]
    async with SimulatorServer(SimulatedGripper(speedup=SPEEDUP)) as server:
        outcome = await shell.finish(await shell.forked(*arguments, "--yes", server.address))
    outcome.assert_succeeded()
    for part in PARTS:
        assert part in outcome.out
    assert "inject_fault" not in outcome.out
