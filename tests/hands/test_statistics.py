"""Figures about the polling."""

from __future__ import annotations

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.hands.statistics import SAMPLES, Counters, Statistics


def test_before_the_first_poll_every_figure_is_zero() -> None:
    numbers = {field.name: 0 for field in dataclasses.fields(Statistics)}
    assert Counters().snapshot(0) == Statistics(**numbers | {"tick": "", "moves": {}})  # type: ignore[arg-type]


def test_a_snapshot_tells_each_counter_under_its_own_name() -> None:
    counters = Counters()
    counters.polls = 1
    counters.writes = 2
    counters.overruns = 3
    counters.reconnects = 4
    counters.longest_stall = 0.5
    counters.tick = "timerfd"
    counters.faults = 9
    counters.moves["reached"] = 10
    counters.periods.append(0.006)
    counters.round_trips.append(0.007)
    counters.status_ages.append(0.004)
    assert dataclasses.asdict(counters.snapshot(8, 11)) == {
        "polls": 1,
        "writes": 2,
        "overruns": 3,
        "reconnects": 4,
        "longest_stall": 0.5,
        "period_p50": 0.006,
        "period_p99": 0.006,
        "round_trip_p50": 0.007,
        "round_trip_p99": 0.007,
        "foreign_commands": 8,
        "tick": "timerfd",
        "faults": 9,
        "moves": {"reached": 10},
        "passing_faults": 11,
        "link_use": 0.0,
        "status_age_p50": 0.004,
        "status_age_p99": 0.004,
    }


def test_the_link_is_in_use_while_an_answer_is_awaited() -> None:
    counters = Counters()
    counters.note_poll(10.000, 10.002, None)
    counters.note_write(0.001, age=0.002)
    counters.note_poll(10.006, 10.008, 0.006)
    counters.note_poll(10.012, 10.014, 0.006)
    figures = counters.snapshot(0)
    assert figures.link_use == pytest.approx((0.003 + 0.002) / 0.012)
    assert (figures.polls, figures.writes) == (3, 1)
    assert figures.status_age_p50 == 0.002


def test_a_hurried_cycle_is_no_period() -> None:
    counters = Counters()
    counters.note_poll(10.000, 10.002, None)
    counters.note_poll(10.003, 10.005, None)
    assert counters.snapshot(0).link_use == 0


def test_percentiles_of_round_trips_are_those_of_periods() -> None:
    counters = Counters()
    counters.periods.extend((n * 617 % 1001) / 1000 for n in range(1001))
    counters.round_trips.extend(n / 1000 for n in range(1000, -1, -1))
    figures = counters.snapshot(0)
    assert figures.period_p50 == figures.round_trip_p50 == 0.5
    assert figures.period_p99 == figures.round_trip_p99 == 0.99


@given(st.lists(st.floats(0, 10), min_size=1, max_size=300))
def test_percentiles_are_measured_values_in_order(values: list[float]) -> None:
    counters = Counters()
    counters.periods.extend(values)
    figures = counters.snapshot(0)
    assert figures.period_p50 in values
    assert figures.period_p99 in values
    assert min(values) <= figures.period_p50 <= figures.period_p99 <= max(values)
    assert sum(value <= figures.period_p50 for value in values) >= len(values) / 2
    assert sum(value <= figures.period_p99 for value in values) >= 0.99 * len(values)


def test_only_the_last_samples_count_and_a_snapshot_does_not_change_with_later_ones() -> None:
    counters = Counters()
    counters.polls = 5
    counters.periods.extend([9.0] * 100 + [0.005] * SAMPLES)
    counters.round_trips.extend([9.0] * 100 + [0.001] * SAMPLES)
    figures = counters.snapshot(0)
    counters.polls = 6
    counters.periods.append(1.0)
    assert (figures.polls, figures.period_p99, figures.round_trip_p99) == (5, 0.005, 0.001)
    assert len(counters.periods) == len(counters.round_trips) == SAMPLES


def test_a_snapshot_is_taken_while_the_polling_counts_on() -> None:
    """As that of a blocking hand, which polls in another thread."""

    class Counting(float):
        def __lt__(self, other: object) -> bool:
            counters.note_poll(0.0, 0.001, 0.005)
            return False

    counters = Counters()
    counters.periods.extend([Counting(0.005), Counting(0.005)])
    counters._busy_times.extend([0.001, 0.001])
    assert counters.snapshot(0).link_use > 0
    assert counters.polls > 0
