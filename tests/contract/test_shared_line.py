"""The contract on a line with a second gripper, which another hand polls and moves all the time.

The hands take turns, and a failure of one is followed by a silence of the line. So all is tried here that
depends on when an exchange comes: starts and stops, commands that meet each other, are halted or cancelled
in the midst of a turn, waits with a limit, links that are lost, and who reads meanwhile. What a gripper
does with its axes, its faults and its parts is in the statuses, however late they come. A scene is tried in
one of its forms: they differ in what the hand is asked, and not in its turns.

A 3-Finger at a port is written with function 16, a jaw behind a socket with 23. A scene has one of the two,
by turns: what a hand does with the turns of its line is the same on either.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from contextvars import copy_context
from functools import partial
from itertools import cycle

import pytest

from robotiq_async import RobotiqConnectionError, RobotiqHand, State
from robotiq_async.simulator import SimulatedGripper
from robotiq_async.simulator.troubles.fault_injector import FaultInjector
from robotiq_async.values.model import THREE_FINGER, TWO_FINGER_85
from tests.contract.bench import HABIT, MODEL, OTHERWISE, SERVER
from tests.fleet.lab import SPEEDUP
from tests.grippers import activate_beforehand
from tests.shared_line import Bus, Kind, serial_bus, socket_bus
from tests.verify.test_contract import scenes

OURS, ITS = 9, 12
TARGETS = (200, 40)
BY_TURNS = {
    "test_commands": [
        "test_set_position_returns_when_acknowledged",
        "test_the_last_value_wins",
        "test_a_loop_that_commands_at_every_status",
        "test_the_last_command_wins_over_all_calls",
        "test_awaited_commands_keep_their_order",
        "test_a_halt_stops_every_axis",
        "test_nothing_commanded_before_a_halt_comes_after_it",
        "test_a_cancelled_halt_is_still_sent",
        "test_a_halt_during_an_activation_ends_in_reset",
        "test_a_cancelled_command_is_carried_out_or_not_and_the_next_one_works",
        "test_another_command_ends_a_move",
    ],
    "test_faults": [
        "test_a_minor_fault_ends_a_move_and_nothing_resumes",
        "test_recover_gives_up_in_time",
        "test_a_command_during_an_activation",
    ],
    "test_grasping": [
        "test_a_grasp_that_is_interrupted",
        "test_a_contact_is_an_event_as_soon_as_it_is_made",
        "test_the_link_is_lost_and_comes_back",
        "test_a_cancelled_wait_for_an_event_loses_nothing",
    ],
    "test_lifetime": [
        "test_an_active_gripper_is_adopted_and_nothing_is_written",
        "test_a_reset_gripper_is_activated",
        "test_starting_twice_at_once_is_refused",
        "test_it_may_be_started_again",
        "test_stop_stops_the_fingers_and_keeps_the_activation",
        "test_stop_may_leave_the_fingers_to_what_they_do",
        "test_a_stop_that_keeps_a_grip_holds_what_moves",
        "test_every_caller_of_stop_waits_until_the_hand_has_stopped",
        "test_a_start_right_after_a_stop_that_was_not_waited_for",
        "test_a_cancelled_stop_still_stops",
        "test_a_stop_while_it_starts_ends_the_start",
        "test_a_cancelled_start_takes_its_activation_back",
        "test_leaving_through_an_exception_stops_the_fingers",
        "test_leaving_by_cancellation_stops_the_fingers",
        "test_nothing_answers",
        "test_a_start_waits_for_a_gripper_that_has_no_power_yet",
        "test_the_wait_of_a_start_ends_at_once",
    ],
    "test_moves": [
        "test_too_slow",
        "test_halted",
        "test_superseded_by_another_move",
        "test_superseded_by_another_client_of_the_gripper",
        "test_moves_of_different_axes_do_not_disturb_each_other",
        "test_reset",
        "test_stopped",
        "test_cancelled",
        "test_cancelled_at_any_moment",
    ],
    "test_observation": [
        "test_while_the_link_is_down",
        "test_a_lost_link_ends_a_move",
        "test_the_newest_status",
        "test_it_moves_from_the_call_until_the_end_of_a_move",
        "test_timestamps_are_of_this_process_and_only_rise",
    ],
    "test_streams": [
        "test_statuses_opened_before_the_start_end_after_the_stop",
        "test_a_slow_reader_costs_only_itself",
        "test_transitions_lose_nothing",
        "test_streams_wait_out_a_lost_link",
        "test_requests",
        "test_a_reader_that_asks_for_it_hears_of_a_lost_link_and_may_read_on",
    ],
    "test_waiting": ["test_not_in_time", "test_a_state_that_lasts_for_a_moment"],
}


class End:
    """The end of the line at our gripper, in place of a server that has it alone."""

    def __init__(self, bus: Bus, other: RobotiqHand) -> None:
        self._bus = bus
        self._other = other
        self.fault_injector: FaultInjector = bus.servers[OURS].fault_injector
        self.moving: asyncio.Task[None] | None = None

    @property
    def address(self) -> str:
        """That of the line; the other hand begins when it is first asked for, and so beside ours."""
        if self.moving is None:
            self.moving = asyncio.create_task(keep_moving(self._other))
        return self._bus.address

    def refuse(self) -> None:
        """Nothing: :meth:`cut` takes the line away."""

    def cut(self) -> None:
        self._bus.pull()

    async def accept(self) -> None:
        await self._bus.plug()


async def keep_moving(hand: RobotiqHand) -> None:
    """Move to and fro for ever, over every loss of the link."""
    await hand.start()
    while True:
        await hand.wait_for_state(State.RUNNING_IDLE)
        with suppress(RobotiqConnectionError):
            for target in TARGETS:
                await hand.move(target)


@asynccontextmanager
async def beside_another(kind: Kind, gripper: SimulatedGripper) -> AsyncIterator[End]:
    """A line with a second gripper and its hand, which must not notice what ours does."""
    other = SimulatedGripper(asyncio.get_running_loop().time, speedup=SPEEDUP, model=TWO_FINGER_85)
    await activate_beforehand(other)
    with pytest.MonkeyPatch.context() as patch:
        async with kind(patch, {OURS: gripper, ITS: other}) as bus:
            hand = bus.hand(ITS)
            end = End(bus, hand)
            try:
                yield end
            finally:
                if end.moving is not None:
                    end.moving.cancel()
                    await asyncio.wait([end.moving])
                await hand.stop()
            assert hand.statistics.foreign_commands == 0
            assert hand.statistics.reconnects <= bus.pulls


LINES = {
    (THREE := "rtu, 3-Finger"): (serial_bus, THREE_FINGER),
    (JAW := "rtu+tcp, 2F-85"): (socket_bus, TWO_FINGER_85),
}
CASES = [
    (THREE if name in OTHERWISE else next(line), file, name)
    for file, names in BY_TURNS.items()
    for line in [cycle([JAW, THREE])]
    for name in names
]


@pytest.mark.parametrize(("line", "file", "name"), CASES)
def test_beside_another_hand_the_contract_holds(line: str, file: str, name: str) -> None:
    (kind, model), context = LINES[line], copy_context()
    context.run(MODEL.set, model)
    context.run(SERVER.set, partial(beside_another, kind))  # type: ignore[arg-type]
    context.run(HABIT.set, (None, {"device_id": OURS}))
    context.run(dict(scenes(file))[name])
