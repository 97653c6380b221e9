"""Requests: what one client asks of an agent, and what it makes of the answers and of silence."""

from __future__ import annotations

import asyncio
import getpass
import os
import secrets
import socket
from collections.abc import Coroutine
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


class Requests:
    """Numbers requests, sends each once, and ends the wait when the agent falls silent."""

    def __init__(self, name: GripperName, bus: Bus) -> None:
        """Ask the agent that serves a gripper; it counts as heard."""
        self._name = name
        self._bus = bus
        self._client = secrets.token_hex(8)
        self._number = 0
        self._heard_at = now()
        self._silence: asyncio.Future[None] = asyncio.get_running_loop().create_future()

    def hear(self) -> None:
        """The agent is heard."""
        self._heard_at = now()
        if self._silence.done():
            self._silence = asyncio.get_running_loop().create_future()

    def fall_silent(self) -> None:
        """The agent is not heard any more: nobody waits for its answers."""
        if not self._silence.done():
            self._silence.set_result(None)

    def make(self, mirror: Mirror, lease: int, arguments: Fields) -> Call:
        """The next request."""
        self._number += 1
        return Call(self._name.base, self._client, mirror.epoch, lease, self._number, mirror.stamp, arguments)

    def send(
        self, call: Call, verb: str, *, timeout: float, urgency: Urgency = Urgency.COMMAND
    ) -> Coroutine[Any, Any, tuple[Answer, bytes]]:
        """Send a request now; what is returned waits for the answer, and for the status that comes with it.

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
        asking = self._bus.ask(self._name.key(verb), call.pack(), timeout=timeout, urgency=urgency)
        return self._answer(asking, call, verb, timeout, urgency)

    async def _answer(
        self, asking: asyncio.Future[Reply | None], call: Call, verb: str, timeout: float, urgency: Urgency
    ) -> tuple[Answer, bytes]:
        asked_at = now()
        awaited: set[asyncio.Future[Any]] = {asking}
        if urgency is not Urgency.STOP:
            awaited.add(self._silence)
        try:
            await asyncio.wait(awaited, return_when=asyncio.FIRST_COMPLETED)
        finally:
            asking.cancel()
        if not asking.done():
            raise NoAnswerError(f"{self._name}: the agent fell silent; {verb} may have been carried out")
        reply = asking.result()
        if reply is None:
            raise self._silent(verb, at_once=now() - asked_at < timeout / 2)
        answer = unpack_answer(reply.payload)
        if answer.to != self._name.base or answer.number not in (0, call.number):
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
