"""Lease: who may command a gripper, and until when. Pure: the caller says what time it is.

The time is the agent's own, and it never counts from the arrival of a message: a holder proves with each
message which stamp of the agent it has heard, and holds the lease until ``window`` seconds after that stamp.
So a message that was stuck in the network prolongs nothing, and a link that is dead in one direction ends the
lease as well as one that is dead in both.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

WINDOW_S: Final = 1.0
"""How long a holder stays one without having proven to hear the agent."""
WINDOW_MIN_S: Final = 0.1
WINDOW_MAX_S: Final = 10.0
_KEPT: Final = 64
"""For how many of the last leases it is known why they ended."""
_RUNS: Final = 64
"""For how many of the last runs of the agent who comes back is known."""


@dataclass(frozen=True, slots=True)
class Holder:
    """Who commands.

    Attributes:
        client: tells one client from all others; made up at random by the client.
        label: the client's words about itself: user, host, process.
    """

    client: str
    label: str


class Lease:
    """The right to command one gripper.

    Attributes:
        window: seconds.
        number: counts the changes of holder, also the change to nobody. A request names the number of the
            lease it was made under, and no other is carried out.
        holder: who holds it; None for nobody.
        runs: those of the agent that its numbers are of.
    """

    def __init__(
        self, window: float = WINDOW_S, run: int = 0, changed: Callable[[], object] = lambda: None
    ) -> None:
        self.window = window
        self.runs: tuple[int, ...] = (run,)
        self._changed = changed
        self.number = 0
        self.holder: Holder | None = None
        self._proven = 0.0
        self._awake_since = 0.0
        self._ends: dict[int, str] = {}
        self._last = ""
        """The client that held it last, and the number of its first lease in a row."""
        self._last_from = 0
        self._barred = -1, ""
        """Number of the newest lease whose holder may not come back by itself, and why."""

    @property
    def expires(self) -> float:
        """The agent's time at which the lease ends unless it is renewed; only while somebody holds it."""
        return self._proven + self.window

    def has_expired(self, now: float) -> bool:
        """Whether a lease is held that nobody has renewed in time."""
        return self.holder is not None and now > self.expires

    def is_fresh(self, seen: float, now: float) -> bool:
        """Whether whoever has heard of ``seen`` has heard it within the window, and not from the future."""
        return max(now - self.window, self._awake_since) <= seen <= now

    def grant(self, holder: Holder, seen: float) -> int:
        """Give a lease that nobody holds to a client; returns its number."""
        self.number += 1
        self.holder = holder
        if holder.client != self._last:
            self._last, self._last_from = holder.client, self.number
        self._proven = seen
        self._changed()
        return self.number

    def renew(self, seen: float) -> None:
        """The holder has proven to have heard a stamp of the agent; an older one changes nothing."""
        self._proven = max(self._proven, seen)

    def end(self, reason: str) -> Holder | None:
        """Take the lease from whoever holds it; returns who that was."""
        holder, self.holder = self.holder, None
        if holder is not None:
            self._ends[self.number] = reason
            self._ends.pop(self.number - _KEPT, None)
            self.number += 1
            self._changed()
        return holder

    def wake(self, now: float) -> None:
        """The machine was suspended, and its clock with it: nothing from before that is fresh any more."""
        self._awake_since = now

    def intervene(self, client: str, reason: str) -> None:
        """A client has halted the gripper, or taken the lease: who held it before does not return by itself.

        Call it before the lease is ended or granted. The last holder's own halt bars all but itself.
        """
        number = self.number if client != self._last else self._last_from - 1
        if number >= self._barred[0]:
            self._barred = number, reason
            self._changed()

    @property
    def record(self) -> dict[str, object]:
        """What the next run of the agent has to know."""
        return {"runs": self.runs, "number": self.number, "barred": self._barred}

    def resume(self, record: Mapping[str, Any]) -> None:
        """Go on from what a run before this one has left.

        Raises:
            KeyError, TypeError, ValueError: it has left something else.
        """
        number, (barred, reason) = int(record["number"]), record["barred"]
        runs = tuple(int(run) for run in record["runs"])
        self.runs = (*runs, *self.runs)[-_RUNS:]
        # The lease that was held when that run ended has ended with it.
        self.number, self._barred = number + 1, (int(barred), str(reason))

    def why_not_again(self, number: int) -> str:
        """Why who held the lease of a number may not come back by itself; empty if it may."""
        barred, reason = self._barred
        return reason if number <= barred else ""

    def is_released_by(self, client: str, number: int) -> bool:
        """Whether a client has given back the lease of a number, and it was the last one."""
        is_last = self.holder is None and client == self._last and number == self.number - 1
        return is_last and self._ends.get(number) == "released"

    def end_of(self, number: int) -> str:
        """Why the lease of a number ended."""
        return self._ends.get(number, "expired")
