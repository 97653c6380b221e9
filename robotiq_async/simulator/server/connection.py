"""The connection to one client: passes on its requests one by one, and sends the replies."""

from __future__ import annotations

import asyncio
import socket
import struct
from collections import deque
from typing import TYPE_CHECKING, Any, Final

from ..physics.driven_axis import PhysicsError
from .framing import BadFrameError

if TYPE_CHECKING:
    from .responder import Responder

MOST_WAITING: Final = 1000
"""Replies that wait to be sent later; while there are so many, no more requests are taken."""
MOST_UNREAD: Final = 65536
"""Bytes of requests that wait to be answered; beyond, the client is not read from."""
_LINGER_NOT: Final = struct.pack("ii", 1, 0)
"""SO_LINGER on, for no time at all: closing the socket then resets the connection."""


class Connection(asyncio.Protocol):
    """Has one request answered in a turn of the loop, and sends the reply as the responder wants it.

    Attributes:
        transport: to the client; None before it has come, and once it is gone.
    """

    def __init__(self, responder: Responder) -> None:
        self.transport: Any = None
        self._loop = asyncio.get_running_loop()
        self._responder = responder
        self._inbox = bytearray()
        self._goes_on = False
        """Whether the next request is answered in the next turn of the loop."""
        self._outbox: deque[tuple[float, bytes]] = deque()
        """Replies to send later, with their times, in order: no reply overtakes an older one."""
        self._is_clogged = False
        """Whether the client does not read its replies."""
        self._is_held = False
        """Whether the client is not read from."""

    def is_active(self) -> bool:
        return self.transport is not None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport
        if not self._responder.lets_in(self):
            self.hang_up(reset=True)
            return
        for part in self._responder.left_over():
            self.pass_on(part)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002  # asyncio's
        self._leave()

    def data_received(self, data: bytes) -> None:
        self._inbox += data
        self._answer_next()

    def pause_writing(self) -> None:
        """The buffers of the system are full; do not fill ours."""
        self._is_clogged = True

    def resume_writing(self) -> None:
        self._is_clogged = False
        self._answer_next()

    def _send(self, reply: bytes) -> None:
        parts = self._responder.deliver(reply)
        if parts is None:
            self.hang_up()
            return
        now = self._loop.time()
        for delay, part in parts:
            if delay <= 0 and not self._outbox:
                self.pass_on(part)
                continue
            last = self._outbox[-1][0] if self._outbox else now
            self._outbox.append((max(last, now + delay), part))
            self._loop.call_at(self._outbox[-1][0], self._write_next)

    def pass_on(self, part: bytes) -> None:
        if not self.is_active():
            self._responder.undelivered(part)
        elif part:
            self.transport.write(part)

    def hang_up(self, *, reset: bool = False) -> None:
        """Drop the connection at once with a reset (RST); unsent bytes are lost."""
        if self.is_active():
            line = self.transport.get_extra_info("socket") if reset else None
            if line is not None:
                line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER_NOT)
            self.transport.abort()
            self._leave()

    def _leave(self) -> None:
        self.transport = None
        self._responder.forget(self)

    def _go_on(self) -> None:
        self._goes_on = False
        self._answer_next()

    def _answer_next(self) -> None:
        """Answer one request, unless none is complete or the client has to wait.

        A thousand requests at once do not hold up the loop: each turn answers one. A gripper without power
        does not even receive them.
        """
        if not self._responder.gripper.is_powered:
            self._inbox.clear()
        while not self._goes_on and not self._is_full and self.is_active():
            try:
                frame = self._responder.take(self._inbox)
            except BadFrameError:
                self.hang_up()
                return
            if frame is None:
                break
            if self._responder.hears(frame):
                if self._inbox:
                    self._goes_on = True
                    self._loop.call_soon(self._go_on)
                try:
                    reply = self._responder.answer(frame)
                except PhysicsError as error:
                    self._responder.fail(error)
                    return
                self._send(reply)
                break
        self._regulate()

    @property
    def _is_full(self) -> bool:
        return self._is_clogged or len(self._outbox) >= MOST_WAITING

    def _regulate(self) -> None:
        """Read only from a client whose requests can be answered in time; TCP makes it wait."""
        hold = len(self._inbox) > MOST_UNREAD
        if hold != self._is_held and self.is_active():
            self._is_held = hold
            if hold:
                self.transport.pause_reading()
            else:
                self.transport.resume_reading()

    def _write_next(self) -> None:
        self.pass_on(self._outbox.popleft()[1])
        self._answer_next()
