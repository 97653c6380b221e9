"""Requests: what one client asks of an agent, and what it makes of the answers and of silence."""

from __future__ import annotations

import asyncio
import getpass
import os
import secrets
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

from ...errors import AgentError, ConnectionLostError, NotAllowedError
from ...session.clock import now
from ..network.bus import Bus, Reply, Urgency
from ..wire.envelope import Answer, Call, unpack_answer
from ..wire.names import GripperName
from ..wire.values import Fields
from .mirror import Mirror

RECENT_S: Final = 0.5
"""So recently the agent must have been heard for an empty answer to mean that the request is not allowed."""


class NoAnswerError(ConnectionLostError):
    """No answer came; whether it was carried out is not known."""


@contextmanager
def plainly() -> Iterator[None]:
    """Around what users call: that no answer came is a lost connection to them.

    Raises:
        ConnectionLostError: no answer came.
    """
    try:
        yield
    except NoAnswerError as error:
        raise ConnectionLostError(str(error)) from error


@dataclass(frozen=True, slots=True)
class Posted:
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


class Requests:
    """Numbers requests, sends each once, and ends the wait when the agent falls silent."""

    def __init__(self, name: GripperName, bus: Bus) -> None:
        """Ask the agent that serves a gripper; it counts as heard."""
        self._name = name
        self._bus = bus
        self._client = secrets.token_hex(8)
        self._number = 0
        self._heard_at = now()
        self._loop = asyncio.get_running_loop()
        self._silence: asyncio.Future[None] = self._loop.create_future()
        self._closed: asyncio.Future[None] = self._loop.create_future()
        self._asking: set[asyncio.Future[Reply | None]] = set()

    def hear(self) -> None:
        """The agent is heard."""
        self._heard_at = now()
        if self._silence.done():
            self._silence = self._loop.create_future()

    def fall_silent(self) -> None:
        """The agent is not heard any more: nobody waits for its answers."""
        if not self._silence.done():
            self._silence.set_result(None)

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

    def post(self, call: Call, verb: str, *, timeout: float, urgency: Urgency = Urgency.COMMAND) -> Posted:
        """Send a request: before whatever is posted after it.

        Args:
            call: the request.
            verb: the last part of the key it goes to.
            timeout: seconds for its answer.
            urgency: a halt is asked for also when the agent has been silent for a while.

        Raises:
            NoAnswerError: the agent is silent: nothing was asked.
        """
        if self._silence.done() and urgency is not Urgency.STOP:
            raise NoAnswerError(f"{self._name}: the agent is silent; {verb} was not asked")
        asking = self._bus.ask(self._name.key(verb), call.pack(), timeout=timeout, urgency=urgency)
        self._asking.add(asking)
        asking.add_done_callback(self._asking.discard)
        return Posted(call, verb, timeout, urgency, now(), asking)

    async def answer(self, posted: Posted) -> tuple[Answer, bytes]:
        """Wait for the answer to a request; returns it, and the status that came with it.

        Raises:
            NoAnswerError: no answer; it may have been carried out.
            NotAllowedError: nobody answers to that, and the agent is there.
            AgentError: the answer was another's, or of another version.
            ProtocolError: it is none.
        """
        asking, verb = posted.asking, posted.verb
        awaited: set[asyncio.Future[Any]] = {asking, self._closed}
        if posted.urgency is not Urgency.STOP:
            awaited.add(self._silence)
        try:
            await asyncio.wait(awaited, return_when=asyncio.FIRST_COMPLETED)
        finally:
            asking.cancel()
        if not asking.done() or asking.cancelled():
            raise NoAnswerError(f"{self._name}: the agent fell silent; {verb} may have been carried out")
        reply = asking.result()
        if reply is None:
            raise self._silent(verb, at_once=now() - posted.asked_at < posted.timeout / 2)
        answer = unpack_answer(reply.payload)
        if answer.to != self._name.base or answer.number not in (0, posted.call.number):
            raise AgentError(f"{self._name}: another answer came to {verb}; it may have been carried out")
        return answer, reply.attachment

    def _silent(self, verb: str, *, at_once: bool) -> NotAllowedError | NoAnswerError:
        """What it means that nobody answered: access rules answer nothing, and at once."""
        if at_once and now() - self._heard_at < RECENT_S:
            return NotAllowedError(f"{self._name}: nobody there answers to {verb}: access denied")
        return NoAnswerError(f"{self._name}: no answer in time; {verb} may have been carried out")


def label() -> str:
    """What this client is called by people."""
    try:
        user = getpass.getuser()
    except (OSError, KeyError):
        user = "somebody"
    return f"{user}@{socket.gethostname()}:{os.getpid()}"
