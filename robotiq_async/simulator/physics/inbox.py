"""Inbox: the writes to a simulated gripper, until they take effect."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Final, NamedTuple

from robotiq_async.values import registers as reg
from robotiq_async.values.checks import check_int
from robotiq_async.values.model import Model
from robotiq_async.values.request import Request

from .controller import ZEROS

_MOST_KEPT_IMAGES: Final = 10_000
_ROUNDING: Final = 1e-9


class HeardWrite(NamedTuple):
    """One write that was kept.

    Attributes:
        time: reading of the gripper's clock, in seconds.
        registers: the full image after the write.
    """

    time: float
    registers: reg.Registers


class Inbox:
    """Takes writes; each takes effect a device cycle later. Times are simulated seconds.

    Attributes:
        image: the registers as written, in effect or not yet.
        pending: writes that will take effect, with their times, oldest first.
        writes: the last writes that were kept, oldest first.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        self.image: reg.Registers = ZEROS
        self.pending: deque[tuple[float, Request]] = deque()
        self.writes: deque[HeardWrite] = deque(maxlen=_MOST_KEPT_IMAGES)
        self._kept_at: float | None = None

    def checked(self, address_offset: int, registers: Sequence[int]) -> reg.Registers:
        """The image with some registers replaced; raises as :meth:`SimulatedGripper.write`."""
        offset = check_int("address_offset", address_offset, 0, reg.REGISTER_COUNT - 1)
        room = reg.REGISTER_COUNT - offset
        if not 1 <= len(registers) <= room:
            raise ValueError(f"registers: expected 1..{room} from offset {offset}, got {len(registers)}")
        image = list(self.image)
        image[offset : offset + len(registers)] = registers
        return reg.check_registers(image)

    def keep(self, time: float, write: HeardWrite, cycle: float, spacing: float) -> None:
        """Keep a write, unless it follows the last one too closely: then it is forgotten."""
        if self._kept_at is not None and time - self._kept_at < spacing - _ROUNDING:
            return
        self._kept_at = time
        self.image = write.registers
        self.writes.append(write)
        # Keep their order, even if the device cycle has been shortened.
        due = max(time + cycle, self.pending[-1][0] if self.pending else 0.0)
        self.pending.append((due, Request.from_registers(write.registers, self._model)))

    def hasten(self, time: float) -> None:
        """Let all that is pending take effect now."""
        self.pending = deque((min(due, time), request) for due, request in self.pending)

    def clear(self, image: reg.Registers = ZEROS) -> None:
        self.image = image
        self.pending.clear()
        self._kept_at = None
