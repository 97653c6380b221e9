"""Requests: sends the requests of one client, repeats them, and interprets answers and silence."""

from __future__ import annotations

import asyncio
import getpass
import os
import secrets
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from ...runtime.clock import now
from ...values.errors import (
    AgentError,
    ConnectionLostError,
    ControlLostError,
    NotAllowedError,
    NotStartedError,
    RobotiqError,
)
from ..network.bus import Bus, Reply, Urgency
from ..wire.envelope import Answer, Call, unpack_answer
from ..wire.names import GripperName
from ..wire.settings import Setting, settings_fields, settings_of
from ..wire.values import Fields
from .mirror import Mirror
from .pending_request import PendingRequest, is_refusal, of_its_run

IN_ANY_RUN: Final = ("info", "halt")  # requests that any run of the agent may answer
RECENT_S: Final = 0.5
"""Seconds in which a message of the agent must follow an empty reply to prove that access was denied."""
AT_ONCE_S: Final = 0.25
"""Seconds: an empty reply before that is no timeout, but means that no process received the request."""
EARLY_S: Final = 0.005  # seconds until all commands are repeated when the agent waits for a lost one
LAST_ANSWER_S: Final = 0.5  # seconds for the answer to a command whose lease has ended


class Settings:
    """The last speed and force of each axis.

    They have no echo in the status. A restarted agent has its own, and another holder of the lease may have
    set others: the next motion could be faster and stronger than the program asked for. So all of them are
    sent with each request for the lease.
    """

    def __init__(self) -> None:
        self._asked: dict[Setting, tuple[int, int]] = {}
        """By setting: the number of the request, and the value."""

    def note(self, verb: str, call: Call) -> None:
        """Remember the settings of a request that was carried out, or may have been."""
        for setting, value in settings_of(verb.removeprefix("cmd/"), call.arguments).items():
            self._asked[setting] = max(self._asked.get(setting, (0, 0)), (call.number, value))

    @property
    def fields(self) -> Fields:
        return settings_fields({setting: value for setting, (_, value) in self._asked.items()})


class NoAnswerError(ConnectionLostError):
    """No answer arrived; whether the request was carried out is unknown."""


@contextmanager
def no_answer_as_lost_connection() -> Iterator[None]:
    """Around public calls: report a missing answer as a lost connection."""
    try:
        yield
    except NoAnswerError as error:
        raise ConnectionLostError(str(error)) from error


class Requests:
    """Numbers requests, repeats each until it is answered, and ends the wait when the agent falls silent.

    Attributes:
        client: identifies the hand to the agent, in all its runs: a lease of an earlier one is its own.
        process: of the run. After a fork, parent and child have the same hand, and are two clients.
        number: of the newest request.
        settings: the speeds and forces that were asked for.
    """

    def __init__(self, name: GripperName, bus: Bus, before: Requests | None) -> None:
        """``before`` has the requests of the hand's last run, if there was one."""
        self._name = name
        self._bus = bus
        self.process: int = os.getpid()
        self.client: str = secrets.token_hex(8)
        self.number: int = 0
        if before is not None and before.process == self.process:
            self.client, self.number = before.client, before.number
        self._loop = asyncio.get_running_loop()
        self._silence: asyncio.Future[None] = self._loop.create_future()
        self._received: asyncio.Future[None] = self._loop.create_future()
        """Done with the next message of the agent."""
        self._closed: asyncio.Future[None] = self._loop.create_future()
        self._has_ended = False
        self._pending: set[PendingRequest] = set()
        self._commands: dict[int, PendingRequest] = {}  # commands without an answer, in their order
        self._resending: asyncio.TimerHandle | None = None
        self.settings = Settings()

    @property
    def has_undelivered_hold(self) -> bool:
        return any(each.verb == "cmd/hold" for each in self._commands.values())

    def receive(self) -> None:
        if not self._received.done():
            self._received.set_result(None)

    def fall_silent(self) -> None:
        # Ends the waits of all requests until now.
        silence, self._silence = self._silence, self._loop.create_future()
        silence.set_result(None)

    def lose_lease(self, lease: int, reason: str) -> None:
        """Wait no longer for the outcome of the commands under a lease that has ended.

        The agent needs a moment to report it. Without its answer each gets an error of its own: what the
        agent said of another request, such as that nothing was done, may not be so of this one.
        """
        for posted in self._commands.values():
            if posted.call.lease == lease:
                posted.stop_repeating()
                outcome = f"{posted.verb} may have been carried out"
                error = ControlLostError(f"{self._name}: the lease has ended ({reason}); {outcome}", reason)
                self._loop.call_later(LAST_ANSWER_S, posted.fail, error)

    def end(self) -> None:
        """The hand was stopped: from now on only requests that end motion are sent."""
        self._has_ended = True
        self.fall_silent()

    async def close(self) -> None:
        """End the requests that :meth:`end` has left, and wait for their ends."""
        self._closed.set_result(None)
        pending = list(self._pending)
        for posted in pending:
            posted.end()
        await asyncio.gather(*(posted.ended() for posted in pending))

    def make(self, mirror: Mirror, lease: int, arguments: Fields) -> Call:
        self.number += 1
        return Call(self._name.base, self.client, mirror.epoch, lease, self.number, mirror.stamp, arguments)

    def post(
        self, call: Call, verb: str, *, timeout: float, urgency: Urgency = Urgency.COMMAND
    ) -> PendingRequest:
        """Send a request, before any that is posted later. Wait for its answer with :meth:`answer`.

        With Urgency.STOP that wait continues if the agent falls silent.
        """
        posted = PendingRequest(call, verb, timeout, urgency)
        if self._has_ended and not posted.is_allowed_after_stop:
            raise NotStartedError("the hand was stopped")
        self._pending.add(posted)
        if posted.is_command:
            self._commands[call.number] = posted
        self._send(posted)
        return posted

    def _send(self, posted: PendingRequest) -> None:
        number = posted.call.number
        before = [each for each in self._commands if each < number] if posted.is_command else ()
        copy = self._bus.ask(
            self._name.key(posted.verb),
            posted.packed(max(before, default=0)),
            timeout=posted.left,
            urgency=posted.urgency,
            decides=is_refusal if posted.is_halt else of_its_run(posted.call),
        )
        posted.add(copy, self._resend_all_soon)
        posted.repeat(lambda: self._resend(posted))

    def _resend(self, posted: PendingRequest) -> None:
        # A full network drops requests and answers.
        if (
            posted.left
            and not posted.answered.done()
            and (posted.is_allowed_after_stop or not self._has_ended)
        ):
            self._send(posted)

    def _resend_all_soon(self) -> None:
        # A command was lost, and the agent refuses those after it: repeat all, in their order.
        if self._resending is None:
            self._resending = self._loop.call_later(EARLY_S, self._resend_all)

    def _resend_all(self) -> None:
        self._resending = None
        for posted in list(self._commands.values()):
            self._resend(posted)

    def _forget(self, posted: PendingRequest) -> None:
        self._commands.pop(posted.call.number, None)
        self._pending.discard(posted)
        posted.end()

    async def answer(self, posted: PendingRequest) -> tuple[Answer, bytes]:
        """Wait for the answer to a request; returns it, and the status that came with it.

        Raises:
            NoAnswerError: no answer; the request may have been carried out.
            NotAllowedError: no reply, although the agent is there: access was denied.
            AgentError: the answer of another gripper, or of another version.
            ProtocolError: the answer is malformed.
        """
        is_refused = False
        try:
            reply = await self._reply(posted)
            answer = unpack_answer(reply.payload)
            is_refused = answer.error is not None
        finally:
            self._forget(posted)
            if posted.is_command and not is_refused:
                self.settings.note(posted.verb, posted.call)
        if answer.to != self._name.base or answer.number not in (0, posted.call.number):
            raise AgentError(
                f"{self._name}: another answer came to {posted.verb}; it may have been carried out"
            )
        if posted.call.epoch not in (0, answer.epoch) and posted.verb not in IN_ANY_RUN:
            # That run did nothing. Whether the addressed run carried it out is unknown.
            raise NoAnswerError(
                f"{self._name}: another run of its agent answered; {posted.verb} may have been carried out"
            )
        return answer, reply.attachment

    async def _reply(self, posted: PendingRequest) -> Reply:
        reply, at_once = await self._wait(posted)
        if reply is None and at_once and await self._is_agent_present():
            # Just after a link has come up, zenoh may not know the agent yet. The second request is carried
            # out once at most: its number and its stamp are the same.
            posted.begin()
            self._resend(posted)
            reply, at_once = await self._wait(posted)
            if reply is None and at_once and await self._is_agent_present():
                raise NotAllowedError(f"{self._name}: no reply to {posted.verb}: access denied")
        if reply is None:
            raise NoAnswerError(f"{self._name}: no answer in time; {posted.verb} may have been carried out")
        return reply

    async def _wait(self, posted: PendingRequest) -> tuple[Reply | None, bool]:
        """A reply, and whether the wait ended at once: then the access rules denied the request."""
        answered = posted.answered
        awaited: set[asyncio.Future[Any]] = {answered, self._closed}
        if not posted.is_allowed_after_stop:
            awaited.add(self._silence)
        # The bus ends the wait in time; the limit holds even if it does not.
        limit = posted.left + LAST_ANSWER_S
        done, _ = await asyncio.wait(awaited, timeout=limit, return_when=asyncio.FIRST_COMPLETED)
        if not done:
            return None, False
        if not answered.done() or answered.cancelled():
            raise NoAnswerError(
                f"{self._name}: the agent fell silent; {posted.verb} may have been carried out"
            )
        reply = answered.result()
        if isinstance(reply, RobotiqError):
            raise reply
        return reply, now() - posted.asked_at < min(AT_ONCE_S, posted.timeout / 2)

    async def _is_agent_present(self) -> bool:
        # By a message from now on: a link that is down now may have delivered one just before.
        if self._received.done():
            self._received = self._loop.create_future()
        sign = self._received
        await asyncio.wait({sign, self._closed}, timeout=RECENT_S, return_when=asyncio.FIRST_COMPLETED)
        return sign.done()


def label() -> str:
    """The name of this client for people: user, host, process."""
    try:
        user = getpass.getuser()
    except (OSError, KeyError):
        user = "unknown"
    return f"{user}@{socket.gethostname()}:{os.getpid()}"
