"""MotionProfile: the motion of an axis in time, with the source of its figures and the number of runs.

The one place for the speeds of the models: :class:`~.scales.SpeedCalibration` is computed from a profile, and
the simulator moves by it.
"""

# Theory of operation
#
# A motion of a jaw is: from a rest a start, during which nothing moves; the way, at a constant rate; before
# an end stop a landing at the slowest rate; and at a part, and at the closed stop, the time for which it
# presses until the end is reported. Each is a straight line in time. Of the shapes that were tried on the
# recordings this one came within 4.4 % of every row at the speeds 0, 128 and 255, and within 5.6 % at 64; a
# constant acceleration within 9 %, the manual's speeds alone within 50 %. It describes one gripper and is no
# law: with one row left out, that row was predicted within 2.9 % on average, and 7.7 % at worst.

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Final

from ..values.model import TWO_FINGER_85, Model

PRESSING_S: Final = 0.05
"""Seconds for which a finger of a 3-Finger presses before it reports a contact: no source gives them."""

GOES_ON_S: Final = 0.2
"""Seconds of rest within which an axis that continues in the same direction needs no start: an assumption.
The recorded motions were strokes to and fro, and none was a stream of small steps."""

# One 2F-85 read 225 closed at force 0 and speed 0, 226 at higher speeds and at force 30, another one 228 at
# 64, and 230 from 80 on.
SHORT_OF_CLOSED: Final = 3
"""Counts by which a jaw that closes with the least force, slowly, reads less than its nominal reading."""
_FIRM: Final = 80
"""The least force that presses the closed stop as far as any."""
_OVERREADING: Final = 0.6
"""Counts that the closed stop reads further at full speed."""
_BETWEEN: Final = 0.8
"""Share of a count at which the closed stop of that gripper lies, from one reading to the next."""


@dataclass(frozen=True, slots=True)
class MotionProfile:
    """The motion of an axis. Immutable.

    Attributes:
        source: of the figures, for people.
        runs: recorded motions behind them; 0 for an estimate.
        rates: counts a second on the way, at each speed value 0..255.
        start_closing_s: seconds from a request at rest to the first motion, if it closes.
        start_opening_s: the same if it opens.
        landing: counts before an end stop that it travels at the slowest rate.
        pressing: it presses for the time of this many counts before it reports a contact or the closed stop.
        pressing_s: seconds that it presses in addition.
        overrun: counts by which a contact at full speed reads further than a slow one.
        give: counts by which the greatest force presses the closed stop further than the least.
    """

    source: str
    runs: int
    rates: tuple[float, ...] = field(repr=False)
    start_closing_s: float = 0.0
    start_opening_s: float = 0.0
    landing: float = 0.0
    pressing: float = 0.0
    pressing_s: float = 0.0
    overrun: float = 0.0
    give: float = 0.0

    @classmethod
    def of_closings(cls, source: str, runs: int, counts: int, seconds: Iterable[float]) -> MotionProfile:
        """The profile in the seconds of full closings at each speed value: one straight line a motion."""
        return cls(source, runs, tuple(counts / each for each in seconds), pressing_s=PRESSING_S)

    @property
    def is_straight(self) -> bool:
        """Whether a motion is one straight line, without a start and a landing."""
        return not (self.landing or self.start_closing_s or self.start_opening_s or self.pressing)

    @property
    def slowest(self) -> float:
        """Counts a second at speed 0."""
        return self.rates[0]

    @property
    def fastest(self) -> float:
        """Counts a second at speed 255."""
        return self.rates[-1]

    def start_s(self, *, closing: bool) -> float:
        """Seconds from a request to the first motion."""
        return self.start_closing_s if closing else self.start_opening_s

    def pressing_time(self, rate: float) -> float:
        """Seconds for which it presses after a way at this rate, in counts a second."""
        return self.pressing_s + self.pressing / rate

    def overrun_at(self, rate: float) -> float:
        """Counts by which a contact reads further after a way at this rate, in counts a second."""
        return float(self.overrun * (rate / self.fastest) ** 3)

    def give_at(self, force: int, rate: float) -> int:
        """Counts by which the closed stop reads further at a force, and after a way at this rate."""
        if not self.give:
            return 0
        return int(_BETWEEN + min(1.0, force / _FIRM) ** 3 * self.give + _OVERREADING * rate / self.fastest)

    def closing_s(self, counts: float, speed: int) -> float:
        """Seconds from a request at rest to the reported end, closing by so many counts to the stop."""
        return self.start_closing_s + self._way_s(counts, speed) + self.pressing_time(self.rates[speed])

    def opening_s(self, counts: float, speed: int) -> float:
        """Seconds from a request at rest to the reported end, opening by so many counts to the stop."""
        return self.start_opening_s + self._way_s(counts, speed)

    def _way_s(self, counts: float, speed: int) -> float:
        landing = min(self.landing, counts)
        return (counts - landing) / self.rates[speed] + landing / self.slowest


def _straight(slow: float, fast: float) -> tuple[float, ...]:
    return tuple(slow + (fast - slow) * value / 255 for value in range(256))


RECORDED_85: Final = MotionProfile(
    # "Thunder": strokes and contacts at the speeds 0, 64, 128 and 255, sampled every 6.5 ms at a URCap; the
    # start took 69 to 93 ms closing and 122 to 146 ms opening. Closed readings: the same, xcore and Dobot.
    "recorded on one 2F-85",
    50,
    _straight(54.6, 365.0),
    start_closing_s=0.082,
    start_opening_s=0.134,
    landing=6.5,
    pressing=8.4,
    overrun=6.0,
    give=4.4,
)
"""The motion of a 2F-85 with TPU fingertips, from public recordings."""


@cache
def profile_of(model: Model) -> MotionProfile | None:
    """The profile of a jaw; None for a 3-Finger, of which closing times alone were measured."""
    if model.has_modes:
        return None
    if model.name == TWO_FINGER_85.name:
        return RECORDED_85
    slow, fast = (speed * model.stroke.counts / model.stroke.mm for speed in model.speeds_mm_s)
    source = "estimate: the manual's speeds, starts and ends of a 2F-85"
    return replace(RECORDED_85, source=source, runs=0, rates=_straight(slow, fast))
