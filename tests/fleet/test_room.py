"""The room of hands on other hosts stays one that a person can read, and stands on few names of the core."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import robotiq_async.fleet

ROOM = Path(robotiq_async.fleet.__file__).parent
MOST_LINES = 5900
MOST_NAMES = 40
CORE = {
    *("calibration", "control", "hands", "link", "local", "runtime", "simulator", "sync", "values"),
}
"""Rooms of the core; docs/architecture.md."""


def test_its_size() -> None:
    lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in ROOM.rglob("*.py"))
    assert 0 < lines <= MOST_LINES


def test_the_names_of_the_core_that_it_uses() -> None:
    names = {name for path in ROOM.rglob("*.py") for name in of_the_core(path)}
    assert "values.Finger" in names
    assert len(names) <= MOST_NAMES, sorted(names)


def test_it_takes_names_and_no_modules_of_the_core() -> None:
    """Behind a module any number of names could hide."""
    package = ROOM.parent
    names = {name for path in ROOM.rglob("*.py") for name in of_the_core(path)}
    modules = [name for name in names if (package / Path(*name.split("."))).with_suffix(".py").exists()]
    assert modules == []


def of_the_core(path: Path) -> Iterator[str]:
    """The names that a module of the room imports from the core, each with its module."""
    here = ["robotiq_async", *path.relative_to(ROOM.parent).parts[:-1]]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            assert not any(each.name.startswith("robotiq_async") for each in node.names), path
        if not isinstance(node, ast.ImportFrom):
            continue
        base = here[: len(here) - node.level + 1] if node.level else []
        parts = [*base, *(node.module or "").split(".")]
        if parts[0] == "robotiq_async" and len(parts) > 1 and parts[1] in CORE:
            yield from (".".join((*parts[1:], each.name)) for each in node.names)
