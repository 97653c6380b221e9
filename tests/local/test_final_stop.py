"""stop() is final from its call on, and of several stops the strongest counts."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import itertools
import logging
from collections.abc import Callable, Sequence

import anyio
import pytest

from robotiq_async import Fault, Finger, NotActivatedError, NotStartedError, RobotiqHand, State
from robotiq_async.simulator import SerialSimulatorServer, SimulatedGripper, SimulatorServer
from robotiq_async.values.registers import Registers
from robotiq_async.values.request import AxisRequest, Request
from tests.calls import COMMANDS, called
from tests.fake_transport import Wire
from tests.grippers import activate_beforehand
from tests.virtual import until
from tests.virtual_line import VirtualLine

pytestmark = pytest.mark.virtual_time

A = Finger.A
LATENCY_S = 0.15
"""Of a slow network: at it a stop found the controller 150 ms late."""
MOMENTS_S = (0.0, 0.002, 0.004, 0.006, 0.05, 0.16)
"""In a cycle, at which the stop comes: before, in and after its read."""
TURNS = pytest.mark.parametrize("turn", MOMENTS_S, ids=lambda s: f"{s * 1000:g}ms")


def images_since(gripper: SimulatedGripper, count: int) -> list[Request]:
    return [Request.from_registers(write.registers) for write in gripper.writes[count:]]


def poller_task() -> asyncio.Task[object]:
    (task,) = (task for task in asyncio.all_tasks() if task.get_name() == "robotiq_async poller")
    return task


async def slow(server: SimulatorServer, turn: float) -> None:
    """Answer late from now on, and wait for a moment of a cycle."""
    server.policy = lambda frame: [(LATENCY_S, frame)]
    await asyncio.sleep(4 * LATENCY_S + turn)


@pytest.mark.parametrize(
    ("turn", "request_"),
    [
        *((turn, "command") for turn in MOMENTS_S),
        *zip(itertools.cycle(MOMENTS_S), sorted({*COMMANDS} - {"command"}), strict=False),
    ],
)  # one at every moment, each of the others at one of them
async def test_after_the_call_of_stop_every_request_is_refused(
    hand: RobotiqHand,
    server: SimulatorServer,
    gripper: SimulatedGripper,
    turn: float,
    request_: str,
) -> None:
    """A command was taken, and an image with rGTO went out: 96 counts of motion."""
    await slow(server, turn)
    writes = len(gripper.writes)
    stopping = asyncio.create_task(hand.stop())
    await asyncio.sleep(0)
    with pytest.raises(NotStartedError):
        await called(hand, request_)
    await stopping
    assert not any(image.go or not image.activate for image in images_since(gripper, writes))


@TURNS
@pytest.mark.parametrize("options", [{}, {"halt": False}, {"keep_grip": True}], ids=str)
async def test_a_control_loop_beside_a_stop_is_refused_at_once(
    hand: RobotiqHand,
    server: SimulatorServer,
    gripper: SimulatedGripper,
    turn: float,
    options: dict[str, bool],
) -> None:
    """At 2 ms, its commands were taken for 108 ms."""
    await slow(server, turn)
    taken: list[float] = []
    loop = asyncio.get_running_loop()

    async def control() -> None:
        position = 0
        while True:
            hand.command(A, position=(position := position + 1) % 200)
            taken.append(loop.time())
            await asyncio.sleep(0.002)

    controlling = asyncio.create_task(control())
    await asyncio.sleep(0.02)
    writes = len(gripper.writes)
    stopping, called = asyncio.create_task(hand.stop(**options)), loop.time()
    await asyncio.wait({controlling})
    assert isinstance(controlling.exception(), NotStartedError)
    assert max(taken) <= called
    await stopping
    # One image may have been on its way when the stop was called, and one is the hold of keep_grip.
    going = [image for image in images_since(gripper, writes) if image.go]
    assert len(going) <= 1 + ("keep_grip" in options)


@TURNS
@pytest.mark.parametrize("options", [{}, {"halt": False}, {"keep_grip": True}], ids=str)
async def test_unsent_requests_are_dropped_and_their_callers_get_an_error_at_once(
    hand: RobotiqHand,
    server: SimulatorServer,
    gripper: SimulatedGripper,
    caplog: pytest.LogCaptureFixture,
    turn: float,
    options: dict[str, bool],
) -> None:
    """It went out up to 250 ms after the stop."""
    await slow(server, turn)
    loop, writes = asyncio.get_running_loop(), len(gripper.writes)
    asked = [asyncio.create_task(hand.move(255)), asyncio.create_task(hand.set_force(200))]
    await asyncio.sleep(0)
    hand.command(A, speed=200)
    before = len(images_since(gripper, writes))
    with caplog.at_level(logging.INFO, logger="robotiq_async"):
        stopping, called = asyncio.create_task(hand.stop(**options)), loop.time()
        await asyncio.wait(asked)
    assert loop.time() - called < 0.001
    assert all(isinstance(each.exception(), NotStartedError) for each in asked)
    assert "requests that were not sent are dropped" in caplog.text
    await stopping
    assert before == 0
    assert not any(image.go for image in images_since(gripper, writes))


@TURNS
async def test_a_command_beside_a_stop_that_keeps_a_grip_leaves_the_grip_alone(
    hand: RobotiqHand, server: SimulatorServer, gripper: SimulatedGripper, turn: float
) -> None:
    """It took the grip apart."""
    gripper.place_object(Finger.ABC, 150)
    await hand.close()
    await slow(server, turn)
    writes = len(gripper.writes)
    stopping = asyncio.create_task(hand.stop(keep_grip=True))
    await asyncio.sleep(0)
    with pytest.raises(NotStartedError):
        hand.command(position=0)
    await stopping
    assert not images_since(gripper, writes)
    assert gripper.grips == Finger.ABC


@pytest.mark.parametrize("turn", [0.0, 0.1, 0.16, 0.31])
async def test_a_gripper_is_not_activated_after_the_end_was_asked_for(turn: float) -> None:
    """It was: rACT was raised, and taken back."""
    loop = asyncio.get_running_loop()
    gripper = SimulatedGripper(loop.time, speedup=20)
    async with SimulatorServer(gripper) as server:
        server.policy = lambda frame: [(LATENCY_S, frame)]
        hand = RobotiqHand(server.address)
        starting = asyncio.create_task(hand.start())
        await asyncio.sleep(turn)
        raised = [image for image in images_since(gripper, 0) if image.activate]
        starting.cancel()
        await asyncio.wait({starting})
        assert [image for image in images_since(gripper, 0) if image.activate] == raised == []
        assert hand.state is State.SHUTDOWN


async def test_an_activation_that_was_not_sent_needs_no_taking_back(
    hand: RobotiqHand, server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    await hand.reset()
    await slow(server, 0.0)
    writes = len(gripper.writes)
    activating = asyncio.create_task(hand.activate())
    await asyncio.sleep(0)
    stopping = asyncio.create_task(hand.stop())
    await asyncio.wait({activating})
    assert isinstance(activating.exception(), NotStartedError)
    await stopping
    assert not any(image.activate for image in images_since(gripper, writes))


async def test_the_end_by_an_exception_is_final_too(
    server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    await activate_beforehand(gripper)
    hand = RobotiqHand(server.address)

    async def control() -> None:
        while True:
            hand.command(A, position=200)
            await asyncio.sleep(0)

    async def fail() -> None:
        async with hand:
            server.policy = lambda frame: [(LATENCY_S, frame)]
            await asyncio.sleep(1)
            tasks.append(asyncio.create_task(control()))
            raise ZeroDivisionError

    tasks: list[asyncio.Task[None]] = []
    writes = len(gripper.writes)
    with pytest.raises(ZeroDivisionError):
        await fail()
    (controlling,) = tasks
    assert isinstance(controlling.exception(), NotStartedError)
    assert not any(image.go for image in images_since(gripper, writes))


# -- several stops -----------------------------------------------------------------------------------------

STOPS = {"leave": {"halt": False}, "keep": {"keep_grip": True}, "halt": {}}


@pytest.mark.parametrize(
    ("first", "second", "between"),
    [
        (first, second, between)
        for number, (first, second) in enumerate(itertools.product(STOPS, STOPS))
        for between in ((0.0, 0.003), (0.0005, 0.1))[number % 2]
    ],
)  # each pair of values
async def test_the_strongest_stop_counts_in_any_order(
    hand: RobotiqHand, gripper: SimulatedGripper, first: str, second: str, between: float
) -> None:
    """Beside a gentler one, stop() returned with rGTO set, and the fingers moved on."""
    await hand.set_speed(0)
    await hand.set_position(255)
    await until(lambda: gripper.is_moving)
    stops = [asyncio.create_task(hand.stop(**STOPS[first]))]
    await asyncio.sleep(between)
    was_over = stops[0].done()
    stops.append(asyncio.create_task(hand.stop(**STOPS[second])))
    await asyncio.gather(*stops)
    await asyncio.sleep(0.05)
    strongest = max(first, first if was_over else second, key=list(STOPS).index)
    assert hand.state is State.SHUTDOWN
    assert gripper.is_moving == (strongest == "leave")
    assert Request.from_registers(gripper.request_registers).go == (strongest != "halt")


class Closing(Wire):
    """Calls something some turns of the loop after it was closed."""

    def __init__(self, turns: int, call: Callable[[], object]) -> None:
        super().__init__()
        self._turns, self._call = turns, call

    async def close(self) -> None:
        await super().close()
        self._after(self._turns)

    def _after(self, turns: int) -> None:
        call = functools.partial(self._after, turns - 1) if turns else self._call
        asyncio.get_running_loop().call_soon(call)


@pytest.mark.parametrize("keep_grip", [False, True])
@pytest.mark.parametrize("turns", range(8))
async def test_a_stop_in_the_last_turns_of_a_gentle_one_counts(turns: int, keep_grip: bool) -> None:
    """As long as the hand is not in SHUTDOWN, a stronger stop counts."""
    stops: list[asyncio.Task[None]] = []
    was_over: list[bool] = []

    async def stop() -> None:
        was_over.append(hand.state is State.SHUTDOWN)
        await hand.stop(keep_grip=keep_grip)

    def begin() -> None:
        if not stops:
            stops.append(asyncio.create_task(stop()))

    wire = Closing(turns, begin)
    await activate_beforehand(wire.gripper)
    hand = RobotiqHand(wire)
    await hand.start()
    hand.command(A, position=255, speed=0)
    await until(lambda: wire.gripper.is_moving)
    await hand.stop(halt=False)
    await until(lambda: bool(stops))
    await asyncio.gather(*stops)
    await asyncio.sleep(0.1)
    assert hand.state is State.SHUTDOWN
    assert wire.gripper.is_moving == was_over[0]
    assert not wire.is_open


async def test_a_weaker_stop_hears_that_a_stronger_one_counts(
    hand: RobotiqHand, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, logger="robotiq_async"):
        await asyncio.gather(hand.stop(), hand.stop(keep_grip=True))
    assert "a stronger stop has begun: the fingers are stopped" in caplog.text


@pytest.mark.parametrize("ask", ["halt", "hold"])
async def test_a_halt_or_a_hold_that_was_not_delivered_is_not_lost_with_a_gentle_stop(
    hand: RobotiqHand, gripper: SimulatedGripper, ask: str
) -> None:
    await hand.set_speed(0)
    await hand.set_position(255)
    await until(lambda: gripper.is_moving)
    asking = asyncio.create_task(getattr(hand, ask)())
    await asyncio.sleep(0)
    await hand.stop(halt=False)
    await asyncio.wait({asking})
    assert isinstance(asking.exception(), NotStartedError)
    assert not gripper.is_moving


class Forgetful(Wire):
    """Acknowledges what it forgets."""

    forgets = False

    def take(self, registers: Registers) -> None:
        if not self.forgets:
            super().take(registers)


@pytest.mark.parametrize("ask", ["halt", "reset"])
async def test_a_stop_that_does_not_show_yet_is_not_lost_with_a_gentle_stop(ask: str) -> None:
    """Acknowledged it was, and forgotten: the fingers moved on after halt() and stop()."""
    wire = Forgetful()
    await activate_beforehand(wire.gripper)
    hand = RobotiqHand(wire)
    await hand.start()
    await hand.set_speed(0)
    await hand.set_position(255)
    await until(lambda: wire.gripper.position(A) > 20)
    wire.forgets, written = True, len(wire.written)
    asking = asyncio.create_task(getattr(hand, ask)())
    await until(lambda: len(wire.written) > written)
    await anext(hand.statuses())  # it was acknowledged
    wire.forgets = False
    await hand.stop(halt=False)
    await asyncio.wait({asking})
    assert isinstance(asking.exception(), NotStartedError)
    assert not wire.gripper.is_moving


async def test_a_gentle_stop_during_a_start_stays_gentle(
    server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    """The stop of a start() that fails does not count as a stronger stop."""
    hand = RobotiqHand(server.address)
    starting = asyncio.create_task(hand.start())
    await until(lambda: gripper.is_moving)
    await hand.stop(halt=False)
    await asyncio.wait({starting})
    assert isinstance(starting.exception(), NotStartedError)
    assert gripper.is_moving


async def test_waiting_for_the_end_is_no_request(hand: RobotiqHand) -> None:
    stopping = asyncio.create_task(hand.stop())
    await asyncio.sleep(0)
    assert await hand.wait_for_state(State.SHUTDOWN) is State.SHUTDOWN
    await stopping


# -- what ends a hand halfway: a scope of anyio's, and a loop that is torn down ------------------------------


async def test_leaving_through_a_cancelled_scope_stops_the_fingers(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    """Each await inside such a scope is cancelled, those of stop() too."""
    await hand.stop()
    with anyio.CancelScope() as scope:
        async with RobotiqHand(server.address, speed=0) as other:
            await other.set_position(255)
            scope.cancel()
            await asyncio.sleep(1)
    assert scope.cancelled_caught
    assert not server.gripper.is_moving
    assert all(server.gripper.position(axis) < 200 for axis in (1, 2, 4))


async def test_the_fingers_are_stopped_when_the_loop_is_torn_down(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    await hand.set_position(255)
    poller = poller_task()
    poller.cancel()
    await asyncio.wait({poller})
    assert not server.gripper.is_moving
    assert hand.state is State.SHUTDOWN


# -- what is decided and not on its way ---------------------------------------------------------------------


class WatchedLine(VirtualLine):
    """A serial line that knows when the hand has written what."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        super().__init__(patch)
        self.written: list[tuple[float, Request]] = []

    def carry(self, is_from_near: bool, data: bytes) -> None:
        if is_from_near and data[1] == 16:
            words = [int.from_bytes(data[at : at + 2], "big") for at in range(7, 23, 2)]
            self.written.append((asyncio.get_running_loop().time(), Request.from_registers(words)))
        super().carry(is_from_near, data)


async def test_an_image_that_waits_for_the_silence_of_the_line_is_not_sent_after_a_stop(
    gripper: SimulatedGripper, monkeypatch: pytest.MonkeyPatch
) -> None:
    """1.75 ms lay between the decision and the wire: an image that began a motion left after stop()."""
    line, loop = WatchedLine(monkeypatch), asyncio.get_running_loop()
    await activate_beforehand(gripper)
    async with SerialSimulatorServer(line.FAR, gripper):
        for step in range(40):
            async with RobotiqHand(f"rtu://{line.near}") as hand:
                hand.command(position=200 - 100 * (step % 2), speed=0)
                await asyncio.sleep(step * 0.0005)
                called = loop.time()
            late = [image for when, image in line.written if when > called and image.go]
            assert late == [], f"stopped {step * 0.5:g} ms after the command"


@pytest.mark.parametrize("turns", range(8))
@pytest.mark.parametrize("options", [{}, {"halt": False}, {"keep_grip": True}], ids=str)
async def test_a_transport_object_gets_no_image_decided_before_the_stop(
    turns: int, options: dict[str, bool]
) -> None:
    """Its calls are made in a task of their own: an image was decided one turn before the stop, and left."""
    stopped_at: list[int] = []
    late: list[Request] = []
    loop = asyncio.get_running_loop()

    class Watched(Wire):
        """Calls for the stop so many turns of the loop after the read that a command is decided on."""

        async def read(self) -> Registers:
            registers = await super().read()
            if commanded and not stopping:
                stopping.append(loop.create_task(stop()))
            return registers

        async def write(self, registers: Sequence[int]) -> None:
            image = Request.from_registers(registers)
            if stopped_at and image.go and any(axis.position == 255 for axis in image.axes):
                late.append(image)
            await super().write(registers)

    async def stop() -> None:
        for _ in range(turns):
            await asyncio.sleep(0)
        stopped_at.append(len(wire.gripper.writes))
        await hand.stop(**options)

    wire = Watched()
    await activate_beforehand(wire.gripper)
    commanded: list[bool] = []
    stopping: list[asyncio.Task[None]] = []
    hand = RobotiqHand(wire)
    await hand.start()
    hand.command(position=255)
    commanded.append(True)
    await until(lambda: bool(stopping))
    await stopping[0]
    assert not late


@pytest.mark.parametrize("poll_s", [0.005, 0.1])
@pytest.mark.parametrize("call", ["halt", "stop"])
async def test_a_stop_just_after_another_client_has_reset_the_gripper_activates_nothing(
    server: SimulatorServer, gripper: SimulatedGripper, call: str, poll_s: float
) -> None:
    """Its rACT was a rising edge: all fingers opened and closed to their stops, after the call."""
    hand = RobotiqHand(server.address, poll_interval=poll_s)
    await hand.start()
    await hand.move(120)
    await anext(hand.statuses())
    gripper.write(0, [0] * 8)
    await asyncio.sleep(poll_s / 2)
    before = gripper.travel(A)
    with contextlib.suppress(NotActivatedError):
        await getattr(hand, call)()
    await asyncio.sleep(2)
    assert gripper.travel(A) - before < 100 * (poll_s + 0.05), (
        "counts, at 100 a second as an activation moves"
    )
    assert not gripper.is_moving
    assert not gripper.request_registers[0] & 0x0100
    await hand.stop()


@pytest.mark.parametrize("how", ["cancelled", "given up", "ended with the loop"])
async def test_a_hand_that_has_only_looked_writes_nothing_at_its_end(
    server: SimulatorServer, gripper: SimulatedGripper, how: str
) -> None:
    """It cleared rGTO, and stopped what another client moves."""
    await activate_beforehand(gripper)
    gripper.write(0, Request(activate=True, go=True, axes=(AxisRequest(255, 0, 0),) * 4).registers)
    writes = len(gripper.writes)
    hand = RobotiqHand(server.address, reconnect=False)
    starting = asyncio.create_task(hand.start(activate=False))
    if how == "cancelled":
        gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)  # the start reads on: it may pass
        await until(lambda: hand.statistics.polls > 0)
        starting.cancel()
        await asyncio.wait({starting})
    else:
        await starting
        if how == "given up":
            server.cut()
        else:
            poller_task().cancel()
        await hand.wait_for_state(State.SHUTDOWN, timeout=3)
    assert len(gripper.writes) == writes
    assert gripper.request_registers[0] & 0x0800


async def test_a_hand_that_keeps_grips_keeps_one_when_its_task_is_cancelled(
    server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    """A program may cancel all tasks: their order decided whether the part fell."""
    gripper.place_object(Finger.ABC, 120)
    async with RobotiqHand(server.address, keep_grip=True) as hand:
        await hand.grasp()
        poller = poller_task()
        poller.cancel()
        await asyncio.wait({poller})
    assert gripper.grips == Finger.ABC
