"""Requests: what one client asks of an agent, and what it makes of the answers and of silence."""

from __future__ import annotations

import asyncio
import getpass
import os
import secrets
import socket
from typing import Any, Final

from ...errors import AgentError, ConnectionLostError, NotAllowedError
from ...session.clock import now
from ..network.bus import Bus, Reply, Urgency
from ..wire.envelope import Answer, Call, unpack_answer
from ..wire.names import GripperName
from ..wire.values import Fields
from .mirror import Mirror

RECENT_S: Final = 0.5
"""So soon the agent must be heard after an empty answer for that to mean that the request is not allowed."""
AT_ONCE_S: Final = 0.25
"""Sooner than any time is over: nobody was there for the request."""


class NoAnswerError(ConnectionLostError):
    """No answer came; whether it was carried out is not known."""


class Requests:
    """Numbers requests, sends each once, and ends the wait when the agent falls silent."""

    def __init__(self, name: GripperName, bus: Bus) -> None:
        """Ask the agent that serves a gripper."""
        self._name = name
        self._bus = bus
        self._client = secrets.token_hex(8)
        self._number = 0
        self._silence: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._sign: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        """Done as soon as the agent is heard."""

    def hear(self) -> None:
        """The agent is heard."""
        if not self._sign.done():
            self._sign.set_result(None)

    def fall_silent(self) -> None:
        """The agent is not heard any more: nobody waits for the answers to what was asked until now."""
        silence, self._silence = self._silence, asyncio.get_running_loop().create_future()
        silence.set_result(None)

    def make(self, mirror: Mirror, lease: int, arguments: Fields) -> Call:
        """The next request."""
        self._number += 1
        return Call(self._name.base, self._client, mirror.epoch, lease, self._number, mirror.stamp, arguments)

    async def send(
        self, call: Call, verb: str, *, timeout: float, urgency: Urgency = Urgency.COMMAND
    ) -> tuple[Answer, bytes]:
        """Send a request and wait for its answer; returns it, and the status that came with it.

        Args:
            call: the request.
            verb: the last part of the key it goes to.
            timeout: seconds.
            urgency: a halt is asked for also when the agent has been silent for a while.

        Raises:
            NoAnswerError: no answer; it may have been carried out.
            NotAllowedError: nobody answers to that, and the agent is there.
            AgentError: the answer was another's, or of another version.
            ProtocolError: it is none.
        """
        reply, at_once = await self._ask(call, verb, timeout, urgency)
        if reply is None and at_once and await self._hears_on():
            # Just after a link has come up nobody seems to be there. Nothing is done twice: the number is the
            # same, and so is what had been heard when it was asked.
            reply, at_once = await self._ask(call, verb, timeout, urgency)
            if reply is None and at_once and await self._hears_on():
                raise NotAllowedError(f"{self._name}: nobody there answers to {verb}: access denied")
        if reply is None:
            raise NoAnswerError(f"{self._name}: no answer in time; {verb} may have been carried out")
        answer = unpack_answer(reply.payload)
        if answer.to != self._name.base or answer.number not in (0, call.number):
            raise AgentError(f"{self._name}: another answer came to {verb}; it may have been carried out")
        return answer, reply.attachment

    async def _ask(
        self, call: Call, verb: str, timeout: float, urgency: Urgency
    ) -> tuple[Reply | None, bool]:
        """Send it once; returns the answer, and whether it came at once: as where access rules say no.

        Raises:
            NoAnswerError: the agent fell silent.
        """
        asked_at = now()
        asking = asyncio.ensure_future(
            self._bus.ask(self._name.key(verb), call.pack(), timeout=timeout, urgency=urgency)
        )
        awaited: set[asyncio.Future[Any]] = {asking}
        if urgency is not Urgency.STOP:
            awaited.add(self._silence)
        try:
            await asyncio.wait(awaited, return_when=asyncio.FIRST_COMPLETED)
        finally:
            asking.cancel()
        if not asking.done():
            raise NoAnswerError(f"{self._name}: the agent fell silent; {verb} may have been carried out")
        return asking.result(), now() - asked_at < min(AT_ONCE_S, timeout / 2)

    async def _hears_on(self) -> bool:
        """Whether the agent is heard from now on; a link that is down may have been up a moment ago."""
        self._sign = sign = self._sign if not self._sign.done() else self._sign.get_loop().create_future()
        await asyncio.wait({sign}, timeout=RECENT_S)
        return sign.done()


def label() -> str:
    """What this client is called by people."""
    try:
        user = getpass.getuser()
    except (OSError, KeyError):
        user = "somebody"
    return f"{user}@{socket.gethostname()}:{os.getpid()}"
