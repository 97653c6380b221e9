"""The serial line of a simulator: where a frame ends, how long it takes, and bytes that are not read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from .connection import MOST_UNREAD, Connection
from .framing import take_rtu

if TYPE_CHECKING:
    from .endpoint import SimulatorEndpoint

BAUD: Final = 115200
BYTE_S: Final = 10 / BAUD
"""8N1: a start bit, eight data bits and a stop bit, 86.8 us."""
SILENCE_S: Final = 0.00175
"""Modbus RTU ends a frame at a silence of 3.5 characters; at more than 19200 baud of this, whatever a
character takes (Modbus over Serial Line, 2.5.1.1)."""
TIMER_S: Final = 0.0015
"""A timer of the loop comes up to a millisecond late, for epoll rounds its time-outs up."""

LONGEST_PAUSE_S: Final = 0.02
"""Longer than this no frame pauses on its way to this program, which does not see the wire: a USB adapter
keeps what it has for up to 16 ms (the usual latency timer), and who writes half a frame to a pseudo terminal
was kept from the other half for 1.9 ms (4000 frames on a busy machine). A client that waits in vain for an
answer waits longer before it asks again, so no more than one request is lost with what was cut off."""

MOST_UNSENT: Final = 4096
"""The most unread bytes on the line; further replies are lost."""


class WireTime:
    """Says when bytes have arrived, in each direction. Keeps no clock.

    A request is whole once its last byte has come and the silence after it has passed; then the reply
    begins. What it is counted from is that moment and not the timer that stood for it, which is late by a
    bit: such delays would add up, exchange after exchange.
    """

    def __init__(self) -> None:
        self._heard_until = 0.0
        self._answers_from = 0.0
        self._sent_until = 0.0

    def unheard(self, now: float) -> float:
        """Bytes that are still on their way to the gripper."""
        return (self._heard_until - now) / BYTE_S

    def unsent(self, now: float) -> float:
        """Bytes that are still on their way from it."""
        return (self._sent_until - now) / BYTE_S

    def hears(self, now: float, size: int) -> tuple[float, float]:
        """Bytes set out for the gripper.

        Returns:
            When they have come and the silence has passed; and the pause before them on the line.
        """
        pause = max(0.0, now - self._heard_until)
        self._heard_until = max(now, self._heard_until) + size * BYTE_S
        return self._heard_until + SILENCE_S, pause

    def heard(self, when: float) -> None:
        """Call back for everything that is due."""
        self._answers_from = when

    def sends(self, now: float, size: int) -> float:
        """When bytes that the gripper sends now have arrived at the client."""
        begins = self._answers_from if now - self._answers_from < TIMER_S else now
        self._sent_until = max(begins, self._sent_until) + size * BYTE_S
        return self._sent_until


class SerialConnection(Connection):
    """The other end of a serial line, which has no connections, no packets and no flow control."""

    def __init__(self, endpoint: SimulatorEndpoint, *, paced: bool) -> None:
        """The end of a line.

        Args:
            endpoint: the simulator it belongs to.
            paced: whether bytes take the time that they take at the baud rate.
        """
        super().__init__(endpoint)
        self._wire = WireTime() if paced else None
        self._heard_at = 0.0
        self._unsent = 0
        """Bytes sent since the line had taken all of them."""

    def data_received(self, data: bytes) -> None:
        """Take bytes from the line, once they have come; more than it can carry for long is lost."""
        now = self._loop.time()
        if self._wire is None:
            pause, self._heard_at = now - self._heard_at, now
            self._hear(data, pause)
        elif self._wire.unheard(now) < MOST_UNREAD:
            due, pause = self._wire.hears(now, len(data))
            self._loop.call_at(due, self._hear_late, due, data, pause)

    def _hear_late(self, due: float, data: bytes, pause: float) -> None:
        assert self._wire is not None, "bytes take time"
        self._wire.heard(due)
        if self.is_active():
            self._hear(data, pause)

    def _hear(self, data: bytes, pause: float) -> None:
        """Bytes have come; those of a frame that was cut off before them are dropped."""
        self._answer_next()  # complete frames are answered, even if their turn has not come
        if not self._goes_on and _begins_anew(pause, data):
            self._inbox.clear()
        super().data_received(data)

    def pass_on(self, part: bytes) -> None:
        """Send bytes; a reader has them when the last one has arrived."""
        now = self._loop.time()
        if self._wire is None:
            self._put(part)
        elif part and self._wire.unsent(now) < MOST_UNSENT:
            self._loop.call_at(self._wire.sends(now, len(part)), self._put, part)

    def _put(self, part: bytes) -> None:
        """Put bytes on the line, unless too many are unread."""
        if self.is_active() and not self.transport.get_write_buffer_size():
            self._unsent = 0
        if self._unsent + len(part) <= MOST_UNSENT:
            self._unsent += len(part)
            super().pass_on(part)

    def _regulate(self) -> None:
        """Drop requests that come faster than the answers: a serial line cannot make a client wait."""
        if len(self._inbox) > MOST_UNREAD:
            self._inbox.clear()


def _begins_anew(pause: float, data: bytes) -> bool:
    """Whether bytes are the beginning of a frame and not the rest of one, judged by the pause before them.

    In between, when it may be the line or the machine that paused, a whole request is a beginning: by
    chance the rest of a frame has its checksum once in 65,536 times.
    """
    return pause > LONGEST_PAUSE_S or (pause > SILENCE_S and take_rtu(bytearray(data)) is not None)
