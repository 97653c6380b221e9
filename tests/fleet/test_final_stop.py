"""stop() of a remote hand is final from its call on, and the strongest of several counts."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from robotiq_async import Finger, NotStartedError, State
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.values.request import Request
from tests.contract.bench import until
from tests.fleet.lab import Lab, lab
from tests.virtual import virtual

A = Finger.A
STOPS: dict[str, dict[str, bool]] = {"leave": {"halt": False}, "keep": {"keep_grip": True}, "halt": {}}
REQUESTS: dict[str, Callable[[RemoteHand], Any]] = {
    "command": lambda hand: hand.command(position=255),
    "move": lambda hand: hand.move(255),
    "grasp": lambda hand: hand.grasp(),
    "set_position": lambda hand: hand.set_position(255),
    "set_speed": lambda hand: hand.set_speed(255),
    "hold": lambda hand: hand.hold(),
    "halt": lambda hand: hand.halt(),
    "activate": lambda hand: hand.activate(),
    "reset": lambda hand: hand.reset(),
    "recover": lambda hand: hand.recover(),
    "acquire": lambda hand: hand.acquire(),
    "take": lambda hand: hand.take(),
}


async def call(what: Callable[[], Any]) -> None:
    answer = what()
    if isinstance(answer, Awaitable):
        await answer


def going(here: Lab, since: int) -> list[Request]:
    images = [Request.from_registers(write.registers) for write in here.gripper.writes[since:]]
    return [image for image in images if image.go]


@pytest.mark.parametrize("request_", REQUESTS.values(), ids=REQUESTS)
@virtual
async def test_after_the_call_of_stop_every_request_is_refused(request_: Callable[[RemoteHand], Any]) -> None:
    async with lab() as here:
        hand = here.client()
        await hand.start()
        writes = len(here.gripper.writes)
        stopping = asyncio.create_task(hand.stop())
        await asyncio.sleep(0)
        with pytest.raises(NotStartedError):
            await call(lambda: request_(hand))
        await stopping
        assert not going(here, writes)


@pytest.mark.parametrize("turns", range(4))
@pytest.mark.parametrize("options", STOPS.values(), ids=STOPS)
@virtual
async def test_a_control_loop_is_refused_at_once_and_nothing_of_it_is_sent_after_that(
    options: dict[str, bool], turns: int
) -> None:
    async with lab() as here:
        hand = here.client()
        await hand.start()
        for position in range(100):
            hand.command(A, position=position)  # four are under way, and the rest is merged
        for _ in range(turns):
            await asyncio.sleep(0)
        stopping = asyncio.create_task(hand.stop(**options))
        await asyncio.sleep(0)
        with pytest.raises(NotStartedError):
            hand.command(A, position=200)
        await stopping
        asked = [image.axes[0].position for image in going(here, 0)]
        await asyncio.sleep(1)
        assert [image.axes[0].position for image in going(here, 0)] == asked
        assert 99 not in asked, "what waited to be sent was dropped"


@virtual
async def test_a_caller_hears_at_once_that_the_hand_was_stopped() -> None:
    """It waited for the end of the run."""
    async with lab() as here:
        hand = here.client()
        await hand.start()
        here.network.cut(("client", "agent"), ("agent", "client"))
        moving = asyncio.create_task(hand.move(255))
        await asyncio.sleep(0.05)
        loop = asyncio.get_running_loop()
        stopping, called = asyncio.create_task(hand.stop()), loop.time()
        await asyncio.wait({moving})
        assert isinstance(moving.exception(), NotStartedError)
        assert loop.time() - called < 0.01
        await stopping


@pytest.mark.parametrize("between", [0.0, 0.0005, 0.003, 0.02, 0.2])
@pytest.mark.parametrize("second", STOPS)
@pytest.mark.parametrize("first", STOPS)
@virtual
async def test_the_strongest_stop_counts_whoever_asks_first(first: str, second: str, between: float) -> None:
    """With a gentler one under way, stop() returned with rGTO set, and the fingers went on."""
    async with lab() as here:
        hand = here.client()
        await hand.start()
        await hand.set_speed(0)
        await hand.set_position(255)
        await until(lambda: here.gripper.is_moving)
        stops = [asyncio.create_task(hand.stop(**STOPS[first]))]
        await asyncio.sleep(between)
        was_over = hand.state is State.SHUTDOWN
        stops.append(asyncio.create_task(hand.stop(**STOPS[second])))
        await asyncio.gather(*stops)
        await asyncio.sleep(0.1)
        strongest = max(first, first if was_over else second, key=list(STOPS).index)
        assert here.gripper.is_moving == (strongest == "leave")
        if strongest == "halt":
            assert not Request.from_registers(here.gripper.request_registers).go


@virtual
async def test_a_weaker_stop_hears_that_a_stronger_one_counts(caplog: pytest.LogCaptureFixture) -> None:
    async with lab() as here:
        hand = here.client()
        await hand.start()
        with caplog.at_level(logging.WARNING, logger="robotiq_async"):
            await asyncio.gather(hand.stop(), hand.stop(keep_grip=True))
        assert "a stop that is under way is stronger: the fingers are stopped" in caplog.text


@pytest.mark.parametrize("turns", range(8))
@virtual
async def test_an_agent_that_is_told_to_end_begins_nothing(turns: int) -> None:
    async with lab() as here:
        hand = here.client()
        await hand.start()
        commanding = asyncio.create_task(_command(hand))
        await asyncio.sleep(0.1)
        here.serving.cancel()
        for _ in range(turns):
            await asyncio.sleep(0)
        await asyncio.wait({here.serving})
        writes = len(here.gripper.writes)
        await asyncio.sleep(2)
        commanding.cancel()
        await asyncio.gather(commanding, return_exceptions=True)
        assert not going(here, writes)
        assert not Request.from_registers(here.gripper.request_registers).go
        await hand.stop()


async def _command(hand: RemoteHand) -> None:
    position = 0
    while True:
        hand.command(A, position=(position := (position + 7) % 256))
        await asyncio.sleep(0.001)
