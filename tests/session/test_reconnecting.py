"""What becomes of a lost link: how long between two tries, and when it is given up."""

from __future__ import annotations

import pytest

from robotiq_async.session.opening import SHORTEST_S, Backoff
from robotiq_async.session.options import ReconnectPolicy


def delays(policy: ReconnectPolicy, tries: int) -> list[float]:
    backoff, found = Backoff(policy, 0.0), []
    for _ in range(tries):
        found.append(backoff.delay)
        backoff.gives_up(0.0)
    return found


def test_a_first_try_at_once_is_not_followed_by_others_at_once() -> None:
    assert delays(ReconnectPolicy(0.0, 1.0), 4) == [0.0, SHORTEST_S, 2 * SHORTEST_S, 4 * SHORTEST_S]


def test_the_delay_is_never_above_its_limit_however_large_the_first_one_was() -> None:
    assert delays(ReconnectPolicy(5.0, 0.3), 3) == [5.0, 0.3, 0.3]


def test_it_is_given_up_after_a_try_that_fails_when_the_time_is_over() -> None:
    backoff = Backoff(ReconnectPolicy(give_up_after=10.0), since=100.0)
    assert not backoff.gives_up(109.9)
    assert backoff.gives_up(110.0)


def test_it_is_tried_for_ever_unless_said_otherwise() -> None:
    assert not Backoff(ReconnectPolicy(), since=0.0).gives_up(1e9)


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("first_delay", -0.1, ValueError),
        ("max_delay", 0.0, ValueError),
        ("max_delay", 61.0, ValueError),
        ("give_up_after", float("nan"), ValueError),
        ("activate", 1, TypeError),
        ("first_delay", "soon", TypeError),
        ("max_delay", True, TypeError),
    ],
)
def test_a_policy_with_a_wrong_value_is_refused(name: str, value: object, error: type[Exception]) -> None:
    with pytest.raises(error, match=name):
        ReconnectPolicy(**{name: value})  # type: ignore[arg-type]
