"""Forgetting the async of ``async with`` and ``async for`` is an error that says so."""

from __future__ import annotations

from typing import Any

import pytest

from robotiq_async import RobotiqHand
from robotiq_async.fleet import RemoteHand


def test_with_names_async_with_and_the_hand_that_blocks() -> None:
    hand: Any = RobotiqHand()
    with pytest.raises(TypeError, match=r"'async with'.*robotiq_async\.sync"), hand:
        pass


def test_with_names_async_with_for_a_hand_on_another_host() -> None:
    hand: Any = RemoteHand("zenoh://lab/cell/left")
    with pytest.raises(TypeError, match="'async with'"), hand:
        pass


@pytest.mark.parametrize("name", ["statuses", "transitions", "requests", "grip_events"])
def test_for_names_async_for(name: str) -> None:
    stream: Any = getattr(RobotiqHand(), name)()
    with pytest.raises(TypeError, match="'async for'"):
        for _ in stream:
            pass
    with pytest.raises(TypeError, match="'async for'"):
        list(stream)
