"""Admission: decides which requests are carried out. Pure: the caller passes the time.

Nothing is carried out twice, late, out of order, under a lease that has ended, for another run of the agent
or by the wrong gripper. A refusal states the reason.
"""

from __future__ import annotations

from typing import Final

from ..errors import AgentError, ControlLostError
from ..wire.envelope import AgentCall
from .lease import Holder, Lease

_MOST_CLIENTS: Final = 1000
"""Clients whose last request for the lease is kept, to recognize repetitions. Bounds the memory: any program
can make up clients."""


class Admission:
    """The requests that one gripper accepts."""

    def __init__(self, base: str, epoch: int, lease: Lease) -> None:
        self.lease = lease
        self._base = base
        self._epoch = epoch
        self._newest = 0  # number of the newest request admitted under the present lease
        self._by_client: dict[str, int] = {}  # number of the newest request for the lease, by client

    def check_meant(self, call: AgentCall, *, in_any_run: bool = False) -> None:
        if call.to != self._base:
            raise AgentError(f"a request for {call.to} was carried to {self._base}")
        if not in_any_run and call.epoch not in (0, self._epoch):
            raise AgentError("the agent was restarted since this request was made")

    def admit(self, call: AgentCall, now: float) -> None:
        """Accept a command and count it, or raise. The caller has ended an expired lease first."""
        self._check_holder(call, now)
        if call.number <= self._newest:
            raise AgentError("a later request overtook this one")
        if call.after > self._newest:
            raise ControlLostError(f"request {call.after} has not come yet", "early")
        self._newest = call.number
        self.lease.renew(call.seen)

    def is_repeated(self, call: AgentCall) -> bool:
        """Whether a request for the lease is a repetition of the one that gave its sender the present lease.

        Raises:
            AgentError: a repetition, but its sender does not hold the lease now.
        """
        before = self._by_client.pop(call.client, -1)
        self._by_client[call.client] = max(before, call.number)
        if len(self._by_client) > _MOST_CLIENTS:
            del self._by_client[next(iter(self._by_client))]
        if call.number > before:
            return False
        holder = self.lease.holder
        if holder is None or holder.client != call.client or call.number < before:
            raise AgentError("the request for the lease was repeated")
        return True

    def acquire(self, call: AgentCall, label: str) -> int:
        """Give the lease to a client; returns its number. The caller ends the previous lease first."""
        holder = self.lease.holder
        if holder is not None:
            raise ControlLostError(f"{holder.label} commands the gripper", "held")
        self._check_again(call)
        self._newest = call.number
        return self.lease.grant(Holder(call.client, label), call.seen)

    def renew(self, call: AgentCall, now: float) -> None:
        self._check_holder(call, now)
        self.lease.renew(call.seen)

    def release(self, call: AgentCall, now: float) -> None:
        # The holder may repeat its release, or strengthen it, as long as no other client has acquired the
        # lease.
        if self.lease.is_released_by(call.client, call.lease):
            self.check_fresh(call, now)
        else:
            self.renew(call, now)

    def _check_again(self, call: AgentCall) -> None:
        # A client that reacquires the lease automatically ("again") must not undo a halt or a take that came
        # in the meantime. Only an explicit acquire() may.
        again = call.arguments.get("again")
        if again is None:
            return
        is_known = type(again) is int and call.arguments.get("run") in self.lease.runs
        reason = self.lease.why_not_again(again if is_known else 0)
        if reason:
            raise ControlLostError(f"the gripper was {reason} since: call acquire() once all agree", reason)
        if not is_known:
            raise ControlLostError(
                "the agent was restarted, and does not know whether the gripper was halted since: call "
                "acquire() once all agree",
                "restarted",
            )

    def is_of_holder(self, call: AgentCall) -> bool:
        holder = self.lease.holder
        return holder is not None and holder.client == call.client and self.lease.number == call.lease

    def bar(self, call: AgentCall) -> None:
        """Refuse, from now on, commands with a number up to this one."""
        self._newest = max(self._newest, call.number)

    def check_fresh(self, call: AgentCall, now: float) -> None:
        if not self.lease.is_fresh(call.seen, now):
            raise ControlLostError(
                f"the request was on its way for {now - call.seen:.1f} s, longer than the window of "
                f"{self.lease.window:g} s",
                "late",
            )

    def _check_holder(self, call: AgentCall, now: float) -> None:
        if not self.is_of_holder(call):
            holder, reason = self.lease.holder, self.lease.end_of(call.lease)
            who = holder.label if holder is not None and holder.client != call.client else "no client"
            raise ControlLostError(f"the lease has ended ({reason}), {who} commands the gripper now", reason)
        self.check_fresh(call, now)
