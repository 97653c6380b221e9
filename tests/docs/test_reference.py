"""Errors, states, codes and commands on the pages are those of the library."""

from __future__ import annotations

import re

import robotiq_async
from robotiq_async import Fault, ObjectStatus, State
from robotiq_async.cli.app import SUBCOMMANDS
from tests.docs.pages import ROOT, read

REFERENCE = read("reference.md")


def test_every_state_has_its_row() -> None:
    text = read("state-machine.md")
    for state in State:
        assert re.search(rf"^\|.*\b{state.name}\b", text, re.MULTILINE), state


def test_every_fault_has_its_row() -> None:
    text = read("registers.md")
    for fault in Fault:
        (row,) = re.findall(rf"^\| 0x{int(fault):02X} \| `{fault.name}` \|.*$", text, re.MULTILINE)
        assert f"| {fault.severity.value} |" in row


def test_the_contact_codes_are_those_of_the_library() -> None:
    text = read("decisions/thesis-map.md")
    for code in ObjectStatus:
        assert re.search(rf"^\| {int(code)} \|[^|]*\| `ObjectStatus\.{code.name}` \|", text, re.MULTILINE), (
            code
        )


def test_every_error_stands_under_its_base() -> None:
    tree = REFERENCE[REFERENCE.index("RobotiqError\n") :]
    for name in robotiq_async.__all__:
        error = getattr(robotiq_async, name)
        if isinstance(error, type) and issubclass(error, Exception):
            depth = len([base for base in error.__mro__ if base.__module__ == error.__module__]) - 1
            (line,) = re.findall(rf"^(.*){name}\b", tree[: tree.index("```")], re.MULTILINE)
            assert len(line) == 4 * depth
            assert ("also a TimeoutError" in tree.splitlines()[_line_of(tree, name)]) == issubclass(
                error, TimeoutError
            )


def _line_of(text: str, name: str) -> int:
    return next(n for n, line in enumerate(text.splitlines()) if re.search(rf"\b{name}\b", line))


def test_the_readme_names_every_command() -> None:
    named = set(re.findall(r"^robotiq-async (\w+)", read(ROOT / "README.md"), re.MULTILINE))
    assert {command.__name__ for command in SUBCOMMANDS} | {"fleet", "measure"} <= named
