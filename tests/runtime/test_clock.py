"""The one clock: whatever loop a hand runs in, its times belong together."""

from __future__ import annotations

import asyncio
import importlib
import logging
import time
from collections.abc import Callable
from importlib.util import find_spec

import pytest

from robotiq_async import Finger, RobotiqHand, RobotiqStatus, SentRequest, State, Transition
from robotiq_async.hands.options import LATE_POLLS
from robotiq_async.runtime.clock import clock_of, now
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.request import AxisRequest, Request
from tests.virtual import VirtualLoop


def shifted(by: float) -> Callable[[], asyncio.AbstractEventLoop]:
    """Makes loops whose time is not the system's."""

    class Shifted(asyncio.SelectorEventLoop):
        def time(self) -> float:
            return super().time() + by

    return Shifted


def shifted_afterwards() -> asyncio.AbstractEventLoop:
    loop = asyncio.new_event_loop()
    loop.time = lambda: time.monotonic() + 1000  # type: ignore[method-assign]
    return loop


LOOPS = [
    pytest.param(asyncio.new_event_loop, id="asyncio"),
    pytest.param(
        lambda: importlib.import_module("uvloop").new_event_loop(),
        id="uvloop",
        marks=pytest.mark.skipif(find_spec("uvloop") is None, reason="uvloop is not installed"),
    ),
    *(pytest.param(shifted(by), id=f"{by:+g} s") for by in (0.5, -0.5, 1000.0, -1000.0)),
    pytest.param(shifted_afterwards, id="patched"),
    pytest.param(lambda: shifted(-time.monotonic())(), id="from 0"),
    pytest.param(lambda: shifted(-time.monotonic() - 1000)(), id="below 0"),
]


@pytest.mark.parametrize("factory", LOOPS[:2])
def test_the_clock_is_the_system_s_monotonic_one(
    factory: Callable[[], asyncio.AbstractEventLoop],
) -> None:
    loop = factory()
    assert clock_of(loop) is time.monotonic
    loop.close()


@pytest.mark.parametrize(
    "factory",
    [*LOOPS[2:], pytest.param(shifted(0.0), id="shifted by 0"), pytest.param(VirtualLoop, id="virtual")],
)
def test_a_loop_with_a_time_of_its_own_is_believed(
    factory: Callable[[], asyncio.AbstractEventLoop],
) -> None:
    """Also one that has the system's time at the moment: it need not stay so."""
    loop = factory()
    assert clock_of(loop) == loop.time
    loop.close()


def test_now_is_the_running_loop_s() -> None:
    async def main() -> float:
        return now() - asyncio.get_running_loop().time()

    with asyncio.Runner(loop_factory=shifted(1000.0)) as runner:
        assert runner.run(main()) == pytest.approx(0, abs=0.1)
    with pytest.raises(RuntimeError):
        now()


@pytest.mark.parametrize("factory", LOOPS)
def test_all_times_of_a_hand_are_of_one_clock(
    factory: Callable[[], asyncio.AbstractEventLoop], caplog: pytest.LogCaptureFixture
) -> None:
    async def main() -> None:
        async with SimulatorServer(SimulatedGripper(speedup=100)) as server:
            hand = RobotiqHand(server.address)
            statuses, transitions, requests = hand.statuses(10_000), hand.transitions(), hand.requests()
            before = now()
            async with hand:
                started = now()
                result = await hand.move(60, Finger.A)
                assert 0 <= result.duration <= now() - started
                short = await hand.move(60, Finger.A)
                assert 0 <= short.duration < 1
                assert 0 <= now() - hand.status.timestamp < 1
                # Another client and a loop that is held up are warned of at any time.
                image = Request(activate=True, go=True, axes=(AxisRequest(50, 255, 100),) * 4)
                server.gripper.write(0, image.registers)
                time.sleep(0.1)  # noqa: ASYNC251  # holds up the loop
                while not hand.statistics.foreign_commands:
                    await anext(statuses)
                await hand.reset()
            seen = list(statuses.drain())
            changes = list(transitions.drain())
            items: list[RobotiqStatus | Transition | SentRequest] = [*seen, *changes, *requests.drain()]
            after = now()
        assert all(before <= each.timestamp <= after for each in items)
        times = [each.timestamp for each in changes]
        assert times == sorted(times)
        asked, was_reset = (
            each.timestamp for each in changes if each.target in (State.DO_RESET, State.RESET)
        )
        cause = next(each for each in seen if each.is_reset and each.timestamp > asked)
        assert cause.timestamp <= was_reset, "a transition comes after the status that it was seen in"
        figures = hand.statistics
        assert 0 < figures.round_trip_p50 < 1
        assert 0 < figures.period_p50 < 1
        assert 0 <= figures.longest_stall < 1

    with asyncio.Runner(loop_factory=factory) as runner, caplog.at_level(logging.WARNING, "robotiq_async"):
        runner.run(main())
    assert "another client" in caplog.text
    assert LATE_POLLS in caplog.text
