"""Statistics: how well the polling goes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from .frozen_mapping import FrozenMapping


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
        longest_stall: longest delay of a tick, in seconds: how long the event loop was blocked.
        reconnects: times the link was opened again.
        foreign_commands: commands of other clients that were seen.
        tick: what times the polls: "timerfd" (Linux) or "loop timer"; empty before the first poll.
        faults: times the gripper reported a minor or a major fault.
        moves: number of :meth:`RobotiqHand.move` calls by outcome: "reached", "contact", "cancelled", or the
            name of the error.
        passing_faults: times fault 0x09 was shown only briefly and ignored, as some grippers show it after a
            second without a poll.
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

    def __post_init__(self) -> None:
        object.__setattr__(self, "moves", FrozenMapping(self.moves))

    def as_dict(self) -> dict[str, Any]:
        """The figures in types that JSON and pandas accept, each under the name of its attribute."""
        return {**asdict(self), "moves": dict(self.moves)}


def percentile(ordered: list[float], share: float) -> float:
    """The value that this share of an ordered list does not exceed; 0 for an empty list."""
    return ordered[math.ceil(share * len(ordered)) - 1] if ordered else 0.0
