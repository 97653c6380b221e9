"""SimulatedGripper: a gripper in memory, with an injected clock and no I/O."""

from __future__ import annotations

import math
import sys
import time
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Final

from robotiq_async.values import registers as reg
from robotiq_async.values.checks import check_byte, check_int, check_number, check_seconds
from robotiq_async.values.enums import NO_AXES, Fault, Finger
from robotiq_async.values.model import Model, index_of, model_of
from robotiq_async.values.request import Request

from .axis import Axis, Obstacle
from .control_modes import SCISSOR_HIGH, SCISSOR_LOW, check_ends, check_scissor_limit
from .controller import GripperController
from .driven_axis import PhysicsError, mechanism_of
from .habits import Habits
from .inbox import HeardWrite, Inbox
from .spread import SEED

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from robotiq_async.calibration.motion_profile import MotionProfile

    from .bodies import Bodies
    from .driven_axis import HasMechanism, Mechanism

_FOREVER_S: Final = 1e9
_CYCLE: Final = 0.005
"""Device cycle of a 3-Finger: its registers are renewed at 200 Hz (manual)."""


class SimulatedGripper:
    """A gripper that behaves like the real one, as far as public sources go: a 3-Finger, or a sibling.

    Nothing runs in the background: the gripper catches up with its clock at each read, write or change.
    Motions, contacts, faults and delayed requests happen at their exact times, so a result does not depend on
    how often it is read. Use one from one thread only.

    A write takes effect one device cycle later, as on the device. Motions take the time of
    :mod:`robotiq_async.calibration.motion_profile`: measured closings of a 3-Finger, whose scissor
    moves the same counts a second, as none are published; recorded motions of a 2F-85; and for the other
    siblings an estimate. Motor currents are in :mod:`.axis`; how far axes miss their requests, in
    :mod:`.spread`: as with a real gripper, a program that waits for gPO = rPR may wait for ever.

    Choices where no source settles the behaviour; :class:`Habits` has the choices that can be changed:

    * A finger that meets something, or tries again, presses for 50 ms with gDT 0 before it reports a contact.
    * A jaw begins a motion late only from rest: on its way it takes a new request at once, and turns at once.
      Small steps in one direction are one motion if they follow within 0.2 s: no recording has such a stream.
    * An axis within 2 counts of a new request has reached it, and does not move.
    * A failed activation stays at gIMC = 1 with fault 0x0D.
    * gMOD, gGTO and the position echoes follow the request also while reset.
    * A minor or major fault stops the axes where they are, with gDT 0; interference below 20 s stops the
      scissor only. When a minor fault ends, a request with rGTO = 1 resumes.
    * The scissor takes its requests as counts, within 15..232.
    * The motor of a sibling draws as much as finger A of a 3-Finger.
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
        physics: HasMechanism | None = None,
        motion: MotionProfile | None = None,
        ends: tuple[int, int] | None = None,
    ) -> None:
        """A gripper that was just switched on: open, reset, all registers 0.

        Args:
            clock: gives the time in seconds; must not go backwards.
            device_cycle: simulated seconds between a write and its effect; None for 5 ms on a 3-Finger and 0
                on a sibling, whose next status has the echo (recorded on a 2F-85).
            speedup: simulated seconds in one second of the clock. All motions and sequences become faster.
            scissor_limit: a software limit of the scissor in counts. A request beyond it is replaced by the
                limit and reported as reached while the echo keeps the request.
            powered: whether the gripper is switched on; :meth:`power_on` does it later.
            spread: whether axes stop a count or two beside their requests, and feel an object some counts
                early or late. Without it they are exact: an open finger reads 6, a closed one 241.
            seed: number of this gripper, 0 or more: another seed, other counts; the same seed, the same.
            habits: its choices that the manual leaves open; None for the usual ones.
            model: of the gripper, a :class:`Model` or its name; None for a 3-Finger.
            physics: a :class:`Physics` for it alone, which moves the axes and has the parts they meet; None:
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
        self._speedup = check_number("speedup", speedup, 0, _FOREVER_S)
        if self._speedup == 0:
            raise ValueError(f"speedup must be above 0, got {speedup!r}")
        kind = model_of(model)
        cycle = (_CYCLE if kind.has_modes else 0.0) if device_cycle is None else device_cycle
        self._cycle = check_seconds("device_cycle", cycle, 0, _FOREVER_S)
        self._physics = physics
        self._mechanism = mechanism = None if physics is None else mechanism_of(physics)
        if mechanism is not None:
            mechanism.attach(kind, clock, self._speedup)
        ends = None if ends is None else check_ends(ends)
        self._controller = GripperController(
            kind, limit, seed_or_none, habits or Habits(), mechanism, motion, ends
        )
        self._time = 0.0
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
        seconds = check_seconds("off_time", off_time, 0, _FOREVER_S)
        self.power_off()
        self._off_until = self._time + seconds

    def strand(self) -> None:
        """Lose the activation, and keep rACT: gACT is 1 and gIMC 0, and nothing moves until rACT is cleared.

        A client found a 2F-85 in this state, and then reset and activated it. The cause is not known.
        A gripper without power stays as it is.
        """
        self._catch_up()
        if self._is_on:
            request = Request(
                activate=True, individual_fingers=False, individual_scissor=False, model=self.model
            )
            self._inbox.clear(request.registers)
            self._controller.strand(self._time, request)

    # Influences from outside: objects, faults, an emergency stop.

    def place_object(
        self,
        fingers: Finger | int,
        position: int,
        *,
        opening: bool = False,
        soft: int = 0,
        thin: bool = False,
        fixed: bool = False,
    ) -> None:
        """Put something in the way of some axes.

        An axis that has passed the position already has the object behind it: no contact until it comes
        from the other side. Each axis has room for one object per direction; a second replaces the first.
        An axis in contact stays there, even if the object is elsewhere now.

        Args:
            fingers: the axes it is in the way of.
            position: count at which an axis touches it, 0..255.
            opening: it is met when opening (gDT = 1) instead of closing (gDT = 2).
            soft: counts by which a force of 255 presses the axis into it, 0..255.
            thin: it is a thin object between fingertips, which the gripper may hold without ever reporting a
                contact (manual 2012, 4.7). Here it never does: the axes continue to their request or stops.
            fixed: it stays there in an activation, which then fails with fault 0x0D (manual 2012, 4.7: see
                that nothing interferes). Anything else is taken out for an activation, and put back after it.

        Raises:
            TypeError: an argument is not an int.
            ValueError: fingers is not a mask of axes, or another argument is outside 0..255.
        """
        if self._controller.driven:
            raise ValueError("a gripper with physics meets the parts of its scene, not obstacles at a count")
        met = Obstacle(check_byte("position", position), check_byte("soft", soft), fixed)
        obstacle = None if thin else met
        for axis in self._axes_in(self.model.mask(fingers)):
            axis.obstruct(self._time, obstacle, opening=opening)

    def remove_object(self, fingers: Finger | int = Finger.ALL) -> None:
        """Remove the obstacles of some axes.

        Axes that they have stopped stay in contact until a position on the other side is requested, the force
        is raised or rGTO goes from 0 to 1 (manual 2014, p. 51).

        Raises:
            TypeError: fingers is not an int.
            ValueError: fingers is not a mask of axes.
        """
        for axis in self._axes_in(self.model.mask(fingers)):
            axis.remove_obstacles(self._time)

    def inject_fault(self, fault: Fault | int, duration: float | None = None) -> None:
        """Make a fault appear. A minor or major one stops the axes; interference, see :meth:`interfere`.

        Args:
            fault: the code, 1..15; unassigned codes count as major.
            duration: simulated seconds until it ends; None: until :meth:`clear_faults` or a reset.

        Raises:
            TypeError: duration is not a number.
            ValueError: no such fault, or duration is negative.
        """
        if not isinstance(fault, Fault):
            fault = self._controller.model.fault(fault)
        if fault is Fault.NONE:
            raise ValueError("fault must be a code in 1..15, got 0; clear_faults() ends faults")
        lasts = None if duration is None else check_seconds("duration", duration, 0, _FOREVER_S)
        self._catch_up()
        self._controller.faults.begin(fault, self._time, lasts)
        self._controller.update(self._time)

    def interfere(self, duration: float | None = None) -> None:
        """Block the scissor: fault 0x0A, which stops it alone, and after 20 s 0x0E, which stops everything.

        Args:
            duration: simulated seconds, None: until :meth:`clear_faults` or a reset.

        Raises:
            TypeError: duration is not a number.
            ValueError: duration is negative, or the model has no scissor.
        """
        index_of(self.model, Finger.SCISSOR)
        self.inject_fault(Fault.SCISSOR_INTERFERENCE, duration)

    @property
    def controller_fault(self) -> int:
        """kFLT, 0..15: the fault that the Universal Controller before a jaw reports; 0 for none.

        Raises:
            TypeError: not an int.
            ValueError: outside 0..15, or the model is a 3-Finger.
        """
        return self._controller.controller_fault

    @controller_fault.setter
    def controller_fault(self, code: int) -> None:
        if self._controller.model.has_modes:
            raise ValueError(f"a {self._controller.model.title} has no controller fault (kFLT)")
        self._catch_up()
        self._controller.report_controller_fault(check_int("controller_fault", code, 0, 15))

    def emergency_stop(self, resets: int = 1) -> None:
        """Press the emergency stop: an active gripper stops, reports fault 0x05, and stays at gIMC = 1.

        Args:
            resets: number of resets needed after :meth:`end_emergency_stop`; an earlier reset does not count.

        Raises:
            TypeError: resets is not an int.
            ValueError: resets is outside 1..9.
        """
        self._catch_up()
        self._controller.stop(self._time, check_int("resets", resets, 1, 9))

    def end_emergency_stop(self) -> None:
        """Unlock the emergency stop."""
        self._catch_up()
        self._controller.end_stop()

    @property
    def is_asleep(self) -> bool:
        """Whether the next image with rACT = 1 only wakes the gripper: it is echoed, and moves nothing.

        Axes that move keep moving, and rGTO = 0 stops them. One driver found that a gripper ignores motions
        on a new connection until rACT = 1 has been written.
        """
        self._catch_up()
        return self._controller.is_asleep

    @is_asleep.setter
    def is_asleep(self, value: bool) -> None:
        self._catch_up()
        self._controller.sleep(value)

    def clear_faults(self) -> None:
        """End the injected faults; a request with rGTO = 1 resumes."""
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
        self._controller.let_activation_fail(value)

    # Bodies.

    @property
    def physics(self) -> HasMechanism | None:
        """The :class:`Physics` that moves its axes; None for straight lines in time."""
        return self._physics

    @property
    def bodies(self) -> Bodies | None:
        """Places of joints and parts, for a drawing; None without physics, and after an error in it."""
        if self._mechanism is None:
            return None
        try:
            self._catch_up()
            return self._mechanism.bodies()
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
        self._controller.change_habits(value)

    @property
    def device_cycle(self) -> float:
        """Simulated seconds between a write and its effect."""
        return self._cycle

    @device_cycle.setter
    def device_cycle(self, value: float) -> None:
        self._cycle = check_seconds("device_cycle", value, 0, _FOREVER_S)

    @property
    def speedup(self) -> float:
        """Simulated seconds in one second of the clock."""
        return self._speedup

    @property
    def _now(self) -> float:
        """Simulated seconds on its clock since the gripper was made."""
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
        index = index_of(self.model, finger)
        self._catch_up()
        return self._controller.axes[index]

    def _axes_in(self, fingers: Finger) -> list[Axis]:
        self._catch_up()
        return [
            axis
            for name, axis in zip(self._controller.model.axes, self._controller.axes, strict=True)
            if name in fingers
        ]

    def _catch_up(self) -> None:
        """Let everything happen that is due, each thing at its own time."""
        now = max(self._time, self._now)
        pending = self._inbox.pending
        while True:
            effect = pending[0][0] if pending else math.inf
            if self._mechanism is not None:
                self._let_move(self._mechanism, min(now, effect, self._controller.next_event))
            event = self._controller.next_event
            if event > now and effect > now:
                break
            if event <= effect:
                self._controller.update(event)
            else:
                self._controller.apply(*pending.popleft())
        self._time = now

    def _let_move(self, mechanism: Mechanism, until: float) -> None:
        """Let the bodies move until a time, or until an axis has something to report."""
        axes = self._controller.driven
        while mechanism.step(until):
            time = self._time = max(self._time, mechanism.time)
            reports = [axis.observe(time) for axis in axes]
            if any(reports):
                return
