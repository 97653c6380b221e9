"""One request on its way, and what has arrived of its reply: of any protocol, and of Modbus.

A connection sends an exchange and hands it what arrives; the exchange knows when its reply is whole.

A line that echoes what is sent (a half-duplex adapter that receives its own bytes) is recognised by the first
read of a connection. It needs no option: a reply to a read does not begin with the whole request, checksum
included. From then on each request must come back whole before its reply, so that the echo of a write is
never taken for its acknowledgement, which begins with the same six bytes.
"""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from typing import Generic, TypeVar

from ..values.errors import ProtocolError, RobotiqConnectionError
from .address import Address
from .frames import MisfitError, RefusedError, check_sum, expected_reply, is_write, show

T = TypeVar("T")


class Exchange(ABC, Generic[T]):
    """A request and its reply, whatever the protocol.

    Attributes:
        frame: the bytes to send.
        answer: what the whole reply says, or why there is none.
    """

    def __init__(self, frame: bytes) -> None:
        self.frame = frame
        self.answer: asyncio.Future[T] = asyncio.get_running_loop().create_future()
        self._received = b""

    @property
    def is_waiting(self) -> bool:
        """Whether the reply, or an end without one, has yet to come."""
        return not self.answer.done()

    @abstractmethod
    def take(self, data: bytes) -> ProtocolError | None:
        """Take bytes; the last one of the reply ends the exchange, or the first wrong one.

        Returns:
            An error of the link that leaves the answer valid.
        """

    def fail(self, error: RobotiqConnectionError) -> None:
        """End the exchange with an error."""
        if self.is_waiting:
            self.answer.set_exception(error)

    def late(self, address: Address, seconds: float) -> str:
        """The message for a reply that has not come in time."""
        return f"{address} did not answer within {seconds:g} s"


class Echo:
    """The echo of a line, as far as it is known.

    Attributes:
        is_on: whether the line brings back what is sent; None until the first exchange of a connection.
    """

    def __init__(self) -> None:
        self.is_on: bool | None = False


class TcpExchange(Exchange[bytes]):
    """A request over Modbus TCP. Every byte of its reply is checked as it comes."""

    def __init__(self, frame: bytes) -> None:
        super().__init__(frame)
        self._expected = expected_reply(frame, serial=False)

    def take(self, data: bytes) -> ProtocolError | None:
        self._received += data
        try:
            if self._expected.is_complete(self._received):
                self.answer.set_result(self._received)
        except ProtocolError as error:
            self.fail(error)
        return None


class SerialExchange(Exchange[bytes]):
    """A request on a serial line. Every byte of its reply is checked as it comes, the checksum at its end."""

    def __init__(self, frame: bytes, echo: Echo) -> None:
        """An exchange that is not sent; it notes in ``echo`` what it learns."""
        super().__init__(frame)
        self._echo = echo
        self._expected = expected_reply(frame, serial=True)

    def take(self, data: bytes) -> ProtocolError | None:
        """Take bytes; the error is for those after an acknowledgement, which counts all the same."""
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
        self._echo.is_on = bool(self._echo.is_on)
        self.answer.set_result(reply)
        return strays(extra) if extra else None

    def _is_whole(self, reply: bytes) -> bool:
        try:
            is_whole = self._expected.is_complete(reply)
        except RefusedError:
            check_sum(reply)  # a damaged reply refuses nothing
            raise
        if is_whole:
            check_sum(reply)
        return is_whole

    def _without_echo(self, received: bytes) -> bytes:
        """The part of the bytes that belongs to the reply."""
        if self._echo.is_on is False:
            return received
        size = len(self.frame)
        if received[:size] != self.frame[: len(received)]:
            if self._echo.is_on:
                raise MisfitError(f"the line echoes what is sent, but not this time: {show(received)}")
            return received
        if len(received) < size:
            return b""
        self._echo.is_on = True
        return received[size:]

    def _beyond_acknowledgement(self, reply: bytes) -> bytes:
        """The bytes after a whole acknowledgement.

        A floating line makes up a byte when the device stops sending. The write is acknowledged nonetheless,
        and reporting it as in doubt would end the motion. For a read it costs nothing to read again.
        """
        return reply[self._expected.size :] if is_write(self.frame) else b""


def strays(data: bytes) -> MisfitError:
    """The error for bytes that answer nothing."""
    return MisfitError(f"{len(data)} bytes without a request: {show(data)}")
