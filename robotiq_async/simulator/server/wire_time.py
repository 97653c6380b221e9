"""How long bytes are on a serial line: a pseudo terminal has no baud rate, and carries them at once."""

from __future__ import annotations

from typing import Final

BAUD: Final = 115200
BYTE_S: Final = 10 / BAUD
"""8N1: a start bit, eight data bits and a stop bit, 86.8 us."""
SILENCE_S: Final = 0.00175
"""Modbus RTU ends a frame at a silence of 3.5 characters; at more than 19200 baud of this, whatever a
character takes (Modbus over Serial Line, 2.5.1.1)."""
TIMER_S: Final = 0.0015
"""A timer of the loop comes up to a millisecond late, for epoll rounds its time-outs up."""


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
