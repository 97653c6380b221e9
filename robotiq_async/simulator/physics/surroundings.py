"""Influences on a simulated gripper from outside: objects, faults, an emergency stop."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Final

from robotiq_async.values.checks import check_byte, check_int, check_seconds
from robotiq_async.values.enums import Fault, Finger

from .axis import Axis, Obstacle

if TYPE_CHECKING:
    from .controller import GripperController

_LONGEST: Final = 1e9


class Surroundings(ABC):
    """The part of a gripper that the world acts on. It catches up with its clock before anything happens."""

    def __init__(self, controller: GripperController) -> None:
        self._controller = controller
        self._time = 0.0

    @abstractmethod
    def _catch_up(self) -> None:
        """Let everything happen that is due."""

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
        An axis in contact stays there, wherever the object is now.

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
        for axis in self._axes(self._controller.model.mask(fingers)):
            if opening:
                axis.in_opening = obstacle
            else:
                axis.in_closing = obstacle
            axis.look_again(self._time)

    def remove_object(self, fingers: Finger | int = Finger.ALL) -> None:
        """Remove the obstacles of some axes.

        Those it has stopped stay in their contact until a position on the other side is requested, the force
        is raised or rGTO goes from 0 to 1 (manual 2014, p. 51).

        Raises:
            TypeError: fingers is not an int.
            ValueError: fingers is not a mask of axes.
        """
        for axis in self._axes(self._controller.model.mask(fingers)):
            axis.in_closing = axis.in_opening = None
            axis.look_again(self._time)

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
            ValueError: duration is negative, or the model has no scissor.
        """
        self._controller.model.index(Finger.SCISSOR)
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
        self._controller.controller_fault = check_int("controller_fault", code, 0, 15)

    def emergency_stop(self, resets: int = 1) -> None:
        """Press the emergency stop: an active gripper stops, reports fault 0x05, and stays at gIMC = 1.

        Args:
            resets: number of resets needed after :meth:`end_emergency_stop`; before it none helps.

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

        Axes that move run on, and rGTO = 0 stops them. One driver found that a gripper ignores motions on a
        new connection until rACT = 1 has been written.
        """
        self._catch_up()
        return self._controller.is_asleep

    @is_asleep.setter
    def is_asleep(self, value: bool) -> None:
        self._catch_up()
        self._controller.is_asleep = value

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
        self._controller.fail_activation = value

    def _axes(self, fingers: Finger) -> list[Axis]:
        self._catch_up()
        return [
            axis
            for name, axis in zip(self._controller.model.axes, self._controller.axes, strict=True)
            if name in fingers
        ]
