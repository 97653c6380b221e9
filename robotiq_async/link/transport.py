"""The connection to a gripper as a hand needs it, on any wire."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol, runtime_checkable

from ..values.errors import RobotiqConnectionError
from ..values.registers import Registers


class WriteAnswer(NamedTuple):
    """The outcome of a write that also reads.

    Attributes:
        registers: the status registers, read after the write.
        doubt: why it is unknown whether the write was carried out; None if it was acknowledged.
    """

    registers: Registers
    doubt: RobotiqConnectionError | None


class Link(Protocol):
    """A connection to a gripper. One task makes all calls, one at a time.

    After any failure it is closed; :meth:`open` starts again.
    """

    @property
    def has_current(self) -> bool:
        """Whether a status has the motor currents, as the last opening has found."""

    @property
    def is_open(self) -> bool:
        """Whether requests can be sent."""

    @property
    def asked_at(self) -> float:
        """When the read of the last status left: it may have been repeated, or have waited for its turn."""

    async def open(self) -> None:
        """Connect.

        Raises:
            RobotiqConnectionError: there is no answer, or not the expected one.
        """

    async def read(self) -> Registers:
        """The eight status registers.

        Raises:
            RobotiqConnectionError: no clean answer in time; the link is closed.
        """

    async def send(self, decide: Callable[[], Sequence[int] | None]) -> bool:
        """Write the image that ``decide`` returns, exactly once, if it returns one.

        A write may have to wait for the silence between the frames of a serial line, or for its turn on a
        line that others use. A request that stops the hand in that time must still count, so ``decide`` is
        called in the turn of the event loop in which the write leaves.

        Returns:
            Whether something was written, and acknowledged.

        Raises:
            RobotiqConnectionError: no clean acknowledgement in time; the link is closed.
        """

    async def close(self) -> None:
        """Disconnect; never fails, and does nothing when closed."""


@runtime_checkable
class CyclicLink(Link, Protocol):
    """A link that can write and read in one exchange."""

    @property
    def reads_with_writes(self) -> bool:
        """Whether the gripper can, too, as far as is known."""

    async def send_and_read(self, decide: Callable[[], Sequence[int] | None]) -> WriteAnswer | None:
        """As :meth:`send`, and read the status in the same exchange; None if nothing new was written.

        ``decide`` is called again if the gripper refuses such an exchange, before another one is tried. It is
        not called if the last image was written again, to try such an exchange.

        Raises:
            RobotiqConnectionError: no clean answer in time, and no status after it; the link is closed.
        """


@runtime_checkable
class SharedLink(Link, Protocol):
    """A link that may have to wait for its turn on a line that others use."""

    @property
    def is_shared(self) -> bool:
        """Whether others use the line now."""

    async def stop_or_read(self, decide: Callable[[], Sequence[int] | None]) -> Registers | None:
        """Write the image that ``decide`` returns, exactly once; read the status if it returns none.

        ``decide`` is called when the turn has come: a stop from the time of waiting leaves in this turn, and
        not after one more of every other user.

        Returns:
            The status registers; None if something was written, and acknowledged.

        Raises:
            RobotiqConnectionError: no clean answer in time; the link is closed.
        """
