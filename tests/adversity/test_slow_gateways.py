"""Gateways that answer late: what a response timeout of up to 5 s does to moves and to stop()."""

from __future__ import annotations

import asyncio
import logging

import pytest

from robotiq_async import ConnectionLostError, Finger, State
from robotiq_async.simulator import Trouble
from tests.adversity.world import started, world
from tests.virtual import run, virtual

A = Finger.A


@virtual
@pytest.mark.parametrize("late", [0.3, 1.0, 2.0, 4.5])
async def test_a_gateway_that_is_slow_is_a_gateway(late: float) -> None:
    async with world(response_timeout=5.0) as here:
        await here.activate_beforehand()
        async with here.server.fault_injector.making(Trouble("delay", late)):
            await here.hand.start()
            result = await here.hand.move(100, A, timeout=60)
            assert result.positions[A] == pytest.approx(100, abs=2)
            assert here.hand.statistics.reconnects == 0


@virtual
@pytest.mark.parametrize("response_timeout", [0.4, 1.0, 5.0])
@pytest.mark.parametrize("trouble", [Trouble("silence"), Trouble("delay", 4.9), Trouble("delay", 1.5)])
@pytest.mark.parametrize("after", [0.0, 0.003, 0.5, 1.2])
@pytest.mark.parametrize("asked", [False, True])
async def test_stop_ends_within_two_seconds_whatever_the_response_timeout(
    response_timeout: float, trouble: Trouble, after: float, asked: bool
) -> None:
    async with started(response_timeout=response_timeout) as here, here.server.fault_injector.making(trouble):
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


@virtual
@pytest.mark.parametrize("late", [0.2, 0.4])
async def test_a_gateway_that_is_a_little_slow_has_confirmed_the_stop_by_then(late: float) -> None:
    for phase in range(10):
        async with (
            started(response_timeout=5.0) as here,
            here.server.fault_injector.making(Trouble("delay", late)),
        ):
            await here.hand.set_position(255, A)
            await asyncio.sleep(0.3 + 0.05 * phase)
            await here.hand.stop()
            await here.nothing_moves_for(2)


@pytest.mark.parametrize("late", [0.6, 0.8])
def test_a_slower_one_has_been_told_to_stop(late: float, caplog: pytest.LogCaptureFixture) -> None:
    """It is not waited for; the log says that it is unknown."""
    caplog.set_level(logging.WARNING, "robotiq_async")

    async def main() -> None:
        async with (
            started(response_timeout=5.0, speedup=1.0) as here,
            here.server.fault_injector.making(Trouble("delay", late)),
        ):
            await here.hand.set_position(255, A)
            await here.hand.stop()
            await here.nothing_moves_for(2, tolerance=1)

    run(main)
    assert "did not confirm in time" in caplog.text


@virtual
@pytest.mark.parametrize("response_timeout", [0.5, 2.0, 5.0])
async def test_a_write_fails_within_twice_the_response_timeout(response_timeout: float) -> None:
    async with (
        started(response_timeout=response_timeout) as here,
        here.server.fault_injector.making(Trouble("silence")),
    ):
        began = here.loop.time()
        with pytest.raises(ConnectionLostError):
            await here.hand.set_position(100)
        assert here.loop.time() - began <= 2 * response_timeout + 0.05
