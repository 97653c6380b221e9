"""Gateways that answer late: what a response timeout of up to 5 s does to moves and to stop()."""

from __future__ import annotations

import asyncio
import logging

import pytest

from robotiq_async import ConnectionLostError, Finger, State
from robotiq_async.simulator import Trouble
from tests.adversity.world import World, started, world
from tests.virtual import inside

A = Finger.A


@inside(world, response_timeout=5.0)
@pytest.mark.parametrize("late", [0.3, 1.0, 2.0, 4.5])
async def test_a_gateway_that_is_slow_is_a_gateway(here: World, late: float) -> None:
    await here.activate_beforehand()
    async with here.server.fault_injector.making(Trouble("delay", late)):
        await here.hand.start()
        result = await here.hand.move(100, A, timeout=60)
        assert result.positions[A] == pytest.approx(100, abs=2)
        assert here.hand.statistics.reconnects == 0


@inside(started, "response_timeout")
@pytest.mark.parametrize(
    ("trouble", "after", "asked", "response_timeout"),
    [
        (trouble, after, asked, (0.4, 1.0, 5.0)[(row + column + asked) % 3])
        for row, trouble in enumerate((Trouble("silence"), Trouble("delay", 4.9), Trouble("delay", 1.5)))
        for column, after in enumerate((0.0, 0.003, 0.5, 1.2))
        for asked in (False, True)
    ],
)  # each pair of values
async def test_stop_ends_within_two_seconds_for_any_response_timeout(
    here: World, trouble: Trouble, after: float, asked: bool
) -> None:
    async with here.server.fault_injector.making(trouble):
        await asyncio.sleep(after)
        writing = asyncio.create_task(here.hand.set_position(200, A)) if asked else None
        await asyncio.sleep(0)
        began = here.loop.time()
        await here.hand.stop()
        assert here.loop.time() - began <= 2.0
        assert here.hand.state is State.SHUTDOWN
        if writing is not None:
            await asyncio.wait({writing}, timeout=0)
            assert writing.done()
            writing.exception()


@inside(started, response_timeout=5.0)
@pytest.mark.parametrize("late", [0.2, 0.4])
@pytest.mark.parametrize("phase", range(10))
async def test_a_gateway_that_is_a_little_slow_has_confirmed_the_stop_by_then(
    here: World, late: float, phase: int
) -> None:
    async with here.server.fault_injector.making(Trouble("delay", late)):
        await here.hand.set_position(255, A)
        await asyncio.sleep(0.3 + 0.05 * phase)
        await here.hand.stop()
        await here.nothing_moves_for(2)


@inside(started, response_timeout=5.0, speedup=1.0)
@pytest.mark.parametrize("late", [0.6, 0.8])
async def test_a_slower_gateway_still_gets_the_stop(
    here: World, late: float, caplog: pytest.LogCaptureFixture
) -> None:
    """It is not waited for; in the log it is unknown."""
    caplog.set_level(logging.WARNING, "robotiq_async")
    async with here.server.fault_injector.making(Trouble("delay", late)):
        await here.hand.set_position(255, A)
        await here.hand.stop()
        await here.nothing_moves_for(2, tolerance=1)
    assert "did not confirm in time" in caplog.text


@inside(started, "response_timeout")
@pytest.mark.parametrize("response_timeout", [0.5, 2.0, 5.0])
async def test_a_write_fails_within_twice_the_response_timeout(here: World, response_timeout: float) -> None:
    async with here.server.fault_injector.making(Trouble("silence")):
        began = here.loop.time()
        with pytest.raises(ConnectionLostError):
            await here.hand.set_position(100)
        assert here.loop.time() - began <= 2 * response_timeout + 0.05


@inside(started, "response_timeout")
@pytest.mark.parametrize("response_timeout", [0.4, 0.5])
async def test_a_write_fails_within_a_second_on_a_slow_link(here: World, response_timeout: float) -> None:
    async with here.server.fault_injector.making(Trouble("delay", response_timeout - 0.01, on="read")):
        await asyncio.sleep(1.0)
        heard = len(here.server.heard)
        await here.until(lambda: len(here.server.heard) > heard)
        began = here.loop.time()
        async with here.server.fault_injector.making(Trouble("drop", on="write")):
            with pytest.raises(ConnectionLostError):
                await here.hand.set_position(100)
        assert here.loop.time() - began <= 1.0
