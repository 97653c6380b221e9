"""The seconds that a move may take if its caller has not said."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.calibration.scales import closing_time
from robotiq_async.local.session import usual_time
from robotiq_async.values.enums import Finger
from robotiq_async.values.model import THREE_FINGER
from tests.register_words import status_of

A, B, C, S = THREE_FINGER.axes
ABC = Finger.ABC

SLOWEST_S, FASTEST_S = 10.021, (2097 + 2122 + 2137) / 3000
"""A full closing, 6 to 241 (thesis, table A1.1, mean of three runs)."""


def timeout(position: int, axes: Finger, at: int | tuple[int, ...], speed: int | tuple[int, ...]) -> float:
    speeds = dict(zip(THREE_FINGER.axes, speed if isinstance(speed, tuple) else (speed,) * 4, strict=True))
    return usual_time(position, axes, status_of(0x31, position=at), speeds, closing_time)


@pytest.mark.parametrize(
    ("position", "axes", "at", "speed", "seconds"),
    [
        (241, ABC, 6, 0, SLOWEST_S),
        (6, ABC, 241, 0, SLOWEST_S),
        (241, ABC, 6, 255, FASTEST_S),
        (6, ABC, 241, 255, FASTEST_S),
        (118, A, 6, 0, SLOWEST_S * 112 / 235),  # half the distance
        (100, ABC, 100, 0, 0.0),
        # The slowest addressed axis counts, and no other.
        (241, A | B, 6, (255, 0, 255, 255), SLOWEST_S),
        (241, A | B, (240, 6, 6, 6), (0, 255, 0, 0), FASTEST_S),
        (241, A, 6, (255, 0, 0, 0), FASTEST_S),
    ],
)
def test_a_move_may_take_twice_the_measured_time_and_two_seconds(
    position: int, axes: Finger, at: int | tuple[int, ...], speed: int | tuple[int, ...], seconds: float
) -> None:
    assert timeout(position, axes, at, speed) == pytest.approx(2 * seconds + 2)


@given(st.integers(0, 255), st.integers(1, 15), st.integers(0, 255), st.integers(0, 255))
def test_any_move_may_take_at_least_the_margin_and_at_most_the_slowest_full_stroke(
    position: int, axes: int, at: int, speed: int
) -> None:
    seconds = timeout(position, Finger(axes), at, speed)
    assert 2.0 <= seconds <= 2 * SLOWEST_S * 255 / 235 + 2.0
