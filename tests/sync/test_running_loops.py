"""A blocking hand in a coroutine: each call holds up the loop that runs there, and the log says so once."""

from __future__ import annotations

import logging
import sys
from types import SimpleNamespace

import pytest

from robotiq_async.sync import RobotiqHand

WORDS = "an event loop runs in this thread"


async def test_it_is_told_once_a_hand(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    for _ in range(2):
        with RobotiqHand("sim://?speedup=50", name="left") as hand:
            hand.move(40)
    told = [record.getMessage() for record in caplog.records if WORDS in record.getMessage()]
    assert len(told) == 2
    assert all(each.startswith("left: ") for each in told)
    caplog.clear()


def test_without_a_loop_nothing_is_told(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING), RobotiqHand("sim://?speedup=50") as hand:
        hand.move(40)
    assert caplog.records == []


async def test_nor_in_a_notebook_whose_cells_run_in_its_loop(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    caplog.set_level(logging.WARNING)
    monkeypatch.setitem(sys.modules, "ipykernel", SimpleNamespace())
    with RobotiqHand("sim://?speedup=50") as hand:
        hand.move(40)
    assert caplog.records == []
