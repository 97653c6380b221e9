"""News of a gripper, logged once each: its faults, a reset, an axis that does not get where it was sent.

A fault is logged when the hand counts it as a fault: not a passing 0x09. A reset by any client is logged,
once the gripper has been active in this run: its part may have fallen.
"""

from __future__ import annotations

from typing import Final

from ..control.state_machine import StateMachine
from ..runtime.logger import Log
from ..values.enums import Fault, Finger, ObjectStatus, Severity, State
from ..values.events import Transition
from ..values.move_result import MoveResult
from ..values.states import RUNNING
from ..values.status import RobotiqStatus

BITS: Final = 0xFF00  # of the second register: gFLT, and kFLT of the controller before a jaw
_FAULTY: Final = frozenset({State.FAULT, State.ATR_DONE, State.WF_ATR})
_STAYS_HELD: Final = "the fingers are held, and nothing resumes when it clears"
DOES: Final = {
    Severity.PRIORITY: "the action is delayed or ignored: see which request came too early",
    Severity.MINOR: f"{_STAYS_HELD}; clear the obstruction, recover() waits for it",
    Severity.MAJOR: "the fingers stop, a part stays held until the reset; clear the obstruction, then "
    "recover() resets and activates: it DROPS the part and MOVES the fingers",
}
"""The motion of the fingers in a fault, and the remedy."""
UNKNOWN_FAULT: Final = (
    f"{_STAYS_HELD}; no manual names it: recover() waits, reset() may clear it and DROPS the part"
)
OTHER_FAULTS: Final = {
    Fault.AUTOMATIC_RELEASE: "all axes OPEN slowly and DROP the part; halt() ends it, by a reset",
    Fault.AUTOMATIC_RELEASE_DONE: "the part has DROPPED; recover() activates it: the fingers MOVE",
}
"""The same for single faults."""
OF_A_RESET: Final = "its part may have fallen; activate() or recover() MOVES its fingers"


class FaultNews:
    """Logs faults and resets.

    Attributes:
        shown: the bits of the fault that has been dealt with.
    """

    def __init__(self, machine: StateMachine) -> None:
        self.shown: int = 0
        self._machine = machine
        self._fault = Fault.NONE  # logged last
        self._controller_fault = 0
        self._was_active = False

    def see(self, status: RobotiqStatus) -> None:
        """Take in a status whose fault bits differ from ``shown``."""
        fault, log = status.fault, self._machine.log
        if fault.is_serious and self._machine.state not in _FAULTY:
            return  # the fault may pass; the next status decides
        self.shown = status.registers[1] & BITS
        if fault is not self._fault:
            self._fault = fault
            if fault is not Fault.NONE:
                say = log.warning if fault.is_serious else log.info
                say("%s fault %s", fault.severity.value, fault_words(fault))
        if status.controller_fault != self._controller_fault:
            self._controller_fault = status.controller_fault
            if status.controller_fault:
                log.warning("%s; look at it before the gripper", status.controller_fault_text)

    def reached(self, change: Transition) -> None:
        """The state has changed."""
        if change.target in RUNNING:
            self._was_active = True
        elif change.target is State.RESET and self._was_active:
            self._was_active = False
            is_ours = change.source is State.WF_RESET
            who = "by this program" if is_ours else "by another client or for lack of power"
            self._machine.log.warning("the gripper is back in RESET, %s; %s", who, OF_A_RESET)


class UnreachedNews:
    """Warns once of an axis that reports "at position" far from its request."""

    def __init__(self, log: Log) -> None:
        self._log: Final = log
        self._has_warned = False

    def ended(self, target: int, result: MoveResult) -> None:
        """A move has ended."""
        # Not for the scissor: its range ends within 15..232 (drivers), and programs send it to 0 and 255.
        # Nor if the gripper echoes its own limit instead of the request.
        for axis, how in result.outcomes.items():
            is_limited = axis is Finger.SCISSOR or result.status.requested_position(axis) != target
            is_there = axis in result.reached or how is not ObjectStatus.AT_POSITION
            if is_limited or is_there or self._has_warned:
                continue
            self._has_warned = True
            self._log.warning(
                "%s was sent to %d, and the gripper reports it at position, at %d: its range ends there (a "
                "software limit, custom fingertips), or it did not follow. See MoveResult.reached; "
                "logged once",
                axis,
                target,
                result.positions[axis],
            )


def fault_words(fault: Fault) -> str:
    """Code, name and description of a fault, the motion of the fingers, and the remedy."""
    does = OTHER_FAULTS.get(fault) or (DOES[fault.severity] if fault.is_known else UNKNOWN_FAULT)
    return f"0x{int(fault):02X} {fault.name}: {fault.description}; {does}"
