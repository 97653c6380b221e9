"""One request on its way, and what has arrived of its reply.

A line that echoes what is sent (a half-duplex adapter that receives its own bytes) is recognised by the first
read of a connection. It needs no option: a reply to a read does not begin with the whole request, checksum
included. From then on each request must come back whole before its reply, so that the echo of a write is
never taken for its acknowledgement, which begins with the same six bytes.
"""

from __future__ import annotations

import asyncio

from ..values.errors import ProtocolError, RobotiqConnectionError
from .frames import MisfitError, RefusedError, check_sum, expected_reply, is_write, show


class Exchange:
    """A request frame and the check of its reply, byte by byte.

    Attributes:
        answer: the whole reply, or why there is none.
        is_echoed: whether the line echoes requests; None until that is known.
    """

    def __init__(
        self, frame: bytes, loop: asyncio.AbstractEventLoop, *, serial: bool, is_echoed: bool | None = False
    ) -> None:
        self.answer: asyncio.Future[bytes] = loop.create_future()
        self.is_echoed = is_echoed
        self._frame = frame
        self._serial = serial
        self._expected = expected_reply(frame, serial=serial)
        self._received = b""

    @property
    def is_waiting(self) -> bool:
        """Whether the reply, or an end without one, has yet to come."""
        return not self.answer.done()

    def take(self, data: bytes) -> ProtocolError | None:
        """Take bytes; the last one of the reply ends the exchange, or the first wrong one.

        Returns:
            The error for bytes after the acknowledgement of a write, which counts all the same.
        """
        self._received += data
        try:
            reply = self._without_echo(self._received)
            extra = self._beyond_acknowledgement(reply)
            reply = reply[: len(reply) - len(extra)]
            if not self._is_whole(reply):
                return None
        except ProtocolError as error:
            self.fail(error)
            return None
        self.answer.set_result(reply)
        return strays(extra) if extra else None

    def fail(self, error: RobotiqConnectionError) -> None:
        """End the exchange with an error."""
        if self.is_waiting:
            self.answer.set_exception(error)

    def _is_whole(self, reply: bytes) -> bool:
        try:
            is_whole = self._expected.is_complete(reply)
        except RefusedError:
            self._check_sum(reply)  # a damaged reply refuses nothing
            raise
        if is_whole:
            self._check_sum(reply)
        return is_whole

    def _check_sum(self, reply: bytes) -> None:
        if self._serial:
            check_sum(reply)

    def _without_echo(self, received: bytes) -> bytes:
        """The part of the bytes that belongs to the reply."""
        if self.is_echoed is False:
            return received
        size = len(self._frame)
        if received[:size] != self._frame[: len(received)]:
            if self.is_echoed:
                raise MisfitError(f"the line echoes what is sent, but not this time: {show(received)}")
            return received
        if len(received) < size:
            return b""
        self.is_echoed = True
        return received[size:]

    def _beyond_acknowledgement(self, reply: bytes) -> bytes:
        """The bytes after a whole acknowledgement on a serial line.

        A floating line makes up a byte when the device stops sending. The write is acknowledged nonetheless,
        and reporting it as in doubt would end the motion. For a read it costs nothing to read again.
        """
        size = self._expected.size
        return reply[size:] if self._serial and is_write(self._frame) else b""


def strays(data: bytes) -> MisfitError:
    """The error for bytes that answer nothing."""
    return MisfitError(f"{len(data)} bytes without a request: {show(data)}")
