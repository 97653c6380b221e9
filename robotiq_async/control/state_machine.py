"""The state of a hand, and whether a person has inhibited its motion.

The table in values/states.py has which state may follow which. Beside it stands a condition that a person
sets, :class:`Inhibit`: then all that may move an axis or make it press is refused, in every state.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

from ..runtime.logger import Log, log
from ..values.enums import State, Trigger
from ..values.errors import MotionInhibitedError, RobotiqError, RobotiqStateError
from ..values.inhibit import Inhibit
from ..values.states import RUNNING, check
from ..values.status import RobotiqStatus


class StateMachine:
    """The state of one hand. It is a view: the controller works out which state holds, and shows it here."""

    def __init__(self, log: Log = log) -> None:
        self.log = log
        self.changed: Callable[[State, State, Trigger], None] = lambda *_: None
        self.why_down: object = None  # why the link is down, for the errors of refused calls
        self.state: State = State.DISCONNECTED  # only show() sets it
        self.inhibited: Inhibit | None = None  # only inhibit() and permit() set it; outlasts runs

    def ask(self, trigger: Trigger, status: RobotiqStatus | None = None, *, presses: bool = True) -> bool:
        """Whether there is anything to do for a call. Raises the error if the table refuses the call.

        ``presses`` is False for a command that neither moves an axis nor makes it press more.
        """
        return check(trigger, self.state, status, self.inhibited if presses else None, why_down=self.why_down)

    def inhibit(self, inhibit: Inhibit) -> None:
        """Refuse all calls that may move or press. The first reason stays, and each halt counts."""
        if self.inhibited is not None:
            self.inhibited = self.inhibited.again()
            return
        self.inhibited = inhibit
        self.log.warning("%s; a person permits it again", inhibit)

    def permit(self, who: str, seen: Inhibit | None = None) -> None:
        """Refuse nothing more. Refused calls are not repeated.

        Raises RobotiqStateError if a person saw another inhibit than the one in force.
        """
        inhibit = self.inhibited
        if inhibit is None:
            return
        if seen is not None and seen != inhibit:
            raise RobotiqStateError(
                f"{inhibit}; not permitted, as a halt came after the one that was seen: look at the gripper, "
                "then permit it again"
            )
        self.inhibited = None
        by = f" by {who}" if who else ""
        self.log.warning("motion is permitted again%s; it was inhibited: %s", by, inhibit.reason)

    def check_permitted(self) -> None:
        """Raise MotionInhibitedError while a person has it inhibited."""
        if self.inhibited is not None:
            raise MotionInhibitedError(self.inhibited)

    def taken_over(self, otherwise: RobotiqError) -> RobotiqError:
        """The error for those whom a halt or a reset ends: an inhibit, or ``otherwise``."""
        return otherwise if self.inhibited is None else MotionInhibitedError(self.inhibited)

    def show(self, target: State, trigger: Trigger) -> None:
        source = self.state
        if target is source:
            return
        self.state = target
        # A control loop goes to RUNNING_CC and back with every command.
        level = logging.DEBUG if {source, target} <= RUNNING else logging.INFO
        self.log.log(level, "%s -> %s (%s)", source.name, target.name, trigger.value)
        self.changed(source, target, trigger)

    def begin(self, changed: Callable[[State, State, Trigger], None]) -> None:
        """A run begins: call this function with source, target and trigger after each change from here on."""
        self.changed, self.why_down = changed, None

    def note_down(self, why: object) -> None:
        """Note why the link is down, for the errors of refused calls."""
        self.why_down = why
