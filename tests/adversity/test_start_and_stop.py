"""The start, an activation and the end, cut short or in bad company: nothing moves afterwards."""

from __future__ import annotations

import asyncio
import logging

import pytest

from robotiq_async import Finger, NotStartedError, RobotiqError, RobotiqHand, State
from robotiq_async.simulator import Trouble
from robotiq_async.values.model import TWO_FINGER_85, Model
from robotiq_async.values.request import Request
from tests.adversity.phases import PHASES, Phase
from tests.adversity.world import MODEL, World, started, world
from tests.virtual import inside, run

A = Finger.A


@inside(world)
@pytest.mark.parametrize("device_cycle", [0.005, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("after", [0.001, 0.02, 0.15])
async def test_a_start_that_was_cancelled_does_not_disturb_the_next(
    here: World, device_cycle: float, after: float
) -> None:
    here.gripper.device_cycle = device_cycle * here.gripper.speedup
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(after):
            await here.hand.start()
    await here.hand.start()
    assert here.hand.state is State.RUNNING_IDLE
    await here.nothing_moves_for(2)  # an activation begins within a device cycle


@inside(world, poll_interval=0.005)
@pytest.mark.parametrize("device_cycle", [0.005, 0.05, 0.2])
@pytest.mark.parametrize("after", [0.04, 0.06, 0.1])
async def test_a_cancelled_start_at_a_gripper_that_a_program_has_reset_leaves_nothing_moving(
    here: World, device_cycle: float, after: float
) -> None:
    """It showed the image of that reset, which was taken for the one that takes the activation back."""
    await here.activate_beforehand()
    await here.hand.start()
    await here.hand.move(100)
    await here.hand.reset()
    await here.hand.stop()
    await asyncio.sleep(1)
    here.gripper.device_cycle = device_cycle * here.gripper.speedup
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(after):
            await here.hand.start()
    await here.nothing_moves_for(6)


@inside(world)
@pytest.mark.parametrize("device_cycle", [0.01, 0.1])
async def test_an_activation_that_was_cancelled_and_reset_can_be_asked_for_again(
    here: World, device_cycle: float
) -> None:
    here.gripper.device_cycle = device_cycle * here.gripper.speedup
    await here.hand.start(activate=False)
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.02):
            await here.hand.activate()
    await here.hand.reset()
    assert here.hand.state is State.RESET
    await here.nothing_moves_for(1)
    await here.hand.activate()


@inside(world, speedup=1.0)
@pytest.mark.parametrize("how", ["start", "stop"])
async def test_an_activation_of_ours_is_taken_back_also_after_the_link_blinked(here: World, how: str) -> None:
    if how == "stop":
        await here.hand.start(activate=False)
    activating = asyncio.create_task(here.hand.start() if how == "start" else here.hand.activate())
    await here.until_moving()
    await here.server.fault_injector.begin(Trouble("close"))
    with pytest.raises(RobotiqError):
        await activating
    if how == "stop":
        await asyncio.sleep(0.5)
        await here.hand.stop()
    await here.nothing_moves_for(6, tolerance=2)


@pytest.mark.parametrize("finds_it", [True, False])
@pytest.mark.parametrize(
    ("link", "model"), [("tcp", MODEL), ("rtu", MODEL), ("urcap", TWO_FINGER_85)], ids=str
)
@pytest.mark.parametrize(("device_cycle", "after"), [(0.005, 0.0), (0.05, 0.02), (0.2, 0.3), (0.05, 1.0)])
def test_a_stop_takes_back_an_activation_that_the_last_start_has_left(
    monkeypatch: pytest.MonkeyPatch,
    link: str,
    model: Model,
    device_cycle: float,
    after: float,
    finds_it: bool,
) -> None:
    """By a stop that comes as soon as the next start has found it, or before that has read anything."""

    async def main() -> None:
        async with world(link, monkeypatch=monkeypatch, model=model, speedup=1.0) as here:
            await here.hand.start(activate=False)
            here.gripper.device_cycle = device_cycle
            activating = asyncio.create_task(here.hand.activate())
            await here.until(lambda: bool(here.gripper.writes))
            await here.hand.stop(halt=False)
            await asyncio.gather(activating, return_exceptions=True)
            await asyncio.sleep(after)
            hand = RobotiqHand(here.hand.address, model=model)
            starting = asyncio.create_task(hand.start(activate=False))
            await (starting if finds_it else asyncio.sleep(0))
            await hand.stop()
            await asyncio.gather(starting, return_exceptions=True)
            await here.nothing_moves_for(4, tolerance=2)
            assert not Request.from_registers(here.gripper.request_registers, model).activate

    run(main)


@inside(world)
@pytest.mark.parametrize("device_cycle", [0.005, 0.05, 0.2])
async def test_stop_during_a_reset_does_not_activate_again(here: World, device_cycle: float) -> None:
    here.gripper.device_cycle = device_cycle * here.gripper.speedup
    await here.activate_beforehand()
    await here.hand.start()
    resetting = asyncio.create_task(here.hand.reset())
    await here.until_state(State.WF_RESET)
    await here.hand.stop()
    with pytest.raises(NotStartedError):
        await resetting
    await here.nothing_moves_for(6)
    assert not Request.from_registers(here.gripper.request_registers).activate


@inside(world)
@pytest.mark.parametrize(
    ("phase", "after", "device_cycle"),
    [
        pytest.param(phase, after, (0.005, 0.2)[(row + column) % 2], id=f"{phase.name}-{after}")
        for row, phase in enumerate(phase for phase in PHASES if phase.name != "releasing")
        for column, after in enumerate((0.0, 0.02, 0.3))
    ],
)  # each pair of values
async def test_a_stop_that_keeps_a_grip_leaves_nothing_moving_in_any_phase(
    here: World, phase: Phase, after: float, device_cycle: float
) -> None:
    """A release aside: rGTO does not end it, and no stop does."""
    call = await phase.reach(here)
    here.gripper.device_cycle = device_cycle * here.gripper.speedup
    task = asyncio.ensure_future(asyncio.sleep(0) if call is None else call())
    await asyncio.sleep(after)
    began = here.loop.time()
    await here.hand.stop(keep_grip=True)
    assert here.loop.time() - began < 2.0
    await asyncio.gather(task, return_exceptions=True)
    await here.nothing_moves_for(6)
    if phase.name == "holding":
        assert here.gripper.grips == Finger.ABC


class FullDisk(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:  # noqa: ARG002
        raise OSError(28, "no space left on device")


@inside(started)
async def test_a_log_handler_that_fails_does_not_keep_the_fingers_from_stopping(
    here: World,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO, logger="robotiq_async")
    logger, handler = logging.getLogger("robotiq_async"), FullDisk()
    moving = asyncio.create_task(here.hand.move(255, A, speed=0))
    waiting = asyncio.create_task(here.hand.wait_for_state(State.FAULT))
    await asyncio.sleep(0.3)
    logger.addHandler(handler)
    try:
        await here.hand.stop()
        assert not here.gripper.is_moving
        for task in (moving, waiting):
            with pytest.raises(NotStartedError):
                await task
        await here.hand.start()
    finally:
        logger.removeHandler(handler)
    assert "no space left" in capsys.readouterr().err
