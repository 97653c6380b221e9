"""Stories of a hand and its gripper in one line: what is asked and what happens, and what comes of it.

A story begins with a hand that has ``started`` (on a device whose cycle may be told), with one that is
``new``, or with one that has ``adopted`` a gripper which another client moves. Requests count from 1 in their
order.
"""

from __future__ import annotations

import pytest

from robotiq_async import (
    ConnectionLostError,
    Finger,
    GripperFaultError,
    MoveSupersededError,
    NotActivatedError,
    ObjectStatus,
    RobotiqError,
    State,
)
from robotiq_async.control.motion import Move
from robotiq_async.values.request import Request
from tests.control.other_client import going_to, image, moved_by_another
from tests.control.scan import POLL_S, Outcome, Scan, started
from tests.grippers import AXES, fingers

ERRORS: dict[str, type[RobotiqError]] = {
    "superseded": MoveSupersededError,
    "lost": ConnectionLostError,
    "inactive": NotActivatedError,
    "faulty": GripperFaultError,
}


def tell(story: str) -> None:
    scan = Scan()
    told: dict[str, Outcome] = {}
    moves: dict[str, Move] = {}
    written, travels = 0, scan.travels()

    def wait(condition: list[str]) -> None:
        match condition:
            case ["told", number, *seconds]:
                scan.until(lambda: told[number].is_told, *map(float, seconds))
            case ["state", name, *seconds]:
                scan.until(lambda: scan.state is State[name], *map(float, seconds))
            case ["still"]:
                scan.until(lambda: not scan.controller.is_moving)
            case ["no", "go"]:
                scan.until(lambda: not scan.latest.go_echo)
            case [axis, "closing"]:
                scan.until(lambda: scan.latest.finger_status(AXES[axis]) is ObjectStatus.CONTACT_CLOSING)

    for step in story.split(", "):
        words = [word.partition("=") for word in step.split()]
        given = {name: int(value) for name, _, value in words if value}
        positions = {AXES[name]: value for name, value in given.items() if name in AXES}
        number = str(len(told) + 1)
        match [word for word, equals, _ in words if not equals]:
            case ["started", *cycle]:
                scan = started(*map(float, cycle))
            case ["adopted"]:
                scan = moved_by_another()
            case ["new"]:
                pass
            # -- what is asked
            case ["move" | "moved" as what, names, position]:
                moves[number], told[number] = scan.move(int(position), fingers(names), **given)
                if what == "moved":
                    wait(["told", number])
            case ["command", names, *position]:
                told[number] = scan.command(fingers(names), *map(int, position), **given)
            case ["hold", *names]:
                told[number] = scan.hold(*map(fingers, names))
            case ["halt"]:
                told[number] = scan.halt()
            case ["abandon", which, *unseen]:
                scan.controller.abandon(moves[which], unseen=bool(unseen))
            case ["reset" | "activate" | "release" as what]:
                getattr(scan.controller, what)()
            case ["stop"]:
                scan.stop()
            case ["refused", why]:
                with pytest.raises(ERRORS[why]):
                    scan.command(Finger.A, position=3)
            # -- what happens
            case ["run", seconds]:
                scan.run(float(seconds))
            case ["step", *unanswered]:
                scan.step(answer=not unanswered)
            case ["see"]:
                scan.controller.see(scan.status())
            case ["undelivered"]:
                scan.now += POLL_S
                assert scan.controller.decide(scan.now) is not None
            case ["later", seconds]:
                scan.now += float(seconds)
            case ["lose"]:
                scan.controller.lost(None)
            case ["back", seconds]:
                scan.come_back(float(seconds))
            case ["blink"]:
                scan.blink()
            case ["connect", *activate]:
                scan.connect(activate=bool(activate))
            case ["until", *condition]:
                wait(condition)
            case ["place", names, position]:
                scan.gripper.place_object(fingers(names), int(position))
            case ["inject", fault, *seconds]:
                scan.gripper.inject_fault(int(fault), *map(float, seconds))
            case ["power-cycle"]:
                scan.gripper.power_cycle()
            case ["theirs"]:
                scan.gripper.write(0, image(positions))
            case ["theirs", position]:
                scan.gripper.write(0, going_to(int(position), speed=0))
            case ["beside"]:
                ours = Request.from_registers(scan.gripper.request_registers)
                scan.gripper.write(0, ours.with_positions(positions).registers)
            case ["note"]:
                written, travels = len(scan.written), scan.travels()
            # -- what comes of it
            case ["state", name]:
                assert scan.state is State[name], step
            case ["written", count]:
                assert len(scan.written) - written == int(count), step
            case ["foreign", count]:
                assert scan.controller.foreign_commands == int(count), step
            case ["rests" | "moves" as what]:
                assert scan.gripper.is_moving is (what == "moves"), step
            case ["no", "go"]:
                assert not scan.latest.go_echo
            case ["no", "moves"]:
                assert not scan.controller._requests.moves
            case [which, "told"]:
                assert told[which].told == [None], step
            case [which, "open"]:
                assert not told[which].is_told, step
            case [which, "faulty", code]:
                error = told[which].error
                assert isinstance(error, GripperFaultError)
                assert error.fault == int(code)
            case [which, why] if why in ERRORS:
                assert isinstance(told[which].error, ERRORS[why]), step
            case [axis, "at", position]:
                assert abs(scan.gripper.position(AXES[axis]) - int(position)) <= 2, step
            case [axis, "asked", position]:
                assert scan.last_image.position(AXES[axis]) == int(position), step
            case [axis, "echoes", position]:
                assert scan.latest.requested_position(AXES[axis]) == int(position), step
            case [axis, "closing"]:
                assert scan.latest.finger_status(AXES[axis]) is ObjectStatus.CONTACT_CLOSING, step
            case [names, "went", counts]:
                for each in fingers(names):
                    assert scan.gripper.travel(each) - travels[each] <= float(counts), f"{step}: {each}"
            case [axis, "goes"]:
                assert scan.gripper.travel(AXES[axis]) - travels[AXES[axis]] > 5, step
            case _:
                raise ValueError(step)
