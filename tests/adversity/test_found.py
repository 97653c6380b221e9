"""Cases that reviews and random runs have found, over a live link in virtual time."""

from __future__ import annotations

import asyncio
import logging
from dataclasses import replace

import pytest

from robotiq_async import (
    ConnectionLostError,
    Fault,
    Finger,
    NotActivatedError,
    NotStartedError,
    RobotiqError,
    State,
)
from robotiq_async.simulator import Trouble
from robotiq_async.wire.request import AxisRequest, Request
from tests.adversity.world import World, world
from tests.virtual import run

A, B = Finger.A, Finger.B


async def nothing_moves_for(world: World, seconds: float, tolerance: float = 0.0) -> None:
    before = world.travels()
    await asyncio.sleep(seconds)
    after = world.travels()
    assert all(after[axis] - before[axis] <= tolerance for axis in after), (before, after)


@pytest.mark.parametrize("device_cycle", [0.005, 0.05, 0.2])
def test_stop_during_a_reset_does_not_activate_again(device_cycle: float) -> None:
    async def main() -> None:
        async with world() as here:
            here.gripper.device_cycle = device_cycle * here.gripper.speedup
            await here.activate_beforehand()
            await here.hand.start()
            resetting = asyncio.create_task(here.hand.reset())
            await here.until_state(State.WF_RESET)
            await here.hand.stop()
            with pytest.raises(NotStartedError):
                await resetting
            await nothing_moves_for(here, 6)
            assert not Request.from_registers(here.gripper.request_registers).activate

    run(main)


@pytest.mark.parametrize("how", ["command", "stop"])
def test_what_happened_while_the_loop_was_held_up_is_seen_before_the_next_write(how: str) -> None:
    async def main() -> None:
        async with world() as here:
            await here.activate_beforehand()
            await here.hand.start()
            await here.hand.move(50, A)
            here.gripper.write(0, [0x0000])  # somebody resets the gripper ...
            here.loop.hold_up(1.0)  # ... while other code holds the loop
            if how == "command":
                here.hand.command(A, position=100)
            else:
                await here.hand.stop()
            await nothing_moves_for(here, 6)

    run(main)


@pytest.mark.parametrize("turns", range(1, 31))
def test_wherever_in_a_poll_the_loop_is_held_up_what_happened_meanwhile_is_seen_first(turns: int) -> None:
    async def main() -> None:
        async with world() as here:
            await here.activate_beforehand()
            await here.hand.start()
            await here.hand.move(50, A)

            def hold_up() -> None:
                here.gripper.write(0, [0x0000])
                here.loop.hold_up(1.0)
                here.hand.command(A, position=100)

            here.loop.after_turns(turns, hold_up)
            await asyncio.sleep(2.0)
            await nothing_moves_for(here, 6)
            assert not Request.from_registers(here.gripper.request_registers).activate

    run(main)


def test_a_move_cancelled_while_the_loop_was_held_up_stops_where_it_is_by_then() -> None:
    async def main() -> None:
        async with world() as here:
            await here.activate_beforehand()
            await here.hand.start()
            moving = asyncio.create_task(here.hand.move(255, A, speed=0))
            await asyncio.sleep(0.3)
            moving.cancel()
            here.loop.hold_up(0.5)
            at = here.gripper.position(A)
            await asyncio.sleep(2)
            assert abs(here.gripper.position(A) - at) < 10

    run(main)


@pytest.mark.parametrize("how", ["start", "stop"])
def test_an_activation_of_ours_is_taken_back_also_after_the_link_blinked(how: str) -> None:
    async def main() -> None:
        async with world(speedup=1.0) as here:
            if how == "stop":
                await here.hand.start(activate=False)
            activating = asyncio.create_task(here.hand.start() if how == "start" else here.hand.activate())
            await here.until_moving()
            await here.server.adversary.begin(Trouble("close"))
            with pytest.raises(RobotiqError):
                await activating
            if how == "stop":
                await asyncio.sleep(0.5)
                await here.hand.stop()
            await nothing_moves_for(here, 6, tolerance=2)

    run(main)


@pytest.mark.parametrize("device_cycle", [0.005, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("after", [0.001, 0.02, 0.15])
def test_a_start_that_was_cancelled_does_not_disturb_the_next(device_cycle: float, after: float) -> None:
    async def main() -> None:
        async with world() as here:
            here.gripper.device_cycle = device_cycle * here.gripper.speedup
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(after):
                    await here.hand.start()
            await here.hand.start()
            assert here.hand.state is State.RUNNING_IDLE
            await nothing_moves_for(here, 6)

    run(main)


@pytest.mark.parametrize("device_cycle", [0.01, 0.1])
def test_an_activation_that_was_cancelled_and_reset_can_be_asked_for_again(device_cycle: float) -> None:
    async def main() -> None:
        async with world() as here:
            here.gripper.device_cycle = device_cycle * here.gripper.speedup
            await here.hand.start(activate=False)
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(0.02):
                    await here.hand.activate()
            await here.hand.reset()
            assert here.hand.state is State.RESET
            await nothing_moves_for(here, 1)
            await here.hand.activate()

    run(main)


@pytest.mark.parametrize("trouble", [Trouble("silence"), Trouble("close"), Trouble("drop", on="write")])
def test_a_cancelled_move_stops_also_when_the_link_fails_at_that_moment(trouble: Trouble) -> None:
    async def main() -> None:
        async with world() as here:
            await here.activate_beforehand()
            await here.hand.start()
            moving = asyncio.create_task(here.hand.move(255, A, speed=0))
            await asyncio.sleep(0.3)
            async with here.server.adversary.making(trouble):
                moving.cancel()
                await asyncio.sleep(0.3)
            await asyncio.sleep(0.3)
            await nothing_moves_for(here, 3)
            assert here.hand.state is State.RUNNING_IDLE
            assert here.gripper.position(A) < 200

    run(main)


def test_a_write_does_not_wait_for_another_client_that_writes_all_the_time(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async def main() -> None:
        async with world() as here:
            await here.activate_beforehand()
            await here.hand.start()
            await here.hand.move(50)
            streaming = asyncio.create_task(stream(here))
            await asyncio.sleep(0.1)
            began = here.loop.time()
            await here.hand.set_position(180, Finger.SCISSOR)
            assert here.loop.time() - began < 0.5
            streaming.cancel()

    async def stream(here: World) -> None:
        image = Request.from_registers(here.gripper.request_registers)
        image = replace(image, axes=tuple(replace(axis, speed=0) for axis in image.axes))
        for position in range(150, 250):
            here.gripper.write(0, image.with_positions({B: position}).registers)
            await asyncio.sleep(0.005)

    run(main)
    assert len([each for each in caplog.records if "another client" in each.message]) == 1


class FullDisk(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:  # noqa: ARG002
        raise OSError(28, "no space left on device")


def test_a_log_handler_that_fails_does_not_keep_the_fingers_from_stopping(
    capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, logger="robotiq_async")
    logger, handler = logging.getLogger("robotiq_async"), FullDisk()

    async def main() -> None:
        async with world() as here:
            await here.activate_beforehand()
            await here.hand.start()
            moving = asyncio.create_task(here.hand.move(255, A, speed=0))
            waiting = asyncio.create_task(here.hand.wait_for_state(State.FAULT))
            await asyncio.sleep(0.3)
            logger.addHandler(handler)
            await here.hand.stop()
            assert not here.gripper.is_moving
            for task in (moving, waiting):
                with pytest.raises(NotStartedError):
                    await task
            await here.hand.start()

    try:
        run(main)
    finally:
        logger.removeHandler(handler)
    assert "no space left" in capsys.readouterr().err


# -- found by the second review ------------------------------------------------------------------------


def test_stop_over_a_new_link_leaves_what_others_have_activated_active() -> None:
    async def main() -> None:
        async with world() as here:
            await here.hand.start(activate=False)
            here.gripper.place_object(Finger.ABC, 150)
            async with here.server.adversary.making(Trouble("refuse")):
                await asyncio.sleep(0.3)
                here.gripper.write(0, [0x0100])
                await asyncio.sleep(3)
                axes = (AxisRequest(255, 128, 64),) * 4
                here.gripper.write(0, Request(activate=True, go=True, axes=axes).registers)
                await asyncio.sleep(3)
            await here.hand.stop()
            await asyncio.sleep(0.2)
            asked = Request.from_registers(here.gripper.request_registers)
            assert asked.activate
            assert not asked.go

    run(main)


def test_a_release_is_called_off_when_the_gripper_was_reset_while_the_loop_was_held_up() -> None:
    async def main() -> None:
        async with world() as here:
            await here.activate_beforehand()
            await here.hand.start()
            await here.hand.move(100)
            here.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
            await here.until_state(State.FAULT)
            await asyncio.sleep(0.3)
            here.gripper.write(0, [0x0000])
            here.loop.hold_up(1.0)
            with pytest.raises(NotActivatedError):
                await here.hand.atr()
            await nothing_moves_for(here, 6)

    run(main)


@pytest.mark.parametrize("response_timeout", [0.4, 0.5])
def test_a_write_fails_within_a_second_on_a_slow_link(response_timeout: float) -> None:
    async def main() -> None:
        async with world(response_timeout=response_timeout) as here:
            await here.activate_beforehand()
            await here.hand.start()
            async with here.server.adversary.making(Trouble("delay", response_timeout - 0.01, on="read")):
                await asyncio.sleep(1.0)
                heard = len(here.server.heard)
                await here.until(lambda: len(here.server.heard) > heard)
                began = here.loop.time()
                async with here.server.adversary.making(Trouble("drop", on="write")):
                    with pytest.raises(ConnectionLostError):
                        await here.hand.set_position(100)
                assert here.loop.time() - began <= 1.0

    run(main)


@pytest.mark.parametrize("turns", range(1, 12))
def test_a_move_cancelled_in_the_turn_in_which_the_link_is_lost_is_stopped_or_told(turns: int) -> None:
    async def main() -> None:
        async with world() as here:
            await here.activate_beforehand()
            await here.hand.start()
            moving = asyncio.create_task(here.hand.move(255, A, speed=0))
            await asyncio.sleep(0.3)
            await here.server.adversary.begin(Trouble("close"))
            here.loop.after_turns(turns, moving.cancel)
            await asyncio.wait({moving})
            await asyncio.sleep(4)
            if moving.cancelled():
                assert here.gripper.position(A) < 150
            else:
                assert isinstance(moving.exception(), ConnectionLostError)

    run(main)


def test_a_loop_that_is_held_up_again_during_the_second_look_is_looked_into_again() -> None:
    async def main() -> None:
        async with world() as here:
            await here.activate_beforehand()
            await here.hand.start()
            await here.hand.move(50, A)
            await anext(here.hand.statuses())
            here.loop.hold_up(0.3)
            here.hand.command(A, position=100)
            heard = len(here.server.heard)
            await here.until(lambda: len(here.server.heard) > heard)
            await asyncio.sleep(0.0001)
            here.loop.hold_up(0.1)
            here.gripper.write(0, [0x0000])
            here.loop.hold_up(0.2)
            await nothing_moves_for(here, 6)

    run(main)
