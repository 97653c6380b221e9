"""A blocking hand in a coroutine: each call holds up the loop that runs there, and is logged once."""

from __future__ import annotations

import logging
import sys
from types import SimpleNamespace

import pytest

from robotiq_async.hands.options import LATE_POLLS
from robotiq_async.sync import RobotiqHand

WORDS = "an event loop runs in this thread"


def warnings(caplog: pytest.LogCaptureFixture) -> list[str]:
    """The warnings of a hand that is used; late polls are a matter of the machine."""
    with caplog.at_level(logging.WARNING), RobotiqHand("sim://?speedup=50", name="left") as hand:
        hand.move(40)
    messages = [record.getMessage() for record in caplog.records]
    caplog.clear()
    return [each for each in messages if LATE_POLLS not in each]


async def test_it_is_logged_once_per_hand(caplog: pytest.LogCaptureFixture) -> None:
    for _ in range(2):
        logged = [each for each in warnings(caplog) if WORDS in each]
        assert len(logged) == 1
        assert logged[0].startswith("left: ")


def test_without_a_loop_nothing_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    assert warnings(caplog) == []


async def test_nor_in_a_notebook_whose_cells_run_in_its_loop(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "ipykernel", SimpleNamespace())
    assert warnings(caplog) == []
