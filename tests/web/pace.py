"""The clock of a simulated gripper, which may run faster or slower than ours."""

from __future__ import annotations

from time import monotonic


class Pace:
    """To be called for the time there."""

    def __init__(self, rate: float = 1.0) -> None:
        """So many times as fast as ours."""
        self._rate = rate
        self._at = self._now = monotonic()

    def __call__(self) -> float:
        """The time there."""
        at = monotonic()
        self._now += self._rate * (at - self._at)
        self._at = at
        return self._now

    def set(self, rate: float) -> None:
        """From now on it runs so many times as fast as ours."""
        self()
        self._rate = rate
