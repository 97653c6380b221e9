"""One word for one thing: classes and constants of the package have names of their own."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import robotiq_async

PACKAGE = Path(robotiq_async.__file__).parent
PAGE = PACKAGE.parent / "docs" / "vocabulary.md"
MOST_WORDS = 60
SAME_ON_PURPOSE = {
    "RobotiqHand": "the blocking hand is used as the other, and only its module tells",
    "Stream": "of a blocking hand, by the same rule",
    "RobotiqGripper": "users of ur_rtde's class and those of LeRobot both look for this name",
}
"""Names of two classes, each with its reason."""


def named() -> Iterator[tuple[str, str, ast.expr | None]]:
    """The classes, types and constants of all modules, private ones too, with module and definition."""
    for path in sorted(PACKAGE.rglob("*.py")):
        for each in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(each, ast.ClassDef):
                yield each.name, str(path), None
            elif isinstance(each, ast.Assign | ast.AnnAssign) and each.value is not None:
                (target, *_) = each.targets if isinstance(each, ast.Assign) else (each.target,)
                for name in target.elts if isinstance(target, ast.Tuple) else [target]:
                    if isinstance(name, ast.Name) and len(name.id.strip("_")) > 1:
                        yield name.id, str(path), each.value


def test_no_two_classes_have_one_name() -> None:
    """A class of one module has no name of another class either, with an underscore or without."""
    meanings = defaultdict(set)
    for name, path, value in named():
        word = name.strip("_")
        if word[0].isupper() and not word.isupper():
            meanings[word].add(path if value is None else ast.unparse(value))
    assert {name for name, where in meanings.items() if len(where) > 1} == SAME_ON_PURPOSE.keys()


def test_no_constant_has_two_values() -> None:
    """Tables that never leave their module may have one name, as ``_WORDS``; figures may not."""
    values = defaultdict(set)
    shared = set()
    for name, _, value in named():
        word = name.strip("_")
        # The members of an enum, unpacked, have the names that it gives them.
        if value is not None and word.isupper() and not isinstance(value, ast.Name):
            values[word].add(ast.unparse(value))
            if not name.startswith("_") or is_figure(value):
                shared.add(word)
    assert {name for name, found in values.items() if len(found) > 1 and name in shared} == set()


def is_figure(value: ast.expr) -> bool:
    inside = [each.value for each in ast.walk(value) if isinstance(each, ast.Constant)]
    is_simple = isinstance(value, ast.Constant | ast.BinOp) and inside != []
    return is_simple and all(isinstance(each, int | float) for each in inside)


def test_asked_is_a_time() -> None:
    """A request, a question and a setting have these names; ``asked`` says when a status was requested."""
    others = {
        f"{path.relative_to(PACKAGE)}: {ast.unparse(each)}"
        for path in PACKAGE.rglob("*.py")
        for each in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(each, ast.arg) and each.arg in ("asked", "asked_at")
        if each.annotation is not None and ast.unparse(each.annotation) not in ("float", "float | None")
    }
    assert others == set()
    calls = {
        f"{path.relative_to(PACKAGE)}: {each.name}"
        for path in PACKAGE.rglob("*.py")
        for each in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef)
        if each.name.strip("_").removesuffix("_at") == "asked"
        if each.returns is None or ast.unparse(each.returns) not in ("float", "float | None")
    }
    assert calls == set()


def test_the_page_of_words_is_short_and_names_places_that_exist() -> None:
    rows = re.findall(
        r"^\| ([^|]+) \| ([^|]+) \| `([^`]+)` \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE
    )
    words = [word for row in rows for word in row[0].split(", ")]
    assert 40 < len(words) <= MOST_WORDS
    assert len(words) == len(set(words))
    for _, _, where in rows:
        assert (PACKAGE / where).is_file(), where
