"""The gripper's firmware: turns requests and events into motion of the four axes.

It knows no clock. Whoever drives it calls :meth:`Controller.update` at exactly :attr:`Controller.next_event`
before doing anything later; all times are simulated seconds.
"""

from __future__ import annotations

from collections import deque
from typing import Final

from robotiq_async.enums import (
    AXES,
    CLOSED_READING,
    OPEN_READING,
    Fault,
    Finger,
    Initialization,
    Mode,
    ObjectStatus,
)
from robotiq_async.wire import registers as reg
from robotiq_async.wire.request import Request

from . import control_modes as control
from .axis import Axis
from .faults import PresentFaults
from .motor import MOTORS, Motor
from .spread import Spread

REST: Final = Request.from_registers((0,) * reg.REGISTER_COUNT)
"""The image of a gripper that was just switched on: all zero."""

_NOWHERE: Final[control.Goals] = (None,) * len(AXES)


class Controller:
    """The four axes and the logic that moves them.

    Attributes:
        axes: A, B, C and the scissor.
        request: the image in force.
        progress: what gIMC says.
        faults: the faults that are present, apart from those that follow from the request and the progress.
        fail_activation: the next activation ends in fault 0x0D; reset to False when it does.
    """

    def __init__(self, scissor_limit: tuple[int, int], seed: int | None) -> None:
        """An open gripper in the basic mode's shape, reset; without a seed one that is exact."""
        *fingers, scissor = (Spread(seed, axis) for axis in AXES)
        self.axes = (
            *(_finger(motor, spread) for motor, spread in zip(MOTORS[:3], fingers, strict=True)),
            Axis(control.MODE_POSITION[Mode.BASIC], *scissor_limit, MOTORS[3], scissor),
        )
        self.request = REST
        self.progress = Initialization.RESET
        self.faults = PresentFaults()
        self.fail_activation = False
        self._release = Fault.NONE
        self._mode: Mode | None = None
        self._steps: deque[control.Goals] = deque()

    @property
    def next_event(self) -> float:
        """When something happens next by itself; infinite when nothing will."""
        a, b, c, scissor = self.axes
        return min(self.faults.changes_at, a.ends_at, b.ends_at, c.ends_at, scissor.ends_at)

    def update(self, time: float) -> None:
        """Let happen what happens at this time, and drive the axes accordingly."""
        for axis in self.axes:
            if axis.ends_at <= time:
                axis.arrive()
        self.faults.update(time)
        self._drive(time)

    def apply(self, time: float, request: Request) -> None:
        """Put an image into force; the same again changes nothing."""
        if request == self.request:
            return
        was_active, self.request = self.request.activate, request
        if was_active and not request.activate:
            self.reset(time)
        elif request.activate and not was_active:
            self._set_mode(time, self._requested_mode)
            self._begin(time, Initialization.ACTIVATING, control.activation(self._mode))
        if request.release:
            self.release(time)
        self._follow_mode(time)
        self._drive(time)

    def power_off(self, time: float) -> None:
        """Forget the request and everything that came of it; the axes stay where they are."""
        self.request = REST
        self.reset(time)

    def reset(self, time: float) -> None:
        """Stop at once and forget faults, sequences and what was touched; nothing moves after it."""
        self.faults.clear()
        self._release = Fault.NONE
        self._begin(time, Initialization.RESET, ())

    def release(self, time: float) -> None:
        """Begin the automatic release; without effect while reset or when it has begun already."""
        if self.request.activate and self._release is Fault.NONE:
            self._release = Fault.AUTOMATIC_RELEASE
            self._begin(time, Initialization.RESET, control.release())
            self._drive(time)

    @property
    def fault(self) -> Fault:
        """What gFLT says: the release above all, then the worst fault, then a request that has to wait."""
        if self._release is not Fault.NONE:
            return self._release
        return max(self.faults.worst, self._waiting, key=lambda fault: (fault.is_serious, fault))

    @property
    def _waiting(self) -> Fault:
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
        return None if self.request.individual_scissor else self.request.mode

    def _follow_mode(self, time: float) -> None:
        """Begin, replace or abandon a mode change; only an active gripper does."""
        mode = self._requested_mode
        if mode == self._mode or self.progress not in (Initialization.COMPLETE, Initialization.CHANGING_MODE):
            return
        self._set_mode(time, mode)
        if mode is not None:
            self._begin(time, Initialization.CHANGING_MODE, control.mode_change(mode))
        elif self.progress is Initialization.CHANGING_MODE:
            self._begin(time, Initialization.COMPLETE, ())

    def _set_mode(self, time: float, mode: Mode | None) -> None:
        self._mode = mode
        for finger in self.axes[:3]:
            finger.confine(time, control.finger_limit(mode))

    def _begin(self, time: float, progress: Initialization, steps: tuple[control.Goals, ...]) -> None:
        self.progress = progress
        self._steps = deque(steps)
        self._clear_axes(time)

    def _clear_axes(self, time: float) -> None:
        for axis in self.axes:
            axis.clear(time)

    def _drive(self, time: float) -> None:
        """Send every axis where it has to go now; steps of a sequence follow one another."""
        self._command(time, self._goals(time))
        while self._steps and self._is_done(self._steps[0]):
            self._steps.popleft()
            self._clear_axes(time)
            if not self._steps:
                self._finish(time)
            self._command(time, self._goals(time))

    def _goals(self, time: float) -> control.Goals:
        if self._steps:
            return self._steps[0]
        if self.progress is Initialization.COMPLETE and self.request.go:
            return control.requested(self.request, [round(axis.position(time)) for axis in self.axes])
        return _NOWHERE

    def _command(self, time: float, goals: control.Goals) -> None:
        for name, axis, goal in zip(AXES, self.axes, goals, strict=True):
            if goal is None or self._is_stopped(name):
                axis.hold(time)
            else:
                axis.command(time, goal)

    def _is_stopped(self, name: Finger) -> bool:
        """Whether a fault keeps the axis from moving; nothing stops the automatic release."""
        if self._release is not Fault.NONE:
            return False
        return self.faults.stops_scissor if name is Finger.SCISSOR else self.faults.stops_fingers

    def _is_done(self, step: control.Goals) -> bool:
        """Whether every axis of the step has arrived or touched something."""
        return all(
            goal is None or axis.status is not ObjectStatus.IN_MOTION
            for axis, goal in zip(self.axes, step, strict=True)
        )

    def _finish(self, time: float) -> None:
        """A sequence has come to its end."""
        if self._release is not Fault.NONE:
            self._release = Fault.AUTOMATIC_RELEASE_DONE
        elif self.progress is Initialization.ACTIVATING and self.fail_activation:
            self.fail_activation = False
            self.faults.begin(Fault.ACTIVATION_FAULT, time, None)
        else:
            self.progress = Initialization.COMPLETE
            self._follow_mode(time)


def _finger(motor: Motor, spread: Spread) -> Axis:
    low = OPEN_READING + spread.open_reading
    return Axis(low, low, CLOSED_READING + spread.closed_reading, motor, spread)
