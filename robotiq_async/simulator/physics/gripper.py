"""SimulatedGripper: a gripper in memory, with an injected clock and no I/O."""

from __future__ import annotations

import math
import sys
import time
from collections import deque
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Final, NamedTuple

from robotiq_async.values import registers as reg
from robotiq_async.values.checks import check_int, check_number, check_seconds
from robotiq_async.values.enums import NO_AXES, Fault, Finger
from robotiq_async.values.model import Model, model_of
from robotiq_async.values.request import Request

from .control_modes import SCISSOR_HIGH, SCISSOR_LOW, check_ends, check_scissor_limit
from .controller import ZEROS, GripperController
from .driven_axis import PhysicsError
from .habits import Habits
from .spread import SEED
from .surroundings import Surroundings

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from robotiq_async.calibration.motion_profile import MotionProfile

    from .axis import Axis
    from .bodies import Bodies
    from .driven_axis import Mechanism

_LONGEST: Final = 1e9
_HISTORY: Final = 10_000
_ROUNDING: Final = 1e-9
_CYCLE: Final = 0.005
"""Device cycle of a 3-Finger: its registers are renewed at 200 Hz (manual)."""


class SimulatedGripper(Surroundings):
    """A gripper that behaves like the real one, as far as public sources go: a 3-Finger, or a sibling.

    Nothing runs in the background: the gripper catches up with its clock whenever it is read, written or
    changed. Motions, contacts, faults and delayed requests happen at their exact times, so a result does not
    depend on how often it is read. Use one from one thread only.

    A write takes effect one device cycle later, as on the device. Motions take the time of
    :mod:`robotiq_async.calibration.motion_profile`: measured closings of a 3-Finger, whose scissor
    moves the same counts a second, as none are published; recorded motions of a 2F-85; and for the other
    siblings an estimate. Motor currents are in :mod:`.axis`; how far axes miss their requests, in
    :mod:`.spread`: as with a real gripper, a program that waits for gPO = rPR may wait for ever.

    Choices where no source settles the behaviour; those that can be changed are in :class:`Habits`:

    * A finger that meets something, or tries again, presses for 50 ms with gDT 0 before it reports a contact.
    * A jaw begins a motion late only from rest: on its way it takes a new request at once, and turns at once.
      Small steps in one direction are one motion if they follow within 0.2 s: no recording has such a stream.
    * An axis within 2 counts of a new request has reached it, and does not move.
    * A failed activation stays at gIMC = 1 with fault 0x0D.
    * gMOD, gGTO and the position echoes follow the request also while reset.
    * A minor or major fault stops the axes where they are, with gDT 0; interference below 20 s stops the
      scissor only. When a minor fault ends, a request with rGTO = 1 resumes.
    * The scissor takes its requests as counts, within 15..232.
    * The motor of a sibling draws what finger A of a 3-Finger does.
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        *,
        device_cycle: float | None = None,
        speedup: float = 1.0,
        scissor_limit: tuple[int, int] = (SCISSOR_LOW, SCISSOR_HIGH),
        powered: bool = True,
        spread: bool = True,
        seed: int = SEED,
        habits: Habits | None = None,
        model: Model | str | None = None,
        physics: Mechanism | None = None,
        motion: MotionProfile | None = None,
        ends: tuple[int, int] | None = None,
    ) -> None:
        """A gripper that was just switched on: open, reset, all registers 0.

        Args:
            clock: gives the time in seconds; must not go backwards.
            device_cycle: simulated seconds between a write and its effect, 0 for none; None for 5 ms on a
                3-Finger and none on a sibling, whose next status has the echo (recorded of a 2F-85).
            speedup: simulated seconds in one second of the clock. All motions and sequences become faster.
            scissor_limit: a software limit of the scissor in counts. A request beyond it is replaced by the
                limit and reported as reached while the echo keeps the request.
            powered: whether the gripper is switched on; :meth:`power_on` does it later.
            spread: whether axes stop a count or two beside their requests, and feel an object some counts
                early or late. Without it they are exact: an open finger reads 6, a closed one 241.
            seed: number of this gripper, 0 or more: another seed, other counts; the same seed, the same.
            habits: its choices that the manual leaves open; None for the usual ones.
            model: of the gripper, a :class:`Model` or its name; None for a 3-Finger.
            physics: a :class:`Physics` of its own, which moves the axes and has the parts they meet; None for
                straight lines in time and the obstacles of :meth:`place_object`. There is no spread with it.
            motion: its motion in time; None for the usual one of its model.
            ends: counts that a finger, or the jaw, reads when it is open, and closed with the least force;
                None for the usual ones. With physics the bodies have theirs.

        Raises:
            TypeError: an argument is of the wrong type.
            ValueError: device_cycle or seed is negative, speedup is not above 0, scissor_limit is not a range
                within 6..232, ends are not two counts in order, or no model has this name.
        """
        number = check_int("seed", seed, 0, sys.maxsize)
        limit, seed_or_none = check_scissor_limit(scissor_limit), number if spread else None
        self._speedup = check_number("speedup", speedup, 0, _LONGEST)
        if self._speedup == 0:
            raise ValueError(f"speedup must be above 0, got {speedup!r}")
        kind = model_of(model)
        cycle = (_CYCLE if kind.has_modes else 0.0) if device_cycle is None else device_cycle
        self._cycle = check_seconds("device_cycle", cycle, 0, _LONGEST)
        self._physics = physics
        if physics is not None:
            physics.attach(kind, clock, self._speedup)
        ends = None if ends is None else check_ends(ends)
        super().__init__(
            GripperController(kind, limit, seed_or_none, habits or Habits(), physics, motion, ends)
        )
        self._clock = clock
        self._began = clock()
        self._off_until = -math.inf if powered else math.inf
        self._heard_at = 0.0
        self._inbox = Inbox(self.model)

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
        image = self._inbox.checked(address_offset, registers)
        self._catch_up()
        if self._is_on:
            self._heard_at = self._time
            self._inbox.keep(
                self._time, HeardWrite(self._clock(), image), self._cycle, self.habits.write_spacing
            )
            self._catch_up()

    def carry_out_writes(self) -> None:
        """Let pending writes take effect now, and not a device cycle later."""
        self._catch_up()
        self._inbox.hasten(self._time)
        self._catch_up()

    @property
    def request_registers(self) -> reg.Registers:
        """The eight request registers as written, in effect or not yet."""
        self._catch_up()
        return self._inbox.image

    def status_registers(self) -> reg.Registers:
        """The eight status registers; zeros without power."""
        self._catch_up()
        if not self._is_on:
            return (0,) * reg.REGISTER_COUNT
        silence, self._heard_at = self._time - self._heard_at, self._time
        fault = self._controller.fault
        if silence >= self.habits.silence_fault and not fault.is_serious:
            fault = Fault.COMMUNICATION_NOT_READY
        return self._controller.status_registers(self._time, fault)

    # Power.

    def power_off(self) -> None:
        """Cut the power: requests, activation and faults are lost, the axes stay where they are."""
        self._catch_up()
        self._off_until = math.inf
        self._inbox.clear()
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

    def strand(self) -> None:
        """Lose the activation, and keep rACT: gACT is 1 and gIMC 0, and nothing moves until rACT is cleared.

        A 2F-85 was found so, by a client that then reset and activated it. What had come before is not known.
        A gripper without power stays as it is.
        """
        self._catch_up()
        if self._is_on:
            request = Request(
                activate=True, individual_fingers=False, individual_scissor=False, model=self.model
            )
            self._inbox.clear()
            self._inbox.image = request.registers
            self._controller.strand(self._time, request)

    # Bodies.

    @property
    def physics(self) -> Mechanism | None:
        """The drive of its axes; None for straight lines in time."""
        return self._physics

    @property
    def bodies(self) -> Bodies | None:
        """Places of joints and parts, for a drawing; None without physics, and after an error in it."""
        if self._physics is None:
            return None
        try:
            self._catch_up()
            return self._physics.bodies()
        except PhysicsError:
            return None

    # Inspection.

    @property
    def model(self) -> Model:
        """The model of the gripper."""
        return self._controller.model

    @property
    def habits(self) -> Habits:
        """Its choices that the manual leaves open; may be replaced at any time."""
        return self._controller.habits

    @habits.setter
    def habits(self, value: Habits) -> None:
        self._catch_up()
        self._controller.habits = value

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
    def _now(self) -> float:
        """Simulated seconds since the gripper was made, by its clock."""
        return (self._clock() - self._began) * self._speedup

    @property
    def is_powered(self) -> bool:
        """Whether the gripper is switched on."""
        return max(self._time, self._now) >= self._off_until

    @property
    def _is_on(self) -> bool:
        return self._time >= self._off_until

    @property
    def is_moving(self) -> bool:
        """Whether an axis moves, for any reason."""
        self._catch_up()
        return any(axis.is_moving for axis in self._controller.axes)

    @property
    def grips(self) -> Finger:
        """The axes that press against an obstacle: rGTO is set, and the request lies beyond it."""
        self._catch_up()
        return self._those(lambda axis: axis.grips)

    @property
    def holds(self) -> Finger:
        """The axes that hold something: they grip, or did when rGTO was cleared or a fault came.

        Such an axis locks itself, unless the gripper ``lets_go_on_halt``. A reset, a loss of power and a new
        request end that.
        """
        self._catch_up()
        return self._those(lambda axis: axis.holds)

    def _those(self, wanted: Callable[[Axis], bool]) -> Finger:
        named = zip(self.model.axes, self._controller.axes, strict=True)
        return reduce(or_, (name for name, axis in named if wanted(axis)), NO_AXES)

    def position(self, finger: Finger | int) -> int:
        """The position of one axis in counts, as gPO reads.

        Raises:
            TypeError: finger is not an int.
            ValueError: finger is not exactly one axis.
        """
        return round(self._axis(finger).position(self._time))

    def target(self, finger: Finger | int) -> int:
        """The target of one axis in counts, within its limits; without a go, its position.

        Raises:
            TypeError: finger is not an int.
            ValueError: finger is not exactly one axis.
        """
        return self._axis(finger).target

    def travel(self, finger: Finger | int) -> float:
        """The distance that one axis has travelled so far, in counts, in both directions. It never decreases.

        Raises:
            TypeError: finger is not an int.
            ValueError: finger is not exactly one axis.
        """
        return self._axis(finger).travel(self._time)

    @property
    def writes(self) -> tuple[HeardWrite, ...]:
        """The last 10000 writes that were kept, oldest first."""
        return tuple(self._inbox.writes)

    def _axis(self, finger: Finger | int) -> Axis:
        index = self.model.index(finger)
        self._catch_up()
        return self._controller.axes[index]

    def _catch_up(self) -> None:
        """Let everything happen that is due, each thing at its own time."""
        now = max(self._time, self._now)
        pending = self._inbox.pending
        while True:
            effect = pending[0][0] if pending else math.inf
            if self._physics is not None:
                self._let_move(self._physics, min(now, effect, self._controller.next_event))
            event = self._controller.next_event
            if event > now and effect > now:
                break
            if event <= effect:
                self._controller.update(event)
            else:
                self._controller.apply(*pending.popleft())
        self._time = now

    def _let_move(self, physics: Mechanism, until: float) -> None:
        """Let the bodies move until a time, or until an axis has something to report."""
        axes = self._controller.driven
        while physics.step(until):
            time = self._time = max(self._time, physics.time)
            reports = [axis.observe(time) for axis in axes]
            if any(reports):
                return


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
        self.writes: deque[HeardWrite] = deque(maxlen=_HISTORY)
        self._kept_at: float | None = None

    def checked(self, address_offset: int, registers: Sequence[int]) -> reg.Registers:
        """The image with some registers replaced; raises what :meth:`SimulatedGripper.write` does."""
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

    def clear(self) -> None:
        self.image = ZEROS
        self.pending.clear()
        self._kept_at = None
