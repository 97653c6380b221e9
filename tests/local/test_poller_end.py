"""The end of the task that owns the link: the fingers are stopped, in time, whatever happens."""

from __future__ import annotations

import asyncio
import logging

import pytest

from robotiq_async.control.pending import changes
from robotiq_async.hands.options import ReconnectPolicy
from robotiq_async.local.ending import STOP_S
from robotiq_async.values.enums import Finger, State
from robotiq_async.values.errors import NotStartedError
from tests.fake_transport import LOST
from tests.local.polled import Polled, polled

pytestmark = pytest.mark.virtual_time


async def moves(here: Polled, position: int = 200, speed: int = 0, polls: int = 20) -> None:
    """Send the fingers off."""
    here.controller.command(changes(Finger.ABC, position, speed))
    await here.polls(polls)


async def test_a_stronger_stop_while_the_link_closes_opens_it_again(here: Polled) -> None:
    await moves(here)
    here.wire.closing_s = 0.3
    here.run.request_stop(halt=False)
    await asyncio.sleep(0.1)
    assert here.wire.calls[-1] == "close"
    assert here.wire.gripper.is_moving
    here.run.request_stop(halt=True)
    await here.end()
    assert not here.wire.gripper.is_moving
    assert here.wire.calls.count("open") == 2


async def test_a_stronger_stop_ends_one_that_keeps_a_grip(here: Polled) -> None:
    await moves(here, 50, 255, polls=300)
    here.run.request_stop(halt=True, keep_grip=True)
    await here.polls(2)
    here.run.request_stop(halt=True)
    await here.end()
    assert not here.requests[-1].request.go


async def test_a_final_hold_is_written_before_anything_is_read(here: Polled) -> None:
    """A gripper that hears and is not heard holds, too."""
    await moves(here)

    def stop() -> None:
        here.wire.silent.add("read")
        here.run.request_stop(halt=True, keep_grip=True)

    here.at_next_status = stop
    await here.end()
    assert here.requests[-1].request.go
    assert not here.wire.gripper.is_moving
    assert here.wire.gripper.position(Finger.A) < 30


async def test_a_link_that_is_lost_at_the_end_lets_a_grip_go(here: Polled) -> None:
    await moves(here, 50, 255, polls=300)

    def stop() -> None:
        here.wire.failing["read"] = LOST
        here.run.request_stop(halt=True, keep_grip=True)
        asyncio.get_running_loop().call_later(0.1, here.wire.failing.clear)

    here.at_next_status = stop
    await here.end()
    assert not here.requests[-1].request.go


async def test_a_link_that_is_lost_before_the_stop_leaves_lets_a_grip_go(here: Polled) -> None:
    """The outcome is that of a loss in mid-exchange: it does not depend on the moment."""
    await moves(here, 50, 255, polls=300)

    def stop() -> None:
        here.wire.is_open = False
        here.run.request_stop(halt=True, keep_grip=True)

    here.at_next_status = stop
    await here.end()
    assert not here.requests[-1].request.go


async def test_a_stop_that_was_not_heard_is_sent_again(here: Polled) -> None:
    """Unlike a motion: a gripper that lost its client keeps moving."""
    await moves(here)
    here.wire.failing["write"] = LOST
    here.run.request_stop(halt=True)
    await asyncio.sleep(0.3)
    assert here.wire.gripper.is_moving
    here.wire.failing.clear()
    await here.end()
    assert not here.wire.gripper.is_moving


async def test_a_link_that_is_down_is_tried_once_more_at_the_end() -> None:
    async with polled(ReconnectPolicy(first_delay=5.0, max_delay=5.0)) as here:
        await moves(here)
        here.wire.failing["read"] = LOST
        await asyncio.sleep(0.1)
        here.wire.failing.clear()
        assert here.machine.state is State.DISCONNECTED
        here.run.request_stop(halt=True)
        await here.end()
        assert not here.wire.gripper.is_moving


@pytest.mark.parametrize("silent", ["read", "write", "open"])
async def test_the_end_comes_in_time_without_any_answer(
    here: Polled, silent: str, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING, "robotiq_async")
    await moves(here)
    here.wire.silent.add(silent)
    if silent == "open":
        here.wire.failing["read"] = LOST
        await asyncio.sleep(0.02)
    began = here.loop.time()
    here.run.request_stop(halt=True)
    await here.end()
    assert here.loop.time() - began == pytest.approx(STOP_S, abs=0.3)
    assert "did not confirm in time that the fingers were stopped" in caplog.text


@pytest.mark.parametrize("when", ["open", "read"])
async def test_a_stop_while_it_connects_ends_that_at_once(when: str) -> None:
    here = Polled(ReconnectPolicy())
    here.wire.silent.add(when)
    here.start()
    await asyncio.sleep(0.1)
    began = here.loop.time()
    here.run.request_stop(halt=True)
    with pytest.raises(NotStartedError, match="stopped while it connected"):
        await here.run.connected
    await here.end()
    assert here.loop.time() - began < 0.01


async def test_a_stop_between_two_tries_does_not_wait_for_the_next() -> None:
    async with polled(ReconnectPolicy(first_delay=10.0, max_delay=10.0)) as here:
        here.wire.failing["read"] = LOST
        await asyncio.sleep(0.1)
        here.run.request_stop(halt=False)
        await here.end()
        assert here.wire.calls.count("open") == 1


async def test_a_bug_does_not_keep_the_fingers_from_being_stopped() -> None:
    here = Polled(ReconnectPolicy())
    await here.wire.activate()
    here.start()
    await here.run.connected
    await moves(here)

    def bug() -> None:
        raise ZeroDivisionError

    here.at_next_status = bug
    await asyncio.wait({here.task})
    assert isinstance(here.task.exception(), ZeroDivisionError)
    assert here.machine.state is State.DO_SHUTDOWN
    assert not here.wire.gripper.is_moving
    assert not here.wire.is_open
