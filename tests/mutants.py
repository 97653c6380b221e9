"""The strength of the tests: small mistakes are made in the library, and the tests should notice each.

    python -m tests.mutants ../mutants.jsonl [--mutants 300] [--seed 24]

The first run keeps a copy of the tree beside the file, runs the tests once and notes which test runs which
statement. Then the mistakes are made in the copy, one at a time, and some of those tests run that run the
statement. The file gets a line of JSON for each; the same command continues where it was interrupted. A
mistake counts as killed by a test that passes without it.
"""

from __future__ import annotations

import argparse
import ast
import collections
import contextlib
import copy
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

PARTS = ("control", "local", "link", "values", "calibration", "hands", "simulator", "fleet", "runtime")
FOLDERS = (*PARTS, "contract", "adversity")
SLOW_S = 4.0
"""Slower tests are left out."""
AT_MOST = 40
"""Tests for one mistake."""
PAIRS = [
    *((ast.Lt, ast.LtE), (ast.Gt, ast.GtE), (ast.Eq, ast.NotEq), (ast.Is, ast.IsNot), (ast.In, ast.NotIn)),
    *((ast.And, ast.Or), (ast.Add, ast.Sub), (ast.Mult, ast.Div), (ast.LShift, ast.RShift)),
    *((ast.FloorDiv, ast.Mult), (ast.BitAnd, ast.BitOr)),
]
SWAPS: dict[type, type] = dict(PAIRS[:-2] + [(after, before) for before, after in PAIRS[:-2]] + PAIRS[-2:])
STATEMENTS = ("body", "orelse", "finalbody")
HITS = "from robotiq_async._hits import hits as _hits"


# -- the mistakes ------------------------------------------------------------------------------------------


class Mistake(NamedTuple):
    """A node that becomes another one; ``statement`` is the one of a function that it is part of."""

    node: ast.AST
    other: ast.AST
    statement: ast.stmt | None

    @property
    def what(self) -> str:
        before, after = (ast.unparse(each).split("\n")[0][:90] for each in (self.node, self.other))
        return f"{type(self.node).__name__}: {before} -> {after}"


def mistakes(parent: ast.AST, statement: ast.stmt | None = None) -> Iterator[Mistake]:
    """All that can be made below a node, always in the same order."""
    in_function = statement is not None or isinstance(parent, ast.FunctionDef | ast.AsyncFunctionDef)
    for name, value in ast.iter_fields(parent):
        # Types are mypy's business.
        if name in ("annotation", "returns"):
            continue
        for node in value if isinstance(value, list) else [value]:
            if isinstance(node, ast.AST) and not is_for_types(node):
                is_first = in_function and name in STATEMENTS and isinstance(node, ast.stmt)
                part_of = node if is_first and isinstance(node, ast.stmt) else statement
                for other in instead_of(node, inside=part_of is not None):
                    yield Mistake(node, ast.copy_location(other, node), part_of)
                yield from mistakes(node, part_of)


def is_for_types(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)


def instead_of(node: ast.AST, *, inside: bool) -> Iterator[Any]:
    """Mutations of a node."""
    match node:
        case ast.Compare(ops=[op]) if type(op) in SWAPS:
            yield ast.Compare(node.left, [SWAPS[type(op)]()], node.comparators)
        case ast.BoolOp(op=op) | ast.BinOp(op=op) if type(op) in SWAPS:
            swapped = copy.copy(node)
            swapped.op = SWAPS[type(op)]()
            yield swapped
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            yield operand
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int(value) | float(value)):
            yield ast.Constant(value + 1)
        case ast.If(test=test) | ast.IfExp(test=test) | ast.While(test=test):
            negated = copy.copy(node)
            negated.test = ast.UnaryOp(ast.Not(), test)
            yield negated
        case ast.Return(value=ast.expr() as value) if ast.unparse(value) != "None":
            yield ast.Return(ast.Constant(None))
        case ast.Raise() | ast.Break() | ast.Continue():
            yield ast.Pass()
        case ast.Assign() | ast.AugAssign() if inside:
            yield ast.Pass()
        case ast.Expr(value=value) if inside and not isinstance(value, ast.Constant):
            # The log is for people.
            if not re.match(r"[\w.]*\blog\.|self\._log\b", ast.unparse(value)):
                yield ast.Pass()


def with_mistake(module: ast.Module, mistake: Mistake) -> str:
    class Replace(ast.NodeTransformer):
        def visit(self, node: ast.AST) -> Any:
            return mistake.other if node is mistake.node else self.generic_visit(node)

    return ast.unparse(ast.fix_missing_locations(Replace().visit(module)))


# -- which test runs which statement -----------------------------------------------------------------------


def place(statement: ast.stmt) -> str:
    return f"{statement.lineno}:{statement.col_offset}"


def probe(node: ast.AST, places: list[str], file: str, *, inside: bool = False) -> None:
    """Put an assignment before each statement of every function, that notes that it was run."""
    inside = inside or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    for name, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                probe(child, places, file, inside=inside)
        if inside and name in STATEMENTS and isinstance(value, list):
            probed: list[ast.stmt] = []
            for statement in value:
                is_docstring = isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
                if not is_docstring:
                    probed += ast.parse(f"_hits[{len(places)}] = 1").body
                    places.append(f"{file}:{place(statement)}")
                probed.append(statement)
            setattr(node, name, probed)


class Recorder:
    """A plugin of pytest."""

    def __init__(self, places: list[str]) -> None:
        self.places = places
        self.tests: dict[str, list[int]] = collections.defaultdict(list)
        self.seconds: dict[str, float] = collections.defaultdict(float)
        self.bad: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.seconds[report.nodeid] += report.duration
        if not report.passed:
            self.bad.add(report.nodeid)

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        hits: bytearray = sys.modules["robotiq_async._hits"].hits
        test = [*self.seconds].index(nodeid)
        for number, was_run in enumerate(bytes(hits)):
            if was_run:
                self.tests[self.places[number]].append(test)
                hits[number] = 0


def record(work: Path) -> None:
    """Run the tests with probes in the library; to be called in the copy."""
    recorder = Recorder([])
    for path in Path("robotiq_async").rglob("*.py"):
        if path.parts[1] in PARTS:
            module = ast.parse(path.read_text())
            probe(module, recorder.places, str(path))
            first = next((n for n, each in enumerate(module.body) if not is_head(each)), len(module.body))
            module.body[first:first] = ast.parse(HITS).body
            path.write_text(ast.unparse(ast.fix_missing_locations(module)))
    Path("robotiq_async/_hits.py").write_text(f"hits = bytearray({len(recorder.places)})\n")
    folders = [f"tests/{folder}" for folder in FOLDERS if Path("tests", folder).is_dir()]
    pytest.main([*folders, "-q", "-n0", "-pno:cacheprovider"], plugins=[recorder])
    tests = [(test, t if test not in recorder.bad else SLOW_S) for test, t in recorder.seconds.items()]
    (work / "noted.json").write_text(json.dumps({"places": recorder.tests, "tests": tests}))


def is_head(statement: ast.stmt) -> bool:
    """Whether it stands before everything else in a module."""
    is_future = isinstance(statement, ast.ImportFrom) and statement.module == "__future__"
    return is_future or (isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant))


# -- the tree in which the mistakes are made ---------------------------------------------------------------


def fitting(seconds: dict[str, float], part: str) -> list[str]:
    """Some of all tests: of a function not more than three at first, the nearest, the quickest."""
    order, seen = [], collections.Counter[str]()
    for test in sorted(seconds, key=lambda test: (seconds[test], test)):
        function = test.split("[")[0]
        seen[function] += 1
        is_far = test.split("/")[1] != part
        order.append((seen[function] > 3, is_far, seconds[test], test))
    return [test for *_, test in sorted(order)][:AT_MOST]


class Tree:
    """The copy."""

    def __init__(self, work: Path) -> None:
        self.root = work / "tree"
        noted = json.loads((work / "tests.json").read_text())
        self.tests: list[str] = [test for test, _ in noted["tests"]]
        self.seconds = {test: seconds for test, seconds in noted["tests"] if seconds < SLOW_S}
        self.places: dict[str, list[int]] = noted["places"]
        self.clean: dict[tuple[str, ...], bool] = {}

    def pick(self, seed: int, count: int) -> list[tuple[str, int]]:
        paths = (path for part in PARTS for path in (self.root / "robotiq_async" / part).rglob("*.py"))
        files = {str(path.relative_to(self.root)): ast.parse(path.read_text()) for path in sorted(paths)}
        every = [(file, n) for file, module in files.items() for n, _ in enumerate(mistakes(module))]
        return random.Random(seed).sample(every, count)

    def run(self, tests: tuple[str, ...], limit: float) -> tuple[int | None, str]:
        """The exit code, None when it took too long, and the test that failed."""
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-n0", "-pno:cacheprovider", "--tb=no", "-rfE"]
        # A compiled mistake would be taken for the file that it was made in.
        variables = {**os.environ, "PYTHONPATH": str(self.root), "PYTHONDONTWRITEBYTECODE": "1"}
        process = subprocess.Popen(
            [*command, "-ohangs_after=0", *tests],
            cwd=self.root,
            env=variables,
            text=True,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            output = process.communicate(timeout=limit)[0]
        except subprocess.TimeoutExpired:
            return None, ""
        finally:
            # And whatever the tests have started.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
        failed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", output, re.MULTILINE)
        return process.returncode, failed[1] if failed else output[-300:]

    def passes(self, tests: tuple[str, ...]) -> bool:
        """Whether they do without a mistake."""
        if tests not in self.clean:
            self.clean[tests] = self.run(tests, 120)[0] == 0
        return self.clean[tests]

    def covering(self, file: str, statement: ast.stmt | None) -> set[str]:
        """The tests that run a statement; what stands in no function is run by all that run the file."""
        start = f"{file}:{place(statement)}" if statement else f"{file}:"
        places = [start] if statement else [each for each in self.places if each.startswith(start)]
        numbers = {number for each in places for number in self.places.get(each, ())}
        return {self.tests[number] for number in numbers} & self.seconds.keys()

    def outcome(self, file: str, number: int) -> dict[str, Any]:
        """The fate of a mistake."""
        path = self.root / file
        original, stat = path.read_text(), path.stat()
        module = ast.parse(original)
        mistake = list(mistakes(module))[number]
        mutant = {
            "file": file,
            "number": number,
            "line": getattr(mistake.node, "lineno", 0),
            "what": mistake.what,
        }
        seconds = {test: self.seconds[test] for test in self.covering(file, mistake.statement)}
        tests = tuple(fitting(seconds, file.split("/")[1]))
        if not tests:
            return {**mutant, "result": "uncovered"}
        limit = max(15.0, 5 * (2 + sum(self.seconds[test] for test in tests)))
        try:
            path.write_text(with_mistake(module, mistake))
            code, failed = self.run(tests, limit)
        finally:
            # With its old time it is the file that was compiled.
            path.write_text(original)
            os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
        if code == 0:
            return {**mutant, "result": "survived", "tests": len(tests)}
        if code not in (1, None):
            return {**mutant, "result": "error", "code": code, "by": failed}
        if not self.passes((failed,) if failed in self.seconds else tests):
            return {**mutant, "result": "error", "code": code, "by": f"fails without it: {failed}"}
        return {**mutant, "result": "killed", "by": failed or "time-out"}


def prepared(work: Path) -> Tree:
    """Record, unless it has been done; and undo a mistake that was made when this was interrupted."""
    root, library = work / "tree", work / "library"
    if not (work / "tests.json").exists():
        shutil.rmtree(work, ignore_errors=True)
        kept = shutil.ignore_patterns(".git", ".venv*", "__pycache__", ".*_cache", ".hypothesis")
        shutil.copytree(".", root, ignore=kept)
        shutil.copytree("robotiq_async", library, ignore=kept)
        program = f"from tests import mutants; mutants.record(mutants.Path({str(work)!r}))"
        in_copy(root, "-c", program)
        (work / "noted.json").rename(work / "tests.json")
    shutil.rmtree(root / "robotiq_async")
    shutil.copytree(library, root / "robotiq_async")
    in_copy(root, "-m", "compileall", "-q", "robotiq_async")
    return Tree(work)


def in_copy(root: Path, *arguments: str) -> None:
    variables = {**os.environ, "PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": ""}
    subprocess.run([sys.executable, *arguments], cwd=root, env=variables, check=True)


def main() -> None:
    what = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what.add_argument("results", type=Path)
    what.add_argument("--mutants", type=int, default=300)
    what.add_argument("--seed", type=int, default=24)
    given = what.parse_args()
    results = given.results.resolve()
    tree = prepared(results.with_suffix(".work"))
    lines = results.read_text().splitlines() if results.exists() else []
    done = {(one["file"], one["number"]): one["result"] for one in map(json.loads, lines)}
    for which in tree.pick(given.seed, given.mutants):
        if which not in done:
            begun = time.monotonic()
            one = tree.outcome(*which)
            done[which] = one["result"]
            with results.open("a") as file:
                file.write(json.dumps({**one, "seconds": round(time.monotonic() - begun, 1)}) + "\n")
    counts = collections.Counter(done.values())
    sys.stdout.write(", ".join(f"{count} {result}" for result, count in counts.items()) + "\n")


if __name__ == "__main__":
    main()
