"""Requests: what one client asks of an agent, and what it makes of the answers and of silence."""

from __future__ import annotations

import asyncio
import getpass
import os
import secrets
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from ...control.waiters import copy_of
from ...runtime.clock import now
from ...values.errors import AgentError, ConnectionLostError, NotAllowedError, NotStartedError, RobotiqError
from ..network.bus import Bus, Reply, Urgency
from ..wire.envelope import Answer, Call, unpack_answer
from ..wire.names import GripperName
from ..wire.values import Fields
from .mirror import Mirror
from .pending_request import PendingRequest, is_refusal, of_its_run
from .settings import Settings

IN_ANY_RUN: Final = ("info", "halt")
"""What any run of the agent may answer."""
RECENT_S: Final = 0.5
"""So soon the agent must be heard after an empty answer for that to mean that the request is not allowed."""
AT_ONCE_S: Final = 0.25
"""Sooner than any time is over: nobody was there for the request."""
EARLY_S: Final = 0.005
"""So soon all is said again when the agent waits for something that got lost."""
LAST_ANSWER_S: Final = 0.5
"""For what the agent says of a command whose lease has ended."""


class NoAnswerError(ConnectionLostError):
    """No answer came; whether it was carried out is not known."""


@contextmanager
def no_answer_as_lost_connection() -> Iterator[None]:
    """Around what users call: that no answer came is a lost connection to them.

    Raises:
        ConnectionLostError: no answer came.
    """
    try:
        yield
    except NoAnswerError as error:
        raise ConnectionLostError(str(error)) from error


class Requests:
    """Numbers requests, says each until it is answered, and ends the wait when the agent falls silent.

    Attributes:
        settings: the speeds and forces that were asked for.
    """

    def __init__(self, name: GripperName, bus: Bus) -> None:
        self._name = name
        self._bus = bus
        self._client = secrets.token_hex(8)
        self._number = 0
        self._loop = asyncio.get_running_loop()
        self._silence: asyncio.Future[None] = self._loop.create_future()
        self._received: asyncio.Future[None] = self._loop.create_future()
        """Done as soon as the agent is heard."""
        self._closed: asyncio.Future[None] = self._loop.create_future()
        self._has_ended = False
        self._pending: set[PendingRequest] = set()
        self._commands: dict[int, PendingRequest] = {}
        """Those that have no answer yet, in the order in which they were asked."""
        self._resending: asyncio.TimerHandle | None = None
        self.settings = Settings()

    @property
    def has_undelivered_hold(self) -> bool:
        """Whether a hold was asked for that the agent has not answered for."""
        return any(each.verb == "cmd/hold" for each in self._commands.values())

    def receive(self) -> None:
        """The agent is heard."""
        if not self._received.done():
            self._received.set_result(None)

    def fall_silent(self) -> None:
        """The agent is not heard any more: nobody waits for the answers to what was asked until now."""
        silence, self._silence = self._silence, self._loop.create_future()
        silence.set_result(None)

    def lose_lease(self, lease: int, error: RobotiqError) -> None:
        """A lease has ended: the agent has a moment to say what became of the commands under it."""
        for posted in self._commands.values():
            if posted.call.lease == lease:
                posted.stop_repeating()
                self._loop.call_later(LAST_ANSWER_S, posted.fail, copy_of(error))

    def end(self) -> None:
        """The hand was stopped: nothing is asked from now on but for what ends motion."""
        self._has_ended = True
        self.fall_silent()

    async def close(self) -> None:
        """Nobody waits for any answer any more."""
        self._has_ended = True
        if not self._closed.done():
            self._closed.set_result(None)
        pending = list(self._pending)
        for posted in pending:
            posted.end()
        await asyncio.gather(*(posted.ended() for posted in pending))

    def make(self, mirror: Mirror, lease: int, arguments: Fields) -> Call:
        """The next request."""
        self._number += 1
        return Call(self._name.base, self._client, mirror.epoch, lease, self._number, mirror.stamp, arguments)

    def post(
        self, call: Call, verb: str, *, timeout: float, urgency: Urgency = Urgency.COMMAND
    ) -> PendingRequest:
        """Send a request: before whatever is posted after it. Wait for its answer with :meth:`answer`.

        Args:
            call: the request.
            verb: the last part of the key it goes to.
            timeout: seconds for its answer.
            urgency: the answer to a halt is waited for also when the agent falls silent.

        Raises:
            NotStartedError: the hand was stopped.
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
        """It may have been dropped on the way, or its answer: on a full network either is."""
        if (
            posted.left
            and not posted.answered.done()
            and (posted.is_allowed_after_stop or not self._has_ended)
        ):
            self._send(posted)

    def _resend_all_soon(self) -> None:
        """A command was lost, and those after it wait for it: in their order, and soon."""
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
            NoAnswerError: no answer; it may have been carried out.
            NotAllowedError: nobody answers to that, and the agent is there.
            AgentError: the answer was another gripper's, or of another version.
            ProtocolError: it is none.
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
            # That one has done nothing. What became of it where it was meant for nobody says.
            raise NoAnswerError(
                f"{self._name}: another run of its agent answered; {posted.verb} may have been carried out"
            )
        return answer, reply.attachment

    async def _reply(self, posted: PendingRequest) -> Reply:
        """Wait for a reply.

        Raises:
            RobotiqError: there is none; as :meth:`answer`.
        """
        reply, at_once = await self._wait(posted)
        if reply is None and at_once and await self._is_agent_present():
            # Just after a link has come up nobody seems to be there. Nothing is done twice: the number is the
            # same, and so is what had been heard when it was asked.
            posted.begin()
            self._resend(posted)
            reply, at_once = await self._wait(posted)
            if reply is None and at_once and await self._is_agent_present():
                raise NotAllowedError(f"{self._name}: nobody there answers to {posted.verb}: access denied")
        if reply is None:
            raise NoAnswerError(f"{self._name}: no answer in time; {posted.verb} may have been carried out")
        return reply

    async def _wait(self, posted: PendingRequest) -> tuple[Reply | None, bool]:
        """Wait for a reply; returns it, and whether it came at once: as where access rules say no.

        Raises:
            NoAnswerError: the agent fell silent, or the run ended.
            RobotiqError: the lease has ended, and the agent said nothing.
        """
        answered = posted.answered
        awaited: set[asyncio.Future[Any]] = {answered, self._closed}
        if not posted.is_allowed_after_stop:
            awaited.add(self._silence)
        # The bus says when the time is over; that nobody waits for longer does not hang on it.
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
        """Whether the agent is heard from now on; a link that is down may have been up a moment ago."""
        if self._received.done():
            self._received = self._loop.create_future()
        sign = self._received
        await asyncio.wait({sign, self._closed}, timeout=RECENT_S, return_when=asyncio.FIRST_COMPLETED)
        return sign.done()


def label() -> str:
    """What this client is called by people."""
    try:
        user = getpass.getuser()
    except (OSError, KeyError):
        user = "somebody"
    return f"{user}@{socket.gethostname()}:{os.getpid()}"
