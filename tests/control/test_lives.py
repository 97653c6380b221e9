"""Random lives of a hand, with slow grippers, lost links and other clients; the promises as invariants."""

from __future__ import annotations

import contextlib
import math
from collections import Counter
from functools import reduce
from operator import or_
from typing import Final, NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robotiq_async import Finger, Inhibit, State
from robotiq_async.control.ledger import WINDOW_S
from robotiq_async.control.waiters import Move
from robotiq_async.values.enums import NO_AXES, Trigger
from robotiq_async.values.errors import RobotiqError
from robotiq_async.values.model import THREE_FINGER, TOLERANCE
from robotiq_async.values.request import Request
from robotiq_async.values.states import RUNNING, SEQUENCES
from tests.control.held_parts import JudgedScan
from tests.control.other_client import image
from tests.control.scan import Outcome

AXES: Final = THREE_FINGER.axes
OURS: Final = ("move", "move", "command", "cancel", "overtake", "hold", "halt")
CLOSED: Final = 255
KINDS: Final = {
    "ours": (*OURS, "place", "forget"),
    "held": (
        "grasp",
        "press",
        "press",
        "press",
        "cancel",
        "overtake",
        "hold",
        "hold",
        "halt",
        "lose",
        "blip",
    ),
    "link": (*OURS, "lose", "lose"),
    "fault": (*OURS, "fault", "clear", "reset", "activate", "release"),
    "foreign": (*OURS, "foreign", "foreign"),
    "person": (*OURS, "place", "forget", "lose", "fault", "clear", "reset", "inhibit", "inhibit", "permit"),
    "all": (
        *OURS,
        *("place", "forget", "lose", "fault", "clear", "reset", "activate", "release"),
        *("foreign", "foreign reset", "foreign activation", "power"),
    ),
}


class Step(NamedTuple):
    """One thing that happens, and the time until the next."""

    what: int
    axes: Finger
    position: int
    chance: float
    pause: float


PAUSES: Final = [0.0, 0.005, 0.005, 0.01, 0.05, 0.3, 2.0]
steps = st.lists(
    st.builds(
        Step,
        st.integers(0, 1000),
        st.integers(1, 15).map(Finger),
        st.integers(0, 255),
        st.floats(0, 1, exclude_max=True),
        st.sampled_from(PAUSES),
    ),
    min_size=3,
    max_size=12,
)


class Watched(JudgedScan):
    """Checks each image before it is written."""

    motions: Counter[tuple[Finger, int]]
    """Number of images that set an axis in motion to a position."""

    def decide(self) -> Request | None:
        state, shown, now = self.state, self.latest, super().decide()
        if now is None:
            return None
        before = Request.from_registers(self.written[-1]) if self.written else Request()
        in_force, holds = Request.from_registers(self.gripper.request_registers), self.gripper.holds
        assert not now.activate or shown.activation_echo or state is State.DO_ACTIVATION, "rACT has risen"
        assert not now.release or state is State.DO_ATR, "rATR was set"
        for axis in AXES:
            asked = now.position(axis)
            is_new = now.go and (not before.go or before.position(axis) != asked)
            # A write that the gripper forgot is undone by our next one, which sets no axis in motion. Nor
            # does rGTO, set again, move a finger that holds something under the same request.
            is_same = in_force.position(axis) == asked and (in_force.go or axis in holds)
            is_new = is_new and not is_same
            if is_new and abs(asked - self.gripper.position(axis)) > TOLERANCE:
                self.motions[axis, asked] += 1
        return now


class Life:
    """A hand, a gripper, and all who want something of them."""

    def __init__(self, scan: Watched) -> None:
        self.scan = scan
        self.calls: list[Outcome] = []
        self.moves: list[tuple[Move, Outcome]] = []
        self.stays: dict[Finger, float] = {}
        """The axes without any request to move, with the travel of each."""
        self.given_up = NO_AXES
        """The axes whose last request was to stand: a hold, a halt, or the end of a cancelled move."""
        self.halted: Outcome | None = None
        """A person's halt that has not been answered."""
        self.disturbed = -math.inf
        """The time at which something else than a request of ours moved an axis, or could."""

    def begin(self) -> None:
        self.scan.motions = Counter()
        self.scan.start()
        self.stays = self.scan.travels()

    def ask(self, axes: Finger, position: int) -> None:
        for axis in AXES:
            if axis in axes:
                self.stays.pop(axis, None)
        self.scan.ask(axes, position)
        self.given_up &= ~axes

    def live_move(self, step: Step) -> tuple[Move, Outcome] | None:
        """One of the moves that have no answer yet."""
        live = [each for each in self.moves if not each[1].is_answered]
        return live[int(step.chance * len(live))] if live else None

    def cancel(self, move: Move, outcome: Outcome, taken: Finger = NO_AXES) -> None:
        """The caller of a move is cancelled, in the turn in which a command has taken over some axes."""
        self.scan.controller.abandon(move, unseen=bool(taken))
        self.calls.remove(outcome)
        self.moves.remove((move, outcome))
        self.stand(move.axes & ~taken)

    def stand(self, axes: Finger) -> None:
        """The axes are to stand; what others have asked and no status shows yet, no request can end."""
        if self.scan.now - self.disturbed > WINDOW_S:
            self.given_up |= axes

    def disturb(self) -> None:
        self.disturbed = self.scan.now
        self.stays.clear()
        self.scan.parts.forget(Finger.ALL)
        self.given_up = NO_AXES

    def happen(self, what: str, step: Step) -> None:
        scan, gripper, axes, position = self.scan, self.scan.gripper, step.axes, step.position
        match what:
            case "move":
                speed = (None, 0, 255)[int(step.chance * 3)]
                move, outcome = scan.move(position, axes, speed=speed)
                self.moves.append((move, outcome))
                self.calls.append(outcome)
                self.ask(axes, position)
            case "command":
                is_motion = step.chance < 0.6
                self.calls.append(scan.command(axes, position if is_motion else None, force=position))
                self.given_up &= ~axes  # more force presses again
                if is_motion:
                    self.ask(axes, position)
            case "cancel":
                if live := self.live_move(step):
                    self.cancel(*live)
            case "overtake":
                if live := self.live_move(step):
                    self.calls.append(scan.command(axes, position))
                    self.ask(axes, position)
                    self.cancel(*live, taken=axes & live[0].axes)
            case "hold":
                held = NO_AXES if scan.state in SEQUENCES else axes  # in one there is nothing to hold
                self.calls.append(scan.hold(axes))
                self.stand(held)
            case "halt":
                if scan.state in SEQUENCES:
                    scan.controller.reset(Trigger.ASK_HALT)
                else:
                    self.calls.append(scan.halt())
                    self.stand(Finger.ALL)
            case "inhibit":
                scan.machine.inhibit(Inhibit("a person", "", 0.0))
                self.happen("halt", step)
                self.halted = None if scan.state in SEQUENCES else self.calls[-1]
            case "permit":
                scan.machine.permit("")
                self.halted = None
                self.stays.clear()  # what held something may press on with the next command
            case "place":
                gripper.place_object(axes, 20 + position * 210 // 255)
                scan.parts.forget(axes)
                self.given_up &= ~axes  # it may have been taken from a finger, which presses on after a halt
            case "grasp":
                gripper.place_object(axes, at := 40 + position * 150 // 255)
                scan.parts.forget(axes)
                self.press(axes, force=at)
                scan.run(3.0)
            case "press":
                self.press(axes, force=position)
            case "blip":
                gripper.inject_fault(0x09)
                scan.run(0.02 + step.chance / 10)
                gripper.clear_faults()
            case "forget":
                scan.forgets += 1
            case "lose":
                self.lose_the_link(step)
            case "fault":
                gripper.inject_fault((0x09, 0x0C, 0x0E)[int(step.chance * 3)])
            case "clear":
                gripper.clear_faults()
            case "reset":
                scan.controller.reset()
            case "activate" | "foreign activation" | "power" | "release" | "foreign reset":
                self.disturb()  # these move every axis, or may
                self.move_all(what)
            case "foreign":
                wanted = {axis: (position + 67 * number) % 256 for number, axis in enumerate(AXES)}
                gripper.write(0, image(wanted, go=step.chance < 0.7))
                self.disturb()

    def press(self, axes: Finger, force: int) -> None:
        move, outcome = self.scan.move(CLOSED, axes, speed=255, force=force)
        self.moves.append((move, outcome))
        self.calls.append(outcome)
        self.ask(axes, CLOSED)

    def move_all(self, what: str) -> None:
        scan = self.scan
        match what:
            case "activate":
                scan.controller.activate()
            case "release":
                scan.controller.release()
            case "power":
                scan.gripper.power_cycle()
            case _:
                scan.gripper.write(0, [0x0100 if what == "foreign activation" else 0])

    def lose_the_link(self, step: Step) -> None:
        scan = self.scan
        if step.chance < 0.5:
            scan.step(answer=False)
        if scan.state is not State.DISCONNECTED:
            scan.controller.lost(None)
        assert all(each.is_answered for each in self.calls), "a caller waits for ever"
        scan.come_back((0.001, 0.05, 1.0)[int(step.chance * 6) % 3])

    def live(self, actions: tuple[str, ...], life: list[Step]) -> None:
        self.begin()
        for step in life:
            forgets = self.scan.forgets
            with contextlib.suppress(RobotiqError):
                self.happen(actions[step.what % len(actions)], step)
            forgets += self.scan.forgets
            self.scan.hurry()
            self.scan.run(step.pause)
            if forgets:  # a hold may be among what it has forgotten, and is not sent again
                self.given_up = NO_AXES
            travels = self.scan.travels()
            if self.halted is not None and self.halted.answers == [None]:  # nothing moves from here on
                self.halted, self.stays = None, {**travels, **self.stays}
            assert all(travels[axis] == travel for axis, travel in self.stays.items()), "nobody asked it"

    def end(self, *, keep_grip: bool) -> None:
        """Everything clears up, and the hand is stopped."""
        scan = self.scan
        scan.gripper.clear_faults()
        scan.run(1.0)
        before = scan.travels()
        if scan.state in RUNNING:
            scan.until(lambda: not scan.gripper.is_moving, 60)
            scan.run(0.6)
            assert not scan.gripper.is_moving
            assert not scan.controller.is_moving
            assert all(each.is_answered for each in self.calls), "a caller waits for ever"
            moved = [axis for axis, travel in scan.travels().items() if travel > before[axis] + TOLERANCE]
            assert not self.given_up & reduce(or_, moved, NO_AXES), "it goes on, and was to stand"
        scan.forgets, is_active = 0, scan.state in RUNNING
        scan.stop(keep_grip=keep_grip)
        assert all(each.is_answered for each in self.calls), "the stop leaves a caller waiting"
        assert keep_grip or not scan.status().go_echo, "rGTO is set after a stop"
        before = scan.travels()
        scan.now += 10
        assert scan.travels() == before or not is_active, "something goes on after a stop"


@pytest.mark.parametrize("kind", KINDS)
@given(
    device_cycle=st.sampled_from([0.0, 0.005, 0.03, 0.2]),
    lag=st.sampled_from([0, 0, 8]),
    spacing=st.sampled_from([0.0, 0.0, 0.01]),
    life=steps,
    keep_grip=st.booleans(),
)
@settings(max_examples=settings().max_examples // 5)
def test_whatever_happens_the_hand_does_what_was_asked_and_nothing_else(
    kind: str, device_cycle: float, lag: int, spacing: float, life: list[Step], keep_grip: bool
) -> None:
    scan = Watched(device_cycle=device_cycle, lag=lag, spacing=spacing)
    lived = Life(scan)
    lived.live(KINDS[kind], life)
    if "foreign" not in KINDS[kind]:  # another client's request is repeated with our own
        assert all(
            count <= scan.asked[motion] for motion, count in scan.motions.items() if scan.asked[motion]
        )
    lived.end(keep_grip=keep_grip)
