"""The end of the task that owns the link: the fingers are stopped, in time, whatever happens."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async.control.requests.pending import Command
from robotiq_async.session.options import ReconnectPolicy
from robotiq_async.session.poller import SHUTDOWN_S
from robotiq_async.values.enums import Finger, State
from robotiq_async.values.errors import NotStartedError
from robotiq_async.values.request import Request
from tests.session.polled import LOST, Polled, polled
from tests.virtual import virtual


@virtual
async def test_the_end_stops_the_fingers_and_sees_it_before_it_disconnects() -> None:
    async with polled() as here:
        here.controller.command(Command(Finger.ABC, 200, 0))
        await here.polls(20)
        assert here.wire.gripper.is_moving
        here.poller.request_stop(halt=True)
        await here.end()
        assert not here.wire.gripper.is_moving
        assert not here.statuses[-1].go_echo
        assert Request.from_registers(here.wire.gripper.request_registers).activate


@virtual
async def test_a_stronger_stop_while_the_link_closes_opens_it_again() -> None:
    async with polled() as here:
        here.controller.command(Command(Finger.ABC, 200, 0))
        await here.polls(20)
        here.wire.closing_s = 0.3
        here.poller.request_stop(halt=False)
        await asyncio.sleep(0.1)
        assert here.wire.calls[-1] == "close"
        assert here.wire.gripper.is_moving
        here.poller.request_stop(halt=True)
        await here.end()
        assert not here.wire.gripper.is_moving
        assert here.wire.calls.count("open") == 2


@virtual
async def test_a_stronger_stop_ends_one_that_keeps_a_grip() -> None:
    async with polled() as here:
        here.controller.command(Command(Finger.ABC, 50, 255))
        await here.polls(300)
        here.poller.request_stop(halt=True, keep_grip=True)
        await here.polls(2)
        here.poller.request_stop(halt=True)
        await here.end()
        assert not here.requests[-1].request.go


@virtual
async def test_what_is_to_be_held_at_the_end_is_told_before_anything_is_read() -> None:
    """A gripper that hears and is not heard holds, too."""
    async with polled() as here:
        here.controller.command(Command(Finger.ABC, 200, 0))
        await here.polls(20)

        def stop() -> None:
            here.wire.silent.add("read")
            here.poller.request_stop(halt=True, keep_grip=True)

        here.at_next_status = stop
        await here.end()
        assert here.requests[-1].request.go
        assert not here.wire.gripper.is_moving
        assert here.wire.gripper.position(Finger.A) < 30


@virtual
async def test_a_link_that_is_lost_at_the_end_lets_a_grip_go() -> None:
    async with polled() as here:
        here.controller.command(Command(Finger.ABC, 50, 255))
        await here.polls(300)

        def stop() -> None:
            here.wire.failing["read"] = LOST
            here.poller.request_stop(halt=True, keep_grip=True)
            asyncio.get_running_loop().call_later(0.1, here.wire.failing.clear)

        here.at_next_status = stop
        await here.end()
        assert not here.requests[-1].request.go


@virtual
async def test_a_stop_that_was_not_heard_is_sent_again() -> None:
    """Unlike a motion: a gripper that lost its client goes on moving."""
    async with polled() as here:
        here.controller.command(Command(Finger.ABC, 200, 0))
        await here.polls(20)
        here.wire.failing["write"] = LOST
        here.poller.request_stop(halt=True)
        await asyncio.sleep(0.3)
        assert here.wire.gripper.is_moving
        here.wire.failing.clear()
        await here.end()
        assert not here.wire.gripper.is_moving


@virtual
async def test_a_link_that_is_down_is_tried_once_more_at_the_end() -> None:
    async with polled(ReconnectPolicy(first_delay=5.0, max_delay=5.0)) as here:
        here.controller.command(Command(Finger.ABC, 200, 0))
        await here.polls(20)
        here.wire.failing["read"] = LOST
        await asyncio.sleep(0.1)
        here.wire.failing.clear()
        assert here.machine.state is State.DISCONNECTED
        here.poller.request_stop(halt=True)
        await here.end()
        assert not here.wire.gripper.is_moving


@virtual
@pytest.mark.parametrize("silent", ["read", "write", "open"])
async def test_the_end_comes_in_time_also_when_nobody_answers(
    silent: str, caplog: pytest.LogCaptureFixture
) -> None:
    async with polled() as here:
        here.controller.command(Command(Finger.ABC, 200, 0))
        await here.polls(20)
        here.wire.silent.add(silent)
        if silent == "open":
            here.wire.failing["read"] = LOST
            await asyncio.sleep(0.02)
        began = here.loop.time()
        here.poller.request_stop(halt=True)
        await here.end()
        assert here.loop.time() - began == pytest.approx(SHUTDOWN_S, abs=0.3)
    assert "did not confirm in time that the fingers were stopped" in caplog.text


@virtual
@pytest.mark.parametrize("when", ["open", "read"])
async def test_a_stop_while_it_connects_ends_that_at_once(when: str) -> None:
    here = Polled(ReconnectPolicy())
    here.wire.silent.add(when)
    here.start()
    await asyncio.sleep(0.1)
    began = here.loop.time()
    here.poller.request_stop(halt=True)
    with pytest.raises(NotStartedError, match="stopped while it connected"):
        await here.poller.connected
    await here.end()
    assert here.loop.time() - began < 0.01


@virtual
async def test_a_stop_between_two_tries_does_not_wait_for_the_next() -> None:
    async with polled(ReconnectPolicy(first_delay=10.0, max_delay=10.0)) as here:
        here.wire.failing["read"] = LOST
        await asyncio.sleep(0.1)
        here.poller.request_stop(halt=False)
        await here.end()
        assert here.wire.calls.count("open") == 1


@virtual
async def test_a_bug_does_not_keep_the_fingers_from_being_stopped() -> None:
    here = Polled(ReconnectPolicy())
    await here.wire.activate()
    here.start()
    await here.poller.connected
    here.controller.command(Command(Finger.ABC, 200, 0))
    await here.polls(20)

    def bug() -> None:
        raise ZeroDivisionError

    here.at_next_status = bug
    await asyncio.wait({here.task})
    assert isinstance(here.task.exception(), ZeroDivisionError)
    assert here.machine.state is State.SHUTDOWN
    assert not here.wire.gripper.is_moving
    assert not here.wire.is_open
