"""Waits of callers beside the task that polls, and their end when it is in vain."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable

import pytest

from robotiq_async.control.pending import changes
from robotiq_async.hands.options import ReconnectPolicy
from robotiq_async.local.session import Session
from robotiq_async.values.enums import Fault, Finger, State
from robotiq_async.values.errors import (
    ConnectionLostError,
    GripperFaultError,
    NotActivatedError,
    NotStartedError,
    StateTimeoutError,
)
from tests.fake_transport import LOST, Wire
from tests.local.sessions import running

pytestmark = pytest.mark.virtual_time

# -- an acknowledgement ------------------------------------------------------------------------------------


def asking(session: Session) -> Awaitable[None]:
    return session.answered(lambda waiter: session.controller.command(changes(Finger.A, 100), waiter))


async def test_a_request_ends_with_the_acknowledgement_or_is_refused_at_once() -> None:
    async with running() as (here, session):
        await asking(session)
        assert here.wire.calls.count("write") == 1
    async with running(active=False) as (here, session):
        with pytest.raises(NotActivatedError):
            await asking(session)
        assert "write" not in here.wire.calls


async def test_a_request_fails_if_the_link_goes_down_before_the_acknowledgement() -> None:
    async with running(policy=ReconnectPolicy()) as (here, session):
        here.wire.failing["write"] = LOST
        with pytest.raises(ConnectionLostError, match="before this was done: unplugged") as caught:
            await asking(session)
        assert caught.value.__cause__ is LOST
        here.wire.failing.clear()


# -- a state -----------------------------------------------------------------------------------------------


async def test_a_state_that_is_not_reached_in_time_is_said_with_the_one_that_is(session: Session) -> None:
    with pytest.raises(StateTimeoutError, match=r"no fault came within 0\.5 s \(now RUNNING_IDLE\)"):
        await session.reach({State.FAULT}, 0.5, what="no fault came")


async def test_a_state_of_the_request_itself_is_returned_though_another_follows_at_once(
    session: Session,
) -> None:
    def ask() -> None:
        session.controller.command(changes(Finger.A, 100))
        session.controller.reset()

    reached = await session.reach({State.RUNNING_CC}, 1.0, what="", ask=ask)
    assert (reached, session.machine.state) == (State.RUNNING_CC, State.DO_RESET)


async def test_a_state_that_means_it_will_not_come_is_an_error(session: Session, wire: Wire) -> None:
    reaching = asyncio.create_task(
        session.reach(
            {State.ATR_DONE}, 9.0, what="", failing={State.FAULT: lambda: GripperFaultError(Fault(0x0E))}
        )
    )
    await asyncio.sleep(0.1)
    wire.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    with pytest.raises(GripperFaultError):
        await reaching


async def test_a_refused_request_leaves_no_waiter(session: Session) -> None:
    with pytest.raises(NotActivatedError):
        await session.reach({State.WF_ATR}, 1.0, what="", ask=refuse)
    assert not session._waiters._waiters


async def test_a_cancellation_leaves_no_waiter(session: Session) -> None:
    reaching = asyncio.create_task(session.reach({State.ATR_DONE}, 9.0, what=""))
    activating = asyncio.create_task(session.activated(session.controller.activate))
    await asyncio.sleep(0.1)
    assert session._waiters._waiters
    for task in (reaching, activating):
        task.cancel()
    await asyncio.gather(reaching, activating, return_exceptions=True)
    assert not session._waiters._waiters


def refuse() -> None:
    raise NotActivatedError("no")


# -- an activation -----------------------------------------------------------------------------------------


async def test_an_activation_is_waited_for_and_nothing_where_none_is_under_way() -> None:
    async with running(active=False) as (here, session):
        await session.activated()
        assert here.machine.state is State.RESET
        await session.activated(session.controller.activate)
        assert here.machine.state is State.RUNNING_IDLE


async def test_an_activation_of_others_that_ends_in_a_fault_is_over_too() -> None:
    """The hand is left there, so that it can be recovered."""
    async with running(active=False) as (here, session):
        here.wire.gripper.fail_activation = True
        here.wire.gripper.write(0, [0x0100])
        await asyncio.sleep(0.1)
        assert here.machine.state is State.WF_ACTIVATION
        await session.activated()
        assert here.machine.state is State.FAULT


@pytest.mark.parametrize("how", ["reset", "power", "link"])
async def test_an_activation_that_comes_to_nothing_says_why(how: str) -> None:
    async with running(active=False, policy=ReconnectPolicy()) as (here, session):
        activating = asyncio.create_task(session.activated(session.controller.activate))
        await asyncio.sleep(1)
        match how:
            case "reset":
                session.controller.reset()
            case "power":
                here.wire.gripper.power_cycle()
            case "link":
                here.wire.failing["read"] = LOST
        error = ConnectionLostError if how == "link" else NotActivatedError
        words = {"reset": "took over", "power": "was reset during the activation", "link": "link is down"}
        with pytest.raises(error, match=words[how]):
            await activating
        here.wire.failing.clear()


# -- the next status ---------------------------------------------------------------------------------------


async def test_the_next_status_is_one_that_was_not_there_before(session: Session) -> None:
    before = session.controller.status
    await session.next_status()
    assert session.controller.status is not before
    waiting = asyncio.create_task(session.next_status())
    await asyncio.sleep(0)
    await session.stop(halt=False)
    with pytest.raises(NotStartedError):
        await waiting


async def test_a_wait_for_the_next_status_fails_with_the_link() -> None:
    """A stream of statuses waits out a lost link; who wants to know what the gripper does now does not."""
    async with running(policy=ReconnectPolicy()) as (here, session):
        here.wire.failing["read"] = here.wire.failing["open"] = LOST
        with pytest.raises(ConnectionLostError, match="the link is down"):
            await session.next_status()
        here.wire.failing.clear()


# -- what is reported of it --------------------------------------------------------------------------------


async def test_changes_of_state_are_published_and_faults_are_counted(session: Session, wire: Wire) -> None:
    stream = session._channels.transitions.open(None)
    for _ in range(2):
        wire.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.1)
        await asyncio.sleep(0.3)
    assert [each.target for each in stream.drain()] == [State.FAULT, State.RUNNING_IDLE] * 2
    assert session.counters.faults == 2
