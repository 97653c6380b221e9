"""One request and the bytes of its reply so far: bytes in, an answer or an outcome out. Also other steps.

No I/O, no clock and no event loop. A line sends :attr:`Exchange.frame` and feeds the bytes that arrive. The
exchange is over with the first answer or outcome that comes out. A Modbus answer is the body of the reply,
from the function code on; an answer of another protocol is its text.

A line that echoes each request (a half-duplex adapter that receives its own bytes) is recognised by the first
read of a connection. It needs no option: a reply to a read does not begin with the whole request, checksum
included. From then on each request must come back whole before its reply, so that the echo of a write is
never taken for its acknowledgement, which begins with the same six bytes.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Generator
from enum import Enum
from typing import Final, NamedTuple, TypeVar

from ..values.errors import ResponseTimeoutError
from . import frames
from .outcome import Answer, Noise, Silent, Stray

T = TypeVar("T")


class Timing(NamedTuple):
    """The limits of an exchange.

    Attributes:
        seconds: the longest time from the request to the end of the reply.
        by: its latest end, in the loop's time, even if ``seconds`` are not over.
        is_long: whether the longer silence of a serial line comes before the request.
        is_whole: whether it may take all of ``seconds`` on a shared line, too.
    """

    seconds: float
    by: float = math.inf
    is_long: bool = False
    is_whole: bool = False


class Exchange(ABC):
    """A request and its reply, in any protocol.

    Attributes:
        frame: the bytes to send.
        timing: its limits.
        extra: bytes that came after the answer and answer nothing, if any did.
    """

    extra: Stray | None = None
    _received = b""

    def __init__(self, frame: bytes, timing: Timing) -> None:
        self.frame: Final = frame
        self.timing: Final = timing

    def feed(self, data: bytes) -> Answer | None:
        """Take bytes; None while more must come."""
        self._received += data
        return self._verdict(self._received)

    @abstractmethod
    def _verdict(self, received: bytes) -> Answer | None:
        """The verdict on all bytes so far; None while more must come."""

    def late(self, place: object, seconds: float) -> Silent:
        """The outcome when the reply has not come within so many seconds."""
        return Silent(ResponseTimeoutError(f"{place} did not answer within {seconds:g} s"))


class TcpExchange(Exchange):
    """A request over Modbus TCP."""

    def _verdict(self, received: bytes) -> Answer | None:
        frame = self.frame
        expected = frames.expected_over_tcp(frame[6:])
        # The usual case, which is cheap: the header is the only part of a reply that is not as the last time.
        is_usual = received.startswith(frame[:4]) and received.startswith(expected.start, 4)
        if is_usual and len(received) == 4 + expected.size:
            return received[7:]
        return expected.after(frame[:4]).verdict(received)


class PduExchange(Exchange):
    """A request through a tunnel, which brings a whole reply or none."""

    def __init__(self, request: bytes, timing: Timing) -> None:
        super().__init__(request[1:], timing)

    def _verdict(self, received: bytes) -> Answer | None:
        answer = frames.expected_in_a_tunnel(self.frame).verdict(received)
        return answer or frames.noise(f"half an answer: {frames.show(received)}")


class Step(Enum):
    """A step of a dialogue other than an exchange."""

    READY = "everything that a request waits for; its result is the obstacle to a request, if there is any"
    HUSH = "silence; its result is noise if there is none"
    TURN = "a turn for the others"


READY, HUSH, TURN = Step
DONE: Final = b""
"""The result of a step that has succeeded, if it is no exchange."""

Dialogue = Generator[Exchange | Step, Answer, T]
"""Yields steps and gets the result of each: an answer, or the outcome that prevents it."""


class EchoFilter:
    """The echo of a line, as far as it is known.

    Attributes:
        is_on: whether the line brings back each request; None until the first exchange of a connection.
    """

    def __init__(self) -> None:
        self.is_on: bool | None = None

    def learn(self, *, is_on: bool | None) -> None:
        """Note it as an exchange has shown it; None for a new connection."""
        self.is_on = is_on


class SerialExchange(Exchange):
    """A request on a serial line; it notes in ``echo`` whether the line echoes.

    Where others use the line, too, whole frames of other units are dropped: answers that came too late for
    their questions.
    """

    def __init__(self, request: bytes, timing: Timing, echo: EchoFilter, *, has_others: bool = False) -> None:
        super().__init__(frames.serial_frame(request), timing)
        self._echo = echo
        self._has_others = has_others
        self._expected = frames.expected_reply(request, checksum=frames.CHECKSUM)

    def _verdict(self, received: bytes) -> Answer | None:
        reply = received if self._echo.is_on is False else self._without_echo(received)
        if isinstance(reply, Noise):
            return reply
        if self._has_others:
            reply = frames.after_others(reply, self.frame[0])
        # A floating line makes up a byte when the device stops sending. A write is acknowledged nonetheless,
        # and reporting it as in doubt would end the motion. A read is cheap to repeat.
        size = self._expected.size if frames.is_write(self.frame) else len(reply)
        verdict = self._expected.verdict(reply[:size])
        if type(verdict) is bytes:
            self._echo.learn(is_on=bool(self._echo.is_on))
            if len(reply) > size:
                self.extra = frames.stray(reply[size:])
        return verdict

    def _without_echo(self, received: bytes) -> bytes | Noise:
        """The part of the bytes that belongs to the reply."""
        size = len(self.frame)
        if received[:size] != self.frame[: len(received)]:
            if self._echo.is_on:
                return frames.noise(
                    f"the line echoes what is sent, but not this time: {frames.show(received)}"
                )
            return received
        if len(received) < size:
            return b""
        self._echo.learn(is_on=True)
        return received[size:]
