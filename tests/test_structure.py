"""The shape of what owns a hand: few fields, and each changed by its own class."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from pathlib import Path

import pytest

import robotiq_async
from robotiq_async.local.ending import Ending
from robotiq_async.local.poller import Poller
from robotiq_async.local.run import _NEXT, Run, RunState
from robotiq_async.local.session import Session

PACKAGE = Path(robotiq_async.__file__).parent
TOLD = ("__cause__", "__doc__")
"""Attributes that Python lets only be set from outside."""
FOREIGN = {"client.ctx", "transport"}
"""Objects of pymodbus and asyncio that link/wires.py sets up."""
SIMULATED = {"gripper", "self._target.gripper", "line", "error"}
"""A simulated gripper and its line, whose properties users set, too; an error that is read from the wire."""
ROOMS = (
    *("local", "hands", "link", "fleet", "sync", "simulator/server", "simulator/troubles"),
    *("tools/recording", "tools/doctor", "tools/measure", "tools/description"),
)
ALONE = ("tools/service.py", "tools/metrics.py", "tools/viewer.py", "tools/actions.py", "tools/wording.py")


def stored(node: ast.AST) -> Iterator[ast.Attribute]:
    for each in ast.walk(node):
        if isinstance(each, ast.Attribute) and isinstance(each.ctx, ast.Store) and each.attr not in TOLD:
            yield each


def test_no_class_changes_the_fields_of_another() -> None:
    modules = [PACKAGE / each for each in ALONE]
    for room in ROOMS:
        modules += (PACKAGE / room).rglob("*.py")
    changed = {
        f"{path.relative_to(PACKAGE)}: {ast.unparse(each)}"
        for path in modules
        for each in stored(ast.parse(path.read_text(encoding="utf-8")))
        if ast.unparse(each.value) not in {"self", *FOREIGN, *SIMULATED}
    }
    assert not changed


@pytest.mark.parametrize("kind", [Poller, Run, Session, Ending])
def test_an_object_of_a_run_has_few_fields_and_changes_fewer(kind: type) -> None:
    (tree,) = ast.parse(inspect.getsource(kind)).body
    assert isinstance(tree, ast.ClassDef)
    made = {field.attr for each in tree.body if is_init(each) for field in stored(each)}
    changed = {field.attr for each in tree.body if not is_init(each) for field in stored(each)}
    assert changed <= made, "all fields are made at the making"
    assert len(made) <= 15
    assert len(changed) <= 5


def is_init(node: ast.AST) -> bool:
    return isinstance(node, ast.FunctionDef) and node.name == "__init__"


def test_a_run_comes_to_its_end_from_every_state_and_never_back_from_there() -> None:
    assert _NEXT.keys() == set(RunState)
    assert all(RunState.OVER in after for state, after in _NEXT.items() if state is not RunState.OVER)
    assert _NEXT[RunState.ENDING] == {RunState.OVER}
    assert not _NEXT[RunState.OVER]
