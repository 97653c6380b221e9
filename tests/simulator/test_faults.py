"""Every fault of the table, and the automatic release."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from robotiq_async.values.calibration.scales import closing_time
from robotiq_async.values.enums import Fault, Severity
from robotiq_async.values.model import THREE_FINGER
from tests.simulator.stories import tell

if TYPE_CHECKING:
    from tests.simulator.conftest import Bench

SERIOUS = [fault for fault in Fault if fault.is_serious and fault is THREE_FINGER.faults[int(fault)]]
SERIOUS.remove(Fault.SCISSOR_INTERFERENCE)
PRIORITY = [fault for fault in Fault if fault.severity is Severity.PRIORITY]
SLOWLY = closing_time(0)
RELEASES = [f"individual, reach 255, {how}" for how in ("write rATR=1", "emergency")]
STORIES = {
    **{
        f"{fault.name} stops all axes": f"individual, go 255, wait 0.5, inject {int(fault)}, note, "
        f"fault {int(fault)}, wait 5, still, rests"
        for fault in (*SERIOUS, Fault(0x0C))
    },
    **{
        f"{fault.name} stops nothing": f"individual, go 255, inject {int(fault)} 30, settle, "
        f"fault {int(fault)}, at 241 241 241, wait 30, fault 0"
        for fault in PRIORITY
    },
    # The danger that a hand has to hold its axes against.
    "a minor fault ends by itself and the motion goes on": "individual, go 255, wait 0.5, inject 9 3, "
    "wait 2.9, fault 9, rests, wait 0.2, fault 0, moves, settle, at 241 241 241",
    "a major fault needs a reset": "active, inject 13, wait 1000, go 255, fault 13, rests, "
    "write rACT=0 rGTO=0, fault 0, write rACT=1, settle, state complete",
    # A reset is rACT falling from 1 to 0, not every image in which it is 0.
    **{
        f"writing to a gripper that is reset does not clear {fault}": f"on, inject {fault} 3, write, "
        f"wait 0.1, fault {fault}, write rMOD=1, fault {fault}, wait 3, fault 0"
        for fault in (9, 10)
    },
    "faults are cleared": "individual, go 255, inject 13, inject 9, clear, fault 0, moves",
    "the worst of several": "active, inject 13 3, inject 9 2, inject 5 5, fault 13, wait 2, fault 13, "
    "wait 2, fault 5",
    **{
        f"{fault} outranks a request that waits": f"on, write rACT=1 rGTO=1, inject {fault} 1, "
        f"fault {fault}, wait 1, fault 5"
        for fault in (9, 1)
    },
    "a minor fault delays an activation": "on, write rACT=1, wait 1, inject 9 60, wait 59, state activating, "
    "wait 1, settle, state complete, travel A 470",
    "paused, an axis reads moving and a contact keeps its code": "individual, place A 20, go 255, wait 0.5, "
    "inject 9 3, A closing, B moving",
    # Interference on the scissor.
    "a short one stops the scissor only": "individual, go 200, interfere 10, settle, fault 10, "
    "at 200 200 200 137, wait 10, settle, fault 0, at 200 200 200 200",
    **{
        f"one of{seconds or ' any'} seconds is a major fault": f"individual, interfere{seconds}, "
        "wait 19.999, fault 10, wait 0.002, fault 14, wait 1000, go 100, fault 14, rests"
        for seconds in ("", " 20.001", " 60")
    },
    "one during a change of the mode": "active, write rMOD=1, interfere 5, wait 4.9, state changing, "
    "fault 10, wait 0.1, settle, at 6 6 6 219",
    # The automatic release.
    **{
        f"it opens all axes slowly: {begun}": f"{begun}, fault 11, state reset, words 09 00, "
        f"wait {0.98 * SLOWLY}, fault 11, wait {0.04 * SLOWLY}, fault 15, state reset, at 6 6 6 15"
        for begun in RELEASES
    },
    **{
        f"it ignores all but rACT: {begun}": f"{begun}, go 255 rATR=0 rMOD=2 rICF=0, inject 9 1, settle, "
        "at 6 6 6 15, go 100, wait 10, at 6 6 6 15, fault 15"
        for begun in RELEASES
    },
    **{
        f"after {seconds} s a reset ends it: {begun}": f"{begun}, wait {seconds}, "
        "write rACT=0 rGTO=0 rATR=0, rests, fault 0, write rACT=1, settle, state complete, reach 100, at 100"
        for begun in RELEASES
        for seconds in (1, 60)
    },
    **{
        f"the same image begins no other: {begun}": f"{begun}, settle, note, write, wait 1, unchanged"
        for begun in RELEASES
    },
    "it comes out of a major fault": "active, reach 255, inject 14, write rATR=1, fault 11, settle, "
    "fault 15, at 6 6 6",
    "it ends at an obstacle too, and is all there is": "active, reach 255, place A 100 opening, "
    "write rATR=1, settle, fault 15, at 100 6 6 15, remove, write, wait 5, at 100 6 6 15",
    "there is none while reset": "on, write rATR=1, emergency, wait 5, words 00 00, fault 0",
}


@pytest.mark.parametrize("name", STORIES)
def test_a_story(name: str) -> None:
    tell(STORIES[name])


@pytest.mark.parametrize(
    ("fault", "duration", "error"),
    [(0, None, ValueError), (16, None, ValueError), (9, -1, ValueError), (9, "1", TypeError)],
)
def test_bad_injections(bench: Bench, fault: int, duration: float | None, error: type[Exception]) -> None:
    with pytest.raises(error):
        bench.gripper.inject_fault(fault, duration)
