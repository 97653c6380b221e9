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
SAME_ON_PURPOSE = {"RobotiqHand", "Stream", "RobotiqGripper"}
"""The blocking hand and its streams; the names that ur_rtde's users and those of LeRobot look for."""
OF_EACH = {"SECONDS"}
"""The limit of time that each stage of verify has."""


def public(name: str) -> bool:
    return not name.startswith("_") and len(name) > 1


def named() -> Iterator[tuple[str, str, ast.stmt]]:
    """The classes, types and constants of all modules, each with its module and its definition."""
    for path in sorted(PACKAGE.rglob("*.py")):
        for each in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(each, ast.ClassDef):
                yield each.name, str(path), each
            elif isinstance(each, ast.Assign | ast.AnnAssign) and each.value is not None:
                (target, *_) = each.targets if isinstance(each, ast.Assign) else (each.target,)
                if isinstance(target, ast.Name):
                    yield target.id, str(path), each


def test_no_two_classes_have_one_name() -> None:
    meanings = defaultdict(set)
    for name, path, each in named():
        if public(name) and name[0].isupper() and not name.isupper():
            is_type = not isinstance(each, ast.ClassDef)
            meanings[name].add(ast.unparse(each) if is_type else path)
    several = {name for name, where in meanings.items() if len(where) > 1}
    assert several - SAME_ON_PURPOSE == set()


def test_no_constant_has_two_values() -> None:
    values = defaultdict(set)
    for name, _, each in named():
        if public(name) and name.isupper():
            assert isinstance(each, ast.Assign | ast.AnnAssign)
            assert each.value is not None
            values[name].add(ast.unparse(each.value))
    assert {name for name, found in values.items() if len(found) > 1} - OF_EACH == set()


def test_the_page_of_words_is_short_and_names_places_that_exist() -> None:
    rows = re.findall(
        r"^\| ([^|]+) \| ([^|]+) \| `([^`]+)` \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE
    )
    words = [word for row in rows for word in row[0].split(", ")]
    assert 40 < len(words) <= MOST_WORDS
    assert len(words) == len(set(words))
    for _, _, where in rows:
        assert (PACKAGE / where).is_file(), where
