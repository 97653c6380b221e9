"""Requests: what one client asks of an agent, and what it makes of the answers and of silence."""

from __future__ import annotations

import asyncio
import getpass
import os
import secrets
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

from ...errors import AgentError, ConnectionLostError, NotAllowedError, RobotiqError
from ...session.timing.clock import now
from ..network.bus import Bus, Reply, Urgency
from ..wire.envelope import Answer, Call, unpack_answer
from ..wire.names import GripperName
from ..wire.values import Fields
from .mirror import Mirror

IN_ANY_RUN: Final = ("info", "halt")
"""What any run of the agent may answer."""
RECENT_S: Final = 0.5
"""So soon the agent must be heard after an empty answer for that to mean that the request is not allowed."""
AT_ONCE_S: Final = 0.25
"""Sooner than any time is over: nobody was there for the request."""


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


@dataclass(frozen=True, slots=True)
class PendingRequest:
    """A request on its way.

    Attributes:
        call: the request.
        verb: the last part of the key it went to.
        timeout: seconds for its answer.
        urgency: of both.
        asked_at: when it was sent.
        asking: waits for the reply.
    """

    call: Call
    verb: str
    timeout: float
    urgency: Urgency
    asked_at: float
    asking: asyncio.Future[Reply | None]

    @property
    def is_halt(self) -> bool:
        """Whether it is for every run of the agent, and answered also when the agent falls silent."""
        return self.urgency is Urgency.STOP


def of_its_run(call: Call) -> Callable[[Reply], bool]:
    """Whether a reply is that of the run of the agent that was asked; of any, if the request names none.

    Where two agents serve a gripper, the one that refuses is the quicker one.
    """

    def decides(reply: Reply) -> bool:
        try:
            answer = unpack_answer(reply.payload)
        except RobotiqError:
            return False
        return (answer.to, answer.number) == (call.to, call.number) and call.epoch in (0, answer.epoch)

    return decides


def is_refusal(reply: Reply) -> bool:
    """Whether a reply to a halt says anything but that the fingers stand: of two agents both have to."""
    try:
        return unpack_answer(reply.payload).error is not None
    except RobotiqError:
        return True


class Requests:
    """Numbers requests, sends each once, and ends the wait when the agent falls silent."""

    def __init__(self, name: GripperName, bus: Bus) -> None:
        """Ask the agent that serves a gripper."""
        self._name = name
        self._bus = bus
        self._client = secrets.token_hex(8)
        self._number = 0
        self._loop = asyncio.get_running_loop()
        self._silence: asyncio.Future[None] = self._loop.create_future()
        self._sign: asyncio.Future[None] = self._loop.create_future()
        """Done as soon as the agent is heard."""
        self._closed: asyncio.Future[None] = self._loop.create_future()
        self._asking: set[asyncio.Future[Reply | None]] = set()

    def hear(self) -> None:
        """The agent is heard."""
        if not self._sign.done():
            self._sign.set_result(None)

    def fall_silent(self) -> None:
        """The agent is not heard any more: nobody waits for the answers to what was asked until now."""
        silence, self._silence = self._silence, self._loop.create_future()
        silence.set_result(None)

    async def close(self) -> None:
        """Nobody waits for any answer any more."""
        if not self._closed.done():
            self._closed.set_result(None)
        for asking in self._asking:
            asking.cancel()
        await asyncio.gather(*self._asking, return_exceptions=True)

    def make(self, mirror: Mirror, lease: int, arguments: Fields) -> Call:
        """The next request."""
        self._number += 1
        return Call(self._name.base, self._client, mirror.epoch, lease, self._number, mirror.stamp, arguments)

    def post(
        self, call: Call, verb: str, *, timeout: float, urgency: Urgency = Urgency.COMMAND
    ) -> PendingRequest:
        """Send a request: before whatever is posted after it.

        Args:
            call: the request.
            verb: the last part of the key it goes to.
            timeout: seconds for its answer.
            urgency: the answer to a halt is waited for also when the agent falls silent.
        """
        asking = self._bus.ask(
            self._name.key(verb),
            call.pack(),
            timeout=timeout,
            urgency=urgency,
            decides=is_refusal if urgency is Urgency.STOP else of_its_run(call),
        )
        self._asking.add(asking)
        asking.add_done_callback(self._asking.discard)
        return PendingRequest(call, verb, timeout, urgency, now(), asking)

    async def answer(self, posted: PendingRequest) -> tuple[Answer, bytes]:
        """Wait for the answer to a request; returns it, and the status that came with it.

        Raises:
            NoAnswerError: no answer; it may have been carried out.
            NotAllowedError: nobody answers to that, and the agent is there.
            AgentError: the answer was another gripper's, or of another version.
            ProtocolError: it is none.
        """
        reply, at_once = await self._wait(posted)
        if reply is None and at_once and await self._hears_on():
            # Just after a link has come up nobody seems to be there. Nothing is done twice: the number is the
            # same, and so is what had been heard when it was asked.
            again = self.post(posted.call, posted.verb, timeout=posted.timeout, urgency=posted.urgency)
            reply, at_once = await self._wait(again)
            if reply is None and at_once and await self._hears_on():
                raise NotAllowedError(f"{self._name}: nobody there answers to {posted.verb}: access denied")
        if reply is None:
            raise NoAnswerError(f"{self._name}: no answer in time; {posted.verb} may have been carried out")
        answer = unpack_answer(reply.payload)
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

    async def _wait(self, posted: PendingRequest) -> tuple[Reply | None, bool]:
        """Wait for a reply; returns it, and whether it came at once: as where access rules say no.

        Raises:
            NoAnswerError: the agent fell silent, or the run ended.
        """
        asking = posted.asking
        awaited: set[asyncio.Future[Any]] = {asking, self._closed}
        if not posted.is_halt:
            awaited.add(self._silence)
        try:
            await asyncio.wait(awaited, return_when=asyncio.FIRST_COMPLETED)
        finally:
            asking.cancel()
        if not asking.done() or asking.cancelled():
            raise NoAnswerError(
                f"{self._name}: the agent fell silent; {posted.verb} may have been carried out"
            )
        return asking.result(), now() - posted.asked_at < min(AT_ONCE_S, posted.timeout / 2)

    async def _hears_on(self) -> bool:
        """Whether the agent is heard from now on; a link that is down may have been up a moment ago."""
        if self._sign.done():
            self._sign = self._loop.create_future()
        sign = self._sign
        await asyncio.wait({sign, self._closed}, timeout=RECENT_S, return_when=asyncio.FIRST_COMPLETED)
        return sign.done()


def label() -> str:
    """What this client is called by people."""
    try:
        user = getpass.getuser()
    except (OSError, KeyError):
        user = "somebody"
    return f"{user}@{socket.gethostname()}:{os.getpid()}"
