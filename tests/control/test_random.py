"""Random sequences of commands, cancels, faults and lost links: the promises as invariants."""

from __future__ import annotations

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from robotiq_async import JAW, Finger, Inhibit, MotionInhibitedError, MoveResult, ObjectStatus, State
from robotiq_async.control.waiters import Move
from robotiq_async.values.model import THREE_FINGER, TOLERANCE, TWO_FINGER_85, Model
from robotiq_async.values.states import RUNNING
from tests.control.held_parts import JudgedScan
from tests.control.other_client import image
from tests.control.scan import Outcome, Scan
from tests.register_words import only_holds

masks = st.integers(1, 15).map(Finger)
values = st.integers(0, 255)
CLOSED = 255
WAITS_S = 0.05
"""Seconds between polls while nothing is asked and everything comes to rest."""
PAUSES = st.sampled_from([0.0, 0.005, 0.01, 0.05])


def wait(scan: Scan, seconds: float) -> None:
    for _ in range(round(seconds / WAITS_S)):
        scan.step(poll=WAITS_S)


class RandomUse(RuleBasedStateMachine):
    """Whatever is done to the hand, it carries out the requests and nothing else."""

    @initialize(
        device_cycle=st.sampled_from([0.0, 0.005, 0.03, 0.2]),
        model=st.sampled_from([THREE_FINGER, TWO_FINGER_85]),
    )
    def begin(self, device_cycle: float, model: Model) -> None:
        self.scan, self.model = JudgedScan(device_cycle=device_cycle, model=model), model
        self.scan.start()
        self.asked: set[Finger] = set()
        """Axes that were ever addressed by a position since the last activation."""
        self.travel = {axis: self.scan.gripper.travel(axis) for axis in self.model.axes}
        self.outcomes: list[tuple[Move | None, Outcome]] = []
        self.halted: Outcome | None = None
        """The newest halt of a person; ``still`` has the travels when it was answered."""
        self.still: object = None

    def teardown(self) -> None:
        """Whatever went before, a stop that keeps a grip leaves nothing moving."""
        if hasattr(self, "scan"):
            self.scan.stop(keep_grip=True)
            before = self.scan.travels()
            self.scan.now += 10
            assert self.scan.travels() == before, "something went on"

    @property
    def running(self) -> bool:
        return self.scan.state in RUNNING

    @property
    def takes_motions(self) -> bool:
        return self.running and self.scan.machine.inhibited is None

    def ask(self, axes: Finger, position: int) -> None:
        self.asked |= {axis for axis in self.model.axes if axis in axes}
        self.scan.ask(axes, position)

    @rule(axes=masks, position=values, speed=st.none() | values)
    @precondition(lambda self: self.takes_motions)
    def move(self, axes: Finger, position: int, speed: int | None) -> None:
        axes = axes & self.model.all_axes or JAW
        self.ask(axes, position)
        self.outcomes.append(self.scan.move(position, axes, speed=speed))

    @rule(axes=masks, position=st.none() | values, force=values)
    @precondition(lambda self: self.takes_motions)
    def command(self, axes: Finger, position: int | None, force: int) -> None:
        axes = axes & self.model.all_axes or JAW
        if position is not None:
            self.ask(axes, position)
        self.outcomes.append((None, self.scan.command(axes, position=position, force=force)))

    @rule(which=st.integers(0, 1000))
    @precondition(
        lambda self: any(move is not None and not outcome.is_answered for move, outcome in self.outcomes)
    )
    def cancel(self, which: int) -> None:
        live = [move for move, outcome in self.outcomes if move is not None and not outcome.is_answered]
        move = live[which % len(live)]
        self.scan.controller.abandon(move)
        self.outcomes = [each for each in self.outcomes if each[0] is not move]

    @rule(axes=masks)
    @precondition(lambda self: self.running)
    def hold(self, axes: Finger) -> None:
        axes = axes & self.model.all_axes or JAW
        self.outcomes.append((None, self.scan.hold(axes)))

    @rule()
    @precondition(lambda self: self.running)
    def halt(self) -> None:
        self.outcomes.append((None, self.scan.halt()))

    @rule()
    @precondition(lambda self: self.running)
    def inhibit(self) -> None:
        """A person halts: from the answer on nothing moves, whatever is asked."""
        self.scan.machine.inhibit(Inhibit("a person", "", 0.0))
        self.halted = self.scan.halt()
        self.outcomes.append((None, self.halted))

    @rule(axes=masks, position=values, force=st.none() | values)
    @precondition(lambda self: self.running and not self.takes_motions)
    def ask_in_vain(self, axes: Finger, position: int, force: int | None) -> None:
        axes = axes & self.model.all_axes or JAW
        for refused in (
            lambda: self.scan.move(position, axes, force=force),
            lambda: self.scan.command(axes, position=position),
            lambda: self.scan.command(axes, force=position),
            self.scan.controller.activate,
        ):
            with pytest.raises(MotionInhibitedError):
                refused()
        self.outcomes.append((None, self.scan.command(axes, speed=position)))

    @rule()
    @precondition(lambda self: self.scan.machine.inhibited is not None)
    def permit(self) -> None:
        self.scan.machine.permit("")
        self.halted, self.still = None, None

    @invariant()
    def nothing_moves_while_it_is_inhibited(self) -> None:
        halted = getattr(self, "halted", None)
        if halted is not None and self.still is None and halted.answers == [None]:
            self.still = self.scan.travels()
        if halted is not None and self.still is not None:
            assert self.scan.travels() == self.still, "it moved while it was inhibited"

    @rule(seconds=st.sampled_from([0.005, 0.01, 0.05, 0.3, 3.0]))
    def wait(self, seconds: float) -> None:
        self.scan.run(seconds)

    @rule(axes=masks, position=st.integers(20, 230))
    def place(self, axes: Finger, position: int) -> None:
        axes = axes & self.model.all_axes or JAW
        self.scan.gripper.place_object(axes, position)
        self.scan.parts.forget(axes)

    @rule(axes=masks, position=st.integers(20, 230), force=values)
    @precondition(lambda self: self.takes_motions)
    def grip(self, axes: Finger, position: int, force: int) -> None:
        axes = axes & self.model.all_axes or JAW
        self.scan.gripper.place_object(axes, position)
        self.scan.parts.forget(axes)
        self.ask(axes, CLOSED)
        self.outcomes.append(self.scan.move(CLOSED, axes, speed=255, force=force))
        self.scan.run(2.0)

    @rule(answered=st.booleans(), away=st.sampled_from([0.0, 0.01, 1.0]))
    @precondition(lambda self: self.running)
    def lose_the_link(self, answered: bool, away: float) -> None:
        if not answered:
            self.scan.step(answer=False)
        if self.scan.state is not State.DISCONNECTED:
            self.scan.controller.lost(None)
        assert all(outcome.is_answered for _, outcome in self.outcomes), "a caller waits for ever"
        writes = len(self.scan.gripper.writes)
        self.scan.now += away
        self.scan.connect(activate=False)
        wait(self.scan, 1.5)  # a hold may have to bring an axis back that had begun to move
        assert only_holds(self.scan.gripper, writes), "something was replayed"

    @rule(fault=st.sampled_from([0x09, 0x0C, 0x0E]))
    @precondition(lambda self: self.running)
    def fault(self, fault: int) -> None:
        self.scan.gripper.inject_fault(fault)
        self.scan.run(0.02)  # 0x09 is one when it lasts
        assert self.scan.state is State.FAULT
        wait(self.scan, 1.0)
        assert all(outcome.is_answered for _, outcome in self.outcomes), "a caller waits for ever"
        at = {axis: self.scan.gripper.position(axis) for axis in self.model.axes}
        contacts = self.scan.latest.contacts
        self.scan.gripper.clear_faults()
        wait(self.scan, 1.0)
        assert self.scan.state is State.RUNNING_IDLE
        for axis in self.model.axes:
            if axis not in contacts:
                # One that close to its request has arrived, and keeps the request.
                assert abs(self.scan.gripper.position(axis) - at[axis]) <= TOLERANCE, f"{axis!r} resumed"

    @rule()
    @precondition(lambda self: self.running)
    def everything_comes_to_rest(self) -> None:
        self.scan.step()  # an object taken away sets axes in motion without a command
        # Behind a halt a move is still to be sent.
        self.scan.until(
            lambda: not (self.scan.gripper.is_moving or self.scan.controller.is_moving), 60, WAITS_S
        )
        wait(self.scan, 0.6)  # what has no echo is given half a second to act
        assert not self.scan.gripper.is_moving
        assert not self.scan.controller.is_moving
        for move, outcome in self.outcomes:
            assert outcome.is_answered
            if move is not None and isinstance(outcome.answers[0], MoveResult):
                assert ObjectStatus.IN_MOTION not in outcome.result.outcomes.values()

    @invariant()
    def only_addressed_axes_have_moved(self) -> None:
        if not hasattr(self, "asked"):
            return
        for axis in self.model.axes:
            if axis not in self.asked:
                assert self.scan.gripper.travel(axis) == self.travel[axis], f"{axis!r} moved"

    @invariant()
    def no_other_client_was_seen(self) -> None:
        assert not hasattr(self, "scan") or self.scan.controller.foreign_commands == 0

    @invariant()
    def every_write_is_a_full_image_under_individual_control(self) -> None:
        if hasattr(self, "scan") and self.scan.written:
            image = self.scan.last_image
            assert image.individual_fingers
            assert image.individual_scissor
            assert image.registers == self.scan.written[-1]


class BesideAnotherClient(RuleBasedStateMachine):
    """Two clients write as they like; once all has come to rest, a command moves the axes that it names."""

    @initialize(device_cycle=st.sampled_from([0.005, 0.02, 0.05, 0.2]))
    def begin(self, device_cycle: float) -> None:
        self.scan = Scan(device_cycle=device_cycle, speed=255)
        self.scan.start()

    @rule(positions=st.tuples(values, values, values, values), go=st.booleans(), seconds=PAUSES)
    def another_client_writes(self, positions: tuple[int, int, int, int], go: bool, seconds: float) -> None:
        asked = dict(zip(THREE_FINGER.axes, positions, strict=True))
        self.scan.gripper.write(0, image(asked, go=go))
        self.scan.run(seconds)

    @rule(axes=masks, position=values, seconds=PAUSES)
    def command(self, axes: Finger, position: int, seconds: float) -> None:
        self.scan.command(axes, position=position)
        self.scan.run(seconds)

    @rule(seconds=PAUSES)
    def halt(self, seconds: float) -> None:
        self.scan.halt()
        self.scan.run(seconds)

    @rule(axes=masks, seconds=PAUSES)
    def hold(self, axes: Finger, seconds: float) -> None:
        self.scan.hold(axes)
        self.scan.run(seconds)

    @rule(axes=masks, position=values)
    def a_command_at_rest_moves_the_axes_that_it_names(self, axes: Finger, position: int) -> None:
        wait(self.scan, 1.0)
        self.scan.until(lambda: not self.scan.gripper.is_moving, 60, WAITS_S)
        self.scan.run(0.3)
        assert not self.scan.controller.is_moving
        before = self.scan.travels()
        self.scan.command(axes, position=position)
        wait(self.scan, 0.5)
        moved = {axis for axis, travel in self.scan.travels().items() if travel != before[axis]}
        assert all(axis in axes for axis in moved), f"{moved} moved"


TestBesideAnotherClient = BesideAnotherClient.TestCase
TestBesideAnotherClient.settings = settings(max_examples=settings().max_examples // 2, stateful_step_count=12)
TestRandomUse = RandomUse.TestCase
TestRandomUse.settings = settings(max_examples=settings().max_examples // 2, stateful_step_count=15)
