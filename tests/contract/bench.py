"""One gripper, and a hand on it: of this process, or on another host. Everything in one virtual loop."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine, Mapping
from contextlib import asynccontextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import wraps
from typing import Any, TypeVar

import pytest

from robotiq_async import RobotiqHand, State
from robotiq_async.hands import Hand
from robotiq_async.hands.options import POLL_INTERVAL_S
from robotiq_async.simulator import Physics, SimulatedGripper, SimulatorServer, Trouble
from robotiq_async.values.model import THREE_FINGER, Model
from robotiq_async.values.request import Request
from tests.fleet.lab import SPEEDUP, Lab, lab
from tests.grippers import activate_beforehand, lose_link
from tests.virtual import inside, until

T = TypeVar("T")
LOCAL, REMOTE = "local", "remote"
A, B, C, S = THREE_FINGER.axes
HABIT: ContextVar[tuple[Trouble | None, Mapping[str, Any]]] = ContextVar("habit", default=(None, {}))
"""A habit of the gripper of a hand of this process, and the options of that hand."""
MODEL: ContextVar[Model] = ContextVar("model", default=THREE_FINGER)
"""The model of the gripper."""
SERVER: ContextVar[type[SimulatorServer]] = ContextVar("server", default=SimulatorServer)
"""Its server, and so the kind of link, for a hand of this process and for that of an agent."""
PHYSICS: ContextVar[str | None] = ContextVar("physics", default=None)
"""The scene of the bodies that move the axes of the gripper of a hand of this process; None for no bodies."""


@dataclass
class Bench:
    """The surroundings of a test of the contract.

    Attributes:
        make: a hand that is not started; each call makes another one on the same gripper.
        lab: what stands behind a hand on another host; None for a hand of this process.
        physics: the bodies that move the axes; None without.
    """

    gripper: SimulatedGripper
    server: SimulatorServer
    make: Callable[[], Hand]
    lab: Lab | None = None
    physics: Physics | None = None

    @asynccontextmanager
    async def hand(self) -> AsyncIterator[Hand]:
        """A hand that is started, and activates nothing."""
        hand = self.make()
        try:
            await hand.start(activate=False)
            yield hand
        finally:
            await hand.stop()

    @property
    def writes(self) -> int:
        return len(self.gripper.writes)

    @property
    def last_write(self) -> Request:
        return Request.from_registers(self.gripper.writes[-1].registers, self.gripper.model)

    @property
    def travels(self) -> list[float]:
        return [self.gripper.travel(axis) for axis in self.gripper.model.axes]

    async def moves(self) -> None:
        """Wait until the gripper moves."""
        await until(lambda: self.gripper.is_moving)

    async def moving(self, work: Coroutine[Any, Any, T]) -> asyncio.Task[T]:
        """Begin a call, and wait until the gripper moves."""
        task = asyncio.create_task(work)
        await self.moves()
        return task

    async def unplug(self, hand: Hand) -> None:
        """Take away the link between hand, or agent, and gripper, and wait until the hand notices."""
        await lose_link(self.server, hand)

    async def plug(self, hand: Hand) -> None:
        await self.server.accept()
        await hand.wait_for_state(State.RUNNING_IDLE)


@asynccontextmanager
async def bench(where: str, *, active: bool = True) -> AsyncIterator[Bench]:
    """A gripper that is active, or reset, and a way to make hands on it."""
    if where == REMOTE:
        setup = lab(
            active=active, model=MODEL.get(), kind_of_server=SERVER.get(), poll_interval=POLL_INTERVAL_S
        )
        async with setup as here:
            # Until the agent has its gripper.
            await until(lambda: here.local.state not in (State.DISCONNECTED, State.SHUTDOWN))
            names = iter(range(1000))
            yield Bench(here.gripper, here.server, lambda: here.client(f"client {next(names)}"), here)
        return
    loop = asyncio.get_running_loop()
    cycle, model, scene = 0.005 * SPEEDUP, MODEL.get(), PHYSICS.get()
    physics = None if scene is None else Physics(scene)
    gripper = SimulatedGripper(
        loop.time,
        speedup=SPEEDUP,
        device_cycle=cycle,
        spread=False,
        model=model,
        physics=physics,
    )
    async with SERVER.get()(gripper) as server:
        if active:
            await activate_beforehand(gripper)
        habit, options = HABIT.get()
        if habit is not None:
            await server.fault_injector.begin(habit)
        yield Bench(
            gripper,
            server,
            lambda: RobotiqHand(server.address, model=gripper.model, **options),
            physics=physics,
        )


def contract(
    test: Callable[..., Coroutine[Any, Any, None]] | None = None, *, active: bool = True
) -> Callable[..., Any]:
    """Let a coroutine function be a test of both hands, inside a :func:`bench`."""

    def of_both(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
        both: Callable[..., None] = pytest.mark.parametrize("where", [LOCAL, REMOTE])(
            inside(bench, "where", active=active)(test)
        )
        return both

    return of_both if test is None else of_both(test)


def on_model(*models: Model) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Let a test of the contract run on one of these grippers: with another, on the first over Modbus."""

    def of(test: Callable[..., None]) -> Callable[..., None]:
        @wraps(test)
        def on_it(*args: Any, **arguments: Any) -> None:
            if MODEL.get() in models:
                test(*args, **arguments)
                return
            token, link = MODEL.set(models[0]), SERVER.set(SimulatorServer)
            try:
                test(*args, **arguments)
            finally:
                MODEL.reset(token)
                SERVER.reset(link)

        return on_it

    return of


async def at_rest(hand: Hand) -> None:
    """Wait until nothing moves."""
    async for _ in hand.statuses():
        if hand.state is State.RUNNING_IDLE and not hand.is_moving:
            return


async def statuses(hand: Hand, count: int) -> list[int]:
    """The sequences of so many statuses."""
    stream = hand.statuses(buffer=1000)
    return [(await anext(stream)).sequence for _ in range(count)]


async def ended(task: asyncio.Task[Any]) -> BaseException | None:
    """The end of a task."""
    await asyncio.wait({task})
    return asyncio.CancelledError() if task.cancelled() else task.exception()


FINGERS = "it counts on three fingers"
STROKE = "it counts on the time that a 3-Finger takes for a stroke"
READING = "it has the reading of a closed 3-Finger"
CODES = "its codes mean something else on a sibling"
AXES = "it names axes that a sibling lacks"
OTHERWISE = {
    "test_more_contacts_than_axes": FINGERS,
    "test_integers_of_numpy_are_integers": FINGERS,
    "test_a_hold_leaves_a_grip_alone": FINGERS,
    "test_a_part_that_every_finger_meets": FINGERS,
    "test_a_part_that_is_pulled_out_is_noticed_when_the_fingers_try_again": FINGERS,
    "test_opening_releases_the_part_and_a_reset_loses_it": FINGERS,
    "test_the_link_is_lost_and_comes_back": FINGERS,
    "test_there": FINGERS,
    "test_against_something": FINGERS,
    "test_against_something_on_the_way_open": FINGERS,
    "test_requests": FINGERS,
    "test_fingers_of_a_3_finger_have_openings_and_no_width": FINGERS,
    "test_the_scissor_has_neither_millimetres_nor_a_fraction": FINGERS,
    "test_a_grasp_that_is_given_up_holds_what_moves_and_keeps_the_grip": STROKE,
    "test_a_finger_that_presses_again_after_a_fault_has_kept_its_grip": STROKE,
    "test_nothing_there": READING,
    "test_a_contact_while_opening_is_not_held": READING,
    "test_a_major_fault": CODES,
    "test_recover_waits_for_a_fault_that_no_manual_names_and_drops_no_part": CODES,
    "test_a_command_moves_only_what_it_addresses": AXES,
    "test_a_contact_is_an_event_as_soon_as_it_is_made": AXES,
    "test_a_hold_keeps_axes_where_they_are": AXES,
    "test_a_part_that_two_fingers_meet": AXES,
    "test_a_stop_that_keeps_a_grip_holds_what_moves": AXES,
    "test_an_integer_mask_is_as_good_as_fingers": AXES,
    "test_cancelled_with_a_part_in_the_grip": AXES,
    "test_in_a_fault_no_grip_is_kept": AXES,
    "test_moves_of_different_axes_do_not_disturb_each_other": AXES,
    "test_one_finger_with_the_others_left_as_they_are": AXES,
    "test_speed_and_force_start_no_motion": AXES,
    "test_stop_may_keep_a_grip": AXES,
    "test_superseded_by_another_move": AXES,
    "test_the_last_value_wins": AXES,
}
"""Scenes about the 3-Finger alone, and why; ``tests/test_models.py`` has their like of a jaw."""
