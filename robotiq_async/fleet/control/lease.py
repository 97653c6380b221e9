"""Lease: the right of one client to command a gripper, until a time. Pure: the caller passes the time.

All times are the agent's own, and the arrival of a message never counts: each message proves which stamp of
the agent its sender has received, and the lease lasts until ``window`` seconds after that stamp. So a message
that was stuck in the network prolongs nothing, and a link that is dead in one direction ends the lease like
one that is dead in both.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

LEASE_WINDOW_S: Final = 1.0
"""Seconds that a lease lasts beyond the newest stamp that its holder has proven to have received."""
WINDOW_MIN_S: Final = 0.1
WINDOW_MAX_S: Final = 10.0
_ENDS_KEPT: Final = 64  # leases whose reason for ending is kept
_RUNS_KEPT: Final = 64  # runs of the agent that are kept: a client may reacquire a lease of one of these


@dataclass(frozen=True, slots=True)
class Holder:
    """The client that commands."""

    client: str  # random, chosen by the client
    label: str  # the client's own: user, host, process


class Lease:
    """The right to command one gripper.

    Attributes:
        window: seconds.
        number: rises with each change of holder, also when the lease ends. A request is refused unless it
            names the present number.
        holder: the client that holds it; None if free.
        runs: the runs of the agent in which the numbers were given.
    """

    def __init__(
        self, window: float = LEASE_WINDOW_S, run: int = 0, changed: Callable[[], object] = lambda: None
    ) -> None:
        self.window = window
        self.runs: tuple[int, ...] = (run,)
        self._changed = changed
        self.number: int = 0
        self.holder: Holder | None = None
        self._proven = 0.0
        self._awake_since = 0.0
        self._ends: dict[int, str] = {}
        self._last = ""
        """The client that held it last; ``_last_from`` is the first lease number of its present series."""
        self._last_from = 0
        self._barred = -1, ""  # leases up to this number may not be reacquired automatically, for this reason

    @property
    def expires(self) -> float:
        """The agent's time at which the lease ends unless renewed; valid while a client holds it."""
        return self._proven + self.window

    def has_expired(self, now: float) -> bool:
        return self.holder is not None and now > self.expires

    def is_fresh(self, seen: float, now: float) -> bool:
        # A stamp from the future was not received from this run of the agent: it proves nothing.
        return max(now - self.window, self._awake_since) <= seen <= now

    def grant(self, holder: Holder, seen: float) -> int:
        """Give the free lease to a client; returns its number."""
        self.number += 1
        self.holder = holder
        if holder.client != self._last:
            self._last, self._last_from = holder.client, self.number
        self._proven = seen
        self._changed()
        return self.number

    def renew(self, seen: float) -> None:
        # A message that was overtaken proves an older stamp, which must not shorten the lease.
        self._proven = max(self._proven, seen)

    def end(self, reason: str) -> Holder | None:
        """Take the lease from its holder; returns the former holder."""
        holder, self.holder = self.holder, None
        if holder is not None:
            self._ends[self.number] = reason
            self._ends.pop(self.number - _ENDS_KEPT, None)
            self.number += 1
            self._changed()
        return holder

    def wake(self, now: float) -> None:
        # The clock stopped while the machine was suspended: older stamps look fresh, but are not.
        self._awake_since = now

    def intervene(self, client: str, reason: str) -> None:
        """Bar present and former holders from reacquiring automatically after a halt or a take.

        Call it before the lease is ended or granted.
        """
        # A halt by the last holder itself bars all others, but not its own series of leases.
        number = self.number if client != self._last else self._last_from - 1
        if number >= self._barred[0]:
            self._barred = number, reason
            self._changed()

    @property
    def record(self) -> dict[str, object]:
        """The state for the next run of the agent."""
        return {"runs": self.runs, "number": self.number, "barred": self._barred}

    def resume(self, record: Mapping[str, Any]) -> None:
        """Continue from the record of an earlier run. KeyError, TypeError, ValueError: it is malformed."""
        number, (barred, reason) = int(record["number"]), record["barred"]
        runs = tuple(int(run) for run in record["runs"])
        self.runs = (*runs, *self.runs)[-_RUNS_KEPT:]
        # The lease that was held at the end of that run ended with it.
        self.number, self._barred = number + 1, (int(barred), str(reason))

    def why_not_again(self, number: int) -> str:
        """The reason why the lease of a number may not be reacquired automatically; empty if it may."""
        barred, reason = self._barred
        return reason if number <= barred else ""

    def is_released_by(self, client: str, number: int) -> bool:
        """Whether the newest lease has this number, and this client has released it."""
        is_last = self.holder is None and client == self._last and number == self.number - 1
        return is_last and self._ends.get(number) == "released"

    def end_of(self, number: int) -> str:
        return self._ends.get(number, "expired")
