"""The diagram of the states is the table; whether generated pages are fresh is tested in test_pages.py."""

from __future__ import annotations

import re

import pytest

from docs import make_tables
from robotiq_async import State
from robotiq_async.values.enums import Trigger
from robotiq_async.values.states import TABLE

LINE = re.compile(r"^ +(\w+) --> (\w+)(?:: (.+))?$", re.MULTILINE)


def test_a_page_without_a_place_for_its_table_is_an_error() -> None:
    with pytest.raises(ValueError, match="no place for the table 'diagram'"):
        make_tables.filled("state-machine.md", "")


def named(words: str) -> list[Trigger]:
    """The triggers in the label of an arrow, where they are separated by commas that they may have, too."""
    found = []
    for trigger in sorted(Trigger, key=lambda each: -len(each.value)):
        if f", {trigger.value}, " in f", {words}, ":
            found.append(trigger)
            words = f", {words}, ".replace(f", {trigger.value}, ", ", ").strip(", ")
    assert not words
    return found


def drawn() -> set[tuple[State, State, Trigger]]:
    """The entries of the table that the arrows of the diagram stand for, with the shared ones spread out."""
    triggers = {each.value: each for each in Trigger}
    lines = LINE.findall(make_tables.diagram())
    shown = {(target, triggers[words]) for source, target, words in lines if source == "shown"}
    anywhere = {(target, triggers[words]) for source, target, words in lines if source == "any"}
    found = set()
    for source, target, words in lines:
        if source not in ("shown", "any"):
            pairs = shown if target == "shown" else {(target, each) for each in named(words)}
            found |= {(State[source], State[name], trigger) for name, trigger in pairs}
    for state, row in TABLE.items():
        found |= {(state, State[name], each) for name, each in anywhere if row[each] is State[name]}
    return found


def test_every_arrow_is_an_entry_of_the_table() -> None:
    assert [each for each in drawn() if TABLE[each[0]][each[2]] is not each[1]] == []


def test_every_call_that_changes_the_state_has_its_arrow() -> None:
    entries = {
        (state, target, trigger)
        for state, row in TABLE.items()
        for trigger, target in row.items()
        if isinstance(target, State) and target is not state and not trigger.is_seen
    }
    missing = entries - drawn()
    # A halt ends a sequence as a reset does: the diagram draws the reset.
    assert {trigger for _, _, trigger in missing} <= {Trigger.ASK_HALT}, missing
