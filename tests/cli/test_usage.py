"""Help, versions and wrong usage; most of it in this process, for speed."""

from __future__ import annotations

import inspect
import re
from itertools import pairwise
from typing import TYPE_CHECKING

import pytest

import robotiq_async
from robotiq_async.cli import main
from robotiq_async.cli.app import COMMANDS as FUNCTIONS
from robotiq_async.cli.commands.fleet import fleet, halt
from robotiq_async.cli.commands.fleet_keys import keys
from robotiq_async.cli.commands.measure.force import force
from robotiq_async.cli.commands.measure.speed import speed
from robotiq_async.cli.output.reflow import reflow

if TYPE_CHECKING:
    from tests.cli.conftest import Shell

WITHOUT = """
import sys
sys.modules["{}"] = None
from robotiq_async.cli import main
sys.exit(main([]))
"""

COMMANDS = ("demo", "simulate", "status", "move", "monitor", "view", "doctor")


def test_help_lists_every_command_and_the_addresses(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    out = capsys.readouterr().out
    for word in (*COMMANDS, "tcp://", "rtu://", "sim://", "real hardware"):
        assert word in out


def test_no_arguments_show_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    assert "Usage: robotiq-async COMMAND" in capsys.readouterr().out


EVERY = {each.__name__: each for each in FUNCTIONS} | {
    "fleet": fleet,
    "fleet halt": halt,
    "fleet keys": keys,
    "measure speed": speed,
    "measure force": force,
}
MOVE = {"demo", "move", "measure speed", "measure force"}


@pytest.mark.parametrize("command", EVERY)
def test_the_help_of_a_command(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for width in (60, 120):
        monkeypatch.setenv("COLUMNS", str(width))
        assert main([*command.split(), "--help"]) == 0
        out = capsys.readouterr().out
        words, _, examples = out.partition("\n\n")[2].partition("For example:")
        assert_wrapped_once(words.splitlines(), width)
        assert f"robotiq-async {command}" in examples
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


def test_paragraphs_flow_and_examples_stay() -> None:
    assert reflow("One\n    two.\n\n        a\n        b\n    Three\n    four.\n") == (
        "One two.\n\n    a\n    b\nThree four."
    )


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip() == robotiq_async.__version__


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("mvoe 3", ["mvoe", "move"]),
        ("move", ["POSITION"]),
        ("move 256", ["POSITION", "256", "0..255"]),
        ("move -1", ["POSITION", "-1", "0..255"]),
        ("move 1.5", ["POSITION", "1.5", "0..255"]),
        ("move ten", ["POSITION", "ten", "0..255"]),
        ("move 3 --speed 256", ["--speed", "256", "0..255"]),
        ("move 3 --force -1", ["--force", "-1", "0..255"]),
        ("move 3 --fingers D", ["--fingers", "'D'", "scissor"]),
        ("move 3 --fingers A,,B", ["--fingers", "''"]),
        ("move 3 --timeout 0", ["timeout", "0", "above 0"]),
        ("move 3 --timeout nan", ["timeout", "nan"]),
        ("move 3 --timeout soon", ["--timeout", "soon"]),
        ("move 3 --wrong 4", ["--wrong"]),
        ("move 3 ftp://gripper", ["ftp://gripper", "tcp://", "rtu://", "sim://"]),
        ("move 3 sim:// 4", ["4"]),
        ("status tcp://", ["tcp://", "rtu://", "sim://"]),
        ("status [/b]", ["[/b]"]),
        ("demo gripper:port", ["gripper:port", "tcp://"]),
        ("simulate --port 65536", ["--port", "65536", "0..65535"]),
        ("simulate --speedup 0", ["speedup", "0"]),
        ("simulate --speedup -2", ["speedup", "-2"]),
    ],
)
def test_wrong_usage_is_one_line_and_exit_code_2(
    arguments: str, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments.split()) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    for word in words:
        assert word in err


async def test_without_the_extra_one_line_names_it(shell: Shell) -> None:
    outcome = await shell.finish(await shell.python("-c", WITHOUT.format("cyclopts")))
    outcome.assert_failed(1, "cyclopts", "pip install 'cyclopts")


async def test_another_missing_module_is_not_taken_for_the_extra(shell: Shell) -> None:
    outcome = await shell.finish(await shell.python("-c", WITHOUT.format("json")))
    assert outcome.code == 1
    assert "pip install" not in outcome.err
