"""The simulated gripper over a real TCP connection: with pymodbus's client, and with frames made by hand."""

from __future__ import annotations

import asyncio
import itertools
import struct
from contextlib import asynccontextmanager, suppress
from typing import TYPE_CHECKING, Any

import pytest
from pymodbus.client import AsyncModbusTcpClient

from robotiq_async.simulator import (
    RtuOverTcpSimulatorServer,
    SerialSimulatorServer,
    SimulatedGripper,
    SimulatorServer,
    Trouble,
    UrcapSimulatorServer,
)
from robotiq_async.simulator.troubles.corruption import unchanged
from robotiq_async.values.enums import Finger
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.patience import patience

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

ACTIVE = (0x0100, 0, 0, 0, 0, 0, 0, 0)


class RawClient:
    """A Modbus TCP client of a few lines that shares nothing with pymodbus."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader = reader
        self.writer = writer
        self.transaction = 0

    def frame(self, pdu: bytes, unit: int = 2) -> bytes:
        self.transaction += 1
        return struct.pack(">HHHB", self.transaction, 0, len(pdu) + 1, unit) + pdu

    async def reply(self) -> tuple[int, int, bytes]:
        """Transaction id, unit id and PDU of the next reply."""
        async with asyncio.timeout(patience(5)):
            header = await self.reader.readexactly(7)
            transaction, protocol, length, unit = struct.unpack(">HHHB", header)
            assert protocol == 0
            return transaction, unit, await self.reader.readexactly(length - 1)

    async def ask(self, pdu: bytes, unit: int = 2) -> bytes:
        self.writer.write(self.frame(pdu, unit))
        transaction, answering_unit, answer = await self.reply()
        assert (transaction, answering_unit) == (self.transaction, unit)
        return answer

    async def read_status(self) -> RobotiqStatus:
        answer = await self.ask(b"\x04\x00\x00\x00\x08")
        assert answer[:2] == b"\x04\x10"
        return RobotiqStatus.from_registers(struct.unpack(">8H", answer[2:]))

    async def write(self, registers: tuple[int, ...]) -> bytes:
        return await self.ask(struct.pack(">BHHB8H", 16, 0, 8, 16, *registers))


@asynccontextmanager
async def raw_client(server: SimulatorServer) -> AsyncIterator[RawClient]:
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    try:
        yield RawClient(reader, writer)
    finally:
        writer.close()
        with suppress(ConnectionError):
            await writer.wait_closed()


@pytest.fixture
async def server() -> AsyncIterator[SimulatorServer]:
    """A server around a gripper a hundred times as fast as a real one."""
    async with SimulatorServer(SimulatedGripper(speedup=100.0)) as server:
        yield server


@pytest.fixture
async def client(server: SimulatorServer) -> AsyncIterator[RawClient]:
    async with raw_client(server) as client:
        yield client


async def until_settled(client: RawClient) -> RobotiqStatus:
    """Poll until the gripper is active and stands still."""
    while not (status := await client.read_status()).is_activated or status.is_moving:
        pass
    return status


async def until_written(server: SimulatorServer) -> None:
    """Wait for the first write to reach the gripper, whose reply is then on its way."""
    while not server.gripper.writes:  # noqa: ASYNC110 - there is no event to wait for
        await asyncio.sleep(0)


# The wire.


async def test_activation_and_a_grasp(server: SimulatorServer, client: RawClient) -> None:
    server.gripper.place_object(Finger.ABC, 150)
    assert await client.write(ACTIVE) == bytes.fromhex("10 0000 0008")
    assert (await client.read_status()).activation_echo
    await until_settled(client)
    image = Request(activate=True, go=True, axes=(AxisRequest(255, 255, 60),) * 4).registers
    await client.write(image)
    while not (status := await client.read_status()).go_echo or status.is_moving:
        pass
    assert status.contacts == Finger.ABC
    assert status.position(Finger.B) == 150
    assert server.gripper.writes[-1].registers == image


async def test_with_pymodbus(server: SimulatorServer) -> None:
    client = AsyncModbusTcpClient("127.0.0.1", port=server.port, retries=0, timeout=2)
    assert await client.connect()
    try:
        assert not (await client.write_registers(0, list(ACTIVE), device_id=2)).isError()
        assert not (await client.write_register(1, 0x1234, device_id=2)).isError()
        reply = await client.read_holding_registers(0, count=8, device_id=2)
        assert tuple(reply.registers) == (0x0100, 0x1234, 0, 0, 0, 0, 0, 0)
        while (await client.read_input_registers(0, count=1, device_id=2)).registers != [0x3100]:
            pass
        refused = await client.read_input_registers(0, count=9, device_id=2)
        assert (refused.isError(), refused.exception_code) == (True, 2)
    finally:
        client.close()


@pytest.mark.parametrize(
    ("pdu", "answer", "at", "registers"),
    [
        ("06 0007 1234", "06 0007 1234", 7, (0x1234,)),
        ("06 0007 0000", "06 0007 0000", 7, (0,)),
        ("10 0002 0002 04 aaaa bbbb", "10 0002 0002", 2, (0xAAAA, 0xBBBB)),
        ("10 03e8 0001 02 0100", "10 03e8 0001", 0, (0x0100,)),
    ],
)
async def test_partial_writes(
    server: SimulatorServer, client: RawClient, pdu: str, answer: str, at: int, registers: tuple[int, ...]
) -> None:
    before = tuple(range(8))
    await client.write(before)
    assert await client.ask(bytes.fromhex(pdu)) == bytes.fromhex(answer)
    expected = (*before[:at], *registers, *before[at + len(registers) :])
    assert server.gripper.request_registers == expected


@pytest.mark.parametrize(("function", "start"), [*itertools.product([3, 4], [0x0000, 0x03E8, 0x07D0])])
@pytest.mark.parametrize(("offset", "count"), [(0, 8), (7, 1), (2, 4)])
async def test_where_the_blocks_are_read(
    server: SimulatorServer, client: RawClient, function: int, start: int, offset: int, count: int
) -> None:
    await client.write((0, 1, 2, 3, 4, 5, 6, 7))
    answer = await client.ask(struct.pack(">BHH", function, start + offset, count))
    reads_status = start == 0x07D0 or (start, function) == (0, 4)
    registers = server.gripper.status_registers() if reads_status else server.gripper.request_registers
    assert answer == struct.pack(f">BB{count}H", function, 2 * count, *registers[offset : offset + count])


@pytest.mark.parametrize(
    ("code", "pdu"),
    [
        *((1, pdu) for pdu in ("01 0000 0001", "05 ffff ff00", "07", "41", "2b 0e 01 00")),
        (1, "17 0000 0001 0000 0001 02 0000"),
        *((2, pdu) for pdu in ("03 0008 0001", "03 0000 0009", "04 0007 0002", "04 03e7 0001")),
        *((2, pdu) for pdu in ("04 07d8 0001", "04 ffff 0001", "06 0008 0000", "06 07d0 0000")),
        *((2, pdu) for pdu in ("10 0007 0002 04 00000000", "10 07d0 0001 02 0100")),
        *((3, pdu) for pdu in ("03 0000 0000", "03 0000 007e", "03 0000", "03 0000 0001 00", "06 0000")),
        *((3, pdu) for pdu in ("10 0000 0000 00", "10 0000 0002 02 0100", "10 0000 0001 02 01", "10 0000")),
    ],
)
async def test_bad_requests_get_an_exception(
    server: SimulatorServer, client: RawClient, pdu: str, code: int
) -> None:
    request = bytes.fromhex(pdu)
    assert await client.ask(request) == bytes([request[0] | 0x80, code])
    assert server.gripper.writes == ()
    assert (await client.read_status()).is_reset, "the connection goes on"


async def test_any_unit_is_answered(client: RawClient) -> None:
    for unit in (0, 1, 9, 255):
        assert (await client.ask(b"\x04\x00\x00\x00\x01", unit))[0] == 4


async def test_only_one_unit_is_answered() -> None:
    async with SimulatorServer(device_id=2) as server, raw_client(server) as client:
        client.writer.write(client.frame(b"\x04\x00\x00\x00\x01", unit=3))
        assert (await client.ask(b"\x04\x00\x00\x00\x01", unit=2))[0] == 4


async def test_many_requests_in_one_segment_are_answered_in_order(client: RawClient) -> None:
    """Alone, pymodbus forgets all but the first."""
    burst = b"".join(client.frame(struct.pack(">BHH", 6, 1, value)) for value in range(100))
    client.writer.write(burst)
    answers = [await client.reply() for _ in range(100)]
    assert [transaction for transaction, _, _ in answers] == list(range(1, 101))
    assert [answer for _, _, answer in answers] == [struct.pack(">BHH", 6, 1, n) for n in range(100)]


async def test_a_request_in_single_bytes(client: RawClient) -> None:
    for byte in client.frame(b"\x04\x00\x00\x00\x01"):
        client.writer.write(bytes([byte]))
        await client.writer.drain()
        await asyncio.sleep(0)
    assert (await client.reply())[2][0] == 4


@pytest.mark.parametrize("junk", ["0001 0001 0006 02 04 0000 0008", "0001 0000 0000 02", "0001 0000 ffff 02"])
async def test_bytes_that_are_not_modbus_end_the_connection(client: RawClient, junk: str) -> None:
    client.writer.write(bytes.fromhex(junk))
    async with asyncio.timeout(patience(5)):
        assert await client.reader.read() == b""


async def test_two_clients_share_one_gripper(server: SimulatorServer, client: RawClient) -> None:
    async with raw_client(server) as other:
        await other.write(ACTIVE)
        assert await client.ask(b"\x03\x00\x00\x00\x01") == bytes.fromhex("03 02 0100")


# Life.


async def test_stop_is_idempotent_and_ends_connections(server: SimulatorServer, client: RawClient) -> None:
    await client.read_status()
    async with asyncio.timeout(patience(1)):
        await server.stop()
        await server.stop()
    assert not server.is_running
    assert await client.reader.read() == b""
    with pytest.raises(ConnectionRefusedError):
        await asyncio.open_connection("127.0.0.1", server.port)
    await SimulatorServer().stop()


async def test_stop_with_requests_in_flight_leaves_no_task(
    server: SimulatorServer, client: RawClient
) -> None:
    before = asyncio.all_tasks()
    client.writer.write(b"".join(client.frame(b"\x04\x00\x00\x00\x08") for _ in range(50)))
    await client.reply()
    await server.stop()
    assert asyncio.all_tasks() <= before


async def test_started_again_it_listens_on_the_same_port(server: SimulatorServer, client: RawClient) -> None:
    with pytest.raises(RuntimeError, match="running already"):
        await server.start()
    await client.write(ACTIVE)
    port = server.port
    await server.stop()
    await server.start()
    assert server.port == port
    async with raw_client(server) as again:
        assert (await again.read_status()).activation_echo


async def test_a_port_that_is_taken(server: SimulatorServer) -> None:
    other = SimulatorServer(port=server.port)
    with pytest.raises(OSError, match="address already in use"):
        await other.start()
    assert not other.is_running


async def test_an_impossible_host() -> None:
    with pytest.raises(OSError, match="cannot be resolved"):
        await SimulatorServer(host="a" * 64).start()


async def test_controls_need_a_running_server() -> None:
    server = SimulatorServer()
    for control in (server.cut, server.refuse):
        with pytest.raises(RuntimeError, match="not running"):
            control()
    with pytest.raises(RuntimeError, match="not running"):
        await server.accept()


@pytest.mark.parametrize(("option", "value"), [("port", 65536), ("port", -1), ("device_id", 256)])
def test_bad_options(option: str, value: int) -> None:
    options: dict[str, Any] = {option: value}
    with pytest.raises(ValueError, match=option):
        SimulatorServer(**options)


# Misbehaviour.


async def test_silence_and_back_to_normal(server: SimulatorServer, client: RawClient) -> None:
    server.policy = lambda _: []
    client.writer.write(client.frame(b"\x06\x00\x01\x00\x01"))
    await until_written(server)
    server.policy = unchanged
    assert (await client.ask(b"\x04\x00\x00\x00\x01"))[0] == 4


async def test_late_replies(server: SimulatorServer, client: RawClient) -> None:
    loop = asyncio.get_running_loop()
    server.policy = lambda frame: [(0.05, frame)]
    began = loop.time()
    await client.ask(b"\x04\x00\x00\x00\x01")
    assert loop.time() - began >= 0.045
    client.writer.write(client.frame(b"\x06\x00\x01\x00\x01"))
    await until_written(server)
    server.policy = unchanged
    client.writer.write(client.frame(b"\x04\x00\x00\x00\x01"))
    assert [(await client.reply())[2][0] for _ in range(2)] == [6, 4], "no reply overtakes an older one"


async def test_a_policy_decides_on_every_reply(server: SimulatorServer, client: RawClient) -> None:
    server.policy = lambda frame: [(0.0, frame), (0.0, frame)]
    await client.ask(b"\x04\x00\x00\x00\x01")
    assert (await client.reply())[0] == client.transaction
    server.policy = lambda _: None
    client.writer.write(client.frame(b"\x04\x00\x00\x00\x01"))
    async with asyncio.timeout(patience(5)):
        assert await client.reader.read() == b""


async def test_refuse_and_accept(server: SimulatorServer, client: RawClient) -> None:
    await client.read_status()
    server.refuse()
    with pytest.raises(ConnectionRefusedError):
        await asyncio.open_connection("127.0.0.1", server.port)
    await client.read_status()
    await server.accept()
    await server.accept()
    async with raw_client(server) as again:
        assert (await again.read_status()).is_reset


async def test_power_cycle(server: SimulatorServer, client: RawClient) -> None:
    await client.write(ACTIVE)
    cycle = asyncio.create_task(server.power_cycle(off_time=10.0))
    async with asyncio.timeout(patience(5)):
        assert await client.reader.read() == b""
    with pytest.raises(ConnectionRefusedError):
        await asyncio.open_connection("127.0.0.1", server.port)
    await cycle
    async with raw_client(server) as again:
        status = await again.read_status()
    assert (status.activation_echo, status.is_reset) == (False, True)


async def test_stop_during_a_power_cycle(server: SimulatorServer) -> None:
    cycle = asyncio.create_task(server.power_cycle(off_time=5.0))
    await asyncio.sleep(0)
    await server.stop()
    await cycle
    assert not server.is_running
    assert server.gripper.is_powered


async def test_a_power_cycle_that_is_cancelled_ends(server: SimulatorServer) -> None:
    """It left a gripper without power that no client could connect to."""
    cycle = asyncio.create_task(server.power_cycle(off_time=3600.0))
    await asyncio.sleep(0)
    assert not server.gripper.is_powered
    cycle.cancel()
    with pytest.raises(asyncio.CancelledError):
        await cycle
    async with raw_client(server) as again:
        assert (await again.read_status()).is_reset


async def test_after_a_power_cycle_a_trouble_that_lasts_goes_on(server: SimulatorServer) -> None:
    """It accepted connections, whichever trouble refused them."""
    async with server.fault_injector.making(Trouble("refuse")):
        await server.power_cycle()
        assert server.gripper.is_powered
        with pytest.raises(ConnectionRefusedError):
            await asyncio.open_connection("127.0.0.1", server.port)
    async with raw_client(server) as again:
        assert (await again.read_status()).is_reset


async def test_a_gripper_without_power_does_not_answer(server: SimulatorServer, client: RawClient) -> None:
    server.gripper.power_off()
    client.writer.write(client.frame(b"\x06\x00\x01\x12\x34"))
    async with raw_client(server) as other:
        other.writer.write(other.frame(b"\x04\x00\x00\x00\x01"))
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.05):
                await other.reader.readexactly(1)
    server.gripper.power_on()
    assert (await client.ask(b"\x03\x00\x01\x00\x01")) == bytes.fromhex("03 02 0000")


async def test_half_a_request_from_before_a_power_cut_is_forgotten(
    server: SimulatorServer, client: RawClient
) -> None:
    await client.read_status()
    request = client.frame(b"\x04\x00\x00\x00\x08")
    (connection,) = server.connections
    connection.data_received(request[:5])
    server.gripper.power_off()
    connection.data_received(request[5:])
    server.gripper.power_on()
    assert (await client.read_status()).is_reset


@pytest.mark.parametrize("kind", ["reset", "close", "accept-silence", "refuse", "power-cut"])
async def test_connections_are_cut_and_new_ones_welcome_afterwards(
    server: SimulatorServer, client: RawClient, kind: str
) -> None:
    port = server.port
    async with raw_client(server) as other:
        await client.read_status()
        await other.read_status()
        async with server.fault_injector.making(Trouble(kind)), asyncio.timeout(patience(5)):
            for each in (client, other):
                if kind == "close":
                    assert await each.reader.read() == b"", "closed in order"
                else:
                    with pytest.raises(ConnectionResetError):
                        await each.reader.read()
            if kind in ("refuse", "power-cut"):
                with pytest.raises(ConnectionRefusedError):
                    await asyncio.open_connection("127.0.0.1", port)
    assert server.port == port
    async with raw_client(server) as again:
        assert (await again.read_status()).is_reset


@pytest.mark.parametrize("turns", range(5))
async def test_cancelled_while_a_trouble_ends_clients_are_let_in_and_the_server_can_stop(
    server: SimulatorServer, turns: int
) -> None:
    begun = await server.fault_injector.begin(Trouble("refuse"))
    ending = asyncio.create_task(server.fault_injector.end(begun))
    for _ in range(turns):
        await asyncio.sleep(0)
    ending.cancel()
    await asyncio.wait({ending})
    await server.fault_injector.end(begun)
    async with raw_client(server) as client:
        assert (await client.read_status()).is_reset
    await server.stop()
    with pytest.raises(ConnectionRefusedError):
        await asyncio.open_connection("127.0.0.1", server.port)


# What it shows.

ALL = {
    *("start", "stop", "is_running", "address", "gripper", "policy", "fault_injector", "link", "functions"),
    *("connections", "failure", "failed", "cut", "refuse", "accept"),
}
ON_TCP, ON_A_LINE = {"port", "power_cycle"}, {"port", "device_id", "paced", "reply_silence", "others"}


@pytest.mark.parametrize(
    ("kind", "names"),
    [
        (SimulatorServer, ALL | ON_TCP),
        (UrcapSimulatorServer, ALL | ON_TCP),
        (RtuOverTcpSimulatorServer, ALL | ON_TCP | ON_A_LINE),
        (SerialSimulatorServer, ALL | ON_A_LINE),
    ],
)
def test_a_server_shows_what_its_users_call_and_no_more(kind: type, names: set[str]) -> None:
    shown = {*dir(kind), *kind.__annotations__, "gripper", "policy", "fault_injector"}
    assert {name for name in shown if not name.startswith("_")} - names == set()
