"""Work at a rate, and the number of statuses that are published."""

from __future__ import annotations

import asyncio
import random
from itertools import pairwise

import pytest

from robotiq_async import NotStartedError
from robotiq_async.ros2.node.timing import Pace, Timer
from tests.virtual import VirtualLoop

pytestmark = pytest.mark.virtual_time


async def test_a_timer_goes_on_until_it_is_cancelled_and_skips_what_a_hold_up_has_cost() -> None:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    began, done, errors = loop.time(), list[float](), list[BaseException]()
    timer = Timer(0.1, lambda: done.append(loop.time() - began), errors.append)
    await asyncio.sleep(0.25)
    loop.hold_up(1.0)
    await asyncio.sleep(0.15)
    timer.cancel()
    await asyncio.sleep(1)
    assert done == pytest.approx([0.0, 0.1, 0.2, 1.25, 1.35])
    assert not errors


async def test_a_stopped_hand_is_ignored_and_any_other_error_is_reported_once() -> None:
    errors: list[Exception] = [NotStartedError("the hand was stopped"), ValueError("not expected")]
    reported: list[BaseException] = []

    def fail() -> None:
        raise errors[0] if len(errors) == 1 else errors.pop(0)

    Timer(0.1, fail, reported.append)
    await asyncio.sleep(1)
    assert reported == errors


@pytest.mark.parametrize(("rate", "jitter"), [(50, 0.0), (50, 0.0008), (200, 0.0004), (1, 0.001)])
def test_as_many_as_were_asked_for(rate: float, jitter: float) -> None:
    pace, chance = Pace(rate), random.Random(1)
    polls = [n * 0.005 + chance.uniform(-jitter, jitter) for n in range(2000)]
    taken = [at for at in polls if pace.takes(at)]
    assert len(taken) == pytest.approx(10 * rate, rel=0.02)
    gaps = [later - sooner for sooner, later in pairwise(taken)]
    assert max(gaps) <= 1 / rate + 0.005 + 2 * jitter


def test_all_of_a_slower_hand_and_no_more_after_a_gap() -> None:
    pace = Pace(200)
    assert all(pace.takes(n * 0.02) for n in range(100))
    pace = Pace(50)
    assert pace.takes(0.0)
    assert [pace.takes(9.0 + n * 0.005) for n in range(8)] == [True, False, False, False] * 2
