"""The log: which hand a record is about, and that texts of others stay within their line."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import pytest

from robotiq_async.cli.output.messages import forwarded_warnings
from robotiq_async.runtime.logger import Log, log, printable

FORMAT = logging.Formatter("[%(hand)s] %(message)s")


@pytest.fixture(autouse=True)
def everything(caplog: pytest.LogCaptureFixture) -> Iterator[None]:
    with caplog.at_level(logging.DEBUG, "robotiq_async"):
        yield


def test_a_record_about_a_hand_begins_with_its_name_and_has_it(caplog: pytest.LogCaptureFixture) -> None:
    Log("left").warning("link lost: %s", "unplugged")
    log.warning("%d messages were dropped", 3)
    assert [FORMAT.format(each) for each in caplog.records] == [
        "[left] left: link lost: unplugged",
        "[] 3 messages were dropped",
    ]


@pytest.mark.parametrize("name", ["50 %", "%s", "%(hand)s", "{0}"])
def test_nothing_in_a_name_is_worked_out(name: str, caplog: pytest.LogCaptureFixture) -> None:
    Log(name).info("it stands still")
    Log(name).info("at %d", 7)
    assert [each.getMessage() for each in caplog.records] == [f"{name}: it stands still", f"{name}: at 7"]


def test_a_record_names_the_function_and_the_error(caplog: pytest.LogCaptureFixture) -> None:
    for each in (Log("left"), log):
        try:
            raise ValueError("why")
        except ValueError:
            each.exception("it failed")
    for record in caplog.records:
        assert record.funcName == "test_a_record_names_the_function_and_the_error"
        assert record.exc_info is not None
        assert record.exc_info[0] is ValueError


def test_arguments_below_the_level_are_not_formatted(caplog: pytest.LogCaptureFixture) -> None:
    class Costly:
        def __str__(self) -> str:
            raise AssertionError

    with caplog.at_level(logging.WARNING, "robotiq_async"):
        Log("left").debug("%s", Costly())
    assert not caplog.records


def test_where_one_hand_is_shown_its_name_is_left_out() -> None:
    outside: list[str] = []
    inside: list[str] = []
    with forwarded_warnings(outside.append), forwarded_warnings(inside.append, of="left"):
        Log("left").warning("link lost")
        Log("right").warning("link lost")
    assert inside == ["link lost", "right: link lost"]
    assert outside == []


@pytest.mark.parametrize("words", ["two\nlines", "\x1b[2Jgone", "bell\a", "back\b\rover", "\u2028", "\x9b1m"])
def test_foreign_text_is_made_printable(words: str, caplog: pytest.LogCaptureFixture) -> None:
    log.warning("%s says: %s", "a client", words)
    log.warning("refused: %s", ValueError(words))
    for record in caplog.records:
        assert record.getMessage().isprintable()
        assert printable(words) in record.getMessage()


def test_printable_text_stays_as_it_is(caplog: pytest.LogCaptureFixture) -> None:
    log.warning("%s: %d of %d", "Grüße", 3, 4)
    (record,) = caplog.records
    assert record.args == ("Grüße", 3, 4), "for those who look at the arguments"
    assert record.getMessage() == "Grüße: 3 of 4"
