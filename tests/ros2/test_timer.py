"""What is done at a rate."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import NotStartedError
from robotiq_async.ros2.node.timing import Timer
from tests.virtual import VirtualLoop

pytestmark = pytest.mark.virtual_time


async def test_it_goes_on_until_it_is_cancelled() -> None:
    loop = asyncio.get_running_loop()
    began, done, errors = loop.time(), list[float](), list[BaseException]()
    timer = Timer(0.1, lambda: done.append(loop.time() - began), errors.append)
    await asyncio.sleep(0.35)
    timer.cancel()
    await asyncio.sleep(1)
    assert done == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert not errors


async def test_what_a_hold_up_has_cost_is_not_made_up_for() -> None:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    began, done, errors = loop.time(), list[float](), list[BaseException]()
    timer = Timer(0.1, lambda: done.append(loop.time() - began), errors.append)
    await asyncio.sleep(0.05)
    loop.hold_up(1.0)
    await asyncio.sleep(0.15)
    timer.cancel()
    assert done == pytest.approx([0.0, 1.05, 1.15])


async def test_a_hand_that_was_stopped_does_not_matter_and_anything_else_is_told_once() -> None:
    errors: list[Exception] = [NotStartedError("the hand was stopped"), ValueError("nobody thought of it")]
    told: list[BaseException] = []

    def fail() -> None:
        raise errors[0] if len(errors) == 1 else errors.pop(0)

    Timer(0.1, fail, told.append)
    await asyncio.sleep(1)
    assert told == errors
