"""The library's log: what others say stays within its line."""

from __future__ import annotations

import pytest

from robotiq_async.log import log, printable


@pytest.mark.parametrize("words", ["two\nlines", "\x1b[2Jgone", "bell\a", "back\b\rover", "\u2028", "\x9b1m"])
def test_what_others_say_neither_begins_a_line_nor_steers_a_terminal(
    words: str, caplog: pytest.LogCaptureFixture
) -> None:
    log.warning("%s says: %s", "somebody", words)
    log.warning("refused: %s", ValueError(words))
    for record in caplog.records:
        assert record.getMessage().isprintable()
        assert printable(words) in record.getMessage()


def test_what_is_harmless_stays_as_it_is(caplog: pytest.LogCaptureFixture) -> None:
    log.warning("%s: %d of %d", "Grüße", 3, 4)
    (record,) = caplog.records
    assert record.args == ("Grüße", 3, 4), "for those who look at the arguments"
    assert record.getMessage() == "Grüße: 3 of 4"
