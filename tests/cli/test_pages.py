"""The shell lines of the pages, typed in their order: those that end by themselves, at a simulated gripper.

What needs a person, a second terminal or minutes is not typed here: each command has tests of its own beside
this file, and tests/docs/test_commands.py reads every line.
"""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values.model import model_of
from tests.cli.conftest import served
from tests.docs.pages import PAGES, ROOT, named
from tests.docs.test_commands import lines, words_of

if TYPE_CHECKING:
    from tests.cli.conftest import Call

TYPED = {
    "doctor": [],
    "export": [],
    "measure stroke": ["--yes"],
    "move": ["--yes"],
    "plot": [],
    "record": ["--seconds", "0.3"],
    "recover": [],
    "replay": [],
    "simulate --troubles": [],
    "status": [],
    "view --layout": [],
}
"""Lines to type, with additions: there is nobody to answer and to press Ctrl-C."""
CALLIPER = b"85\n66\n43\n21\n0\n"
GRIPPERS = re.compile(r"(tcp|rtu|rtu\+tcp|urcap)://.*|192\.168\.1\.\d+|\$GRIPPER")
"""Addresses that stand for a gripper of the reader."""


def typed(page: Path) -> list[list[str]]:
    """The lines of a page that are typed, without the name of the program."""
    found = [words_of(line)[1:] for _, line in lines(page) if line.startswith("robotiq-async ")]
    return [words for words in found if adds(words) is not None and "zenoh" not in " ".join(words)]


def adds(words: list[str]) -> list[str] | None:
    """The addition to a line; None if it is not typed."""
    return TYPED.get(" ".join(words[:2]), TYPED.get(words[0]))


PAGES_WITH_SOME = [page for page in [ROOT / "README.md", *PAGES] if typed(page)]


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("page", PAGES_WITH_SOME, ids=named)
def test_the_lines_of_a_page_can_be_typed_in_their_order(
    page: Path, call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for words in typed(page):
        name = (re.findall(r"model=([\w-]+)", " ".join(words)) or ["3f"])[0]
        with served(SimulatedGripper(speedup=20, model=model_of(name))) as server:
            there = [server.address if GRIPPERS.fullmatch(word) else word for word in words]
            stdin = CALLIPER if words[:2] == ["measure", "stroke"] else b""
            outcome = call(*there, *(adds(words) or []), stdin=stdin)
        assert outcome.code == 0, f"{shlex.join(words)}\n{outcome.out}{outcome.err}"


def test_each_of_these_commands_is_on_a_page() -> None:
    on_pages = [words for page in PAGES_WITH_SOME for words in typed(page)]
    assert {words[0] for words in on_pages} == {command.split()[0] for command in TYPED}
