"""Troubles as data: the words, the values, and what is refused."""

from __future__ import annotations

import itertools
import math
import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.simulator import Trouble, parse_troubles
from robotiq_async.simulator.troubles.trouble import KINDS

INF = math.inf
CONDITIONS = [
    *("accept-silence", "refuse", "multiplexer", "power-cut", "slow-device", "interference", "fault"),
    *("idle-reset", "e-stop"),
    *("status-lag", "silence-fault", "slow-activation", "echoed-limits", "write-spacing"),
    *("wake-needed", "function-3-only", "one-connection-only", "echo", "strict-silence", "registers"),
    "no-function-23",
]
"""Kinds that cannot be for a single reply or moment."""
REPLIES = [
    *("delay", "late", "drop", "half", "pieces", "twice", "exception"),
    *("wrong-function", "wrong-length", "wrong-count", "wrong-transaction"),
    *("wrong-unit", "wrong-protocol", "wrong-checksum"),
    *("byte-before", "byte-after", "seven-bits", "garbled"),
]
"""Kinds that can be about replies to reads and to writes."""


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
        on=draw(st.sampled_from(["any", "read", "write"] if name in REPLIES else ["any"])),
        at=draw(st.just(0.0) | seconds(0, 86400)),
        lasts=draw(st.none() | lasts),
    )
    if trouble.duration == INF or draw(st.booleans()):
        return trouble
    every = draw(seconds(int(trouble.duration) + 1, 86400))
    return Trouble(name, value, on=trouble.on, at=trouble.at, lasts=trouble.lasts, every=every)


def test_the_kinds_that_are_about_replies() -> None:
    """The lists above are all there are."""
    corrupting = {name for name, kind in KINDS.items() if kind.corruption is not None}
    assert corrupting == {*REPLIES, "wrong-echo"}
    assert {name for name, kind in KINDS.items() if kind.lasts == INF} == {
        *CONDITIONS,
        *("delay", "pieces", "silence", "seven-bits", "garbled"),
    }


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
    for kind, direction in itertools.product(set(KINDS) - {*REPLIES, "wrong-echo"}, ["read", "write"]):
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


VALUES = {
    "delay": (0.05, 0, 10),
    "late": (0.7, 0, 10),
    "pieces": (0.002, 0, 1),
    "multiplexer": (0.7, 0, 10),
    "exception": (4, 1, 255),
    "foreign": (128, 0, 255),
    "fault": (9, 1, 15),
    "e-stop": (1, 1, 9),
    "idle-reset": (5, 0, 3600),
    "slow-device": (0.2, 0, 10),
    "status-lag": (0.05, 0, 1),
    "silence-fault": (1, 0, 3600),
    "slow-activation": (25, 0, 600),
    "write-spacing": (0.01, 0, 1),
    "byte-before": (0, 0, 255),
    "byte-after": (0, 0, 255),
    "strict-silence": (0.00175, 0, 1),
    "registers": (3, 1, 8),
}
"""The usual value of each kind that has one, the least and the greatest."""
WHOLE = {"exception", "foreign", "fault", "e-stop", "byte-before", "byte-after", "registers"}
"""Kinds whose value is a whole number; others have seconds, or none."""


def test_the_values() -> None:
    for name, kind in KINDS.items():
        assert Trouble(name).amount == VALUES.get(name, (0, 0, 0))[0], name
        assert (kind.low, kind.high) == VALUES.get(name, (0, 0, 0))[1:], name
        assert isinstance(kind.value, int) == (name in WHOLE), name


def test_conditions_last_until_ended_and_events_happen_once() -> None:
    for_ever = dict.fromkeys([*CONDITIONS, "delay", "pieces", "silence"], INF)
    events = ["late", "drop", "wrong-echo", "reset", "close", "foreign", "release"]
    for kind, duration in (for_ever | dict.fromkeys(events, 0)).items():
        assert Trouble(kind).duration == duration, kind
        assert Trouble(kind, lasts=2).duration == 2, kind


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


@given(plan=st.lists(troubles()), separator=st.sampled_from(["\n", ";", "; ", " # again\n"]))
def test_the_words_of_a_plan_give_an_equal_plan(plan: list[Trouble], separator: str) -> None:
    assert parse_troubles(separator.join(map(str, plan))) == plan
