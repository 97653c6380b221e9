"""A hand that was given a name: errors, the log, its repr and figures have the name."""

from __future__ import annotations

import asyncio
import copy
import logging
import pickle
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest

from robotiq_async import (
    ConnectFailedError,
    ConnectionLostError,
    Finger,
    GripperFaultError,
    InvalidStateError,
    MoveSupersededError,
    MoveTimeoutError,
    NotActivatedError,
    NotStartedError,
    RobotiqConnectionError,
    RobotiqError,
    RobotiqHand,
    State,
    StateTimeoutError,
    sync,
)
from robotiq_async.hands.options import LONGEST_NAME
from robotiq_async.simulator import SimulatedGripper, SimulatorServer, Trouble
from robotiq_async.values.request import AxisRequest, Request
from tests.calls import COMMANDS, called
from tests.conftest import Clock, started

pytestmark = pytest.mark.virtual_time

NAME = "left 100% %s"
"""Nothing in a name is for the log to work out."""


@pytest.fixture
async def named(server: SimulatorServer, clock: Clock) -> AsyncIterator[RobotiqHand]:
    hand = RobotiqHand(server.address, name=NAME)
    await started(hand, clock)
    yield hand
    await hand.stop()


# -- what it is not ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [RobotiqHand, sync.RobotiqHand], ids=["async", "blocking"])
@pytest.mark.parametrize("how", [pickle.dumps, copy.copy, copy.deepcopy])
def test_a_hand_is_neither_pickled_nor_copied(kind: type[object], how: Callable[[object], object]) -> None:
    with pytest.raises(TypeError, match=r"RobotiqHand cannot be pickled or copied: it owns the connection"):
        how(kind())


# -- what it is called -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["left", "linke Hand, Zelle 3", "x" * LONGEST_NAME, "左"])
def test_a_name_is_kept_and_shown(name: str) -> None:
    hand = RobotiqHand("tcp://192.168.1.11", name=name)
    assert (hand.name, hand.address) == (name, "tcp://192.168.1.11:502")
    assert repr(hand) == f"<RobotiqHand {name} tcp://192.168.1.11:502 DISCONNECTED>"


def test_without_a_name_it_is_called_by_its_address() -> None:
    hand = RobotiqHand("192.168.1.11")
    assert hand.name == hand.address == "tcp://192.168.1.11:502"
    assert repr(hand) == "<RobotiqHand tcp://192.168.1.11:502 DISCONNECTED>"


@pytest.mark.parametrize(
    "name", ["", " ", " left", "left\n", "le\tft", "\x1b[2J", "a\u202eb", "x" * 65, "\ud800"]
)
def test_a_malformed_name_is_a_value_error(name: str) -> None:
    with pytest.raises(
        ValueError, match=r"name must be None or a text of 1\.\.64 printable characters"
    ) as caught:
        RobotiqHand(name=name)
    assert repr(name)[:60] in str(caught.value)


@pytest.mark.parametrize("name", [7, b"left", Finger.A, ["left"]])
def test_a_name_that_is_not_text_is_a_type_error(name: Any) -> None:
    with pytest.raises(TypeError, match="name must be None or a text"):
        RobotiqHand(name=name)


# -- errors ------------------------------------------------------------------------------------------------


PROPERTIES = ("is_activated", "is_moving", "is_reset", "status")


async def error_of(hand: RobotiqHand, name: str) -> RobotiqError:
    with pytest.raises(RobotiqError) as caught:
        await called(hand, name)
    return caught.value


def assert_tells(error: BaseException | None, name: str = NAME) -> None:
    assert isinstance(error, RobotiqError)
    assert error.hand == name
    advice = f": {error.advice}" if error.advice else ""
    assert str(error) == f"{name}: {error.message}{advice}"
    assert name not in error.message
    assert repr(str(error)) in repr(error)


@pytest.mark.parametrize("name", [*COMMANDS, *PROPERTIES, "wait_for_state"])
async def test_a_refusal_tells_the_name_when_there_is_one(name: str) -> None:
    assert_tells(await error_of(RobotiqHand(name=NAME), name))
    error = await error_of(RobotiqHand(), name)
    assert error.hand == ""
    assert str(error).startswith(error.message)
    assert error.message == error.args[0]


async def test_a_start_that_fails_tells_the_name(server: SimulatorServer, named: RobotiqHand) -> None:
    for each in (named, RobotiqHand(server.address, name=NAME)):
        error = await error_of(each, "start")
        assert isinstance(error, InvalidStateError)
        assert_tells(error)
    server.refuse()
    await named.stop()
    error = await error_of(named, "start")
    assert isinstance(error, ConnectFailedError)
    assert_tells(error)
    assert server.address in str(error)


async def waiting(hand: RobotiqHand, **options: Any) -> asyncio.Task[Any]:
    moving = asyncio.create_task(hand.move(255, speed=0, **options))
    async for _ in hand.statuses():
        if hand.status.is_moving:
            break
    return moving


async def failed(task: asyncio.Task[Any], kind: type[RobotiqError]) -> RobotiqError:
    await asyncio.wait({task})
    error = task.exception()
    assert type(error) is kind
    return error


async def test_errors_of_waiting_calls_carry_the_name(
    named: RobotiqHand, gripper: SimulatedGripper, server: SimulatorServer
) -> None:
    assert_tells(await failed(await waiting(named, timeout=0.01), MoveTimeoutError))
    two = [await waiting(named), asyncio.create_task(named.reset())]
    assert_tells(await failed(two[0], MoveSupersededError))
    await two[1]
    assert_tells(await error_of(named, "move"))
    await named.activate()
    with pytest.raises(StateTimeoutError, match=NAME):
        await named.wait_for_state(State.FAULT, timeout=0.01)
    moving = await waiting(named)
    gripper.inject_fault(0x09)
    assert_tells(await failed(moving, GripperFaultError))
    gripper.clear_faults()
    await named.wait_for_state(State.RUNNING_IDLE)
    one, other = await waiting(named), asyncio.create_task(named.wait_for_state(State.FAULT))
    server.cut()
    lost = await failed(one, ConnectionLostError)
    assert_tells(lost)
    await named.wait_for_state(State.RUNNING_IDLE)
    await named.stop()
    assert_tells(await failed(other, NotStartedError))
    # An error that is raised again, copied or sent to another process has it still, and once.
    for again in (copy.copy(lost), pickle.loads(pickle.dumps(lost))):
        assert_tells(again)


@pytest.mark.parametrize("ends", ["lost link", "stop"])
@pytest.mark.parametrize("call", ["set_speed", "hold", "halt", "reset", "activate", "atr", "recover"])
async def test_errors_of_calls_that_wait_for_an_answer_carry_the_name(
    call: str, ends: str, named: RobotiqHand, gripper: SimulatedGripper, server: SimulatorServer
) -> None:
    if call in ("atr", "recover"):
        gripper.inject_fault(0x0E)
        await named.wait_for_state(State.FAULT)
    if call == "activate":
        await named.reset()
    asking = asyncio.create_task(called(named, call))
    await asyncio.sleep(0)
    if ends == "stop":
        await named.stop()
        assert_tells(await failed(asking, NotStartedError))
    else:
        async with server.fault_injector.making(Trouble("silence")):
            assert_tells(await failed(asking, ConnectionLostError))
            assert_tells(await error_of(named, "is_moving"))


async def test_a_stream_that_ends_for_good_tells_the_name(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address, name=NAME, reconnect=False)
    await hand.start(activate=False)
    statuses = hand.statuses(1000)
    server.cut()
    with pytest.raises(RobotiqConnectionError) as caught:
        async for _ in statuses:
            pass
    assert_tells(caught.value)
    assert_tells(await error_of(hand, "set_speed"))
    await hand.stop()
    await hand.start(activate=False)
    await anext(hand.statuses())
    await hand.stop()


async def test_a_reset_gripper_refuses_by_name(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address, name=NAME)
    await hand.start(activate=False)
    error = await error_of(hand, "command")
    assert isinstance(error, NotActivatedError)
    assert_tells(error)
    await hand.stop()


# -- the log -----------------------------------------------------------------------------------------------


async def eventful(hand: RobotiqHand, server: SimulatorServer, clock: Clock) -> None:
    """All that is logged: states, a lost link, another client, a listener, an undelivered end."""
    hand.add_listener(lambda item: (_ for _ in ()).throw(ValueError(repr(item))))
    await started(hand, clock)
    image = Request(activate=True, go=True, axes=(AxisRequest(10, 255, 100),) * 4)
    server.gripper.write(0, image.registers)
    async for _ in hand.statuses():
        if hand.statistics.foreign_commands:
            break
    server.cut()
    await hand.wait_for_state(State.DISCONNECTED)
    await hand.wait_for_state(State.RUNNING_IDLE)
    async with server.fault_injector.making(Trouble("silence")):
        await hand.stop()


@pytest.mark.parametrize("name", [NAME, None])
async def test_every_line_of_the_log_tells_the_hand(
    name: str | None, server: SimulatorServer, clock: Clock, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.DEBUG, "robotiq_async"):
        await eventful(RobotiqHand(server.address, name=name), server, clock)
    records = [each for each in caplog.records if each.name == "robotiq_async"]
    words = " ".join(record.getMessage() for record in records)
    for part in ("->", "link lost", "link back", "another client", "a listener raised", "was not delivered"):
        assert part in words
    known = name or server.address
    for record in records:
        assert record.__dict__["hand"] == known
        assert record.getMessage().startswith(f"{known}: ")
        assert not record.getMessage().removeprefix(f"{known}: ").startswith(known)
        assert record.pathname.endswith(".py")
        assert not record.pathname.endswith(("log.py", "logging/__init__.py")), "it tells who logged it"
