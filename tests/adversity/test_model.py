"""Random use over a live link that fails at random: what was written, what moved and what was reported.

What an example has found becomes a test of its own, among those of its subject (tests/control, tests/local,
tests/adversity). More examples: ``HYPOTHESIS_PROFILE=explore``.
"""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from contextlib import AsyncExitStack, suppress
from typing import Any

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from robotiq_async import JAW, Fault, Finger, MoveResult, ObjectStatus, RobotiqError, State
from robotiq_async.simulator import Trouble
from robotiq_async.values.enums import NO_AXES
from robotiq_async.values.model import TWO_FINGER_85, Model
from robotiq_async.values.request import Request
from robotiq_async.values.states import RUNNING
from tests.adversity.world import MODEL, World, world
from tests.register_words import only_holds
from tests.virtual import VirtualLoop

ALL = Finger.ALL
CLOSED = 255
MOST_FORCE = 255
masks = st.integers(1, 15).map(Finger)
values = st.integers(0, 255)
LINK_TROUBLES = [
    Trouble("drop"),
    Trouble("drop", on="write"),
    Trouble("late"),
    Trouble("half"),
    Trouble("twice", on="write"),
    Trouble("wrong-transaction"),
    Trouble("exception", on="write"),
    Trouble("silence", lasts=0),
    Trouble("reset"),
    Trouble("close"),
]
"""Troubles that end with the first request they meet."""
LASTING_TROUBLES = [
    Trouble("delay", 0.1),
    Trouble("pieces", 0.01),
    Trouble("slow-device", 0.2),
    Trouble("silence"),
    Trouble("refuse"),
    Trouble("power-cut"),
    Trouble("interference"),
    Trouble("fault", 9),
    Trouble("fault", 12),
]


class LiveUse(RuleBasedStateMachine):
    """Whatever is done, and whatever goes wrong, the promises hold."""

    def __init__(self) -> None:
        super().__init__()
        self.runner = asyncio.Runner(loop_factory=VirtualLoop)
        self.stack = AsyncExitStack()
        self.calls: set[asyncio.Task[Any]] = set()
        self.may_move = ALL
        """Axes that a user has given a reason to move since everything was last at rest."""
        self.gripping = NO_AXES
        """Axes that a user has closed on something, and given no reason to let go."""
        self.foreign = 0

    def run(self, work: Coroutine[Any, Any, Any]) -> Any:
        return self.runner.run(work)

    @initialize(model=st.sampled_from([MODEL, TWO_FINGER_85]))
    def begin(self, model: Model) -> None:
        async def enter() -> World:
            here = await self.stack.enter_async_context(world(model=model))
            await here.activate_beforehand()
            await here.hand.start()
            return here

        self.world: World = self.run(enter())
        self.hand, self.gripper = self.world.hand, self.world.gripper
        self.at_rest()

    def teardown(self) -> None:
        async def leave() -> None:
            await self.hand.stop()
            await asyncio.wait_for(asyncio.gather(*self.calls, return_exceptions=True), 1.0)
            self.world.check_no_stale_status()
            await self.stack.aclose()
            left = asyncio.all_tasks() - {asyncio.current_task()}
            assert not left, left

        if hasattr(self, "world"):
            self.run(leave())
        loop = self.runner.get_loop()
        assert isinstance(loop, VirtualLoop)
        assert not loop.complaints, loop.complaints
        self.runner.close()

    def call(self, work: Coroutine[Any, Any, Any]) -> None:
        """A user makes a call and waits for it; it is begun before this returns."""

        async def begin() -> None:
            self.calls.add(asyncio.create_task(work))
            await asyncio.sleep(0)

        self.run(begin())

    @property
    def running(self) -> bool:
        return self.hand.state in RUNNING

    def give_a_reason(self, axes: Finger) -> None:
        """The user lets axes move, and let go."""
        self.may_move |= axes
        self.gripping &= ~axes

    def of_the_model(self, axes: Finger) -> Finger:
        return axes & self.gripper.model.all_axes or JAW

    # -- what users do ---------------------------------------------------------------------------------

    @rule(axes=masks, position=values, speed=st.sampled_from([None, 0, 255]))
    def move(self, axes: Finger, position: int, speed: int | None) -> None:
        axes = self.of_the_model(axes)
        self.give_a_reason(axes)
        self.call(self.hand.move(position, axes, speed=speed))

    @rule(axes=masks, position=values)
    def set_position(self, axes: Finger, position: int) -> None:
        axes = self.of_the_model(axes)
        self.give_a_reason(axes)
        self.call(self.hand.set_position(position, axes))

    @rule(axes=masks, at=st.integers(40, 200), force=values, holds_after=st.sampled_from([None, 0.0, 0.03]))
    @precondition(lambda self: self.running)
    def grip(self, axes: Finger, at: int, force: int, holds_after: float | None) -> None:
        """Close on something and wait for it; then more force may make it press again, and a hold comes."""
        axes = self.of_the_model(axes)
        self.give_a_reason(axes)
        for axis in self.gripper.model.axes:
            if axis in axes & ~self.gripper.grips:
                self.gripper.place_object(axis, max(at, self.gripper.position(axis)))  # not behind it

        async def close() -> None:
            with suppress(RobotiqError):
                self.gripping |= (await self.hand.close(axes, speed=255, force=force)).contacts

        self.run(close())
        if holds_after is not None:
            self.set_force(axes, MOST_FORCE)
            self.wait(holds_after)
            self.hold(axes)
            self.wait(0.3)

    @rule(axes=masks, force=values, seconds=st.sampled_from([0.0, 0.03, 0.06]))
    @precondition(lambda self: self.running)
    def press_and_give_up(self, axes: Finger, force: int, seconds: float) -> None:
        axes = self.of_the_model(axes)
        self.may_move |= axes

        async def press() -> None:
            pressing = asyncio.create_task(self.hand.close(axes, force=force))
            await asyncio.sleep(seconds)
            pressing.cancel()
            await asyncio.gather(pressing, return_exceptions=True)

        self.run(press())

    @rule(axes=masks, positions=st.lists(values, min_size=1, max_size=5), pause=st.sampled_from([0, 0.004]))
    @precondition(lambda self: self.running)
    def control_loop(self, axes: Finger, positions: list[int], pause: float) -> None:
        axes = self.of_the_model(axes)

        async def loop() -> None:
            for position in positions:
                if self.hand.state in RUNNING:
                    self.hand.command(axes, position=position)
                await asyncio.sleep(pause)

        self.give_a_reason(axes)
        self.run(loop())

    @rule(axes=masks, force=values)
    def set_force(self, axes: Finger, force: int) -> None:
        axes = self.of_the_model(axes)
        self.call(self.hand.set_force(force, axes))

    @rule(axes=masks)
    def hold(self, axes: Finger) -> None:
        axes = self.of_the_model(axes)
        self.call(self.hand.hold(axes))

    @rule()
    def halt(self) -> None:
        self.call(self.hand.halt())

    @rule()
    def reset(self) -> None:
        self.gripping = NO_AXES
        self.call(self.hand.reset())

    @rule()
    def recover(self) -> None:
        if not self.running:
            self.give_a_reason(ALL)
        self.call(self.hand.recover(timeout=30))

    @rule()
    @precondition(lambda self: self.hand.state is State.FAULT)
    def atr(self) -> None:
        self.give_a_reason(ALL)
        self.call(self.hand.atr())

    @rule(which=st.integers(0, 100))
    @precondition(lambda self: any(not call.done() for call in self.calls))
    def cancel(self, which: int) -> None:
        waiting = sorted((call for call in self.calls if not call.done()), key=lambda call: call.get_name())
        waiting[which % len(waiting)].cancel()
        self.run(asyncio.sleep(0))

    @rule(activate=st.booleans(), keep_grip=st.booleans())
    def stop_and_start(self, activate: bool, keep_grip: bool) -> None:
        async def again() -> None:
            began, writes = self.world.loop.time(), len(self.gripper.writes)
            went = self.hand.status.go_echo
            await self.hand.stop(keep_grip=keep_grip)
            assert self.world.loop.time() - began < 2.0
            # rGTO does not end a release. And where it is clear there is nothing to stop: what another client
            # has written since the last poll acts afterwards.
            has_stopped = len(self.gripper.writes) > writes or (keep_grip and went)
            if has_stopped and self.hand.status.fault is not Fault.AUTOMATIC_RELEASE:
                await self.world.nothing_moves_for(1.0)
            try:
                await self.hand.start(activate=activate)
            except RobotiqError:
                await self.hand.start(activate=False)

        self.gripping = NO_AXES
        if activate:
            self.may_move = ALL
        self.run(again())

    @rule(seconds=st.sampled_from([0.0007, 0.01, 0.03, 0.3]))
    def wait(self, seconds: float) -> None:
        self.run(asyncio.sleep(seconds))

    @rule(turns=st.integers(1, 30))
    def a_few_turns_of_the_loop(self, turns: int) -> None:
        """Into the middle of an exchange."""

        async def wait() -> None:
            loop = self.world.loop
            over = loop.create_future()
            loop.after_turns(turns, lambda: over.set_result(None))
            await over

        self.run(wait())

    # -- what goes wrong -------------------------------------------------------------------------------

    @rule(axes=masks, position=st.integers(20, 230))
    def something_is_in_the_way(self, axes: Finger, position: int) -> None:
        axes = self.of_the_model(axes)
        self.gripping &= ~axes
        self.gripper.place_object(axes, position)

    @rule(seconds=st.sampled_from([0.05, 0.3, 1.0]))
    def the_loop_is_held_up(self, seconds: float) -> None:
        async def hold() -> None:
            self.world.loop.hold_up(seconds)

        self.run(hold())

    @rule(trouble=st.sampled_from(LINK_TROUBLES))
    def the_link_fails(self, trouble: Trouble) -> None:
        async def fail() -> None:
            reconnects = self.hand.statistics.reconnects
            ongoing = await self.world.server.fault_injector.begin(trouble)
            await asyncio.sleep(0.6)
            await self.world.server.fault_injector.end(ongoing)
            if self.hand.statistics.reconnects > reconnects:
                writes = len(self.gripper.writes)
                await asyncio.sleep(1.0)
                assert only_holds(self.gripper, writes), "something was written without a request"

        self.run(fail())

    @rule(trouble=st.sampled_from(LASTING_TROUBLES), seconds=st.sampled_from([0.02, 0.7]))
    def something_goes_wrong(self, trouble: Trouble, seconds: float) -> None:
        if trouble.kind == "interference" and Finger.SCISSOR not in self.gripper.model.all_axes:
            return

        self.gripping = NO_AXES

        async def go() -> None:
            async with self.world.server.fault_injector.making(trouble):
                await asyncio.sleep(seconds)
            await asyncio.sleep(2.5)  # the longest pause before the next try is 2 s

        self.run(go())

    @rule(position=values)
    def another_client_writes(self, position: int) -> None:
        self.foreign += 1
        self.give_a_reason(ALL)
        self.run(self.world.server.fault_injector.begin(Trouble("foreign", position)))

    # -- what must be so -------------------------------------------------------------------------------

    @rule()
    def everything_comes_to_rest(self) -> None:
        async def rest() -> None:
            async with asyncio.timeout(120):
                while True:
                    state = self.hand.state
                    await asyncio.sleep(0.7)
                    quiet = not self.gripper.is_moving and all(call.done() for call in self.calls)
                    if quiet and self.hand.state is state and state is not State.DISCONNECTED:
                        break

            await asyncio.sleep(0.05)  # the newest status may be from just before it came to rest
            self.look_at_outcomes()
            self.look_at_state()

        self.run(rest())
        self.at_rest()

    def look_at_outcomes(self) -> None:
        for call in self.calls:
            if call.cancelled():
                continue
            error = call.exception()
            assert error is None or isinstance(error, RobotiqError), repr(error)
            if error is None and isinstance(result := call.result(), MoveResult):
                assert ObjectStatus.IN_MOTION not in result.outcomes.values()
        self.calls.clear()

    def look_at_state(self) -> None:
        """The hand knows what the gripper really is, and has no wrong idea of others."""
        status = self.hand.status
        assert self.world.loop.time() - status.timestamp < 0.1
        for axis in self.gripper.model.axes:
            assert status.position(axis) == self.gripper.position(axis)
        if self.hand.state is State.RUNNING_IDLE:
            assert not self.hand.is_moving
        assert self.hand.statistics.foreign_commands <= self.foreign

    def at_rest(self) -> None:
        self.may_move = NO_AXES
        self.travels = self.world.travels()

    @invariant()
    def only_axes_with_a_reason_have_moved(self) -> None:
        if hasattr(self, "world"):
            for axis in self.gripper.model.axes:
                if axis not in self.may_move:
                    assert self.gripper.travel(axis) == self.travels[axis], f"{axis!r} moved"

    @invariant()
    def no_grip_is_loosened(self) -> None:
        if hasattr(self, "world"):
            model = self.gripper.model
            image = Request.from_registers(self.gripper.request_registers, model)
            loose = [axis for axis in model.axes if axis in self.gripping and image.position(axis) < CLOSED]
            assert not loose, f"{loose} held something"

    @invariant()
    def every_write_is_a_full_image_under_individual_control(self) -> None:
        if hasattr(self, "world"):
            for write in self.gripper.writes[-5:]:
                image = Request.from_registers(write.registers, self.gripper.model)
                assert image.individual_fingers
                assert image.individual_scissor
                assert image.registers == write.registers


TestLiveUse = LiveUse.TestCase
TestLiveUse.settings = settings(max_examples=settings().max_examples // 2, stateful_step_count=12)
