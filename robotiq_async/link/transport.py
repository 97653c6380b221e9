"""What a hand needs of a link."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from ..wire.registers import Registers


@runtime_checkable
class Transport(Protocol):
    """What a hand needs of a link. Pass an object of this shape instead of an address for other buses.

    One task calls it, one call at a time. After any failure the transport is closed, and :meth:`open`
    begins anew.
    """

    @property
    def is_open(self) -> bool:
        """Whether requests can be sent."""

    async def open(self) -> None:
        """Connect.

        Raises:
            RobotiqConnectionError: nobody answers, or not what was expected.
        """

    async def read(self) -> Registers:
        """The eight status registers.

        Raises:
            RobotiqConnectionError: no clean answer in time; the transport is closed.
        """

    async def write(self, registers: Sequence[int]) -> None:
        """Write the eight request registers, exactly once.

        Raises:
            RobotiqConnectionError: no clean acknowledgement in time; the transport is closed.
        """

    async def close(self) -> None:
        """Disconnect; never fails, and does nothing when closed."""


class Link(Transport, Protocol):
    """A transport of ours, which can be asked to be ready: what is written then does not wait."""

    async def ready(self) -> None:
        """Wait until the line takes a request.

        Raises:
            RobotiqConnectionError: the link went down meanwhile; the transport is closed.
        """
