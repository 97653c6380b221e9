"""Troubles as data: the words, the values, and what is refused."""

from __future__ import annotations

import itertools
import math
import re
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robotiq_async.simulator import Trouble, parse_troubles
from robotiq_async.simulator.troubles.trouble import KINDS
from tests.simulator.kinds import (
    CONDITIONS,
    EITHER_WAY,
    EVENT,
    EXPECTED,
    REPLIES,
    REPLY,
    WRITE_REPLY,
)

INF = math.inf


def seconds(low: int, high: int) -> st.SearchStrategy[float]:
    """Tenths of seconds, which words carry exactly."""
    return st.integers(10 * low, 10 * high).map(lambda tenths: tenths / 10)


@st.composite
def troubles(draw: st.DrawFn) -> Trouble:
    """Any trouble there can be."""
    name = draw(st.sampled_from(list(KINDS)))
    kind = KINDS[name]
    value: float | None = None
    if isinstance(kind.value, int):
        value = draw(st.none() | st.integers(int(kind.low), int(kind.high)))
    elif kind.value is not None:
        value = draw(
            st.none() | st.integers(int(1000 * kind.low), int(1000 * kind.high)).map(lambda each: each / 1000)
        )
    lasts = st.just(INF) | seconds(1, 86000)
    if kind.lasts == 0 or name not in CONDITIONS:
        lasts |= st.just(0.0)
    trouble = Trouble(
        name,
        value,
        on=draw(st.sampled_from(["any", "read", "write"] if name in EITHER_WAY else ["any"])),
        at=draw(st.just(0.0) | seconds(0, 86400)),
        lasts=draw(st.none() | lasts),
    )
    if trouble.duration == INF or draw(st.booleans()):
        return trouble
    every = draw(seconds(int(trouble.duration) + 1, 86400))
    return Trouble(name, value, on=trouble.on, at=trouble.at, lasts=trouble.lasts, every=every)


# Words.


@pytest.mark.parametrize(
    ("words", "trouble"),
    [
        ("drop", Trouble("drop", value=None, on="any", at=0.0, lasts=None, every=None)),
        ("drop at 5", Trouble("drop", at=5)),
        ("delay 0", Trouble("delay", 0)),
        ("delay 10", Trouble("delay", 10.0)),
        ("silence once", Trouble("silence", lasts=0)),
        ("drop for ever", Trouble("drop", lasts=INF)),
        ("refuse for 86400 at 86400", Trouble("refuse", at=86400, lasts=86400)),
        ("drop every 0.001", Trouble("drop", every=0.001)),
        ("refuse for 1 every 1.001", Trouble("refuse", lasts=1, every=1.001)),
        ("wrong-echo on write", Trouble("wrong-echo", on="write")),
        ("power-cut at 10 for 2 every 60", Trouble("power-cut", at=10, lasts=2, every=60)),
        ("late 0.9 every 60 once at 10 on read", Trouble("late", 0.9, on="read", at=10, lasts=0, every=60)),
        ("foreign 255", Trouble("foreign", 255.0)),
        ("exception 1e0", Trouble("exception", 1)),
        ("  drop   at\t5 # lost; then found", Trouble("drop", at=5)),
    ],
)
def test_words_are_read(words: str, trouble: Trouble) -> None:
    assert parse_troubles(words) == [trouble]


def test_several_on_lines_and_between_semicolons_in_their_order() -> None:
    text = """
    # what goes wrong on Mondays
    power-cut at 20 for 2; foreign 0 at 30   # the other cell

    drop every 10;
    """
    assert parse_troubles(text) == [
        Trouble("power-cut", at=20, lasts=2),
        Trouble("foreign", 0, at=30),
        Trouble("drop", every=10),
    ]
    assert parse_troubles(" \n;; \n# nothing") == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("dorp now", "unknown trouble 'dorp'; known are: delay, late, drop, "),
        ("drop 1", "drop takes no value, got 1.0"),
        ("delay much", "delay must be followed by a number, got 'much'"),
        ("delay 10.5", "the value of delay must be seconds in 0..10, got 10.5"),
        ("delay nan", "the value of delay must be seconds in 0..10, got nan"),
        ("foreign 256", "the value of foreign must be a whole number in 0..255, got 256.0"),
        ("foreign 1.5", "the value of foreign must be a whole number in 0..255, got 1.5"),
        ("fault 0", "the value of fault must be a whole number in 1..15, got 0.0"),
        ("drop on both", "on must be read, write or any, got 'both'"),
        ("wrong-echo on read", "'on read' means nothing for wrong-echo"),
        ("drop at noon", "at must be followed by a number, got 'noon'"),
        ("drop at -1", "at must be seconds in 0..86400.0, got -1.0"),
        ("drop for long", "for must be followed by a number, got 'long'"),
        ("drop for -1", "for must be seconds in 0..86400.0, got -1.0"),
        ("drop for 86401", "for must be seconds in 0..86400.0, got 86401.0"),
        ("drop for -inf", "for must be seconds in 0..86400.0, got -inf"),
        ("drop every day", "every must be followed by a number, got 'day'"),
        ("drop every 0", "every must be seconds in 0.001..86400.0, got 0.0"),
        ("power-cut for 2 every 2", "power-cut cannot come again after 2 s: it lasts as long"),
        ("drop for 2 every 1.5", "drop cannot come again after 1.5 s: it lasts as long"),
        ("drop once for 3", "cannot read 'drop once for 3': 'once' and 'for' contradict each other"),
        ("drop at", "cannot read 'drop at' at 'at'; the form is: KIND [VALUE] [on read|write] [at S] "),
        ("drop at 5 at 6", "cannot read 'drop at 5 at 6' at 'at'"),
        ("drop at 5 sharp", "cannot read 'drop at 5 sharp' at 'sharp'"),
        ("delay 1 2", "cannot read 'delay 1 2' at '2'"),
        ("drop; silence; dorp", "unknown trouble 'dorp'"),
    ],
)
def test_words_that_are_refused_say_why(words: str, message: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
        parse_troubles(words)


def test_on_is_refused_for_troubles_that_are_no_replies() -> None:
    for kind, direction in itertools.product(set(KINDS) - {*EITHER_WAY, "wrong-echo"}, ["read", "write"]):
        with pytest.raises(ValueError, match=f"^'on {direction}' means nothing for {kind}$"):
            parse_troubles(f"{kind} on {direction}")


def test_a_condition_is_not_for_once() -> None:
    for kind, words in itertools.product(CONDITIONS, ["once", "for 0"]):
        with pytest.raises(ValueError, match=f"^{kind} is a condition: give a duration"):
            parse_troubles(f"{kind} {words}")


# Values.


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"value": "0.1"}, "the value of delay must be seconds in 0..10, got '0.1'"),
        ({"value": True}, "the value of delay must be seconds in 0..10, got True"),
        ({"at": "5"}, "at must be seconds in 0..86400.0, got '5'"),
        ({"lasts": True}, "for must be seconds in 0..86400.0, got True"),
        ({"lasts": 1, "every": "5"}, "every must be seconds in 0.001..86400.0, got '5'"),
    ],
)
def test_options_that_are_not_numbers_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(TypeError, match=f"^{re.escape(message)}$"):
        Trouble("delay", **options)


def test_a_direction_that_is_none_is_refused() -> None:
    direction: Any = "READ"
    with pytest.raises(ValueError, match=r"^on must be read, write or any, got 'READ'$"):
        Trouble("drop", on=direction)


# The defaults.


def test_every_kind_is_as_expected() -> None:
    assert set(KINDS) == set(EXPECTED), "a row in tests/simulator/kinds.py"
    for name, kind in KINDS.items():
        form, links, value = EXPECTED[name]
        assert kind.links == links, name
        assert (kind.value, kind.low, kind.high) == (value or (None, 0, 0)), name
        assert isinstance(kind.value, int) == EXPECTED[name].is_whole, name
        assert (kind.corruption is not None) == (form in (REPLY, REPLIES, WRITE_REPLY)), name
        assert Trouble(name).amount == (value or (0,))[0], name
        assert Trouble(name).duration == (0 if form in (REPLY, WRITE_REPLY, EVENT) else INF), name
        assert Trouble(name, lasts=2).duration == 2, name


@pytest.mark.parametrize(
    ("words", "read", "write"),
    [
        *(("drop", True, True), ("drop on read", True, False), ("drop on write", False, True)),
        *(("wrong-echo", False, True), ("wrong-echo on write", False, True)),
    ],
)
def test_which_replies_a_trouble_affects(words: str, read: bool, write: bool) -> None:
    (trouble,) = parse_troubles(words)
    assert (trouble.is_about(write=False), trouble.is_about(write=True)) == (read, write)


# And back into words.


@pytest.mark.parametrize(
    "words",
    [
        *("drop", "silence once", "drop for ever", "foreign 0 at 30", "late once every 60"),
        *("delay 0.05 on read at 2.5 for 3 every 10", "delay 0.1234567 at 12345.678 for 86399.99"),
    ],
)
def test_a_trouble_in_words(words: str) -> None:
    (trouble,) = parse_troubles(words)
    assert str(trouble) == words


@settings(max_examples=50)
@given(plan=st.lists(troubles(), max_size=4), separator=st.sampled_from(["\n", ";", "; ", " # again\n"]))
def test_the_words_of_a_plan_give_an_equal_plan(plan: list[Trouble], separator: str) -> None:
    assert parse_troubles(separator.join(map(str, plan))) == plan
