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
FOREIGN = {
    "link": {"client.ctx", "transport"},
    "tools/web/page": {"group"},
    "cli": {"self._history", "self._question", "console"},
    "ros2/node": {"service", "response", "descriptor", "message", "message.header", "source", "result"},
    "simulator/mechanics": {
        *("self._data", "spec.option", "spec.visual.headlight", "mount", "weld"),
        "weakref.finalize(self, self._stepper.end)",
    },
    "runtime": {"self._time", "record"},
    "values": {"member"},
}
"""Objects of others, by the room that sets them up: of pymodbus, NiceGUI, Textual, ROS, MuJoCo, Python."""
SIMULATED = {"gripper", "self._server.gripper", "line", "error"}
"""A simulated gripper and its line, whose properties users set, too; an error that is read from the wire."""
CONSTANTS = {"Convention"}
"""A class that has its own constants as attributes, which only exist once it does."""


def stored(node: ast.AST) -> Iterator[ast.Attribute]:
    for each in ast.walk(node):
        if isinstance(each, ast.Attribute) and isinstance(each.ctx, ast.Store) and each.attr not in TOLD:
            yield each


def foreign(path: Path) -> set[str]:
    inside = path.relative_to(PACKAGE).as_posix()
    return {name for room, names in FOREIGN.items() if inside.startswith(f"{room}/") for name in names}


def test_no_class_changes_the_fields_of_another() -> None:
    changed = {
        f"{path.relative_to(PACKAGE)}: {ast.unparse(each)}"
        for path in PACKAGE.rglob("*.py")
        for each in stored(ast.parse(path.read_text(encoding="utf-8")))
        if ast.unparse(each.value) not in {"self", *foreign(path), *SIMULATED, *CONSTANTS}
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


WHOLE_ALONE = {
    "Axis": "by its table; a mechanism moves the other",
    "Connection": "over TCP; the other is a serial line",
    "ConnectionLostError": "callers catch it; the other says that no answer came",
}
"""Bases in another file that have one subclass, and that are used without it: each with both uses."""


def test_no_class_is_cut_over_two_files_by_inheritance() -> None:
    """A base for one subclass is a part of it: it has the other one, or both are in one file."""
    modules = {path: ast.parse(path.read_text(encoding="utf-8")) for path in PACKAGE.rglob("*.py")}
    classes = [
        (each, path)
        for path, module in modules.items()
        for each in module.body
        if isinstance(each, ast.ClassDef)
    ]
    home = {each.name: path for each, path in classes}
    heirs: dict[str, set[Path]] = {}
    count: dict[str, int] = {}
    for each, path in classes:
        for base in each.bases:
            name = ast.unparse(base).partition("[")[0].rpartition(".")[2]
            heirs.setdefault(name, set()).add(path)
            count[name] = count.get(name, 0) + 1
    cut = {
        name for name, paths in heirs.items() if count[name] == 1 and name in home and {home[name]} != paths
    }
    assert cut == WHOLE_ALONE.keys()
