"""Faults: what they end, and that nothing resumes when they clear."""

from __future__ import annotations

import pytest

from robotiq_async import Fault, Finger, State
from robotiq_async.control.passing_fault import LASTS_READS
from tests.control.scan import POLL_S, started
from tests.control.stories import tell

UNKNOWN = Fault(0x0C)
A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR

STORIES = {
    **{
        f"{code} ends a move at once": f"started, move ABC 255, run 0.3, inject {code}, "
        f"run {(LASTS_READS + 1) * POLL_S if code == 9 else POLL_S}, state FAULT, 1 faulty {code}, "
        "refused faulty"
        for code in (9, 10, 12, 13, 14, 1)
    },
    **{
        f"{code} is no fault": f"started, move ABC 255, run 0.3, inject {code}, until told 1, "
        "state RUNNING_IDLE, A at 241"
        for code in (5, 6, 7)
    },
    "a gripper found in one is left there": "new, inject 14, connect activate, run 0.5, state FAULT, "
    "written 0, foreign 0",
    # Nothing resumes when it clears.
    "a move": "started, move ABC 255, run 0.5, inject 9 1, run 0.5, note, until state RUNNING_IDLE, run 2, "
    "rests, A went 2",
    "a motion nobody awaits": "started, command A 255, run 0.5, inject 9 0.5, run 0.1, note, run 3, "
    "state RUNNING_IDLE, A went 2",
    "a command sent just before": "started 0.2, note, command A 149, inject 9 1, run 3, state RUNNING_IDLE, "
    "A went 1",
    "a write lost before": "started 0.2, note, command A 149, step unanswered, connect, step, inject 9 1, "
    "run 3, state RUNNING_IDLE, A went 1",
    "one that began while the link was down": "started, move A 200 speed=0, run 0.5, lose, inject 9 2, "
    "back 0.1, state FAULT, refused faulty, note, run 10, A went 4",
    "an axis that it keeps from starting": "started 0, moved ABC 6, note, command A 107, inject 9 1, run 3, "
    "A went 1",
    # A is still ours, and what the other client asked of B goes on.
    "another client has moved another axis": "started, move A 200, run 0.3, beside B=60, run 0.5, 1 open, "
    "inject 9 0.5, run 0.1, 1 faulty, note, run 5, A went 2, B at 60",
    "the motion of another client does, also after a blink": "adopted, blink, run 0.3, inject 9 0.1, run 15, "
    "written 0, A at 200",
    # A hold or a halt carries rACT = 1: written after a power cycle it would activate.
    "one at the loss of the activation does not activate": "started, move A 200, run 0.3, note, power-cycle, "
    "inject 9 0.5, run 3, ABCS went 1, state RESET, written 0",
    "a halt that waits in one does not activate": "started, move ABC 255, run 0.5, inject 12, step, "
    "state FAULT, halt, note, power-cycle, see, 2 inactive, run 0.5, state RESET, written 0, rests",
}


@pytest.mark.parametrize("name", STORIES)
def test_a_story(name: str) -> None:
    tell(STORIES[name])


@pytest.mark.parametrize("device_cycle", [0.0, 0.005, 0.03, 0.2])
@pytest.mark.parametrize("by", [-2, -1, 1, 2])
def test_an_axis_that_the_fault_keeps_from_its_last_two_counts_is_held(device_cycle: float, by: int) -> None:
    """So close to its request an axis counts as there; one that had not begun yet went on afterwards."""
    for steps in range(8):
        scan = started(device_cycle)
        scan.moved(112, A)
        scan.move(112 + by, A)
        for _ in range(steps):
            scan.step()
        scan.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 1.0)
        scan.run(0.5)
        assert scan.state is State.FAULT
        at = scan.gripper.travel(A)
        scan.run(2.0)
        assert scan.state is State.RUNNING_IDLE
        assert scan.gripper.travel(A) == at, f"it went on, {steps} steps after the command"
