"""The reference names everything that is public."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator

import pytest

import robotiq_async
from robotiq_async import (
    Fault,
    Finger,
    GraspResult,
    GripChange,
    GripEvent,
    Initialization,
    Mode,
    MoveResult,
    ObjectStatus,
    ReconnectPolicy,
    RobotiqHand,
    RobotiqStatus,
    SentRequest,
    Severity,
    State,
    Statistics,
    Stream,
    Transition,
    Units,
    fleet,
    simulator,
    sync,
)
from robotiq_async.cli.app import COMMANDS
from robotiq_async.values.request import Request
from tests.docs.pages import DOCS
from tests.register_words import status_of

REFERENCE = (DOCS / "reference.md").read_text(encoding="utf-8")
WORDS = set(re.findall(r"\w+", REFERENCE))


def public(kind: type) -> Iterator[str]:
    bases = [base for base in kind.__mro__ if base.__module__.startswith("robotiq_async")]
    yield from sorted({name for base in bases for name in vars(base) if not name.startswith("_")})
    if dataclasses.is_dataclass(kind):
        yield from (field.name for field in dataclasses.fields(kind))


@pytest.mark.parametrize("name", [*robotiq_async.__all__, *simulator.__all__, *fleet.__all__])
def test_every_public_name_is_there(name: str) -> None:
    assert name in WORDS


@pytest.mark.parametrize(
    "kind",
    [
        RobotiqHand,
        RobotiqStatus,
        MoveResult,
        GraspResult,
        GripEvent,
        Units,
        Statistics,
        ReconnectPolicy,
        Transition,
        SentRequest,
        fleet.RemoteHand,
        fleet.Fleet,
        fleet.Member,
    ],
    ids=lambda k: k.__name__,
)
def test_every_public_attribute_is_there(kind: type) -> None:
    assert {*public(kind)} - WORDS == set()


def test_every_key_of_what_is_told_is_there() -> None:
    told = status_of(0xB9, 0xEA).as_dict() | SentRequest(Request(), 0.0, acknowledged=True).as_dict()
    assert {*told, *told["A"]} - WORDS == set()


def test_what_a_blocking_stream_is_for_is_there() -> None:
    assert {*public(sync.Stream)} <= WORDS


def test_what_a_stream_is_for_is_there() -> None:
    # push(), end() and belong_to() are the hand's side of it.
    assert {*public(Stream)} - {"push", "end", "belong_to"} <= WORDS


@pytest.mark.parametrize(
    "kind", [Finger, GripChange, ObjectStatus, Initialization, Mode, Severity], ids=lambda k: k.__name__
)
def test_every_member_is_there(kind: type[Finger]) -> None:
    assert {*kind.__members__} <= WORDS


@pytest.mark.parametrize("page", ["thesis-map.md", "state-machine.md"])
def test_every_state_has_its_row(page: str) -> None:
    text = (DOCS / page).read_text(encoding="utf-8")
    for state in State:
        assert re.search(rf"^\|.*\b{state.name}\b", text, re.MULTILINE), state


@pytest.mark.parametrize("page", ["thesis-map.md", "registers.md"])
def test_every_fault_has_its_row(page: str) -> None:
    text = (DOCS / page).read_text(encoding="utf-8")
    for fault in Fault:
        (row,) = re.findall(rf"^\| 0x{int(fault):02X} \|.*$", text, re.MULTILINE)
        assert fault.name in row
        assert f"| {fault.severity.value} |" in row


def test_the_contact_codes_are_those_of_the_library() -> None:
    text = (DOCS / "thesis-map.md").read_text(encoding="utf-8")
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


def test_what_each_call_raises_is_there() -> None:
    (section,) = re.findall(r"^### What each call raises\n(.*?)^### ", REFERENCE, re.MULTILINE | re.DOTALL)
    rows = re.findall(r"^\| ([^|]+) \| ([^|]+) \|$", section, re.MULTILINE)
    calls = [call for first, _ in rows for call in re.findall(r"`(\w+)`", first)]
    assert sorted(calls) == sorted(public(RobotiqHand))
    builtin = {"TypeError", "ValueError", "RuntimeError"}
    errors = set(re.findall(r"\w+Error\b", section)) - builtin
    assert errors <= set(robotiq_async.__all__)


def _line_of(text: str, name: str) -> int:
    return next(n for n, line in enumerate(text.splitlines()) if re.search(rf"\b{name}\b", line))


def test_every_command_is_there() -> None:
    assert {command.__name__ for command in COMMANDS} | {"fleet", "measure"} <= WORDS
