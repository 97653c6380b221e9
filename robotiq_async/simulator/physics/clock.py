"""The gripper's own time: simulated seconds since it was made."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from robotiq_async.values.checks import check_seconds

if TYPE_CHECKING:
    from collections.abc import Callable

_FASTEST: Final = 1e9


class Clock:
    """Makes simulated seconds of a clock's.

    Attributes:
        speedup: simulated seconds in one second of the clock.
    """

    def __init__(self, real: Callable[[], float], speedup: float) -> None:
        """A clock that begins at 0 now.

        Raises:
            TypeError: speedup is not a number.
            ValueError: speedup is not above 0.
        """
        self._real = real
        self.speedup = check_seconds("speedup", speedup, 0, _FASTEST)
        if self.speedup == 0:
            raise ValueError(f"speedup must be above 0, got {speedup!r}")
        self._began = real()

    @property
    def now(self) -> float:
        """Simulated seconds since the beginning."""
        return (self._real() - self._began) * self.speedup
