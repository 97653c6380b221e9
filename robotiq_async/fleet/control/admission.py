"""Admission: which requests are carried out. Pure: the caller says what time it is.

Nothing is carried out twice, late, out of turn, for a lease that has ended, for another run of the agent or
by the wrong gripper; a request that is refused says why.
"""

from __future__ import annotations

from typing import Final

from ...values.errors import AgentError, ControlLostError
from ..wire.envelope import Call
from .lease import Holder, Lease

_CLIENTS: Final = 1000
"""Clients that are remembered for repeated requests for the lease."""


class Admission:
    """What one gripper lets in.

    Attributes:
        lease: who may command.
    """

    def __init__(self, base: str, epoch: int, lease: Lease) -> None:
        self.lease = lease
        self._base = base
        self._epoch = epoch
        self._newest = 0
        """Number of the newest request let in under the present lease."""
        self._asked: dict[str, int] = {}
        """For each client, the number of the newest request for the lease."""

    def check_meant(self, call: Call, *, in_any_run: bool = False) -> None:
        """Refuse what is meant for another gripper, or another run of the agent if that matters.

        Raises:
            AgentError: it is.
        """
        if call.to != self._base:
            raise AgentError(f"a request for {call.to} was carried to {self._base}; nothing was done")
        if not in_any_run and call.epoch not in (0, self._epoch):
            raise AgentError("the agent has been started anew since this was asked; nothing was done")

    def admit(self, call: Call, now: float) -> None:
        """Let a command in, and count it, or say why not. The caller has ended a lease that has expired.

        Raises:
            ControlLostError: it is not the holder's, or it was on its way for too long; or the one before it
                has not come yet.
            AgentError: a later one came first.
        """
        self._check_holder(call, now)
        if call.number <= self._newest:
            raise AgentError("a later request overtook this one; nothing was done")
        if call.after > self._newest:
            raise ControlLostError(f"request {call.after} has not come yet; nothing was done", "early")
        self._newest = call.number
        self.lease.renew(call.seen)

    def is_repeated(self, call: Call) -> bool:
        """Whether a request for the lease has come before, and its sender holds the lease because of it.

        Raises:
            AgentError: it has come before, and the lease is another's by now.
        """
        before = self._asked.pop(call.client, -1)
        self._asked[call.client] = max(before, call.number)
        if len(self._asked) > _CLIENTS:
            del self._asked[next(iter(self._asked))]
        if call.number > before:
            return False
        holder = self.lease.holder
        if holder is None or holder.client != call.client or call.number < before:
            raise AgentError("the request for the lease came again; nothing was done")
        return True

    def acquire(self, call: Call, label: str) -> int:
        """Give the lease to a client; returns its number. The caller has ended what has to end.

        Raises:
            ControlLostError: another client holds it.
        """
        holder = self.lease.holder
        if holder is not None:
            raise ControlLostError(f"{holder.label} commands the gripper", "held")
        self._check_again(call)
        self._newest = call.number
        return self.lease.grant(Holder(call.client, label), call.seen)

    def renew(self, call: Call, now: float) -> None:
        """Prolong the lease.

        Raises:
            ControlLostError: as :meth:`admit`.
        """
        self._check_holder(call, now)
        self.lease.renew(call.seen)

    def release(self, call: Call, now: float) -> None:
        """Let a client give the lease back; also one that has done so, as long as nobody has come after it.

        Raises:
            ControlLostError: as :meth:`admit`.
        """
        if self.lease.is_released_by(call.client, call.lease):
            self.check_fresh(call, now)
        else:
            self.renew(call, now)

    def _check_again(self, call: Call) -> None:
        """Refuse a client that comes back by itself when somebody else has stepped in since it left.

        Raises:
            ControlLostError: somebody has.
        """
        again = call.arguments.get("again")
        if again is None:
            return
        is_known = type(again) is int and call.arguments.get("run") in self.lease.runs
        reason = self.lease.why_not_again(again if is_known else 0)
        if reason:
            raise ControlLostError(f"the gripper was {reason} since: acquire() it when people agree", reason)
        if not is_known:
            raise ControlLostError(
                "the agent was started anew, and does not know whether somebody has halted since: acquire() "
                "it when people agree",
                "restarted",
            )

    def is_of_holder(self, call: Call) -> bool:
        """Whether a request comes from who holds the lease, under this lease."""
        holder = self.lease.holder
        return holder is not None and holder.client == call.client and self.lease.number == call.lease

    def bar(self, call: Call) -> None:
        """Let nothing in any more that the holder asked before this."""
        self._newest = max(self._newest, call.number)

    def check_fresh(self, call: Call, now: float) -> None:
        """Refuse what was on its way for too long.

        Raises:
            ControlLostError: it was.
        """
        if not self.lease.is_fresh(call.seen, now):
            raise ControlLostError(
                f"the request was on its way for {now - call.seen:.1f} s, longer than the window of "
                f"{self.lease.window:g} s; nothing was done",
                "late",
            )

    def _check_holder(self, call: Call, now: float) -> None:
        if not self.is_of_holder(call):
            holder, reason = self.lease.holder, self.lease.end_of(call.lease)
            who = holder.label if holder is not None and holder.client != call.client else "nobody"
            raise ControlLostError(
                f"the lease has ended ({reason}), {who} commands the gripper now; nothing was done", reason
            )
        self.check_fresh(call, now)
