"""How a lost link is opened again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from ..values.checks import check_seconds

SHORTEST_S: Final = 0.01
"""The shortest time between two tries."""


@dataclass(frozen=True, slots=True)
class ReconnectPolicy:
    """How a lost link is opened again.

    Attributes:
        first_delay: seconds before the first try, 0..10.
        max_delay: the delay doubles up to this, in seconds, 0.01..60.
        give_up_after: seconds after which the hand gives up; None tries for ever.
        activate: whether a gripper that comes back without its activation is activated. The fingers MOVE
            then, at a moment that you do not choose: leave it off unless nothing can be in their way.
    """

    first_delay: float = 0.05
    max_delay: float = 2.0
    give_up_after: float | None = None
    activate: bool = False

    def __post_init__(self) -> None:
        """Check the values, and keep them as plain floats.

        Raises:
            TypeError: not a number, or activate is not a bool.
            ValueError: outside its range.
        """
        self._keep("first_delay", 0.0, 10.0)
        self._keep("max_delay", 0.01, 60.0)
        if self.give_up_after is not None:
            self._keep("give_up_after", 0.0, 86400.0)
        if not isinstance(self.activate, bool):
            raise TypeError(f"activate must be True or False, got {self.activate!r}")

    def _keep(self, name: str, low: float, high: float) -> None:
        object.__setattr__(self, name, check_seconds(name, getattr(self, name), low, high))


class Backoff:
    """The delays of one attempt to get a link back.

    Attributes:
        since: when the link was lost, in seconds of the caller's clock.
        delay: seconds until the next try.
    """

    def __init__(self, policy: ReconnectPolicy, since: float) -> None:
        self._policy = policy
        self.since = since
        self.delay = policy.first_delay

    def gives_up(self, now: float) -> bool:
        """Whether the try that has just failed was the last one. If not, lengthen the delay.

        The last try begins when ``give_up_after`` is over, and no later.
        """
        limit = self._policy.give_up_after
        self.delay = min(max(2 * self.delay, SHORTEST_S), self._policy.max_delay)
        if limit is None:
            return False
        left = self.since + limit - now
        self.delay = min(self.delay, max(left, 0.0))
        return left <= 0
