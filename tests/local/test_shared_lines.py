"""Several grippers on one serial line, each with a hand of its own, in virtual time."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager

import pytest

from robotiq_async import (
    ConnectFailedError,
    Finger,
    InvalidStateError,
    NotStartedError,
    RobotiqConnectionError,
    RobotiqHand,
    State,
)
from robotiq_async.link.line import HUSH_S
from robotiq_async.link.serial.patience import QUESTION_S
from robotiq_async.simulator import SimulatedGripper, Trouble
from robotiq_async.values.model import THREE_FINGER, TWO_FINGER_85, Model
from tests.grippers import activate_beforehand
from tests.shared_line import Bus, Kind, serial_bus, socket_bus
from tests.virtual import until

pytestmark = pytest.mark.virtual_time

A = Finger.A
LEFT, RIGHT = 9, 12
OTHERS = (LEFT, 14)


@asynccontextmanager
async def pair(kind: Kind, patch: pytest.MonkeyPatch, left: Model, right: Model) -> AsyncIterator[Bus]:
    """A line with two grippers that are active."""
    clock = asyncio.get_running_loop().time
    grippers = {unit: SimulatedGripper(clock, model=model) for unit, model in ((LEFT, left), (RIGHT, right))}
    for gripper in grippers.values():
        await activate_beforehand(gripper)
    async with kind(patch, grippers) as bus:
        yield bus


@pytest.fixture(params=[serial_bus, socket_bus], ids=["rtu", "rtu+tcp"])
async def bus(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Bus]:
    async with pair(request.param, monkeypatch, TWO_FINGER_85, TWO_FINGER_85) as bus:
        yield bus


async def longest_gap(hand: RobotiqHand, seconds: float) -> float:
    """The longest time between two statuses."""
    now = asyncio.get_running_loop().time
    last, until_then, longest = now(), now() + seconds, 0.0
    async for _ in hand.statuses():
        longest, last = max(longest, now() - last), now()
        if last >= until_then:
            break
    return longest


async def positions(hand: RobotiqHand, ended: asyncio.Event) -> set[int]:
    """The positions in statuses until something has ended."""
    seen = set()
    async for status in hand.statuses():
        seen.add(status.position(A))
        if ended.is_set():
            break
    return seen


async def test_each_moves_its_own_gripper(bus: Bus) -> None:
    async with bus.hand(LEFT) as left, bus.hand(RIGHT) as right:
        ends = await asyncio.gather(left.move(200, speed=255), right.move(50, speed=255))
        assert [end.positions[A] for end in ends] == pytest.approx([200, 50], abs=3)
        assert [bus.gripper(unit).target(A) for unit in (LEFT, RIGHT)] == [200, 50]
        assert left.statistics.reconnects == right.statistics.reconnects == 0


async def test_turns_are_fair(bus: Bus) -> None:
    async with bus.hand(LEFT) as left, bus.hand(RIGHT) as right:
        before = left.statistics.polls, right.statistics.polls
        await asyncio.sleep(0.8)
        polls = left.statistics.polls - before[0], right.statistics.polls - before[1]
        assert min(polls) > 0.95 * max(polls)
        assert min(polls) > 0.8 * 140
        # A stream of one takes turns from the other, and not all.
        for step in range(40):
            left.command(position=step)
            await asyncio.sleep(0.01)
        assert await longest_gap(right, 0.5) < 0.02


async def test_a_silent_gripper_costs_the_other_a_twentieth_of_its_polls(bus: Bus) -> None:
    async with bus.hand(LEFT) as left, bus.hand(RIGHT) as right:
        async with bus.servers[LEFT].fault_injector.making(Trouble("silence")):
            assert await longest_gap(right, 1.0) < 0.1
            assert left.state is State.DISCONNECTED
            before = right.statistics.polls
            assert await longest_gap(right, 8.0) < 0.1
            assert right.statistics.polls - before > 0.95 * 8 * 200
        assert right.statistics.reconnects == 0
        await left.wait_for_state(State.RUNNING_IDLE, timeout=2)
        await left.move(70)


async def test_a_late_answer_now_and_then_costs_no_link(bus: Bus) -> None:
    """It met the next question, and each second one ended the link: moves failed that a sole user makes."""
    async with bus.hand(LEFT) as left, bus.hand(RIGHT):
        late = Trouble("late", 0.1, every=0.7)
        async with bus.servers[LEFT].fault_injector.making(late):
            for position in (255, 0, 255):
                await left.move(position, speed=255)
                await asyncio.sleep(1.0)
        assert left.statistics.reconnects == 0


async def test_a_stop_that_is_acknowledged_late_is_acknowledged(bus: Bus) -> None:
    """halt() raised after 63 ms, and the link was lost, although the gripper had stopped."""
    async with bus.hand(LEFT) as left, bus.hand(RIGHT):
        left.command(position=255, speed=0)
        await until(lambda: bus.gripper(LEFT).is_moving)
        await bus.servers[LEFT].fault_injector.begin(Trouble("late", 0.2, on="write"))
        await left.halt()
        assert left.statistics.reconnects == 0


async def test_a_late_answer_to_what_no_status_shows_costs_no_link(bus: Bus) -> None:
    """Speed has no echo: the status that was read after 60 ms could not tell that the command had arrived."""
    async with bus.hand(LEFT) as left, bus.hand(RIGHT):
        left.command(position=255, speed=0)
        await until(lambda: bus.gripper(LEFT).is_moving)
        await bus.servers[LEFT].fault_injector.begin(Trouble("late", 0.1, on="write"))
        await left.move(255, speed=255)
        assert left.statistics.reconnects == 0


async def test_a_gripper_that_falls_silent_on_its_own_stop_keeps_the_line_once(bus: Bus) -> None:
    loop = asyncio.get_running_loop()
    async with bus.hand(LEFT) as left, bus.hand(RIGHT) as right:
        for hand in (left, right):
            hand.command(position=255, speed=0)
        await until(lambda: bus.gripper(RIGHT).is_moving)
        async with bus.servers[LEFT].fault_injector.making(Trouble("silence")):
            began, stopping = loop.time(), asyncio.create_task(left.halt())
            await right.halt()
            assert 0.25 < loop.time() - began < 0.25 + 0.15, "for its response timeout"
            with pytest.raises(RobotiqConnectionError):
                await stopping
            right.command(position=0, speed=0)
            await until(lambda: bus.gripper(RIGHT).is_moving)
            began = loop.time()
            await right.halt()
            assert loop.time() - began < 0.15


@pytest.mark.parametrize("count", [1, 2])
async def test_what_silent_grippers_delay_a_write_and_a_stop_by(
    count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They fall silent together, at any time before the call. One bound holds for both, acknowledged."""
    loop, clock = asyncio.get_running_loop(), asyncio.get_running_loop().time
    units = (RIGHT, *OTHERS[:count])
    grippers = {unit: SimulatedGripper(clock, model=TWO_FINGER_85) for unit in units}
    for gripper in grippers.values():
        await activate_beforehand(gripper)
    async with serial_bus(monkeypatch, grippers) as bus, AsyncExitStack() as stack:
        right, *others = [await stack.enter_async_context(bus.hand(unit)) for unit in units]
        stops, writes = [], []
        for turn in range(20):
            right.command(position=255 if right.status.position(A) < 128 else 0, speed=0)
            await until(lambda: grippers[RIGHT].is_moving)
            async with AsyncExitStack() as silence:
                for unit in OTHERS[:count]:
                    trouble = bus.servers[unit].fault_injector.making(Trouble("silence"))
                    await silence.enter_async_context(trouble)
                await asyncio.sleep(0.0037 * turn)
                began = loop.time()
                if turn % 4 < 2:
                    await right.halt()
                    stops.append(loop.time() - began)
                else:
                    await right.set_position(128)
                    writes.append(loop.time() - began)
            for other in others:
                await other.wait_for_state(State.RUNNING_IDLE, timeout=3)
        bound = 0.15 * count
        assert 0.4 * bound < max(stops) < bound
        assert 0.4 * bound < max(writes) < bound


async def test_statuses_of_a_silent_gripper_that_come_late_reach_nobody(bus: Bus) -> None:
    """Replies 0.3 s late, after the response timeout, in the turns of the other gripper."""
    async with bus.hand(LEFT) as left, bus.hand(RIGHT) as right:
        await asyncio.gather(left.move(220, speed=255), right.move(30, speed=255))
        ended = asyncio.Event()
        watching = [asyncio.create_task(positions(hand, ended)) for hand in (left, right)]
        async with bus.servers[LEFT].fault_injector.making(Trouble("delay", 0.3)):
            await asyncio.sleep(3)
        await left.wait_for_state(State.RUNNING_IDLE, timeout=3)
        ended.set()
        for seen, there in zip(await asyncio.gather(*watching), (220, 30), strict=True):
            assert seen
            assert all(abs(position - there) <= 3 for position in seen)


@pytest.mark.parametrize(
    ("trouble", "longest", "phase"),
    [
        *((Trouble("delay", 0.2), QUESTION_S + HUSH_S, phase) for phase in (0, 6)),
        *((Trouble("silence"), QUESTION_S + HUSH_S, phase) for phase in (3, 9)),
    ],
    ids=str,
)
async def test_a_stop_waits_for_one_turn_of_the_other_and_not_for_two(
    bus: Bus, trouble: Trouble, longest: float, phase: int
) -> None:
    """It may come while the line is the other's and a poll waits for its turn: it takes that turn."""
    loop = asyncio.get_running_loop()
    async with bus.hand(LEFT), bus.hand(RIGHT) as right:
        right.command(position=255, speed=0)
        await until(lambda: bus.gripper(RIGHT).is_moving)
        async with bus.servers[LEFT].fault_injector.making(trouble):
            await asyncio.sleep(1 + longest * phase / 10)
            began = loop.time()
            halting = asyncio.create_task(right.halt())
            await until(lambda: not bus.gripper(RIGHT).is_moving)
            assert loop.time() - began < longest + 0.03
            await halting
        assert right.statistics.reconnects == 0


async def test_a_command_waits_for_a_new_status_where_a_stop_does_not(bus: Bus) -> None:
    async with (
        bus.hand(LEFT),
        bus.hand(RIGHT) as right,
        bus.servers[LEFT].fault_injector.making(Trouble("delay", 0.2)),
    ):
        await asyncio.sleep(1.1)
        before = right.status
        right.command(position=200)
        await until(lambda: bus.gripper(RIGHT).target(A) == 200)
        assert right.status.timestamp > before.timestamp


async def test_a_stop_arrives_although_the_other_is_silent(bus: Bus) -> None:
    loop = asyncio.get_running_loop()
    async with bus.hand(LEFT), bus.hand(RIGHT) as right:
        right.command(position=255)
        await until(lambda: right.status.position(A) > 20)
        async with bus.servers[LEFT].fault_injector.making(Trouble("silence")):
            await asyncio.sleep(0.3)
            began = loop.time()
            await right.stop()
            assert loop.time() - began < 2.0
        assert not bus.gripper(RIGHT).is_moving
        assert bus.gripper(RIGHT).position(A) < 200


async def test_the_one_that_stays_keeps_the_line_and_the_last_one_closes_it(bus: Bus) -> None:
    async with bus.hand(RIGHT) as right:
        async with bus.hand(LEFT) as left:
            await left.move(90, speed=255)
        assert await longest_gap(right, 0.5) < 0.02
        await right.move(80, speed=255)
        async with bus.hand(LEFT) as again:
            await again.move(40, speed=255)
        assert right.statistics.reconnects == 0
    async with bus.hand(None, device_id=LEFT) as alone:
        await alone.move(10, speed=255)


async def test_an_end_of_the_connection_is_the_end_for_both(
    bus: Bus, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING, logger="robotiq_async")
    async with bus.hand(LEFT) as left, bus.hand(RIGHT) as right:
        bus.pull()
        for hand in (left, right):
            await hand.wait_for_state(State.DISCONNECTED, timeout=1)
        await asyncio.sleep(0.5)
        await bus.plug()
        for hand in (left, right):
            await hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
            assert hand.statistics.reconnects == 1
        await asyncio.gather(left.move(100), right.move(100))
    reasons = {message.partition("link lost: ")[2] for message in caplog.messages} - {""}
    assert len(reasons) == 1, "both say what has happened"


async def test_the_log_tells_each_hand_what_becomes_of_its_line(
    bus: Bus, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG, logger="robotiq_async")
    async with bus.hand(LEFT, name="left"), bus.hand(RIGHT, name="right") as right:
        caplog.clear()
        bus.pull()
        await right.wait_for_state(State.DISCONNECTED, timeout=1)
    said = [each.getMessage() for each in caplog.records if "line: IN_STEP -> CLOSED" in each.getMessage()]
    assert [each.partition(": ")[0] for each in said] == ["left", "right"]


async def test_a_cancelled_start_leaves_the_other_alone(bus: Bus) -> None:
    async with bus.hand(RIGHT) as right:
        nobody = bus.hand(33)
        starting = asyncio.create_task(nobody.start(wait=5))
        await asyncio.sleep(0.1)
        starting.cancel()
        with pytest.raises(asyncio.CancelledError):
            await starting
        assert await longest_gap(right, 1.0) < 0.05
        assert right.statistics.reconnects == 0
        with pytest.raises(NotStartedError):
            nobody.status  # noqa: B018


async def test_a_unit_that_is_not_there(bus: Bus) -> None:
    async with bus.hand(RIGHT) as right:
        with pytest.raises(ConnectFailedError, match="no device answers"):
            await bus.hand(33).start()
        assert right.statistics.reconnects == 0


async def test_the_units_of_a_line_are_claimed(bus: Bus) -> None:
    async with bus.hand(LEFT):
        for unit in (LEFT, None):
            with pytest.raises(InvalidStateError, match="give each of the hands its device_id"):
                await bus.hand(unit).start()


@pytest.mark.parametrize("kind", [serial_bus, socket_bus])
async def test_different_models_on_a_line(kind: Kind, monkeypatch: pytest.MonkeyPatch) -> None:
    async with (
        pair(kind, monkeypatch, THREE_FINGER, TWO_FINGER_85) as bus,
        bus.hand(LEFT, model=THREE_FINGER) as left,
        bus.hand(RIGHT) as right,
    ):
        ends = await asyncio.gather(left.move(120, speed=255), right.move(50, speed=255))
        assert [end.positions[A] for end in ends] == pytest.approx([120, 50], abs=3)


async def test_a_line_that_nobody_uses_takes_another_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    async with pair(serial_bus, monkeypatch, TWO_FINGER_85, TWO_FINGER_85) as bus:
        kept = bus.hand(LEFT)
        async with kept:
            pass
        async with bus.hand(RIGHT, f"{bus.address}?baud=57600") as right:
            await right.move(40)
            with pytest.raises(ConnectFailedError, match=r"the port is in use as .*baud=57600"):
                await kept.start()
        async with kept:
            await kept.move(60)


async def test_a_line_has_one_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    async with (
        pair(serial_bus, monkeypatch, TWO_FINGER_85, TWO_FINGER_85) as bus,
        bus.hand(LEFT) as left,
    ):
        for is_there in (True, False):  # a hand that looks for its gripper keeps the line at its rate
            if not is_there:
                bus.pull()
                await left.wait_for_state(State.DISCONNECTED)
            with pytest.raises(ConnectFailedError, match="the port is in use as rtu:///dev/ttyNEAR"):
                await bus.hand(RIGHT, f"{bus.address}?baud=57600").start()
