"""The rooms of the package. Who may import whom is import-linter's business: `make lint`."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import robotiq_async
from docs import make_tables

PACKAGE = Path(robotiq_async.__file__).parent
ROOT = Path(__file__).parents[1]
AROUND = re.compile(r"robotiq_async\.(cli|dropins|fleet|ros2|tools)\b|pytest_robotiq_async\b")
OUTSIDE = {"__init__", "__main__", "__pycache__", "__pyinstaller", "_demo", "data", "py", "version"}
"""Modules that no contract needs to name."""


def test_every_room_has_its_layer_and_says_what_it_is_for() -> None:
    """A module that no contract names may import anything, and be imported by any other."""
    rooms = {path.name.partition(".")[0] for path in PACKAGE.iterdir()} - OUTSIDE
    rows = dict(re.findall(r"^\| `(\w+)` \| (.+) \|$", make_tables.layers(), re.MULTILINE))
    assert rooms == rows.keys()
    assert [room for room, purpose in rows.items() if len(purpose) <= 20] == []


def test_what_stands_around_the_core_uses_no_private_names_of_it() -> None:
    """Lint finds each use (SLF001); here none may be allowed. import-linter keeps the modules."""
    around = [PACKAGE / room for room in ("cli", "dropins", "fleet", "ros2", "tools")] + [
        ROOT / "pytest_robotiq_async"
    ]
    files = [path for folder in around for path in folder.rglob("*.py")]
    assert [str(path) for path in files if "SLF001" in path.read_text(encoding="utf-8")] == []


def test_the_index_of_the_tools_says_of_each_for_whom_it_is() -> None:
    """One that is for nobody else is part of another one; what they share is named, and no more than that."""
    tools = PACKAGE / "tools"
    text = ast.get_docstring(ast.parse((tools / "__init__.py").read_text(encoding="utf-8"))) or ""
    products, _, shared = text.partition("They share")
    found = {path.name.partition(".")[0] for path in tools.iterdir()} - OUTSIDE
    rows = re.findall(r"^``(\w+)`` +for (?:people|programs) .+$", products, re.MULTILINE)
    assert sorted(found) == sorted([*rows, *re.findall(r"``(\w+)``", shared)])
    assert len(rows) <= 9


def test_no_module_is_too_long_to_read() -> None:
    """A class is not cut into a chain of files to stay short; what must stay short is a function."""
    long = {
        str(path.relative_to(PACKAGE)): lines
        for path in PACKAGE.rglob("*.py")
        if (lines := len(path.read_text(encoding="utf-8").splitlines())) > 600
    }
    assert not long


def test_no_function_is_longer_than_sixty_lines() -> None:
    """Without its signature and its docstring."""
    long = {
        f"{path.relative_to(PACKAGE)}: {function.name}": lines
        for path in PACKAGE.rglob("*.py")
        for function in statements(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef) and (lines := length(function)) > 60
    }
    assert not long


def test_no_docstring_begins_with_what() -> None:
    """A noun says sooner of what it speaks."""
    found = [
        f"{path.relative_to(PACKAGE)}: {each.value.value.splitlines()[0]}"
        for path in PACKAGE.rglob("*.py")
        for each in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(each, ast.Expr) and isinstance(each.value, ast.Constant)
        if isinstance(each.value.value, str) and each.value.value.startswith("What ")
    ]
    assert not found


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """Statements of a module, down to the innermost block, without those in expressions."""
    for block in ("body", "handlers", "orelse", "finalbody", "cases"):
        for each in getattr(node, block, ()):
            yield each
            yield from statements(each)


def length(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    body = function.body[ast.get_docstring(function) is not None :]
    return body[-1].end_lineno - body[0].lineno + 1 if body and body[-1].end_lineno else 0


def test_no_room_has_more_modules_than_a_glance_takes() -> None:
    """Above that a folder of its own is due; two short files are none."""
    rooms = [PACKAGE, *(path for path in PACKAGE.rglob("*") if path.is_dir())]
    modules = {room: [each for each in room.glob("*.py") if each.stem != "__init__"] for room in rooms}
    assert not {str(room): len(inside) for room, inside in modules.items() if len(inside) > 16}


def test_importing_the_library_imports_neither_simulator_nor_extras() -> None:
    """They take tens of milliseconds, and the extras may be missing."""
    script = "import sys, robotiq_async; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    modules = done.stdout.split()
    for name in (
        "robotiq_async.simulator",
        "robotiq_async.cli",
        "robotiq_async.tools",
        "robotiq_async.fleet",
        "zenoh",
        "matplotlib",
        "mcap",
    ):
        assert name not in modules


def test_importing_values_and_units_opens_no_file_but_modules() -> None:
    """Their figures are code, so that a program in a zip or a frozen one has them."""
    script = """
import sys
opened = []
sys.addaudithook(lambda event, said: opened.append(str(said[0])) if event == "open" else None)
import robotiq_async.values, robotiq_async.calibration
print(*(each for each in opened if not each.endswith((".py", ".pyc")) and "__pycache__" not in each))
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_a_maintainer_of_the_core_reads_what_the_page_says() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    found = re.search(r"\*\*To maintain it, read\*\*(.*?)\n\n", page, re.DOTALL)
    assert found is not None
    lines, words = (int(each.replace(",", "")) for each in re.findall(r"([\d,]+) (?:lines|words)", found[1]))
    left_out = re.findall(r"`([\w-]+)`", found[1])
    rooms = re.findall(r"`(\w+)`", page.partition("## The edge of the core")[2])[:7]
    sources = [path for room in rooms for path in (PACKAGE / room).rglob("*.py")]
    pages = [ROOT / "docs" / name for name in ("architecture.md", "state-machine.md", "what-happens-when.md")]
    decisions = {path.stem: path for path in (ROOT / "docs" / "decisions").glob("*.md")}
    assert set(left_out) <= decisions.keys()
    pages += [path for name, path in decisions.items() if name not in left_out]
    assert sum(len(each.read_text(encoding="utf-8").split()) for each in pages) < 1.05 * words
    assert sum(len(each.read_text(encoding="utf-8").splitlines()) for each in sources) < 1.05 * lines


def test_the_tests_of_the_core_run_without_what_stands_around_it() -> None:
    """``make test-core``: a change of the core waits for no page and no other host."""
    folders = (ROOT / "tests" / "core.txt").read_text(encoding="utf-8").split()
    left = [file for folder in folders for file in (ROOT / folder).rglob("*.py")]
    known = set(left)
    assert len(left) > 100
    while left:
        file = left.pop()
        for name in imported(file):
            assert not AROUND.match(name), f"{file.relative_to(ROOT)} imports {name}"
            other = (ROOT / name.replace(".", "/")).with_suffix(".py")
            if name.startswith("tests.") and other.is_file() and other not in known:
                known.add(other)
                left.append(other)


def imported(file: Path) -> Iterator[str]:
    """The modules that a test imports, and the names that it takes from them as if they were modules."""
    for node in statements(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{each.name}" for each in node.names)
        elif isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
