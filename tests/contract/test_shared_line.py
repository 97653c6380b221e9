"""The contract on a line with a second gripper, which another hand polls and moves all the time.

The hands take turns, and a failure of one is followed by a silence of the line. So all is tried here that
depends on when an exchange comes; what is refused or converted before any is left out. A scene is tried in
one of its forms: they differ in what the hand is asked, and not in its turns. A 3-Finger is written with
function 16, a jaw with 23.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from contextvars import copy_context
from typing import Any

import pytest

from robotiq_async import RobotiqConnectionError, RobotiqHand, State
from robotiq_async.simulator import SimulatedGripper
from robotiq_async.simulator.troubles.fault_injector import FaultInjector
from robotiq_async.values.model import THREE_FINGER, TWO_FINGER_85, Model
from tests.contract.bench import HABIT, MODEL, OTHERWISE, SERVER
from tests.fleet.lab import SPEEDUP
from tests.grippers import activate_beforehand
from tests.shared_line import Bus, Kind, serial_bus, socket_bus
from tests.verify.test_contract import ASKING, scenes

OURS, ITS = 9, 12
TARGETS = (200, 40)
EXCEPT = {
    "test_statistics": "it counts polls at 200 Hz, and here are 150",
    "test_a_cancelled_wait_leaves_nothing": "its fault 0x09 is over before three reads have seen it",
    "test_a_loop_that_was_closed_under_it": "the ports of the line stay open in the loop that is closed",
}
"""Scenes that cannot pass, and why."""


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


@pytest.mark.parametrize("file", ASKING)
@pytest.mark.parametrize(
    ("kind", "model"),
    [(serial_bus, THREE_FINGER), (socket_bus, TWO_FINGER_85)],
    ids=["rtu, 3-Finger", "rtu+tcp, 2F-85"],
)
def test_beside_another_hand_the_contract_holds(kind: Kind, model: Model, file: str) -> None:
    def served(gripper: SimulatedGripper) -> Any:
        return beside_another(kind, gripper)

    excepted = EXCEPT.keys() | (OTHERWISE.keys() if model is TWO_FINGER_85 else set())
    failed, kept = {}, 0
    for name, scene in dict(scenes(file)).items():
        if name in excepted:
            continue
        context = copy_context()
        context.run(MODEL.set, model)
        context.run(SERVER.set, served)  # type: ignore[arg-type]
        context.run(HABIT.set, (None, {"device_id": OURS}))
        try:
            context.run(scene)
            kept += 1
        except Exception as error:  # noqa: BLE001  # every way to fail counts
            if not re.search("axes of a|axis of a", str(error)):
                failed[name] = error
    assert not failed
    assert kept > 0


def test_no_exception_is_of_a_scene_that_there_is_not() -> None:
    assert EXCEPT.keys() <= {name for file in ASKING for name, _ in scenes(file)}
