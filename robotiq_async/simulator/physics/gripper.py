"""SimulatedGripper: a gripper in memory, with an injected clock and no I/O."""

from __future__ import annotations

import math
import sys
import time
from collections import deque
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Final, NamedTuple

from robotiq_async.enums import AXES, NO_AXES, Fault, Finger
from robotiq_async.wire import registers as reg
from robotiq_async.wire.checks import check_axis, check_byte, check_int, check_mask, check_seconds
from robotiq_async.wire.request import Request

from .axis import Axis, Obstacle
from .control_modes import SCISSOR_HIGH, SCISSOR_LOW
from .controller import REST, Controller
from .spread import SEED
from .status_report import status_registers

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

_HISTORY: Final = 10_000
_LONGEST: Final = 1e9


class Write(NamedTuple):
    """One write as it came in.

    Attributes:
        time: reading of the gripper's clock, in seconds.
        registers: the full image after the write.
    """

    time: float
    registers: reg.Registers


class SimulatedGripper:
    """A 3-Finger gripper that behaves like the real one as far as public sources tell.

    Nothing runs in the background: the gripper catches up with its clock whenever it is read, written or
    changed. Motions, contacts, faults and delayed requests happen at their exact times, so a result does not
    depend on how often anybody looks. Use one from one thread only.

    A write takes effect one device cycle later, as on the device. Speeds are the measured ones of
    :mod:`robotiq_async.calibration.closing_time`; the scissor moves the same counts a second, as none are
    published. What the motors draw stands in :mod:`.motor`, and by how much axes miss what they are asked in
    :mod:`.spread`: as with a real gripper, who waits for gPO = rPR waits for ever.

    Choices where no source settles the behaviour:

    * An axis that meets something, or tries again, presses for 50 ms with gDT 0 before it reports a contact.
    * An axis that stands within 2 counts of a new request has reached it, and does not move.
    * Activation closes and opens at full speed (4.2 s); a failed one stays at gIMC = 1 with fault 0x0D.
    * Clearing rGTO ends a grip (:attr:`grips`), though the axis stays in its place and its gDT tells of the
      contact still. A real finger locks itself; whether that holds a part nobody has tried.
    * gMOD, gGTO and the position echoes follow the request also while reset.
    * A minor or major fault stops the axes where they are, with gDT 0; interference below 20 s stops the
      scissor only. When a minor fault ends, a request with rGTO = 1 goes on by itself.
    * The scissor takes its requests as counts, within 6..232.
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        *,
        device_cycle: float = 0.005,
        speedup: float = 1.0,
        scissor_limit: tuple[int, int] = (SCISSOR_LOW, SCISSOR_HIGH),
        powered: bool = True,
        spread: bool = True,
        seed: int = SEED,
    ) -> None:
        """A gripper that was just switched on: open, reset, all registers 0.

        Args:
            clock: gives the time in seconds; must not go backwards.
            device_cycle: simulated seconds between a write and its effect, 0 for none.
            speedup: simulated seconds in one second of the clock. Everything the gripper does becomes faster.
            scissor_limit: a software limit of the scissor in counts. A request beyond it is replaced by the
                limit and reported as reached while the echo keeps the request.
            powered: whether the gripper is switched on; :meth:`power_on` does it later.
            spread: whether axes stop a count or two beside what was asked, and feel an object some counts
                early or late. Without it they are exact: an open finger reads 6, a closed one 241.
            seed: which gripper it is, 0 or more: another seed, other counts; the same seed, the same.

        Raises:
            TypeError: an argument is of the wrong type.
            ValueError: device_cycle or seed is negative, speedup is not above 0, or scissor_limit is not a
                range within 6..232.
        """
        self._cycle = check_seconds("device_cycle", device_cycle, 0, _LONGEST)
        self._speedup = _check_speedup(speedup)
        number = check_int("seed", seed, 0, sys.maxsize)
        self._controller = Controller(_check_limit(scissor_limit), number if spread else None)
        self._clock = clock
        self._began = clock()
        self._time = 0.0
        self._off_until = -math.inf if powered else math.inf
        self._written = list(REST.registers)
        self._pending: deque[tuple[float, Request]] = deque()
        self._writes: deque[Write] = deque(maxlen=_HISTORY)

    # The bus side.

    def write(self, address_offset: int, registers: Sequence[int]) -> None:
        """Write some or all of the eight request registers; the others keep their content.

        A gripper without power loses the write.

        Args:
            address_offset: index of the first register written, 0..7.
            registers: one or more values of 16 bits.

        Raises:
            TypeError: the offset or a register is not an int.
            ValueError: the registers do not lie within the block, or one is outside 0..65535.
        """
        offset = check_int("address_offset", address_offset, 0, reg.REGISTER_COUNT - 1)
        room = reg.REGISTER_COUNT - offset
        if not 1 <= len(registers) <= room:
            raise ValueError(f"registers: expected 1..{room} from offset {offset}, got {len(registers)}")
        image = list(self._written)
        image[offset : offset + len(registers)] = registers
        checked = reg.check_registers(image)
        self._catch_up()
        if not self._is_on:
            return
        self._written = list(checked)
        self._writes.append(Write(self._clock(), checked))
        # In their order, also when the device cycle has become shorter meanwhile.
        due = max(self._time + self._cycle, self._pending[-1][0] if self._pending else 0.0)
        self._pending.append((due, Request.from_registers(checked)))
        self._catch_up()

    @property
    def request_registers(self) -> reg.Registers:
        """The eight request registers as written, in effect or not yet."""
        self._catch_up()
        return tuple(self._written)

    def status_registers(self) -> reg.Registers:
        """The eight status registers; zeros without power."""
        self._catch_up()
        if not self._is_on:
            return (0,) * reg.REGISTER_COUNT
        return status_registers(self._controller, self._time)

    # The world around.

    def place_object(
        self,
        fingers: Finger | int,
        position: int,
        *,
        opening: bool = False,
        soft: int = 0,
        thin: bool = False,
    ) -> None:
        """Put something in the way of some axes.

        An axis that has passed the position already has the object behind it: no contact until it comes
        from the other side. Each axis has room for one object per direction; a second replaces the first.
        An axis that stands in a contact stays there, wherever the object is now.

        Args:
            fingers: the axes it is in the way of.
            position: count at which an axis touches it, 0..255.
            opening: it is met when opening (gDT = 1) instead of closing (gDT = 2).
            soft: counts by which a force of 255 presses the axis into it, 0..255.
            thin: it is a thin object between fingertips, which the gripper may hold without ever reporting a
                contact (manual). Here it never does: the axes go on to their request or their stops.

        Raises:
            TypeError: an argument is not an int.
            ValueError: fingers is not a mask of axes, or another argument is outside 0..255.
        """
        met = Obstacle(check_byte("position", position), check_byte("soft", soft))
        obstacle = None if thin else met
        for axis in self._axes(check_mask(fingers)):
            if opening:
                axis.in_opening = obstacle
            else:
                axis.in_closing = obstacle
            axis.look_again(self._time)

    def remove_object(self, fingers: Finger | int = Finger.ALL) -> None:
        """Take away what is in the way of some axes.

        Those it has stopped stay in their contact until a position on the other side is requested, the force
        is raised or rGTO goes from 0 to 1 (manual).

        Raises:
            TypeError: fingers is not an int.
            ValueError: fingers is not a mask of axes.
        """
        for axis in self._axes(check_mask(fingers)):
            axis.in_closing = axis.in_opening = None
            axis.look_again(self._time)

    def inject_fault(self, fault: Fault | int, duration: float | None = None) -> None:
        """Make a fault appear. A minor or major one stops the axes; interference, see :meth:`interfere`.

        Args:
            fault: the code, 1..15; unassigned codes count as major.
            duration: simulated seconds until it ends by itself; None: until :meth:`clear_faults` or a reset.

        Raises:
            TypeError: duration is not a number.
            ValueError: no such fault, or duration is negative.
        """
        fault = Fault(fault)
        if fault is Fault.NONE:
            raise ValueError("fault must be a code in 1..15, got 0; clear_faults() ends faults")
        lasts = None if duration is None else check_seconds("duration", duration, 0, _LONGEST)
        self._catch_up()
        self._controller.faults.begin(fault, self._time, lasts)
        self._controller.update(self._time)

    def interfere(self, duration: float | None = None) -> None:
        """Block the scissor: fault 0x0A, which stops it alone, and after 20 s 0x0E, which stops everything.

        Args:
            duration: simulated seconds, None: until :meth:`clear_faults` or a reset.

        Raises:
            TypeError: duration is not a number.
            ValueError: duration is negative.
        """
        self.inject_fault(Fault.SCISSOR_INTERFERENCE, duration)

    def clear_faults(self) -> None:
        """End the injected faults; a request with rGTO = 1 goes on by itself."""
        self._catch_up()
        self._controller.faults.clear()
        self._controller.update(self._time)

    def emergency_release(self) -> None:
        """Begin an automatic release as rATR = 1 would; without effect while reset."""
        self._catch_up()
        self._controller.release(self._time)

    @property
    def fail_activation(self) -> bool:
        """Whether the next activation ends in fault 0x0D; False again when it has."""
        self._catch_up()
        return self._controller.fail_activation

    @fail_activation.setter
    def fail_activation(self, value: bool) -> None:
        self._catch_up()
        self._controller.fail_activation = value

    def power_off(self) -> None:
        """Cut the power: requests, activation and faults are lost, the axes stay where they are."""
        self._catch_up()
        self._off_until = math.inf
        self._pending.clear()
        self._written = list(REST.registers)
        self._controller.power_off(self._time)

    def power_on(self) -> None:
        """Switch on; without effect when it is on."""
        self._catch_up()
        self._off_until = -math.inf

    def power_cycle(self, off_time: float = 0.0) -> None:
        """Cut the power for some simulated seconds.

        Raises:
            TypeError: off_time is not a number.
            ValueError: off_time is negative.
        """
        seconds = check_seconds("off_time", off_time, 0, _LONGEST)
        self.power_off()
        self._off_until = self._time + seconds

    # Inspection.

    @property
    def device_cycle(self) -> float:
        """Simulated seconds between a write and its effect."""
        return self._cycle

    @device_cycle.setter
    def device_cycle(self, value: float) -> None:
        self._cycle = check_seconds("device_cycle", value, 0, _LONGEST)

    @property
    def speedup(self) -> float:
        """Simulated seconds in one second of the clock."""
        return self._speedup

    @property
    def is_powered(self) -> bool:
        """Whether the gripper is switched on."""
        self._catch_up()
        return self._is_on

    @property
    def _is_on(self) -> bool:
        return self._time >= self._off_until

    @property
    def is_moving(self) -> bool:
        """Whether an axis really moves, for whatever reason."""
        self._catch_up()
        return any(axis.is_moving for axis in self._controller.axes)

    @property
    def grips(self) -> Finger:
        """The axes that are driven against what they touch: rGTO is set, and the request lies beyond it."""
        self._catch_up()
        gripping = (name for name, axis in zip(AXES, self._controller.axes, strict=True) if axis.grips)
        return reduce(or_, gripping, NO_AXES)

    def position(self, finger: Finger | int) -> int:
        """Where one axis is, in counts, as gPO reads.

        Raises:
            TypeError: finger is not an int.
            ValueError: finger is not exactly one axis.
        """
        return round(self._axis(finger).position(self._time))

    def target(self, finger: Finger | int) -> int:
        """Where one axis is driven to, in counts within its limits; without a go, where it is.

        Raises:
            TypeError: finger is not an int.
            ValueError: finger is not exactly one axis.
        """
        return self._axis(finger).target

    def travel(self, finger: Finger | int) -> float:
        """The way one axis has gone so far, in counts, forth and back added up. It never decreases.

        Raises:
            TypeError: finger is not an int.
            ValueError: finger is not exactly one axis.
        """
        return self._axis(finger).travel(self._time)

    @property
    def writes(self) -> tuple[Write, ...]:
        """The last 10000 writes, oldest first."""
        return tuple(self._writes)

    def _axis(self, finger: Finger | int) -> Axis:
        index = AXES.index(check_axis(finger))
        self._catch_up()
        return self._controller.axes[index]

    def _axes(self, fingers: Finger) -> list[Axis]:
        self._catch_up()
        return [axis for name, axis in zip(AXES, self._controller.axes, strict=True) if name in fingers]

    def _catch_up(self) -> None:
        """Let everything happen that is due, each thing at its own time."""
        now = max(self._time, (self._clock() - self._began) * self._speedup)
        while True:
            event = self._controller.next_event
            effect = self._pending[0][0] if self._pending else math.inf
            if event > now and effect > now:
                break
            if event <= effect:
                self._controller.update(event)
            else:
                self._controller.apply(*self._pending.popleft())
        self._time = now


def _check_speedup(value: float) -> float:
    factor = check_seconds("speedup", value, 0, _LONGEST)
    if factor == 0:
        raise ValueError(f"speedup must be above 0, got {value!r}")
    return factor


def _check_limit(limit: tuple[int, int]) -> tuple[int, int]:
    low = check_int("scissor_limit", limit[0], SCISSOR_LOW, SCISSOR_HIGH)
    return low, check_int("scissor_limit", limit[1], low, SCISSOR_HIGH)
