"""Makes the blocking hand from the async one: robotiq_async/sync/ from robotiq_async/hand/.

For each class of the async hand one with the same name, and for each method one with the same parameters and
docstring, which makes the call in the hand's event loop and waits for it. What such a call returns, and has
coroutines itself, gets a class of its own in the same way. So a method that is added to the async hand cannot
be missing: make_pages.py writes the modules, and a test compares them with what this script makes.
"""

from __future__ import annotations

import ast
import functools
import importlib
import inspect
import re
import subprocess
import sys
import typing
from collections.abc import AsyncIterator, Iterator
from importlib.util import resolve_name
from pathlib import Path
from types import ModuleType
from typing import Final

ROOT: Final = Path(__file__).parents[1]
PACKAGE: Final = "robotiq_async"
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))

from robotiq_async import RobotiqHand  # noqa: E402
from robotiq_async.session.streams import Stream  # noqa: E402

FOLDER: Final = ROOT / PACKAGE / "sync"
BY_HAND: Final = frozenset({"__init__", "blocking", "caller", "loop_thread", "streams"})
"""Modules there that are not made."""
ABOUT_ERRORS: Final = "tells_its_hand"
"""A decorator that changes nothing of what a method gives: what it raises has been told its hand by then."""
DOCSTRINGS: Final = {
    "Observation": "A hand that is looked at.",
    "RobotiqHand": """A Robotiq 3-Finger gripper behind Modbus TCP, a serial line, or simulated, that blocks.

    Use it as ``with RobotiqHand(address) as hand:``, or call :meth:`start` and :meth:`stop`. The calls, their
    arguments, results and errors are those of :class:`robotiq_async.RobotiqHand`, and each returns when the
    async one has ended. All blocking hands share one event loop in a thread of its own, which polls while
    your code runs. Calls may come from any thread, also from one in which another event loop runs: that one
    stands still meanwhile.

    What a call does when it is cancelled it does here at Ctrl-C, and whatever moves by then is held. A hand
    that was not stopped is stopped when the program ends. After a fork it stays with the parent. Listeners
    are called in the hand's thread, where a call that waits is a RuntimeError.

    Nothing of this has run on real hardware yet.
    """,
}
"""Where that of the async class would be wrong."""

_Function = ast.FunctionDef | ast.AsyncFunctionDef


def generated() -> dict[Path, str]:
    """Every module that is made, as it has to be now.

    Raises:
        ValueError: something of the async hand that this script does not know how to make blocking.
    """
    return {FOLDER / f"{name}.py": shaped(text) for name, text in modules(RobotiqHand).items()}


def modules(hand: type) -> dict[str, str]:
    """The modules of a blocking hand by their names; not put into shape yet."""
    made: dict[str, _Module] = {}
    waiting, seen = [(hand, "BlockingHand")], set[type]()
    while waiting:
        last, root = waiting.pop(0)
        for kind in reversed(last.__mro__[:-1]):
            if kind not in seen:
                seen.add(kind)
                name = _module_name(kind)
                if name in BY_HAND:
                    raise ValueError(f"{kind.__module__}: {name} is a module that is not made")
                module = made.setdefault(name, _Module(importlib.import_module(kind.__module__)))
                waiting += [(each, "Blocking") for each in module.add(kind, root)]
    return {name: module.text() for name, module in made.items()}


@functools.cache
def shaped(text: str) -> str:
    """A module as ruff wants it."""
    for command in (("check", "--quiet", "--select=I", "--fix"), ("format", "--quiet")):
        ruff = (sys.executable, "-m", "ruff", *command, "--stdin-filename", str(FOLDER / "made.py"), "-")
        text = subprocess.run(ruff, input=text, capture_output=True, text=True, check=True, cwd=ROOT).stdout
    return text


class _Module:
    """One module: a blocking class for each class of an async one."""

    def __init__(self, source: ModuleType) -> None:
        self._source = source
        self._tree = ast.parse(inspect.getsource(source))
        self._imports: set[str] = set()
        self._classes: list[ast.stmt] = []

    def text(self) -> str:
        doc = f"{ast.get_docstring(self._tree)}\n\nMade from {self._source.__name__} by docs/make_sync.py."
        head = [ast.Expr(ast.Constant(f"{doc}\n")), *_code("from __future__ import annotations")]
        module = ast.Module([*head, *_code("\n".join(sorted(self._imports))), *self._classes], [])
        return ast.unparse(ast.fix_missing_locations(module))

    def add(self, kind: type, root: str) -> list[type]:
        """Add a class; gives those that get a blocking class for its sake."""
        (node,) = (
            each for each in self._tree.body if isinstance(each, ast.ClassDef) and each.name == kind.__name__
        )
        _refuse_what_is_no_call(node, is_hand=root == "BlockingHand")
        body: list[ast.stmt] = [_docstring(node, DOCSTRINGS.get(node.name))]
        parts: list[type] = []
        for each in node.body:
            if isinstance(each, _Function) and each.name == "__init__" and root == "BlockingHand":
                body.append(self._constructor(each, kind))
            elif isinstance(each, _Function) and not each.name.startswith("_"):
                body.append(self._method(each, kind, parts))
        (made,) = _code(f"class {node.name}({self._base(kind, root)}): ...")
        assert isinstance(made, ast.ClassDef)
        made.body = body
        self._classes.append(made)
        return parts

    def _base(self, kind: type, root: str) -> str:
        if kind.__bases__ != (object,):
            (base,) = kind.__bases__
            self._import(f".{_module_name(base)}", base.__name__)
            return base.__name__
        self._import(".blocking", root)
        if root == "BlockingHand":
            return root
        self._import(kind.__module__, f"{kind.__name__} as Async{kind.__name__}")
        return f"{root}[Async{kind.__name__}]"

    def _constructor(self, node: _Function, kind: type) -> ast.stmt:
        self._import(".caller", "Caller")
        self._import(f"{PACKAGE}.hand.robotiq_hand", f"{kind.__name__} as Async{kind.__name__}")
        made = f"hand = Async{kind.__name__}({_arguments(node)})"
        return self._function(node, f"{made}\nsuper().__init__(hand, Caller(hand))")

    def _method(self, node: _Function, kind: type, parts: list[type]) -> ast.stmt:
        node.decorator_list = [each for each in node.decorator_list if ast.unparse(each) != ABOUT_ERRORS]
        decorators = [ast.unparse(each) for each in node.decorator_list]
        if decorators not in ([], ["property"]):
            raise ValueError(f"{kind.__name__}.{node.name}: nobody knows what {decorators} means here")
        result, what = _result(node, kind), f"self._inner.{node.name}"
        if not decorators:
            way = "wait" if isinstance(node, ast.AsyncFunctionDef) else "tell"
            way = node.name if node.name in ("start", "stop") else way
            what = f"self._caller.{way}(lambda: {what}({_arguments(node)}))"
        if result is not None:
            what = f"{result.__name__}({what}, self._caller)"
            if result is not Stream:
                parts.append(result)
        is_none = isinstance(node.returns, ast.Constant) and node.returns.value is None
        return self._function(node, what if is_none else f"return {what}", result)

    def _function(self, node: _Function, body: str, result: type | None = None) -> ast.stmt:
        """A function with the parameters and the docstring of another, and another body."""
        for each in (*ast.walk(node.args), *(ast.walk(node.returns) if node.returns else ())):
            if isinstance(each, ast.Name):
                self._import_as_there(each.id, result)
        (made,) = _code(f"def {node.name}(): ...")
        assert isinstance(made, ast.FunctionDef)
        made.args, made.returns, made.decorator_list = node.args, node.returns, node.decorator_list
        made.body = [_docstring(node), *_code(body)]
        return made

    def _import_as_there(self, name: str, result: type | None) -> None:
        """Import a name from where the async module has it; of a blocking class from where that is."""
        if result is not None and name == result.__name__:
            self._import(".streams" if result is Stream else f".{_module_name(result)}", name)
            return
        for node in ast.walk(self._tree):
            if isinstance(node, ast.ImportFrom) and name in (each.asname or each.name for each in node.names):
                module = "." * node.level + (node.module or "")
                self._import(resolve_name(module, self._source.__package__), name)
                return
        if hasattr(self._source, name):
            self._import(self._source.__name__, name)

    def _import(self, module: str, what: str) -> None:
        if module != f".{self._source.__name__.rpartition('.')[2]}":
            self._imports.add(f"from {re.sub(rf'^{PACKAGE}(?=[.])', '.', module)} import {what}")


def _refuse_what_is_no_call(node: ast.ClassDef, *, is_hand: bool) -> None:
    """Only methods and properties are made; what else a class has would be missing.

    Raises:
        ValueError: it has public attributes, or (other than a hand) is used with ``async with``.
    """
    for each in ast.walk(node):
        if isinstance(each, ast.Assign | ast.AnnAssign):
            targets = each.targets if isinstance(each, ast.Assign) else [each.target]
            for target in targets:
                is_own = isinstance(target, ast.Attribute) and ast.unparse(target.value) == "self"
                name = ast.unparse(target).removeprefix("self.")
                if (is_own or (each in node.body)) and not name.startswith("_"):
                    raise ValueError(f"{node.name}.{name}: nobody knows it, make it a property")
        if isinstance(each, ast.AsyncFunctionDef) and each.name.startswith("__") and not is_hand:
            raise ValueError(f"{node.name}.{each.name}: nobody knows how that is made blocking")


def _result(node: _Function, kind: type) -> type | None:
    """What a method gives, if that has coroutines.

    Raises:
        ValueError: it gives something that has coroutines, and nobody knows how that is made blocking.
    """
    member = vars(kind)[node.name]
    hint = typing.get_type_hints(member.fget if isinstance(member, property) else member).get("return")
    found = [each for each in _classes_in(hint) if _has_coroutines(each)]
    if not found:
        return None
    own = found[0].__module__.partition(".")[0] == kind.__module__.partition(".")[0]
    if found != [typing.get_origin(hint) or hint] or not own:
        raise ValueError(f"{kind.__name__}.{node.name} gives {hint}: nobody knows how that is made blocking")
    return found[0]


def _classes_in(hint: object) -> Iterator[type]:
    """The classes that are named in an annotation."""
    kind = typing.get_origin(hint) or hint
    if isinstance(kind, type):
        yield kind
    for each in typing.get_args(hint):
        yield from _classes_in(each)


def _has_coroutines(kind: type) -> bool:
    members = (inspect.unwrap(getattr(kind, name)) for name in dir(kind) if hasattr(kind, name))
    return issubclass(kind, AsyncIterator) or any(inspect.iscoroutinefunction(each) for each in members)


def _module_name(kind: type) -> str:
    return kind.__module__.rpartition(".")[2]


def _arguments(node: _Function) -> str:
    """What hands on the parameters of a function."""
    args = node.args
    names = [each.arg for each in (*args.posonlyargs, *args.args)][1:]
    names += [f"*{args.vararg.arg}"] if args.vararg else []
    names += [f"{each.arg}={each.arg}" for each in args.kwonlyargs]
    names += [f"**{args.kwarg.arg}"] if args.kwarg else []
    return ", ".join(names)


def _docstring(node: ast.ClassDef | _Function, instead: str | None = None) -> ast.stmt:
    """That of a class or function, without what can only happen to coroutines."""
    doc = instead or ast.get_docstring(node, clean=False) or ""
    doc = re.sub(r"\n( *)RuntimeError:.*(\n\1 +\S.*)*", "", doc)
    doc = re.sub(r"\n\n *Raises:(?=\s*$|\n\n)", "", doc)
    return ast.Expr(ast.Constant(doc.replace("``async with``", "``with``")))


def _code(text: str) -> list[ast.stmt]:
    return ast.parse(text).body
