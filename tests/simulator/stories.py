"""Stories of a simulated gripper in one line: what happens to it, and what it then shows.

A story begins with a gripper that is ``on``, ``active`` in simple control, or ``individual``: active, with
registers of its own for every axis. Registers, states and numbers of faults are those of the manual.
"""

from __future__ import annotations

from typing import Any

from robotiq_async.simulator import Habits
from robotiq_async.values.enums import Initialization, Mode, ObjectStatus
from tests.grippers import AXES, fingers
from tests.simulator.conftest import Bench

BITS = {
    "rACT": "activate",
    "rMOD": "mode",
    "rGTO": "go",
    "rATR": "release",
    "rICF": "individual_fingers",
    "rICS": "individual_scissor",
}
STATES = {
    "reset": Initialization.RESET,
    "activating": Initialization.ACTIVATING,
    "changing": Initialization.CHANGING_MODE,
    "complete": Initialization.COMPLETE,
}
SHOWN = {
    "moving": ObjectStatus.IN_MOTION,
    "opening": ObjectStatus.CONTACT_OPENING,
    "closing": ObjectStatus.CONTACT_CLOSING,
    "arrived": ObjectStatus.AT_POSITION,
}


def request(words: list[str], given: dict[str, float]) -> dict[str, Any]:
    """What a bench is asked for with 'go 255' or 'go A=200 B=30 force=100 rICF=1'."""
    asked = int(words[0]) if words else {AXES[name]: given[name] for name in given if name in AXES}
    how: dict[str, Any] = {name: given[name] for name in ("speed", "force") if name in given}
    return {"positions": asked, **how, **changes(given)}


def changes(given: dict[str, float]) -> dict[str, Any]:
    return {
        BITS[name]: value if name == "rMOD" else value == 1 for name, value in given.items() if name in BITS
    }


def number(text: str) -> float:
    """Also yes and no."""
    return {"yes": True, "no": False}[text] if text.isalpha() else float(text) if "." in text else int(text)


def tell(story: str) -> None:
    bench = Bench()
    gripper = bench.gripper
    travelled: dict[str, float] = {}
    shown: tuple[int, ...] = ()
    for step in story.split(", "):
        what, *rest = step.split()
        words = [word for word in rest if "=" not in word]
        given = {
            name: number(value) for name, _, value in (word.partition("=") for word in rest if "=" in word)
        }
        numbers = [float(word) for word in words if word.replace(".", "").isdigit()]
        match what:
            case "on":
                pass
            case "active":
                bench.activate(mode=Mode.BASIC)
            case "individual":
                bench.activate_individually()
            case "write":
                bench.write(**changes(given))
            case "go":
                bench.go(**request(words, given))
            case "reach":
                bench.reach(**request(words, given))
            case "settle":
                bench.settle()
            case "wait":
                bench.wait(*numbers)
            case "place":
                manner: dict[str, Any] = {**dict.fromkeys(words[2:], True), **given}
                gripper.place_object(fingers(words[0]), int(words[1]), **manner)
            case "remove":
                gripper.remove_object(*map(fingers, words))
            case "inject":
                gripper.inject_fault(int(words[0]), *numbers[1:])
            case "clear":
                gripper.clear_faults()
            case "interfere":
                gripper.interfere(*numbers)
            case "emergency":
                gripper.emergency_release()
            case "power-cycle":
                gripper.power_cycle()
            case "power-off":
                gripper.power_off()
            case "fail-activation":
                gripper.fail_activation = True
            case "habits":
                habits: dict[str, Any] = {**given}
                gripper.habits = Habits(**habits)
            case "stop":
                gripper.emergency_stop(*map(int, words))
            case "stop-ends":
                gripper.end_emergency_stop()
            case "sleep":
                gripper.is_asleep = True
            case "note":
                travelled = {name: gripper.travel(axis) for name, axis in AXES.items()}
                shown = gripper.status_registers()
            case "still":
                for name in words[0] if words else AXES:
                    assert gripper.travel(AXES[name]) == travelled[name], step
            case "unchanged":
                assert gripper.status_registers() == shown, step
            case "fault":
                assert bench.fault == int(words[0]), step
            case "state":
                assert bench.status.initialization is STATES[words[0]], step
            case "at":
                assert [*bench.positions[: len(numbers)]] == numbers, step
            case "echo":
                assert [bench.status.requested_position(axis) for axis in AXES.values()] == numbers, step
            case "words":
                assert bench.words == tuple(bytes.fromhex(step.removeprefix("words"))), step
            case "travel":
                assert gripper.travel(AXES[words[0]]) == int(words[1]), step
            case "target":
                assert gripper.target(AXES[words[0]]) == int(words[1]), step
            case "grips" | "holds":
                assert (gripper.grips if what == "grips" else gripper.holds) == fingers("".join(words)), step
            case "asleep" | "awake":
                assert gripper.is_asleep is (what == "asleep"), step
            case "moves" | "rests":
                assert gripper.is_moving is (what == "moves"), step
            case "all":
                assert bench.outcomes == (SHOWN[words[0]],) * 4, step
            case _ if words[0] == "echoes":
                assert [bench.status.requested_position(AXES[what])] == numbers, step
            case _:
                assert bench.status.finger_status(AXES[what]) is SHOWN[words[0]], step
                assert [gripper.position(AXES[what])] * len(numbers) == numbers, step
