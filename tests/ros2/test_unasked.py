"""Goals whose clients have not asked for the result when the node ends."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async.ros2.node.unasked import ASKING_S, UnaskedGoals

pytestmark = pytest.mark.virtual_time


async def waited(goals: UnaskedGoals) -> float:
    """Seconds that the end of the node waits."""
    loop = asyncio.get_running_loop()
    began = loop.time()
    await goals.wait()
    return loop.time() - began


async def test_the_end_waits_for_the_client_of_a_goal() -> None:
    goals, loop = UnaskedGoals(), asyncio.get_running_loop()
    for key in (b"one", b"another"):
        goals.accepted(key)
        goals.ended(key)
    loop.call_later(0.5, goals.requested, b"one")
    loop.call_later(1.0, goals.requested, b"another")
    assert await waited(goals) == pytest.approx(1.0)


async def test_nobody_waits_if_all_have_asked() -> None:
    goals = UnaskedGoals()
    assert await waited(goals) == 0.0
    goals.accepted(b"asked while it runs")
    goals.requested(b"asked while it runs")
    goals.ended(b"asked while it runs")
    goals.requested(b"a goal of another node")
    assert await waited(goals) == 0.0


async def test_a_client_that_never_asks_does_not_hold_up_the_end() -> None:
    goals = UnaskedGoals()
    goals.accepted(b"over")
    goals.ended(b"over")
    await asyncio.sleep(ASKING_S)
    assert await waited(goals) == 0.0, "its result was kept long enough"
    goals.accepted(b"just over")
    goals.ended(b"just over")
    await asyncio.sleep(1.0)
    assert await waited(goals) == pytest.approx(ASKING_S - 1.0)
    goals.accepted(b"ended by nobody")
    assert await waited(goals) == pytest.approx(ASKING_S), "as when the executor hangs"
