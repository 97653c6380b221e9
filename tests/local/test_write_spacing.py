"""A gripper that acknowledges writes closer than 10 ms and forgets them: no request is lost."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from itertools import pairwise
from typing import Any

import pytest

from robotiq_async import Fault, Finger, RobotiqHand, State
from robotiq_async.simulator import Habits, SerialSimulatorServer, SimulatedGripper, SimulatorServer
from robotiq_async.values.request import Request
from tests.fake_transport import Wire
from tests.grippers import activate_beforehand
from tests.virtual import until
from tests.virtual_line import VirtualLine

pytestmark = pytest.mark.virtual_time

A = Finger.A
SPACING_S = 0.01


@asynccontextmanager
async def forgetful(**options: Any) -> AsyncIterator[tuple[SimulatedGripper, RobotiqHand]]:
    """A hand that has been idle for a while, and its gripper."""
    habits = Habits(write_spacing=SPACING_S)
    gripper = SimulatedGripper(asyncio.get_running_loop().time, spread=False, habits=habits, speedup=4)
    await activate_beforehand(gripper)
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address, **options) as hand:
        await asyncio.sleep(0.1)
        yield gripper, hand


@pytest.mark.parametrize(
    ("period", "counts"),
    [*((period, (10, 11)) for period in (0.001, 0.005, 0.012)), (0.002, (12, 13)), (0.0071, (12, 13))],
)
async def test_the_last_value_of_a_control_loop_arrives(period: float, counts: tuple[int, ...]) -> None:
    """It was lost in 12 of 16 of these, and the hand took its own last but one for another client's."""
    async with forgetful() as (gripper, hand):
        for count in counts:
            for step in range(count):
                hand.command(A, position=50 + 2 * step, speed=255)
                await asyncio.sleep(period)
            await asyncio.sleep(0.6)
            assert gripper.request_registers == gripper.writes[-1].registers
            assert Request.from_registers(gripper.request_registers).position(A) == 50 + 2 * (count - 1)
            assert hand.statistics.foreign_commands == 0
            assert not hand.is_moving


async def test_a_move_right_after_another_one_goes_where_it_is_asked() -> None:
    """Within 5 ms of a write it failed with "another client commands the gripper", half a second later."""
    async with forgetful(speed=255) as (_, hand):
        for step in range(24):  # two cycles of a poll, and the distance of two writes
            await hand.set_position(20, A)
            await asyncio.sleep(step * 0.0005)
            assert (await hand.move(10, A)).positions[A] == pytest.approx(10, abs=2)
            await asyncio.sleep(0.02)


async def test_a_command_keeps_its_distance_from_a_trial_of_function_23(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It came 6 ms after it: forgotten, and its move failed with "another client commands the gripper"."""
    cable, habits = VirtualLine(monkeypatch), Habits(write_spacing=SPACING_S)
    gripper = SimulatedGripper(asyncio.get_running_loop().time, habits=habits, model="2f85")
    async with SerialSimulatorServer(cable.FAR, gripper):
        await activate_beforehand(gripper)
        address = f"rtu://{cable.NEAR}?model=2f85"
        async with RobotiqHand(address, write_spacing=SPACING_S) as hand:
            for position in (60, 30):  # the second one finds the jaw at rest, as this link has requested it
                assert (await hand.move(position, speed=255)).positions[A] == pytest.approx(position, abs=3)


@pytest.mark.parametrize("spacing", [0.0, 0.004, 0.01, 0.03])
async def test_writes_keep_the_distance_that_is_asked_for(spacing: float) -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time)
    await activate_beforehand(gripper)
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address, write_spacing=spacing) as hand:
        await asyncio.sleep(0.1)
        written = len(gripper.writes)
        for step in range(60):
            hand.command(A, position=step)
            await asyncio.sleep(0.005)
        gaps = [later.time - earlier.time for earlier, later in pairwise(gripper.writes[written:])]
    assert min(gaps) >= spacing
    usual = max(0.005, spacing)
    assert sum(gaps) / len(gaps) < usual + 0.003, "no slower than it must be"


@pytest.mark.parametrize("later", [0.0, 0.001, 0.004, 0.006, 0.009])
@pytest.mark.parametrize("call", ["halt", "stop", "stop that keeps a grip", "reset"])
async def test_a_stop_waits_for_nothing_and_is_repeated_soon(call: str, later: float) -> None:
    """stop() ended with a warning after 1.2 s, halt() after 0.5 s, reset() never; and the axis moved on."""
    async with forgetful() as (gripper, hand):
        loop = asyncio.get_running_loop()
        await hand.set_speed(0)
        await asyncio.sleep(0.1)
        await hand.set_position(255, A)
        await asyncio.sleep(later)
        keeps, sent, asked = "keeps" in call, hand.requests(), loop.time()
        stopping = asyncio.create_task(hand.stop(keep_grip=True) if keeps else getattr(hand, call)())

        def is_stopped() -> bool:
            request = Request.from_registers(gripper.request_registers)
            return request.position(A) < 60 if keeps else not request.go

        await until(is_stopped)
        assert loop.time() - asked < 0.025, "it is repeated as soon as the gripper bears that"
        async with asyncio.timeout(1.0):
            await stopping
        assert not gripper.is_moving
        assert gripper.position(A) < 60
        if not keeps:
            assert next(sent.drain()).timestamp - asked < 0.006, "and the first one waits for nothing"
        if call == "halt":
            assert hand.state is State.RUNNING_IDLE
        if call == "reset" and later in (0.0, 0.004):  # what activates comes at its distance from the reset
            async with asyncio.timeout(10):
                await hand.activate()


async def test_an_activation_and_a_release_keep_their_distance_from_the_write_before() -> None:
    """They move the fingers, and are sent once: forgotten, the gripper stayed reset, or in its fault."""
    async with forgetful() as (gripper, hand):
        gripper.inject_fault(Fault.SCISSOR_BLOCKED)
        await hand.wait_for_state(State.FAULT)
        await hand.halt()
        await hand.atr()
        await hand.reset()
        await hand.activate()
        writes = gripper.writes
    assert min(later.time - earlier.time for earlier, later in pairwise(writes)) >= SPACING_S
    activations = [Request.from_registers(each.registers).activate for each in writes]
    assert activations[-2:] == [False, True]


@pytest.mark.parametrize("later", [0.0, 0.001, 0.002, 0.003, 0.004, 0.006])
async def test_a_stop_is_not_taken_for_done_by_what_was_there_before_the_motion(later: float) -> None:
    """Halted, then moved, then halted again: a status from before the motion had gGTO = 0."""
    async with forgetful() as (gripper, hand):
        await hand.halt()
        await asyncio.sleep(0.1)
        moving = asyncio.create_task(hand.set_position(255, A))
        await asyncio.sleep(later)
        await hand.halt()
        await asyncio.gather(moving, return_exceptions=True)
        assert not gripper.is_moving
        await asyncio.sleep(0.3)
        assert not gripper.is_moving


@pytest.mark.parametrize("later", [step * 0.001 for step in range(12)], ids=lambda s: f"{s * 1000:g}ms")
async def test_an_activation_is_taken_back_although_the_gripper_shows_reset_still(later: float) -> None:
    """The taking back was forgotten, and the status from before the activation looked like its effect."""
    gripper = SimulatedGripper(asyncio.get_running_loop().time, habits=Habits(write_spacing=SPACING_S))
    async with SimulatorServer(gripper) as server:
        hand = RobotiqHand(server.address)
        await hand.start(activate=False)
        await asyncio.sleep(0.1)
        activating = asyncio.create_task(hand.activate())
        await asyncio.sleep(later)
        await hand.stop()
        await asyncio.gather(activating, return_exceptions=True)
        await asyncio.sleep(1)
        assert not gripper.is_moving


class ResetByAnother(Wire):
    """Another client resets the gripper some time after this one has stopped its fingers; once."""

    resets_after = 0.0
    is_reset = False

    async def write(self, registers: Sequence[int]) -> None:
        await super().write(registers)
        image = Request.from_registers(registers)
        if image.activate and not image.go and not self.is_reset:
            self.is_reset = True
            reset = Request().registers
            asyncio.get_running_loop().call_later(self.resets_after, self.gripper.write, 0, reset)


@pytest.mark.parametrize(
    ("spacing", "later", "resets_after"),
    [
        *((0.0, 0.0, 0.0), (0.0, 0.009, 0.003), (0.0, 0.05, 0.001)),
        *((0.01, 0.0, 0.003), (0.01, 0.009, 0.001), (0.01, 0.05, 0.0)),
        *((0.1, 0.0, 0.001), (0.1, 0.009, 0.0), (0.1, 0.05, 0.003)),
    ],
)  # each pair of values once
@pytest.mark.parametrize("call", ["halt", "stop"])
async def test_a_stop_that_is_repeated_activates_nothing(
    call: str, spacing: float, later: float, resets_after: float
) -> None:
    """It was written again with rACT = 1 on a gripper that had been reset in between: the fingers moved."""
    wire = ResetByAnother()
    wire.gripper.device_cycle = 0.0
    await wire.activate()
    hand = RobotiqHand(wire, write_spacing=spacing)
    await hand.start(activate=False)
    await asyncio.sleep(0.2)
    await hand.set_position(255, A)
    await asyncio.sleep(later)
    wire.resets_after = resets_after
    stopping = asyncio.create_task(getattr(hand, call)())
    await asyncio.wait({stopping}, timeout=2)
    await asyncio.sleep(0.5)
    assert not wire.gripper.status_registers()[0], "it was reset, and is so still"
    await asyncio.gather(stopping, return_exceptions=True)
    await hand.stop(halt=False)
