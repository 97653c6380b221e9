"""The end of a request on a serial line, and its addressee; in virtual time."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
import serial

from robotiq_async.simulator import SerialSimulatorServer, SimulatedGripper
from robotiq_async.simulator.server.framing import Frame
from tests.serial_line import with_crc
from tests.virtual_line import VirtualLine

pytestmark = pytest.mark.virtual_time

READ = with_crc(bytes.fromhex("09 03 07d0 0001"))
RESET_READING = with_crc(bytes.fromhex("09 03 02 0000"))
CUT_OFF = bytes.fromhex("09 10 03e8 007b f6")
"""The beginning of a request of 255 bytes."""


class Client:
    """The near end of the line."""

    def __init__(self, port: serial.Serial) -> None:
        self._port = port

    async def say(self, data: bytes, then_wait: float = 0.0) -> None:
        """Send bytes, and be silent for some seconds after the last of them."""
        self._port.write(data)
        await asyncio.sleep(len(data) * 87e-6 + then_wait)

    async def hear(self, seconds: float = 0.1) -> bytes:
        """All that comes in some seconds."""
        await asyncio.sleep(seconds)
        return bytes(self._port.read(4096))

    async def ask(self, request: bytes) -> bytes:
        await self.say(request)
        return await self.hear()


@asynccontextmanager
async def line(
    patch: pytest.MonkeyPatch, **options: Any
) -> AsyncIterator[tuple[SerialSimulatorServer, Client]]:
    cable = VirtualLine(patch)
    gripper = SimulatedGripper(asyncio.get_running_loop().time)
    async with SerialSimulatorServer(cable.FAR, gripper, **options) as server:
        port = serial.serial_for_url(cable.near)
        try:
            yield server, Client(port)
        finally:
            port.close()


Ends = tuple[SerialSimulatorServer, Client]


@pytest.fixture
async def ends(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Ends]:
    async with line(monkeypatch) as ends:
        yield ends


@pytest.fixture
def server(ends: Ends) -> SerialSimulatorServer:
    return ends[0]


@pytest.fixture
def client(ends: Ends) -> Client:
    return ends[1]


# Where a frame ends.


@pytest.mark.parametrize("silence", [0.002, 0.005, 0.05, 1.0])
@pytest.mark.parametrize(
    "cut_off",
    [CUT_OFF, CUT_OFF[:1], CUT_OFF[:2], READ[:-1], READ[:-1] + b"\0", bytes.fromhex("09 2b 0e 01"), bytes(3)],
)
async def test_silence_ends_what_was_cut_off(client: Client, silence: float, cut_off: bytes) -> None:
    await client.say(cut_off, silence)
    assert await client.ask(READ) == RESET_READING
    assert await client.ask(READ) == RESET_READING


async def test_the_request_after_one_without_silence_is_heard(client: Client) -> None:
    await client.say(CUT_OFF + READ, 0.03)
    assert await client.hear() == b""
    assert await client.ask(READ) == RESET_READING


@pytest.mark.parametrize("pause", [0.0005, 0.002, 0.016])
@pytest.mark.parametrize("at", range(1, len(READ)))
async def test_a_request_in_two_parts_as_an_adapter_delivers_it(
    client: Client, pause: float, at: int
) -> None:
    await client.say(READ[:at], pause)
    assert await client.ask(READ[at:]) == RESET_READING


@pytest.mark.parametrize("silence", [0.002, 0.005])
async def test_after_silence_a_request_may_come_in_parts_too(client: Client, silence: float) -> None:
    await client.say(CUT_OFF, 0.03)
    await client.say(READ[:3], silence)
    assert await client.ask(READ[3:]) == RESET_READING


async def test_requests_that_came_while_the_loop_was_held_up_are_all_answered(client: Client) -> None:
    loop = asyncio.get_running_loop()
    for _ in range(3):
        await client.say(READ)
        loop.hold_up(0.05)  # type: ignore[attr-defined]
    assert await client.hear() == 3 * RESET_READING


# What is answered.


def frame(pdu: str) -> bytes:
    return with_crc(bytes.fromhex(f"09 {pdu}"))


@pytest.mark.parametrize(
    "exchanges",
    [
        [("10 03e8 0008 10 0100" + 28 * "0", "10 03e8 0008"), ("03 03e8 0001", "03 02 0100")],
        [
            ("10 03ea 0002 04 aaaa bbbb", "10 03ea 0002"),
            ("06 03eb 1234", "06 03eb 1234"),
            ("03 03ea 0002", "03 04 aaaa 1234"),
        ],
        # The manual's example of function 23, but for the checksum that it prints under the request.
        [("17 07d0 0002 03e9 0002 04 00e6 3cc8", "17 04 0000 00e6"), ("03 03e9 0002", "03 04 00e6 3cc8")],
        # What is written comes before what is read.
        [("17 03e9 0001 03e9 0001 02 1234", "17 02 1234"), ("17 03e9 0001 03e9 0001 02 5678", "17 02 5678")],
    ],
)
async def test_requests_are_answered(client: Client, exchanges: list[tuple[str, str]]) -> None:
    for request, answer in exchanges:
        assert await client.ask(frame(request)) == frame(answer)


# What is refused.


@pytest.mark.parametrize(
    "frame",
    [
        *(
            with_crc(b"\x09" + bytes.fromhex(pdu))
            for pdu in (
                *("05 0000 ff00", "03 07d0 0009", "06 07d0 0001", "03 07d0 0000"),
                *("17 07d0 0000 03e9 0001 02 1234", "17 07d0 007e 03e9 0001 02 1234"),
                *("17 07d0 0009 03e9 0001 02 1234", "17 07d8 0001 03e9 0001 02 1234"),
                *("17 07d0 0001 03e9 0000 00", "17 07d0 0001 03e9 0001 04 12345678"),
                *("17 07d0 0001 03e9 0002 02 1234", "17 07d0 0001 03e9 0001 01 12"),
                *("17 07d0 0001 07d0 0001 02 1234", "17 07d0 0001 03ef 0002 04 12345678"),
            )
        ),
        bytes.fromhex("ff ff ff"),
        bytes.fromhex("09 03 07d0 0008 0000"),
        bytes.fromhex("09 03 07d0 0008 0000 09 03"),  # a wrong checksum takes along what follows
    ],
    ids=bytes.hex,
)
async def test_a_bad_request_gets_no_answer_and_changes_nothing(
    server: SerialSimulatorServer, client: Client, frame: bytes
) -> None:
    assert await client.ask(frame) == b""
    assert await client.ask(READ) == RESET_READING
    assert server.gripper.writes == ()


# Who is meant.


@pytest.mark.parametrize("unit", [1, 8, 10, 247])
async def test_other_units_are_left_to_themselves(
    server: SerialSimulatorServer, client: Client, unit: int
) -> None:
    assert await client.ask(with_crc(bytes([unit]) + READ[1:-2])) == b""
    assert await client.ask(with_crc(bytes([unit]) + bytes.fromhex("06 03e9 1234"))) == b""
    assert server.gripper.writes == ()


async def test_the_unit_id_can_be_another(monkeypatch: pytest.MonkeyPatch) -> None:
    async with line(monkeypatch, device_id=12) as (_, client):
        assert await client.ask(READ) == b""
        assert await client.ask(with_crc(b"\x0c" + READ[1:-2])) == with_crc(b"\x0c" + RESET_READING[1:-2])


@pytest.mark.parametrize("write", ["00 06 03e9 1234", "00 10 03e9 0001 02 1234"])
async def test_a_broadcast_is_carried_out_and_not_answered(
    server: SerialSimulatorServer, client: Client, write: str
) -> None:
    assert await client.ask(with_crc(bytes.fromhex(write))) == b""
    assert server.gripper.request_registers[1] == 0x1234
    assert await client.ask(with_crc(b"\0" + READ[1:-2])) == b"", "nor is a broadcast that reads"
    assert await client.ask(READ) == RESET_READING


@pytest.mark.parametrize("unit", [-1, 0, 248, 255])
def test_a_unit_id_that_no_unit_can_have(unit: int) -> None:
    with pytest.raises(ValueError, match=f"device_id must be in 1..247, got {unit}"):
        SerialSimulatorServer("/dev/ttyFAR", device_id=unit)


# Without power.


async def test_a_request_that_waits_for_its_turn_at_a_power_cut_is_not_answered(
    server: SerialSimulatorServer, client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = asyncio.Event()
    take = server._responder.take

    def taken(inbox: bytearray) -> Frame | None:
        asked.set()
        return take(inbox)

    monkeypatch.setattr(server._responder, "take", taken)
    await client.say(READ + READ)
    await asked.wait()
    server.gripper.power_off()
    assert len(await client.hear()) == 3 + 2 + 2, "the first alone"
