"""Bytes take their time on the simulator's serial line: by its clock, by the machine's, and for a hand."""

from __future__ import annotations

import asyncio
import logging
import time
from typing import Any

import pytest
import serial

pytest.importorskip("pty")

from robotiq_async import Finger, RobotiqHand
from robotiq_async.simulator import (
    RtuOverTcpSimulatorServer,
    SerialSimulatorServer,
    SimulatedGripper,
    Trouble,
    parse_troubles,
)
from robotiq_async.simulator.server.connection import MOST_UNREAD
from robotiq_async.simulator.server.serial_server import MOST_UNSENT, WireTime
from robotiq_async.values.model import model_of
from tests.grippers import activate_beforehand
from tests.serial_line import with_crc
from tests.simulator.test_serial_server import Line
from tests.virtual import HoldWatch, VirtualLoop, virtual
from tests.virtual_line import VirtualLine

BYTE_S = 10 / 115200
SILENCE_S = 3.5 * BYTE_S + 0.0005
READ = with_crc(bytes.fromhex("09 03 07d0 0008"))
WRITE = with_crc(bytes.fromhex("09 10 03e8 0008 10") + bytes(16))
EXCHANGES = [(READ, 21), (WRITE, 8)]


def on_the_wire(request: bytes, answer_size: int) -> float:
    """Seconds of an exchange; the silence after the answer comes before the next request."""
    return (len(request) + answer_size) * BYTE_S + SILENCE_S


def test_the_figures_of_the_manual_pages() -> None:
    read, write = (on_the_wire(*each) for each in EXCHANGES)
    assert 1000 * (read - SILENCE_S) == pytest.approx(2.52, abs=0.005)
    assert 1000 * (write - SILENCE_S) == pytest.approx(2.86, abs=0.005)
    assert 1000 * (read + write + 2 * SILENCE_S) == pytest.approx(8.60, abs=0.01)


def test_directions_are_apart_and_nothing_overtakes() -> None:
    wire = WireTime()
    due, pause = wire.hears(10.0, 8)
    assert (due, pause) == (pytest.approx(10.0 + 8 * BYTE_S + SILENCE_S), 10.0)
    assert wire.hears(10.0, 8) == (pytest.approx(10.0 + 16 * BYTE_S + SILENCE_S), 0.0), "behind the first"
    wire.heard(due)
    assert wire.sends(due + 0.0009, 21) == pytest.approx(due + 21 * BYTE_S), "a timer that was late"
    assert wire.sends(due + 0.0009, 21) == pytest.approx(due + 42 * BYTE_S)
    assert wire.sends(due + 1.0, 21) == pytest.approx(due + 1.0 + 21 * BYTE_S), "a reply that was late"


@virtual
@pytest.mark.parametrize("paced", [True, False])
@pytest.mark.parametrize(("request_", "size"), EXCHANGES)
async def test_an_exchange_takes_what_its_bytes_take(
    request_: bytes, size: int, paced: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    loop, cable = asyncio.get_running_loop(), VirtualLine(monkeypatch)
    expected = pytest.approx(on_the_wire(request_, size), abs=1e-6) if paced else 0
    async with SerialSimulatorServer(cable.FAR, SimulatedGripper(loop.time), paced=paced):
        port: Any = serial.serial_for_url(cable.near)
        for _ in range(3):
            arrived: asyncio.Future[None] = loop.create_future()
            loop.add_reader(port.fileno(), arrived.set_result, None)
            began = loop.time()
            port.write(request_)
            await arrived
            loop.remove_reader(port.fileno())
            assert loop.time() - began == expected
            assert len(port.read(4096)) == size
            await asyncio.sleep(SILENCE_S)
        port.close()


@pytest.mark.parametrize(("request_", "size"), EXCHANGES)
async def test_by_the_clock_of_the_machine(request_: bytes, size: int) -> None:
    """Never shorter; and longer by the timers' millisecond and a bit, and by what other processes took."""
    line, took, own, watch = Line(), [], [], HoldWatch()
    try:
        async with SerialSimulatorServer(line.port):
            for _ in range(50):
                began, waited = time.perf_counter(), watch.waiting()
                line.send(request_)
                await line.receive(size)
                took.append(time.perf_counter() - began)
                own.append(took[-1] - (watch.waiting() - waited))
                await asyncio.sleep(SILENCE_S)
    finally:
        watch.close()
        line.close()
    assert min(took) >= on_the_wire(request_, size) - 0.0001
    assert sorted(own)[5] <= on_the_wire(request_, size) + 0.0025


@pytest.mark.parametrize("paced", ["yes", 1, None])
def test_paced_or_not(paced: Any) -> None:
    with pytest.raises(TypeError, match="paced must be True or False"):
        SerialSimulatorServer("/dev/ttyFAR", paced=paced)
    with pytest.raises(TypeError, match="paced must be True or False"):
        RtuOverTcpSimulatorServer(paced=paced)


@virtual
async def test_a_line_keeps_no_more_than_it_carries_for_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    loop, cable = asyncio.get_running_loop(), VirtualLine(monkeypatch)
    async with SerialSimulatorServer(cable.FAR, SimulatedGripper(loop.time)) as server:
        connection: Any = server.connections[0]
        for _ in range(1000):
            connection.data_received(100 * WRITE)
            connection.pass_on(bytes(100))
        assert connection._wire.unheard(loop.time()) <= MOST_UNREAD + 100 * len(WRITE)
        assert connection._wire.unsent(loop.time()) <= MOST_UNSENT + 100
        await asyncio.sleep(60)
        assert not connection._inbox


# -- a hand on such a line ---------------------------------------------------------------------------------


@virtual
@pytest.mark.parametrize(
    ("model", "options", "streaming", "polls", "writes"),
    [
        ("3f", {}, False, 200, 0),
        ("3f", {}, True, 131.6, 131.6),
        ("3f", {"poll_interval": 0.01}, False, 100, 0),
        ("2f85", {}, False, 200, 0),
        ("2f85", {"write_function": 23}, True, 269.4, 269.4),
        ("2f85", {}, True, 269.4, 269.4),  # it never rests: function 23 is tried before the first command
    ],
)
async def test_how_often_a_hand_polls(
    model: str,
    options: dict[str, float],
    streaming: bool,
    polls: float,
    writes: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A read fits into 5 ms, a read and a write do not; a line that is the limit misses nothing.

    Commands go out as often as the line bears, which is oftener than a gripper does.
    """
    loop, cable = asyncio.get_running_loop(), VirtualLine(monkeypatch)
    gripper = SimulatedGripper(loop.time, model=model_of(model))
    async with SerialSimulatorServer(cable.FAR, gripper):
        await activate_beforehand(gripper)
        address = f"rtu://{cable.near}?model={model}"
        async with RobotiqHand(address, write_spacing=0.0, **options) as hand:  # type: ignore[arg-type]
            await asyncio.sleep(0.02)
            seconds, before = 2.0 if streaming else 1.0, hand.statistics
            until = loop.time() + seconds
            while loop.time() < until:
                if streaming:
                    hand.command(Finger.A, position=100 + int(20 * (loop.time() % 5)))
                    hand.command(Finger.A, speed=int(1000 * loop.time()) % 256)
                await asyncio.sleep(0.002)
            after = hand.statistics
            assert (after.polls - before.polls) / seconds == pytest.approx(polls, rel=0.02)
            assert (after.writes - before.writes) / seconds == pytest.approx(writes, rel=0.02)
            assert after.overruns == after.reconnects == 0
            if streaming:
                assert after.link_use > 0.9
                assert 0.002 < after.status_age_p50 <= after.status_age_p99 <= 0.006


@virtual
@pytest.mark.parametrize(
    ("words", "what_is_logged"),
    [
        ("echo", ""),
        ("strict-silence", "does not answer after a silence of 0.3 ms, so it gets 1.75 ms"),
        ("registers", "did not answer a read of all registers"),
        ("byte-before on read every 0.2", "a read was repeated"),
        ("byte-after every 0.2", "a read was repeated"),
    ],
)
@pytest.mark.parametrize("model", ["3f", "2f85"])
async def test_a_hand_works_on_lines_as_they_are(
    words: str,
    what_is_logged: str,
    model: str,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """It moves, loses no link, and polls as often as the line bears."""
    if words == "registers" and model == "3f":
        pytest.skip("a 3-Finger has eight registers")
    caplog.set_level(logging.INFO)
    loop, cable = asyncio.get_running_loop(), VirtualLine(monkeypatch)
    gripper = SimulatedGripper(loop.time, model=model_of(model))
    async with SerialSimulatorServer(cable.FAR, gripper) as server:
        await activate_beforehand(gripper)
        plan = asyncio.create_task(server.fault_injector.run(parse_troubles(words)))
        await asyncio.sleep(0)
        async with RobotiqHand(f"rtu://{cable.near}?model={model}") as hand:
            for position in (100, 40, 70):
                result = await hand.move(position, Finger.A)
                assert result.positions[Finger.A] == pytest.approx(position, abs=3)
            assert hand.statistics.reconnects == 0
            assert hand.statistics.period_p50 <= 0.0055
        plan.cancel()
        await asyncio.wait([plan])
    assert what_is_logged in caplog.text
    if not what_is_logged:
        assert "WARNING" not in caplog.text


@virtual
async def test_a_device_that_needs_the_longer_silence_now_and_then(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """The reads at opening do not reveal it; the third read without an answer does."""
    loop, cable = asyncio.get_running_loop(), VirtualLine(monkeypatch)
    async with (
        SerialSimulatorServer(cable.FAR, SimulatedGripper(loop.time)) as server,
        RobotiqHand(f"rtu://{cable.near}") as hand,
        server.fault_injector.making(Trouble("strict-silence")),
    ):
        await asyncio.sleep(3)
        assert "so it gets 1.75 ms" in caplog.text
        polls = hand.statistics.polls
        await asyncio.sleep(1)
        assert hand.statistics.polls - polls > 150
        assert hand.statistics.reconnects == 0


@virtual
async def test_a_loop_that_is_held_up_misses_polls_on_a_line_too(monkeypatch: pytest.MonkeyPatch) -> None:
    loop, cable = asyncio.get_running_loop(), VirtualLine(monkeypatch)
    assert isinstance(loop, VirtualLoop)
    gripper = SimulatedGripper(loop.time)
    async with SerialSimulatorServer(cable.FAR, gripper):
        await activate_beforehand(gripper)
        async with RobotiqHand(f"rtu://{cable.near}") as hand:
            await asyncio.sleep(0.1)
            assert hand.statistics.overruns == 0
            loop.hold_up(0.03)
            await asyncio.sleep(0.1)
            assert 5 <= hand.statistics.overruns <= 7


@virtual
async def test_a_line_that_takes_fifty_milliseconds_misses_polls(monkeypatch: pytest.MonkeyPatch) -> None:
    loop, cable = asyncio.get_running_loop(), VirtualLine(monkeypatch)
    gripper = SimulatedGripper(loop.time)
    async with SerialSimulatorServer(cable.FAR, gripper) as server:
        await activate_beforehand(gripper)
        async with RobotiqHand(f"rtu://{cable.near}") as hand:
            server.policy = lambda frame: [(0.06, frame)]
            await asyncio.sleep(1.0)
            assert hand.statistics.overruns > 100


@virtual
async def test_a_line_as_slow_as_bluetooth_works_with_the_right_timeouts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    loop, cable = asyncio.get_running_loop(), VirtualLine(monkeypatch)
    gripper = SimulatedGripper(loop.time)
    async with SerialSimulatorServer(cable.FAR, gripper) as server:
        await activate_beforehand(gripper)
        server.policy = lambda reply: [(0.08, reply)]
        address = f"rtu://{cable.near}"
        async with RobotiqHand(address, poll_interval=0.1, response_timeout=0.5) as hand:
            result = await hand.move(200)
            assert result.positions[Finger.A] == pytest.approx(200, abs=2)
            assert hand.statistics.reconnects == 0
            began = loop.time()
            await hand.set_speed(10)
            assert loop.time() - began < 0.4
