"""Listeners: told at once and in order, and harmless."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

import pytest

from robotiq_async.session.streams import Listeners


@pytest.fixture
def listeners() -> Listeners:
    return Listeners()


def test_each_is_told_everything_in_its_order(listeners: Listeners) -> None:
    one: list[object] = []
    other: list[object] = []
    listeners.add(one.append)
    listeners.tell(1)
    listeners.add(other.append)
    listeners.tell(2)
    assert (one, other) == ([1, 2], [2])


def test_one_that_is_removed_is_told_no_more(listeners: Listeners) -> None:
    told: list[object] = []
    remove = listeners.add(told.append)
    remove_other = listeners.add(told.append)
    remove()
    remove()
    listeners.tell(1)
    assert told == [1], "the same function was added twice"
    remove_other()
    listeners.tell(2)
    assert told == [1]


def test_one_that_is_removed_by_another_is_not_told_any_more(listeners: Listeners) -> None:
    told: list[object] = []
    removers: list[Callable[[], None]] = []
    listeners.add(lambda _: removers[0]())
    removers.append(listeners.add(told.append))
    listeners.tell(1)
    assert told == []


def test_one_may_remove_itself_and_add_others(listeners: Listeners) -> None:
    told: list[object] = []

    def once(item: object) -> None:
        told.append(item)
        remove()
        listeners.add(told.append)

    remove = listeners.add(once)
    listeners.tell(1)
    listeners.tell(2)
    assert told == [1, 2]


def test_what_a_listener_brings_about_is_told_after_what_it_was_told(listeners: Listeners) -> None:
    told: list[object] = []
    listeners.add(lambda item: listeners.tell("then") if item == "first" else None)
    listeners.add(told.append)
    listeners.tell("first")
    assert told == ["first", "then"]


@pytest.mark.parametrize("error", [ValueError("no"), asyncio.CancelledError()], ids=repr)
def test_one_that_raises_is_logged_once_and_hurts_nobody(
    listeners: Listeners, caplog: pytest.LogCaptureFixture, error: BaseException
) -> None:
    told: list[object] = []

    def fail(_: object) -> None:
        raise error

    listeners.add(fail)
    listeners.add(told.append)
    listeners.tell(1)
    listeners.tell(2)
    assert told == [1, 2]
    (record,) = caplog.records
    assert record.levelno == logging.ERROR
    assert record.exc_info is not None
    assert record.exc_info[1] is error


def test_an_interrupt_is_not_held_back_and_telling_goes_on_afterwards(listeners: Listeners) -> None:
    told: list[object] = []
    errors = [KeyboardInterrupt()]

    def interrupted(item: object) -> None:
        told.append(item)
        if errors:
            raise errors.pop()

    listeners.add(interrupted)
    with pytest.raises(KeyboardInterrupt):
        listeners.tell(1)
    listeners.tell(2)
    assert told == [1, 2]
