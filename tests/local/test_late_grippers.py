"""A gripper that has no power yet when its program starts: start(wait=...), in virtual time."""

from __future__ import annotations

import asyncio
import logging

import pytest

from robotiq_async import (
    ConnectFailedError,
    ConnectionLostError,
    InvalidStateError,
    NotStartedError,
    ReconnectPolicy,
    RobotiqConnectionError,
    RobotiqHand,
    State,
)
from robotiq_async.simulator import Trouble
from tests.adversity.world import world
from tests.calls import COMMANDS, called

pytestmark = pytest.mark.virtual_time

ABSENT = [Trouble("power-cut"), Trouble("refuse"), Trouble("silence"), Trouble("exception", 11, lasts=1e4)]
"""A gripper without power: directly, and behind gateways that are there already."""


@pytest.mark.parametrize("trouble", ABSENT, ids=lambda trouble: trouble.kind)
@pytest.mark.parametrize("activate", [True, False])
async def test_a_gripper_that_comes_in_time_is_started(trouble: Trouble, activate: bool) -> None:
    async with world() as here:
        absent = await here.server.fault_injector.begin(trouble)
        starting = asyncio.create_task(here.hand.start(activate, wait=30.0))
        await asyncio.sleep(20.0)
        assert not starting.done()
        assert here.gripper.writes == ()
        await here.server.fault_injector.end(absent)
        came = here.loop.time()
        async with asyncio.timeout(2.0 + 2.5 + 10.0 * activate):
            await starting
        assert here.hand.state is (State.RUNNING_IDLE if activate else State.RESET)
        assert activate or here.loop.time() - came <= 2.5, "delays double up to 2 s"
        assert bool(here.gripper.writes) is activate


@pytest.mark.parametrize("trouble", ABSENT, ids=lambda trouble: trouble.kind)
@pytest.mark.parametrize("wait", [0.0, 0.3, 10.0])
async def test_a_gripper_that_does_not_come_gives_an_error_and_leaves_nothing_running(
    trouble: Trouble, wait: float
) -> None:
    async with world() as here:
        async with here.server.fault_injector.making(trouble):
            began = here.loop.time()
            with pytest.raises(RobotiqConnectionError) as caught:
                await here.hand.start(wait=wait)
            assert wait <= here.loop.time() - began <= wait + 2.5
            assert isinstance(caught.value, ConnectFailedError) or trouble.kind == "exception"
        assert here.hand.state is State.SHUTDOWN
        heard = len(here.server.heard)
        await asyncio.sleep(10)
        assert len(here.server.heard) == heard
        await here.hand.start()  # and may be started again


@pytest.mark.parametrize(
    ("trouble", "how", "after"),
    [
        (trouble, how, (0.0, 0.3, 5.0)[(row + column) % 3])
        for row, trouble in enumerate(ABSENT)
        for column, how in enumerate(("cancel", "timeout", "stop"))
    ],
)  # each pair of values
async def test_waiting_ends_at_once(trouble: Trouble, how: str, after: float) -> None:
    async with world() as here:
        async with here.server.fault_injector.making(trouble):
            starting = asyncio.create_task(here.hand.start(wait=3600))
            await asyncio.sleep(after)
            began = here.loop.time()
            if how == "stop":
                await here.hand.stop()
                if after:  # at once it is called before the start has had its turn
                    with pytest.raises(NotStartedError):
                        await starting
                else:
                    starting.cancel()
            elif how == "cancel":
                starting.cancel()
            else:
                with pytest.raises(TimeoutError):
                    async with asyncio.timeout(0.1):
                        await starting
            await asyncio.wait({starting})
            assert here.loop.time() - began <= 0.5
        await asyncio.sleep(10)
        assert here.gripper.writes == ()
        assert here.hand.state in (State.SHUTDOWN, State.DISCONNECTED)


async def test_while_it_waits_it_owns_the_address_and_refuses_commands() -> None:
    async with world() as here, here.server.fault_injector.making(Trouble("refuse")):
        starting = asyncio.create_task(here.hand.start(wait=3600))
        await asyncio.sleep(1)
        for call in COMMANDS:
            with pytest.raises(ConnectionLostError):
                await called(here.hand, call)
        with pytest.raises(NotStartedError):
            _ = here.hand.status
        with pytest.raises(InvalidStateError):
            await here.hand.start(wait=3600)
        with pytest.raises(InvalidStateError):
            await RobotiqHand(here.server.address).start(wait=3600)
        assert here.hand.state is State.DISCONNECTED
        assert not starting.done()
        await here.hand.stop()
        with pytest.raises(NotStartedError):
            await starting


async def test_statuses_and_transitions_may_be_waited_for_meanwhile() -> None:
    async with world() as here:
        absent = await here.server.fault_injector.begin(Trouble("refuse"))
        starting = asyncio.create_task(here.hand.start(activate=False, wait=3600))
        first = asyncio.create_task(anext(here.hand.statuses()))
        await asyncio.sleep(5)
        assert not first.done()
        await here.server.fault_injector.end(absent)
        assert (await first).is_reset
        await starting


@pytest.mark.parametrize("reconnect", [True, False, ReconnectPolicy(max_delay=0.2, give_up_after=0.5)])
async def test_wait_counts_for_the_start_and_not_for_a_link_loss_later(
    reconnect: bool | ReconnectPolicy,
) -> None:
    async with world(reconnect=reconnect) as here:
        absent = await here.server.fault_injector.begin(Trouble("refuse"))
        starting = asyncio.create_task(here.hand.start(activate=False, wait=20.0))
        await asyncio.sleep(10)
        await here.server.fault_injector.end(absent)
        await starting


async def test_the_reason_of_the_wait_is_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING, "robotiq_async")
    async with world() as here, here.server.fault_injector.making(Trouble("refuse")):
        with pytest.raises(ConnectFailedError):
            await here.hand.start(wait=20.0)
    logged = [each.getMessage() for each in caplog.records if "no gripper yet" in each.getMessage()]
    assert len(logged) == 1
    assert "20 s" in logged[0]
