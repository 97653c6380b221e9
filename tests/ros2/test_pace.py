"""How many of the statuses are published."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest

from robotiq_async.ros2.node.timing import Pace


@pytest.mark.parametrize(
    ("rate", "jitter"), [(50, 0.0), (50, 0.0008), (200, 0.0004), (30, 0.0008), (1, 0.001)]
)
def test_as_many_as_were_asked_for(rate: float, jitter: float) -> None:
    pace, chance = Pace(rate), random.Random(1)
    polls = [n * 0.005 + chance.uniform(-jitter, jitter) for n in range(2000)]
    taken = [at for at in polls if pace.takes(at)]
    assert len(taken) == pytest.approx(10 * rate, rel=0.02)
    gaps = [later - sooner for sooner, later in pairwise(taken)]
    assert max(gaps) <= 1 / rate + 0.005 + 2 * jitter


def test_all_of_a_slower_hand() -> None:
    pace = Pace(200)
    assert all(pace.takes(n * 0.02) for n in range(100))


def test_what_a_gap_has_cost_is_not_made_up_for() -> None:
    pace = Pace(50)
    assert pace.takes(0.0)
    assert [pace.takes(9.0 + n * 0.005) for n in range(8)] == [True, False, False, False] * 2
