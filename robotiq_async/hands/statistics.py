"""Statistics: figures of the polling, and the counters behind them."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Final, Self

from ..values.errors import RobotiqError
from ..values.frozen_mapping import FrozenMapping
from ..values.move_result import MoveResult


@dataclass(frozen=True, slots=True)
class Statistics:
    """Figures of a hand's polling since its start. Percentiles cover the last 2000 polls.

    Attributes:
        polls: statuses read.
        writes: requests acknowledged.
        overruns: ticks that were missed; they are skipped.
        period_p50: median seconds between two polls; 0 before the second poll.
        period_p99: 99th percentile of that time.
        round_trip_p50: median seconds from sending a read to its reply; 0 before the first poll.
        round_trip_p99: 99th percentile of that time.
        longest_stall: longest delay of a tick: seconds for which the event loop was blocked.
        reconnects: times the link was opened again.
        foreign_commands: commands of other clients that were seen.
        tick: the timer of the polls: "timerfd" (Linux) or "loop timer"; empty before the first poll.
        faults: times the gripper reported a minor or a major fault.
        moves: number of :meth:`RobotiqHand.move` calls by outcome: "reached", "contact", "cancelled", or the
            name of the error.
        passing_faults: times fault 0x09 was reported only briefly and ignored: some grippers do so after a
            second without a poll.
        link_use: share of the time, 0..1, in which the hand waits for an answer; 1 for a link that is the
            limit.
        status_age_p50: median seconds from a read to the write that was decided on its status; 0 before
            the first write.
        status_age_p99: 99th percentile of that time.
    """

    polls: int
    writes: int
    overruns: int
    period_p50: float
    period_p99: float
    round_trip_p50: float
    round_trip_p99: float
    longest_stall: float
    reconnects: int
    foreign_commands: int
    tick: str
    faults: int
    moves: Mapping[str, int]
    passing_faults: int = 0
    link_use: float = 0.0
    status_age_p50: float = 0.0
    status_age_p99: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "moves", FrozenMapping(self.moves))

    def as_dict(self) -> dict[str, Any]:
        """The figures in types that JSON and pandas accept, each under the name of its attribute."""
        return {**asdict(self), "moves": dict(self.moves)}

    @classmethod
    def from_dict(cls, told: Mapping[str, Any]) -> Self:
        """The figures with this :meth:`as_dict`, perhaps of an older or a newer version of the library.

        Raises:
            TypeError: one is missing that every version has.
        """
        return cls(**{each.name: told[each.name] for each in fields(cls) if each.name in told})


def no_statistics() -> Statistics:
    """The figures before the first poll."""
    return Statistics(0, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0, "", 0, {})


def percentile(ordered: list[float], share: float) -> float:
    """The value that this share of an ordered list does not exceed; 0 for an empty list."""
    return ordered[math.ceil(share * len(ordered)) - 1] if ordered else 0.0


SAMPLES: Final = 2000  # the periods and round trips that percentiles are made from: 10 s at 200 Hz


@dataclass(slots=True)
class Counters:
    """Counts from one start to the next."""

    polls: int = 0
    writes: int = 0
    has_begun_to_write: bool = False  # whether a write was begun, acknowledged or not
    overruns: int = 0
    reconnects: int = 0
    longest_stall: float = 0.0
    tick: str = ""
    faults: int = 0
    moves: Counter[str] = field(default_factory=Counter)
    periods: deque[float] = field(default_factory=lambda: deque(maxlen=SAMPLES))
    round_trips: deque[float] = field(default_factory=lambda: deque(maxlen=SAMPLES))
    status_ages: deque[float] = field(default_factory=lambda: deque(maxlen=SAMPLES))
    _busy: float = 0.0  # seconds spent in exchanges since the last period began
    _busy_times: deque[float] = field(default_factory=lambda: deque(maxlen=SAMPLES))
    """The seconds of each period that were spent in exchanges."""

    def note_poll(self, asked: float, answered: float, period: float | None) -> None:
        """Count a poll; ``period`` is the time since the one before it, None if that is not to be counted."""
        self.polls += 1
        self.round_trips.append(answered - asked)
        if period is not None:
            self.periods.append(period)
            self._busy_times.append(self._busy)
        self._busy = answered - asked

    def note_write(self, took: float, age: float) -> None:
        """Count a write that was acknowledged; ``age`` is the age of the status it was decided on."""
        self.writes += 1
        self._busy += took
        self.status_ages.append(age)

    def note_begun_to_write(self) -> None:
        """A write leaves, acknowledged later or not."""
        self.has_begun_to_write = True

    def note_missed(self, ticks: int) -> None:
        self.overruns += ticks

    def note_stall(self, seconds: float) -> None:
        """Note the longest delay of a tick so far."""
        self.longest_stall = seconds

    def note_tick(self, source: str) -> None:
        self.tick = source

    def note_reconnect(self) -> None:
        self.reconnects += 1

    def note_fault(self) -> None:
        self.faults += 1

    @contextmanager
    def move(self) -> Iterator[Callable[[MoveResult], None]]:
        """Count a move by its outcome; call the function that this yields with its result."""
        outcome = "cancelled"

        def note(result: MoveResult) -> None:
            nonlocal outcome
            outcome = "contact" if result.object_detected else "reached"

        try:
            yield note
        except RobotiqError as error:
            outcome = type(error).__name__
            raise
        finally:
            self.moves[outcome] += 1

    def snapshot(self, foreign_commands: int, passing_faults: int = 0) -> Statistics:
        periods, round_trips = sorted(self.periods), sorted(self.round_trips)
        ages = sorted(self.status_ages)
        time = sum(periods)
        # Copies: a blocking hand is read in one thread while it polls in another.
        spent = zip(tuple(self.periods), tuple(self._busy_times), strict=False)
        busy = sum(min(each) for each in spent)
        return Statistics(
            polls=self.polls,
            writes=self.writes,
            overruns=self.overruns,
            period_p50=percentile(periods, 0.50),
            period_p99=percentile(periods, 0.99),
            round_trip_p50=percentile(round_trips, 0.50),
            round_trip_p99=percentile(round_trips, 0.99),
            longest_stall=self.longest_stall,
            reconnects=self.reconnects,
            foreign_commands=foreign_commands,
            tick=self.tick,
            faults=self.faults,
            moves=self.moves,
            passing_faults=passing_faults,
            link_use=busy / time if time else 0.0,
            status_age_p50=percentile(ages, 0.50),
            status_age_p99=percentile(ages, 0.99),
        )
