"""LeaseState: this client's part of the lease, and how each event changes it."""

# The agent decides who holds the lease. This is the client's view of it, which may be late: a lease that has
# ended unnoticed is refused with the next request. A client must not get a lease back by itself that people
# have given to another client, or that it has released: only an explicit acquire() leads out of READS.
#
#   READS       holds nothing, and tries nothing.
#   SEEKS       holds nothing, and tries until the lease is granted or refused for good.
#   HOLDS       holds it. If it is lost by silence or a restart of the agent, the client seeks it again.
#   HOLDS_LAST  holds it, but will not seek it again: two agents serve the gripper, and this lease may be that
#               of the wrong gripper.
#   OVER        the run ends. A lease that is granted now is not renewed, and expires.

from __future__ import annotations

from enum import Enum, auto
from typing import Final

from ...values.errors import ControlLostError

OVERRULING: Final = ("taken", "halted", "held", "restarted")
"""Reasons after which people decide which client commands: only an explicit acquire() gets the lease."""


class LeaseState(Enum):
    """States of the client's side of the lease."""

    READS = auto()
    SEEKS = auto()
    HOLDS = auto()
    HOLDS_LAST = auto()
    OVER = auto()


class LeaseEvent(Enum):
    """Events for the client's side of the lease; the order is that of the columns of the table."""

    GRANTED = auto()
    LOST = auto()  # silence, or another reason without intention
    OVERRULED = auto()  # another client, a halt, or a new run of the agent
    RELEASED = auto()
    DOUBTED = auto()  # a second agent was seen
    ENDED = auto()


_R, _S, _H, _L, _O = LeaseState
_TABLE: Final = {
    state: dict(zip(LeaseEvent, targets, strict=True))
    for state, targets in {
        #   GRANTED LOST OVERRULED RELEASED DOUBTED ENDED
        _R: (_H, _R, _R, _R, _R, _O),
        _S: (_H, _S, _R, _R, _R, _O),
        _H: (_H, _S, _R, _R, _L, _O),
        _L: (_H, _R, _R, _R, _L, _O),
        _O: (_O, _O, _O, _O, _O, _O),
    }.items()
}

_EVENTS: Final = {"released": LeaseEvent.RELEASED, **dict.fromkeys(OVERRULING, LeaseEvent.OVERRULED)}


class ClientLease:
    """The client's side of the lease in one run.

    Attributes:
        state: see the table.
        number: of the lease that the client holds, or held last.
        run: the run of the agent that gave the number.
        lost: why the client lost control; None while it is in control, and if it never was.
    """

    def __init__(self, name: str) -> None:
        self.state = LeaseState.READS
        self.number = 0
        self.run = 0
        self.lost: ControlLostError | None = None
        self._name = name

    @property
    def is_held(self) -> bool:
        return self.state in (LeaseState.HOLDS, LeaseState.HOLDS_LAST)

    @property
    def is_over(self) -> bool:
        return self.state is LeaseState.OVER

    def grant(self, number: int, run: int) -> None:
        self.number, self.run = number, run
        self._take(LeaseEvent.GRANTED)
        if self.is_held:
            self.lost = None

    def lose(self, reason: str, why: str) -> bool:
        """The lease has ended; returns whether it was held until now."""
        if not self.is_held:
            return False
        self._take(_EVENTS.get(reason, LeaseEvent.LOST))
        self.lost = ControlLostError(f"lost control of {self._name}: {why}", reason)
        return True

    def refuse(self, error: ControlLostError) -> None:
        """The agent refused to give the lease back, because another client was first or intervened."""
        if self.state is LeaseState.SEEKS:
            self._take(LeaseEvent.OVERRULED)
            self.lost = error

    def release(self) -> None:
        """Give up the lease, or the attempts to get it."""
        if not self.lose("released", "it was released"):
            self._take(LeaseEvent.RELEASED)

    def doubt(self) -> None:
        self._take(LeaseEvent.DOUBTED)

    def end(self) -> None:
        self._take(LeaseEvent.ENDED)

    def check(self) -> None:
        """Refuse a command without the lease.

        Raises:
            ControlLostError: always a new one, so that no traceback grows.
        """
        if not self.is_held:
            if self.lost is None:
                raise ControlLostError("this hand only reads: acquire() the lease first", "released")
            raise ControlLostError(str(self.lost), self.lost.reason)

    def _take(self, event: LeaseEvent) -> None:
        self.state = _TABLE[self.state][event]
