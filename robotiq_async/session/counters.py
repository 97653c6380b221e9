"""The counters behind :class:`Statistics`."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final

from ..values.errors import RobotiqError
from ..values.move_result import MoveResult
from ..values.statistics import Statistics, percentile

SAMPLES: Final = 2000
"""The periods and round trips that percentiles are made from: 10 s at 200 Hz."""


@dataclass(slots=True)
class Counters:
    """Counts from one start to the next."""

    polls: int = 0
    writes: int = 0
    has_begun_to_write: bool = False
    """Whether a write was begun, acknowledged or not."""
    overruns: int = 0
    reconnects: int = 0
    longest_stall: float = 0.0
    tick: str = ""
    faults: int = 0
    moves: Counter[str] = field(default_factory=Counter)
    periods: deque[float] = field(default_factory=lambda: deque(maxlen=SAMPLES))
    round_trips: deque[float] = field(default_factory=lambda: deque(maxlen=SAMPLES))

    @contextmanager
    def move(self) -> Iterator[Callable[[MoveResult], None]]:
        """Count how a move ends; call the function that this yields with its result."""
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
        )
