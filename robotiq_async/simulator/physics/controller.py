"""The gripper's firmware: turns requests and events into motion of the axes.

It knows no clock. Its caller must call :meth:`Controller.update` at exactly :attr:`Controller.next_event`
before doing anything later; all times are simulated seconds.
"""

# Theory of operation
#
# The state is the image in force, gIMC (progress) and the steps that are left of a sequence:
#
#   RESET           no steps: reset; with steps: the automatic release, whose fault is _release
#   ACTIVATING      the steps of an activation; none: it failed (fault 0x0D), or an emergency stop ended it
#   CHANGING_MODE   the steps of a mode change
#   COMPLETE        no steps: the axes follow the image while rGTO = 1
#
# apply() takes an image, update() a due time; power, release and emergency stop have methods of their own.
# Only _begin() and _finish() change progress. rACT = 0 resets from every state and clears the faults, but the
# emergency stop outlasts it.
#
# _drive() then sends each axis the goal of the present step or of the image, and holds it without a goal or
# in a fault. A step ends when every axis has arrived or touched something, in an activation not before half
# of its time. A contact in an activation fails it. _note() keeps each change of gDT, because a status may
# report it later than the rest (Habits.status_lag).

from __future__ import annotations

import math
import struct
from collections import deque
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Final, NamedTuple

from robotiq_async.calibration.motion_profile import SHORT_OF_CLOSED, MotionProfile
from robotiq_async.calibration.scales import SpeedCalibration
from robotiq_async.values import registers as reg
from robotiq_async.values.enums import (
    SPEED_MAX,
    Fault,
    Finger,
    Initialization,
    Mode,
    ObjectStatus,
)
from robotiq_async.values.request import Request

from . import control_modes as control
from .axis import MOTORS, Axis, Motor
from .driven_axis import DrivenAxis
from .faults import PresentFaults
from .spread import Spread

if TYPE_CHECKING:
    from collections.abc import Sequence

    from robotiq_async.values.model import Model

    from .driven_axis import Mechanism
    from .habits import Habits

ZEROS: Final = (0,) * reg.REGISTER_COUNT
"""The image of a gripper that was just switched on."""
_AS_REGISTERS: Final = struct.Struct(">8H")
_MOVING, _SOME_STOPPED, _ALL_STOPPED, _ALL_ARRIVED = range(4)

Statuses = tuple[ObjectStatus, ...]


class _TrailPoint(NamedTuple):
    since: float
    statuses: Statuses


class StatusTrail:
    """The object status of each axis over time. Times are simulated seconds and never decrease."""

    def __init__(self, first: Statuses) -> None:
        self._entries = deque([_TrailPoint(-math.inf, first)])

    def note(self, time: float, statuses: Statuses, lag: float) -> None:
        if statuses == self._entries[-1].statuses:
            return
        self._entries.append(_TrailPoint(time, statuses))
        while self._entries[1].since <= time - lag:
            self._entries.popleft()
            if len(self._entries) == 1:
                return

    def at(self, time: float) -> Statuses:
        """The statuses at a time; before the oldest entry that is kept, the statuses of that entry."""
        for entry in reversed(self._entries):
            if entry.since <= time:
                return entry.statuses
        return self._entries[0].statuses


class GripperController:
    """The axes and the logic that moves them.

    Attributes:
        model: of the gripper.
        axes: in the order of the model.
        driven: the same axes if a mechanism moves them; else empty.
        habits: its choices that the manual leaves open.
        request: the image in force.
        progress: gIMC.
        faults: the present faults, apart from faults that follow from the request and the progress.
        fail_activation: the next activation ends in fault 0x0D; reset to False when it does.
        controller_fault: kFLT, of the controller before a jaw.
        is_asleep: the next image with rACT = 1 wakes the gripper, and moves nothing.
    """

    def __init__(
        self,
        model: Model,
        scissor_limit: tuple[int, int],
        seed: int | None,
        habits: Habits,
        mechanism: Mechanism | None = None,
        motion: MotionProfile | None = None,
        ends: tuple[int, int] | None = None,
    ) -> None:
        self.model = model
        self._motion = motion or usual_motion(model)
        self._ends = ends
        named = zip(model.axes, MOTORS, strict=False)
        if mechanism is None:
            self.driven: tuple[DrivenAxis, ...] = ()
            self.axes: tuple[Axis, ...] = tuple(
                self._scissor(scissor_limit, seed)
                if axis is Finger.SCISSOR
                else self._finger(motor, axis, seed)
                for axis, motor in named
            )
        else:
            self.axes = self.driven = tuple(
                self._driven(mechanism, axis, motor, scissor_limit) for axis, motor in named
            )
        self._places = tuple(
            (shown.byte, shown.shift, echo.byte, position.byte, current.byte)
            for shown, echo, position, current in zip(
                model.object_status, reg.gPR, reg.gPO, reg.gCU, strict=False
            )
        )
        """Of each axis in a status: byte and shift of its gDT, bytes of its gPR, gPO and gCU."""
        self._nothing = (ObjectStatus.IN_MOTION,) * len(model.axes)
        """gDT without a meaning: zeros."""
        self._nowhere: control.Goals = (None,) * len(model.axes)
        self.habits = habits
        self._at_rest = Request.from_registers(ZEROS, model)
        self.request: Request = self._at_rest
        self._obeyed = self.request
        self.progress: Initialization = Initialization.RESET
        self.faults: PresentFaults = PresentFaults()
        self.fail_activation: bool = False
        self.controller_fault = 0
        self.is_asleep: bool = False
        self._is_stopped = False
        """Whether the emergency stop is pressed."""
        self._resets_needed = 0
        """Resets needed after an emergency stop: by one report, of a two-finger gripper, a reset helps only
        sometimes."""
        self._release = Fault.NONE
        self._mode: Mode | None = None
        self._steps: deque[control.Goals] = deque()
        self._step_lasts_until = -math.inf
        self._trail = StatusTrail(self._nothing)

    @property
    def next_event(self) -> float:
        """The time of the next event without a request; infinite if there is none."""
        step_ends = self._step_lasts_until if self._steps and self._is_done(self._steps[0]) else math.inf
        return min(self.faults.changes_at, step_ends, *[axis.ends_at for axis in self.axes])

    def update(self, time: float) -> None:
        """Apply the events of this time, and drive the axes accordingly."""
        for axis in self.axes:
            if axis.ends_at <= time:
                axis.arrive()
        self.faults.update(time)
        self._drive(time)

    def apply(self, time: float, request: Request) -> None:
        """Put an image into force; the same again changes nothing."""
        obeyed = self._obeyed_of(request)
        if request == self.request and obeyed == self._obeyed:
            return
        was_active, self.request, self._obeyed = self.request.activate, request, obeyed
        if was_active and not request.activate:
            self.reset(time)
        elif request.activate and not was_active:
            self._set_mode(time, self._requested_mode)
            steps = control.activation(
                self._mode, self.habits.activation_time, self.model.stroke.counts, self._motion.fastest
            )
            self._begin(time, Initialization.ACTIVATING, steps)
        if request.release:
            self.release(time)
        self._follow_mode(time)
        self._drive(time)

    def power_off(self, time: float) -> None:
        """Forget the request and its effects; the axes stay where they are."""
        self.request = self._obeyed = self._at_rest
        self.is_asleep = False
        self._resets_needed = 0
        self.reset(time)

    # The world changes these; the gripper has caught up with its clock before.

    def change_habits(self, habits: Habits) -> None:
        self.habits = habits

    def report_controller_fault(self, code: int) -> None:
        self.controller_fault = code

    def sleep(self, is_asleep: bool) -> None:
        self.is_asleep = is_asleep

    def let_activation_fail(self, fails: bool) -> None:
        self.fail_activation = fails

    def strand(self, time: float, request: Request) -> None:
        """Lose the activation under a request with rACT: nothing moves until that is cleared."""
        self.reset(time)
        self.request = self._obeyed = request
        self._drive(time)

    def reset(self, time: float) -> None:
        """Stop at once; forget faults, sequences and contacts."""
        if not self._is_stopped and self._resets_needed:
            self._resets_needed -= 1
        self.faults.clear()
        self._release = Fault.NONE
        self._begin(time, Initialization.RESET, ())

    def release(self, time: float) -> None:
        """Begin the automatic release; without effect while reset or when it has begun already."""
        if self.request.activate and self._release is Fault.NONE:
            self._release = Fault.AUTOMATIC_RELEASE
            self._begin(time, Initialization.RESET, control.release(self.request))
            self._drive(time)

    def stop(self, time: float, resets: int) -> None:
        """Begin an emergency stop, after whose end so many resets are needed."""
        self._is_stopped, self._resets_needed = True, resets
        if self.request.activate:
            self._begin(time, Initialization.ACTIVATING, ())

    def end_stop(self) -> None:
        self._is_stopped = False

    @property
    def _is_in_emergency(self) -> bool:
        return self._is_stopped or self._resets_needed > 0

    @property
    def echoes(self) -> list[int]:
        """The gPR of each axis: its own register, even where simple control drives it by another."""
        positions = [axis.position for axis in self.request.axes]
        is_limited = self.model.has_modes and self.progress is Initialization.COMPLETE
        if self.habits.echoes_limits and is_limited:
            if (limit := control.finger_limit(self._mode)) is not None:
                positions[:3] = [min(limit, position) for position in positions[:3]]
            if self.request.individual_scissor:
                positions[3] = self.axes[3].within_stops(positions[3])
        return positions

    def shown_statuses(self, time: float) -> Statuses:
        if self.progress is not Initialization.COMPLETE:
            return self._nothing
        return self._trail.at(time - self.habits.status_lag)

    def status_registers(self, time: float, fault: Fault) -> reg.Registers:
        """The status registers at a time, with a fault code.

        gDT and gSTA are 0 unless gIMC = 3. Without rGTO an axis in a contact or at its request keeps its gDT,
        unless the gripper has another habit; one that was stopped on its way reads 0. So gSTA = 0 then does
        not mean motion.
        """
        content = bytearray(2 * reg.REGISTER_COUNT)
        model, request, statuses = self.model, self.request, self.shown_statuses(time)
        content[0] = request.activate << reg.gACT.shift | request.go << reg.gGTO.shift
        content[0] |= self.progress << reg.gIMC.shift
        if model.has_modes:
            content[0] |= request.mode << reg.gMOD.shift | _summary(statuses[:3]) << reg.gSTA.shift
        content[reg.gFLT.byte] = fault | self.controller_fault << reg.kFLT.shift
        for axis, status, echo, (shown, shift, echo_byte, position_byte, current_byte) in zip(
            self.axes, statuses, self.echoes, self._places, strict=True
        ):
            content[shown] |= status << shift
            content[echo_byte] = echo
            content[position_byte] = round(axis.position(time))
            content[current_byte] = axis.current(time)
        return _AS_REGISTERS.unpack(content)

    @property
    def fault(self) -> Fault:
        """gFLT: the release above all, then the worst fault, then a request that has to wait."""
        if self._release is not Fault.NONE:
            return self._release
        if self._waiting is Fault.NONE:
            return self.faults.worst
        return max(self.faults.worst, self._waiting, key=lambda fault: (fault.is_serious, fault))

    @property
    def _waiting(self) -> Fault:
        if self.request.activate and self._is_in_emergency:
            return Fault.ACTIVATION_PENDING
        if not self.request.go:
            return Fault.NONE
        if not self.request.activate:
            return Fault.NOT_ACTIVATED
        if self.progress is Initialization.ACTIVATING:
            return Fault.ACTIVATION_PENDING
        if self.progress is Initialization.CHANGING_MODE:
            return Fault.MODE_CHANGE_PENDING
        return Fault.NONE

    @property
    def _requested_mode(self) -> Mode | None:
        return None if self._obeyed.individual_scissor else self._obeyed.mode

    def _obeyed_of(self, request: Request) -> Request:
        """The part of an image that acts: all of it, unless it wakes the gripper, which moves nothing."""
        if not self.is_asleep or not request.activate:
            return request
        self.is_asleep = False
        if not request.go:
            return request
        before = self._obeyed
        return replace(before, activate=True, release=request.release)

    def _follow_mode(self, time: float) -> None:
        """Begin, replace or abandon a mode change; only an active gripper does."""
        mode = self._requested_mode
        if mode == self._mode or self.progress not in (Initialization.COMPLETE, Initialization.CHANGING_MODE):
            return
        was_changing = self.progress is Initialization.CHANGING_MODE
        opens = was_changing or self._mode is not None or self.habits.opens_without_rics
        self._set_mode(time, mode)
        if mode is not None and opens:
            self._begin(time, Initialization.CHANGING_MODE, control.mode_change(mode))
        elif was_changing:
            self._begin(time, Initialization.COMPLETE, ())

    def _set_mode(self, time: float, mode: Mode | None) -> None:
        self._mode = mode
        for name, axis in zip(self.model.axes, self.axes, strict=True):
            if name is not Finger.SCISSOR:
                axis.confine(time, control.finger_limit(mode))

    def _begin(self, time: float, progress: Initialization, steps: tuple[control.Goals, ...]) -> None:
        self.progress = progress
        self._steps = deque(step[: len(self.axes)] for step in steps)
        self._clear_axes(time)
        self._begin_step(time)
        self._note(time)

    def _clear_axes(self, time: float) -> None:
        for axis in self.axes:
            axis.clear(time)

    def _drive(self, time: float) -> None:
        """Send every axis to its present goal; steps of a sequence follow one another."""
        self._command(time, self._goals(time))
        while self._steps and self._is_done(self._steps[0]) and time >= self._step_lasts_until:
            self._end_step(time)
            self._command(time, self._goals(time))
        self._note(time)

    def _begin_step(self, time: float) -> None:
        """Begin a step. A step of an activation lasts as long from any position."""
        half = self.habits.activation_time / 2 if self.progress is Initialization.ACTIVATING else 0.0
        self._step_lasts_until = time + half

    def _end_step(self, time: float) -> None:
        """Begin the next step; an activation that has met something ends in a fault."""
        self._steps.popleft()
        if self.progress is Initialization.ACTIVATING and any(axis.status.is_contact for axis in self.axes):
            self._steps.clear()
            self.fail_activation = True
        self._clear_axes(time)
        self._begin_step(time)
        if not self._steps:
            self._finish(time)

    def _goals(self, time: float) -> control.Goals:
        if self._steps:
            return self._steps[0]
        if self.progress is Initialization.COMPLETE and self._obeyed.go:
            return control.requested(self._obeyed, [round(axis.position(time)) for axis in self.axes])
        return self._nowhere

    def _command(self, time: float, goals: control.Goals) -> None:
        for name, axis, goal in zip(self.model.axes, self.axes, goals, strict=True):
            if goal is None or self._is_blocked(name):
                axis.hold(time, locks=not self.habits.lets_go_on_halt)
            else:
                axis.command(time, goal)

    def _is_blocked(self, name: Finger) -> bool:
        """Whether a fault keeps the axis from moving; nothing but the power stops the automatic release."""
        if self._is_in_emergency:
            return True
        if self._release is not Fault.NONE:
            return False
        return self.faults.stops_scissor if name is Finger.SCISSOR else self.faults.stops_fingers

    def _is_done(self, step: control.Goals) -> bool:
        """Whether every axis of the step has arrived or touched something."""
        return all(
            goal is None or (axis.status is not ObjectStatus.IN_MOTION and not self._is_blocked(name))
            for name, axis, goal in zip(self.model.axes, self.axes, step, strict=True)
        )

    def _finish(self, time: float) -> None:
        if self._release is not Fault.NONE:
            self._release = Fault.AUTOMATIC_RELEASE_DONE
        elif self.progress is Initialization.ACTIVATING and self.fail_activation:
            self.fail_activation = False
            self.faults.begin(Fault.ACTIVATION_FAULT, time, None)
        else:
            self.progress = Initialization.COMPLETE
            self._follow_mode(time)

    def _note(self, time: float) -> None:
        statuses = tuple(axis.status for axis in self.axes)
        if self.progress is not Initialization.COMPLETE or self._is_silent_on_halt:
            statuses = self._nothing
        self._trail.note(time, statuses, self.habits.status_lag)

    @property
    def _is_silent_on_halt(self) -> bool:
        return not (self.request.go or self.habits.keeps_status_on_halt)

    def _finger(self, motor: Motor, axis: Finger, seed: int | None) -> Axis:
        spread, stroke = Spread(seed, axis), self.model.stroke
        if self._ends is not None:
            low, closed = self._ends
        elif self.model.has_modes:
            low = stroke.open_reading + spread.open_reading
            closed = stroke.closed_reading + spread.closed_reading
        else:
            low = stroke.open_reading - spread.open_reading
            closed = stroke.closed_reading - SHORT_OF_CLOSED
        high = closed + self._motion.give_at(SPEED_MAX, self._motion.fastest)
        return Axis(low, low, high, motor, spread, self._motion)

    def _driven(self, mechanism: Mechanism, axis: Finger, motor: Motor, limit: tuple[int, int]) -> DrivenAxis:
        stroke = self.model.stroke
        low, high = limit if axis is Finger.SCISSOR else (stroke.open_reading, stroke.closed_reading)
        return DrivenAxis(mechanism.drive(axis), axis, low, high, motor, self._motion)

    def _scissor(self, limit: tuple[int, int], seed: int | None) -> Axis:
        spread = Spread(seed, Finger.SCISSOR)
        return Axis(control.MODE_POSITION[Mode.BASIC], *limit, MOTORS[3], spread, self._motion)


@cache
def usual_motion(model: Model) -> MotionProfile:
    """The motion of a model, with the figures that the driver expects."""
    speeds = SpeedCalibration.usual(model)
    times = (speeds.closing_time(speed) for speed in range(256))
    return speeds.profile or MotionProfile.of_closings(speeds.source, 3, model.stroke.counts, times)


def _summary(fingers: Sequence[ObjectStatus]) -> int:
    """Return gSTA of the three fingers."""
    if ObjectStatus.IN_MOTION in fingers:
        return _MOVING
    arrived = fingers.count(ObjectStatus.AT_POSITION)
    if arrived == len(fingers):
        return _ALL_ARRIVED
    return _SOME_STOPPED if arrived else _ALL_STOPPED
