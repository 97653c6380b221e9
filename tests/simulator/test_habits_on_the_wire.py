"""Habits as troubles: what a client meets while they last, and that they end."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager

import pytest

from robotiq_async import JAW, TWO_FINGER_85
from robotiq_async.simulator import Habits, SimulatedGripper, SimulatorServer, Trouble, UrcapSimulatorServer
from robotiq_async.simulator import parse_troubles as plan_of
from robotiq_async.simulator.physics.habits import REAL_ACTIVATION
from robotiq_async.simulator.troubles.trouble import KINDS
from robotiq_async.values.enums import Fault, Finger, Initialization
from robotiq_async.values.request import AxisRequest, Request
from tests.serial_line import with_crc
from tests.simulator.conftest import simulator
from tests.simulator.test_fault_injector import activate, is_answered, status
from tests.simulator.test_serial_frames import READ as READ_SERIAL
from tests.simulator.test_serial_frames import RESET_READING, line
from tests.simulator.test_server import RawClient, raw_client

pytestmark = pytest.mark.virtual_time

READ_3 = bytes.fromhex("03 0000 0001")
READ_4 = bytes.fromhex("04 0000 0001")
REFUSED = b"\x84\x01"


def image(position: int, *, go: bool = True) -> tuple[int, ...]:
    axes = (AxisRequest(position, 255, 0),) * 4
    return Request(activate=True, go=go, axes=axes).registers


async def begin(server: SimulatorServer) -> None:
    """Activate it, with a request for every axis to stay open."""
    await activate(server)
    server.gripper.write(0, image(0))
    await asyncio.sleep(10)


async def test_each_habit_is_the_grippers_own_again_when_its_trouble_ends(server: SimulatorServer) -> None:
    own = server.gripper.habits
    for name, kind in KINDS.items():
        if kind.habit is None:
            continue
        async with server.fault_injector.making(Trouble(name)):
            expected = True if kind.value is None else kind.value
            assert getattr(server.gripper.habits, kind.habit) == expected
        assert server.gripper.habits == own


async def test_habits_overlap_and_the_newest_counts(server: SimulatorServer) -> None:
    own = server.gripper.habits
    begun = [await server.fault_injector.begin(each) for each in plan_of("status-lag 0.1; echoed-limits")]
    async with server.fault_injector.making(Trouble("status-lag", 0.3)):
        assert server.gripper.habits.status_lag == 0.3
        await server.fault_injector.end(begun[1])
        assert server.gripper.habits == Habits(status_lag=0.3)
    assert server.gripper.habits == Habits(status_lag=0.1)
    await server.fault_injector.end(begun[0])
    assert server.gripper.habits == own


async def test_the_times_of_troubles_are_real_ones() -> None:
    slow = Trouble("slow-activation", 12)
    async with simulator(speedup=20) as server, server.fault_injector.making(slow):
        server.gripper.write(0, Request(activate=True).registers)
        await asyncio.sleep(11.9)
        assert status(server).initialization is Initialization.ACTIVATING
        await asyncio.sleep(0.2)
        assert status(server).is_activated


def test_a_server_that_is_given_no_gripper_activates_as_slowly_as_a_real_one() -> None:
    assert SimulatorServer().gripper.habits == Habits(activation_time=REAL_ACTIVATION)


async def test_writes_that_are_acknowledged_and_forgotten(server: SimulatorServer, client: RawClient) -> None:
    async with server.fault_injector.making(Trouble("write-spacing")):
        for position in (10, 20, 30):
            assert await client.write(image(position)) == struct.pack(">BHH", 16, 0, 8)
        await asyncio.sleep(0.01)
        assert await client.write(image(40)) == struct.pack(">BHH", 16, 0, 8)
    kept = [Request.from_registers(write.registers).axes[0].position for write in server.gripper.writes]
    assert kept == [10, 40]


async def test_the_first_motion_on_a_new_connection_is_forgotten(
    server: SimulatorServer, client: RawClient
) -> None:
    await begin(server)
    async with server.fault_injector.making(Trouble("wake-needed")):
        await client.write(image(50))
        await asyncio.sleep(5)
        assert server.gripper.position(Finger.A) == 50, "an old connection is awake"
        async with raw_client(server) as newer:
            await newer.read_status()
            await newer.write(image(200))
            await asyncio.sleep(5)
            seen = await newer.read_status()
            assert (seen.requested_position(Finger.A), seen.position(Finger.A)) == (200, 50)
            await newer.write(image(200))
            await asyncio.sleep(5)
            assert server.gripper.position(Finger.A) == 200
        async with raw_client(server) as newer:
            await newer.read_status()
    await client.write(image(100))
    await asyncio.sleep(5)
    assert server.gripper.position(Finger.A) == 100, "it is over"


async def test_function_3_serves_where_4_would(server: SimulatorServer, client: RawClient) -> None:
    await activate(server)
    async with server.fault_injector.making(Trouble("function-3-only")):
        assert await client.ask(READ_4) == REFUSED
        assert await client.ask(READ_3) == b"\x03\x02\x31\x00"
        assert await client.write(image(50)) == struct.pack(">BHH", 16, 0, 8)
        await asyncio.sleep(0.1)
        assert (await client.ask(bytes.fromhex("03 07d0 0001"))) == b"\x03\x02\x39\x00"
    assert await client.ask(READ_4) == b"\x04\x02\x39\x00"
    assert await client.ask(READ_3) == struct.pack(">BBH", 3, 2, image(50)[0])


async def test_function_3_on_a_serial_line(monkeypatch: pytest.MonkeyPatch) -> None:
    read_with_4 = with_crc(bytes.fromhex("09 04 07d0 0001"))
    async with line(monkeypatch) as (server, client):
        async with server.fault_injector.making(Trouble("function-3-only")):
            assert await client.ask(read_with_4) == b"", "a serial line refuses by silence"
            assert await client.ask(READ_SERIAL) == RESET_READING
        assert await client.ask(read_with_4) != b""


async def test_one_connection_at_a_time(server: SimulatorServer) -> None:
    async with server.fault_injector.making(Trouble("one-connection-only")):
        async with raw_client(server) as first:
            assert await is_answered(first)
            assert await is_reset(server)
            assert await is_answered(first), "the first one goes on"
        await asyncio.sleep(0.1)
        async with raw_client(server) as second:
            assert await is_answered(second)
        await asyncio.sleep(0.1)
    async with raw_client(server) as one, raw_client(server) as other:
        assert [await is_answered(each) for each in (one, other)] == [True, True]


async def is_reset(server: SimulatorServer) -> bool:
    """Whether a new connection is reset before anything is answered."""
    async with raw_client(server) as client:
        try:
            await RawClient.ask(client, READ_4)
        except (ConnectionResetError, asyncio.IncompleteReadError):
            return True
    return False


@asynccontextmanager
async def text_port() -> AsyncIterator[tuple[UrcapSimulatorServer, Callable[[str], Awaitable[str]]]]:
    """A jaw behind a text port, which takes variables one by one, and what says a line to it."""
    gripper = SimulatedGripper(asyncio.get_running_loop().time, spread=False, model=TWO_FINGER_85)
    async with UrcapSimulatorServer(gripper) as server:
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)

        async def say(line: str) -> str:
            writer.write(f"{line}\n".encode())
            return (await reader.read(100)).decode()

        await server.fault_injector.begin(Trouble("one-by-one", 0.1))
        yield server, say
        writer.close()
        await asyncio.sleep(0.01)


def asked(server: UrcapSimulatorServer) -> tuple[bool, bool, int]:
    image = Request.from_registers(server.gripper.request_registers, TWO_FINGER_85)
    return image.activate, image.go, image.position(JAW)


async def test_the_variables_of_a_set_are_taken_one_by_one_and_in_order() -> None:
    async with text_port() as (server, say):
        assert await say("SET SID 9") == "ack"
        assert await say("SET ACT 1 POS 50 GTO 1") == "ack"
        assert await say("SET GTO 0 POS 20") == "ack", "it waits behind the other"
        assert asked(server) == (False, False, 0), "acknowledged, and not taken"
        seen = []
        for _ in range(6):
            seen.append(asked(server))
            await asyncio.sleep(0.1)
        assert seen[1:] == [
            *((True, False, 0), (True, False, 50), (True, True, 50)),
            *((True, False, 50), (True, False, 20)),
        ]


@pytest.mark.parametrize(
    "line", ["SET POS 50 OBJ 1", "SET POS 50 GTO", "SET POS 50 GTO 2", "SET POS 50 SID 1"]
)
async def test_nothing_of_a_set_that_is_refused_is_taken(line: str) -> None:
    async with text_port() as (server, say):
        assert await say(line) == "?"
        await asyncio.sleep(1)
        assert asked(server) == (False, False, 0)


async def test_without_power_nothing_more_is_taken() -> None:
    async with text_port() as (server, say):
        await say("SET ACT 1 POS 50 GTO 1")
        await asyncio.sleep(0.1)
        server.gripper.power_cycle()
        await asyncio.sleep(0.05)
        server.gripper.power_off()
        await asyncio.sleep(0.1)
        server.gripper.power_on()
        await asyncio.sleep(1)
        assert asked(server) == (False, False, 0)


async def test_a_server_that_is_stopped_takes_nothing_more() -> None:
    async with text_port() as (server, say):
        await say("SET ACT 1 POS 50 GTO 1")
        await asyncio.sleep(0.15)
        await server.stop()
        await asyncio.sleep(1)
        assert asked(server) == (True, False, 0)


async def test_an_emergency_stop_for_a_while(server: SimulatorServer) -> None:
    await begin(server)
    async with server.fault_injector.making(Trouble("e-stop", 2)):
        async with server.fault_injector.making(Trouble("e-stop", 1)):
            assert status(server).fault is Fault.ACTIVATION_PENDING
        server.gripper.write(0, (0,) * 8)
        await asyncio.sleep(1)
    for expected in (False, True):
        server.gripper.write(0, Request(activate=True).registers)
        await asyncio.sleep(30)
        assert status(server).is_activated is expected
        server.gripper.write(0, (0,) * 8)
        await asyncio.sleep(1)
