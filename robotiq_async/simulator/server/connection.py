"""One client of a simulator: pymodbus's request handler, fed and drained by us."""

from __future__ import annotations

import socket
import struct
from collections import deque
from typing import TYPE_CHECKING, Any, Final, Protocol

from pymodbus.pdu import ExceptionResponse
from pymodbus.server.requesthandler import ServerRequestHandler

from .framing import BadFrameError, Frame, refusal

if TYPE_CHECKING:
    import asyncio
    from collections.abc import Collection, Iterable

    from pymodbus.server.base import ModbusBaseServer

MOST_WAITING: Final = 1000
"""Replies that wait to be sent later; while there are so many, no more requests are taken."""
MOST_UNREAD: Final = 65536
"""Bytes of requests that wait to be answered; beyond, the client is not read from."""
_LINGER_NOT: Final = struct.pack("ii", 1, 0)
"""SO_LINGER on, for no time at all: closing the socket then resets the connection."""


class Endpoint(Protocol):
    """What a connection asks of the simulator it belongs to."""

    @property
    def served_functions(self) -> Collection[int]:
        """The Modbus functions that are served now."""

    @property
    def answers_nobody(self) -> bool:
        """Whether the gripper is without power."""

    def take(self, inbox: bytearray) -> Frame | None:
        """Cut the next request out of what has arrived."""

    def hears(self, frame: Frame) -> bool:
        """Whether a request is heard, and meant for this gripper."""

    def deliver(self, reply: bytes) -> Iterable[tuple[float, bytes]] | None:
        """What to send for a reply, as a reply policy gives it."""

    def undelivered(self, part: bytes) -> None:
        """Drop what is left for a client that is gone."""

    def lets_in(self, client: Connection) -> bool:
        """Whether a client that has come may stay."""

    def left_over(self) -> Iterable[bytes]:
        """What a new client is sent before it has asked for anything."""


class Connection(ServerRequestHandler):
    """Hands pymodbus one request at a time and sends its replies as the endpoint's policy says.

    pymodbus's own handler loses what arrives beside the request it works on, answers some malformed
    requests with function code 0, and knows no misbehaviour.
    """

    def __init__(self, owner: ModbusBaseServer, endpoint: Endpoint) -> None:
        super().__init__(owner, None, None, None)  # type: ignore[no-untyped-call]
        self._endpoint = endpoint
        self._inbox = bytearray()
        self._answering = False
        self._answer_task: asyncio.Task[None] | None = None
        self._outbox: deque[tuple[float, bytes]] = deque()
        """Replies to send later, with their times, in order: no reply overtakes an older one."""
        self._is_clogged = False
        """Whether the client does not read its replies."""
        self._is_held = False
        """Whether the client is not read from."""

    def callback_connected(self) -> None:
        """A client is there."""
        super().callback_connected()
        if not self._endpoint.lets_in(self):
            self.hang_up(reset=True)
            return
        for part in self._endpoint.left_over():
            self.pass_on(part)

    def data_received(self, data: bytes) -> None:
        """Take bytes from the client."""
        self._inbox += data
        self._answer_next()

    def pause_writing(self) -> None:
        """The buffers of the system are full; do not fill ours."""
        self._is_clogged = True

    def resume_writing(self) -> None:
        """The client has read."""
        self._is_clogged = False
        self._answer_next()

    def handle_later(self) -> None:
        """Answer the request that was taken, in a task.

        pymodbus goes through the loop's descriptor for other threads, which costs two turns and system calls.
        """
        self._answer_task = self.loop.create_task(self.handle_request())  # type: ignore[no-untyped-call]

    def send(self, data: bytes, addr: tuple[Any, ...] | None = None) -> None:  # noqa: ARG002
        """Send a reply, or what the policy makes of it, and go on with the next request."""
        self._answering = False
        parts = () if self._endpoint.answers_nobody else self._endpoint.deliver(data)
        if parts is None:
            self.hang_up()
            return
        now = self.loop.time()
        for delay, part in parts:
            if delay <= 0 and not self._outbox:
                self.pass_on(part)
                continue
            last = self._outbox[-1][0] if self._outbox else now
            self._outbox.append((max(last, now + delay), part))
            self.loop.call_at(self._outbox[-1][0], self._write_next)
        if self._inbox:
            self.loop.call_soon(self._answer_next)

    def pass_on(self, part: bytes) -> None:
        """Send bytes now."""
        if not self.is_active():
            self._endpoint.undelivered(part)
        elif part:
            self.transport.write(part)  # type: ignore[attr-defined]

    def hang_up(self, *, reset: bool = False) -> None:
        """Drop the connection at once with a reset (RST); what was not sent is lost."""
        if self.is_active():
            line = self.transport.get_extra_info("socket") if reset else None
            if line is not None:
                line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER_NOT)
            self.transport.abort()  # type: ignore[attr-defined]
            self.close()

    def _answer_next(self) -> None:
        """Hand over requests until one is being worked on, none is complete, or the client has to wait.

        A gripper without power does not even hear them.
        """
        if self._endpoint.answers_nobody:
            self._inbox.clear()
        while not self._answering and not self._is_full and self.is_active():
            try:
                frame = self._endpoint.take(self._inbox)
            except BadFrameError:
                self.hang_up()
                return
            if frame is None:
                break
            if self._endpoint.hears(frame):
                self._answer(frame)
        self._regulate()

    @property
    def _is_full(self) -> bool:
        """Whether there are enough replies that the client has not got."""
        return self._is_clogged or len(self._outbox) >= MOST_WAITING

    def _regulate(self) -> None:
        """Read only from a client that does not ask faster than it is answered; TCP makes it wait."""
        hold = len(self._inbox) > MOST_UNREAD
        if hold != self._is_held and self.is_active():
            self._is_held = hold
            if hold:
                self.transport.pause_reading()  # type: ignore[attr-defined]
            else:
                self.transport.resume_reading()  # type: ignore[attr-defined]

    def _answer(self, frame: Frame) -> None:
        self._answering = True
        if (code := refusal(frame.pdu, self._endpoint.served_functions)) is not None:
            self.pdu_send(ExceptionResponse(frame.pdu[0], code, frame.unit, frame.transaction))
            return
        self.recv_buffer = b""
        super().data_received(frame.raw)

    def _write_next(self) -> None:
        self.pass_on(self._outbox.popleft()[1])
        self._answer_next()
