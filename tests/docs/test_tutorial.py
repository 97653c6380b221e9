"""The tutorial, typed as it stands: each block runs and prints the output on the page."""

from __future__ import annotations

import ast
import asyncio
import contextlib
import io
import sys
from asyncio.subprocess import PIPE, STDOUT
from collections.abc import Iterator
from doctest import ELLIPSIS, OutputChecker
from itertools import pairwise
from pathlib import Path
from types import CodeType
from typing import Any

import pytest

from robotiq_async.hands.options import LATE_POLLS
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.docs.pages import ROOT, TUTORIAL, Block, blocks, compiled_prompt, read, run_prompt
from tests.patience import patience

BLOCKS = blocks(read(TUTORIAL))
TYPED = [
    (code, output)
    for code, output in pairwise(BLOCKS)
    if code.language == "python" and "asyncio.run(" not in code.text
]
"""Blocks typed at the prompt, each with its output on the page."""
(PROGRAM,) = [pair for pair in pairwise(BLOCKS) if "\nasyncio.run(" in pair[0].text]
BETWEEN_STATEMENTS = 0.05
"""Seconds, as a person's keys are slow: ten polls, and half a second of the simulated fingers."""


def statements(block: Block) -> Iterator[CodeType]:
    """Each statement of a block as ``python -m asyncio`` compiles it, with the page's line numbers."""
    lines = "\n" * (block.line - 1) + block.text
    for statement in ast.parse(lines).body:
        yield compiled_prompt(ast.Module([statement], []), "tutorial.md")


async def typed(block: Block, names: dict[str, Any]) -> str:
    """The output of a block, with the hand polling on between its statements as it does at the prompt."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        for code in statements(block):
            await run_prompt(code, names)
            await asyncio.sleep(BETWEEN_STATEMENTS)
    return printed.getvalue()


def agree(shown: str, printed: str) -> bool:
    return OutputChecker().check_output(shown, printed, ELLIPSIS)


def test_every_python_block_shows_its_output() -> None:
    assert len(TYPED) >= 12
    assert all(output.language == "text" for _, output in [*TYPED, PROGRAM])
    assert {block.language for block in BLOCKS} == {"sh", "python", "text"}


async def test_typing_the_tutorial() -> None:
    names: dict[str, Any] = {"asyncio": asyncio}
    try:
        for code, output in TYPED:
            printed = await typed(code, names)
            assert agree(output.text, printed), f"line {code.line} of tutorial.md printed:\n{printed}"
    finally:
        # Only when a block failed is there something left to stop.
        for name in {"hand", "server"} & names.keys():
            await names[name].stop()


async def test_the_program_at_its_end(tmp_path: Path) -> None:
    code, output = PROGRAM
    program = tmp_path / "grasp.py"
    program.write_text(code.text, encoding="utf-8")
    async with SimulatorServer(SimulatedGripper(speedup=20)) as server:
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, str(program), server.address),
            env={"PYTHONPATH": str(ROOT)},
            stdout=PIPE,
            stderr=STDOUT,
        )
        printed, _ = await asyncio.wait_for(process.communicate(), patience(30))
    assert process.returncode == 0, printed.decode()
    # A busy machine may poll late, and logs it.
    lines = [each for each in printed.decode().splitlines(keepends=True) if LATE_POLLS not in each]
    assert agree(output.text, "".join(lines)), printed.decode()


def test_blocks_can_be_pasted() -> None:
    """At the prompt an empty line ends an indented block, and nothing else does."""
    goes_on = ("except", "else", "finally", " ")
    for code, _ in TYPED:
        for line, following in pairwise([*code.text.split("\n")]):
            if not line:
                assert not following.startswith(" "), f"line {code.line}: {following!r}"
            if line.startswith(" ") and following:
                assert following.startswith(goes_on), f"line {code.line}: {following!r}"
        assert not code.text.splitlines()[-1].startswith(" "), f"line {code.line}: the end is missing"


@pytest.mark.parametrize("shown", ["tcp:...", "x"])
def test_the_comparison_of_outputs_tells_them_apart(shown: str) -> None:
    assert agree(f"{shown}\n", "tcp://127.0.0.1:5020\n") == (shown != "x")
