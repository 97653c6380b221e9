"""Replies come late, twice, damaged or not at all, at random: what is read always answers the newest request.

``REPLIES=10000 pytest tests/link/test_stale_replies.py`` tries so many; the suite tries fewer.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import random
import struct
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import Any, Final

import pytest
import serial

from robotiq_async import RobotiqConnectionError
from robotiq_async.link.address import parse_address
from robotiq_async.link.modbus import ModbusTransport
from robotiq_async.values.model import TWO_FINGER_85
from robotiq_async.values.registers import RTU_REGISTERS, TCP_REGISTERS, RegisterMap
from tests.link.scripted_device import request_size, unopened
from tests.link.writing import write_image
from tests.serial_line import with_crc
from tests.virtual_line import VirtualLine

pytestmark = pytest.mark.virtual_time

REPLIES: Final = int(os.environ.get("REPLIES", "400"))
RESPONSE_S: Final = 0.05
WRITTEN: Final = 0x0900


class Liar:
    """Answers with the number of the request in every register; what becomes of the answer is chance.

    Like a gripper it answers in order: a reply that is late keeps back those after it.
    """

    def __init__(self, seed: int) -> None:
        self.chance = random.Random(seed)
        self.numbers: Counter[int] = Counter()
        """The number of the last request, by unit id."""
        self.did: Counter[str] = Counter()
        self._loop = asyncio.get_running_loop()
        self._free_at = 0.0

    def send(self, data: bytes) -> None:
        raise NotImplementedError

    def damage(self, reply: bytes) -> bytes:
        raise NotImplementedError

    def answer(self, reply: bytes) -> None:
        what = self.chance.choices(
            ("right", "late", "later", "lost", "damaged", "twice", "half"), (80, 8, 4, 2, 3, 1.5, 1.5)
        )[0]
        self.did[what] += 1
        parts = {
            "lost": b"",
            "damaged": self.damage(reply),
            "twice": 2 * reply,
            "half": reply[: len(reply) // 2],
        }
        delay = {"late": self.chance.uniform(0.5, 1.5), "later": self.chance.uniform(1, 4)}.get(what, 0.0)
        at = max(self._free_at, self._loop.time() + 0.001 + delay * RESPONSE_S)
        self._free_at = at
        self._loop.call_at(at, self.send, parts.get(what, reply))

    def registers(self, unit: int, count: int) -> bytes:
        self.numbers[unit] = self.numbers[unit] % 0xFFFF + 1
        return struct.pack(f">{count}H", *[self.numbers[unit]] * count)


class RtuLiar(Liar):
    """A liar with the frames of a serial line."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self._inbox = b""

    def damage(self, reply: bytes) -> bytes:
        at = self.chance.randrange(len(reply))
        return reply[:at] + bytes((reply[at] ^ 1 << self.chance.randrange(8),)) + reply[at + 1 :]

    def hear(self, data: bytes) -> None:
        self._inbox += data
        while len(self._inbox) >= 8:
            size = request_size(self._inbox)
            if len(self._inbox) < size:
                return
            request, self._inbox = self._inbox[:size], self._inbox[size:]
            unit, function, count = request[0], request[1], request[5]
            if function == 16:
                self.registers(unit, 1)
                self.answer(with_crc(request[:6]))
            else:
                self.answer(with_crc(bytes((unit, function, 2 * count)) + self.registers(unit, count)))


class SerialLiar(RtuLiar):
    """At the far end of a line."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self._port: Any = serial.serial_for_url(VirtualLine.FAR)
        self._loop.add_reader(self._port.fileno(), self._ready)

    def close(self) -> None:
        self._loop.remove_reader(self._port.fileno())
        self._port.close()

    def send(self, data: bytes) -> None:
        with contextlib.suppress(ValueError, OSError):  # the end of the test
            self._port.write(data)

    def _ready(self) -> None:
        self.hear(self._port.read(4096))


class BehindASocket(Liar, asyncio.Protocol):
    """A liar that answers the connection that is there when the answer comes."""

    _inbox = b""
    _transport: Any = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport, self._inbox = transport, b""

    def send(self, data: bytes) -> None:
        if self._transport is not None:
            self._transport.write(data)


class ServerLiar(BehindASocket, RtuLiar):
    """A serial server."""

    def data_received(self, data: bytes) -> None:
        self.hear(data)


class TcpLiar(BehindASocket):
    """A gateway."""

    def damage(self, reply: bytes) -> bytes:
        """TCP has no damaged bytes, but gateways that answer something else."""
        return reply[:2] + self.chance.choice((b"\0\1", b"\0\0")) + reply[4:7] + b"\x03" + reply[8:]

    def data_received(self, data: bytes) -> None:
        self._inbox += data
        while len(self._inbox) >= 6 and len(self._inbox) >= 6 + self._inbox[5]:
            size = 6 + self._inbox[5]
            request, self._inbox = self._inbox[:size], self._inbox[size:]
            unit, function, count = request[6], request[7], request[11]
            if function == 16:
                self.registers(unit, 1)
                body = request[6:12]
            else:
                body = bytes((unit, function, 2 * count)) + self.registers(unit, count)
            self.answer(request[:4] + struct.pack(">H", len(body)) + body)


@asynccontextmanager
async def a_line(patch: pytest.MonkeyPatch, seed: int) -> AsyncIterator[tuple[SerialLiar, str]]:
    VirtualLine(patch)
    liar = SerialLiar(seed)
    yield liar, VirtualLine.NEAR
    liar.close()


async def exchange_at_random(transport: ModbusTransport, unit: int, liar: Liar, count: int) -> None:
    """Read, write, or both, and open again when the connection is lost."""
    chance, done = random.Random(unit), 0
    while done < count:
        with contextlib.suppress(RobotiqConnectionError):
            if not transport.is_open:
                await transport.open()
            done += 1
            how = chance.random()
            if how < 0.7:
                registers = await transport.read()
            elif transport.reads_with_writes:
                answer = await transport.send_and_read(lambda: (WRITTEN,) * 8)
                assert answer is not None
                registers = answer.registers
            else:
                await write_image(transport, (WRITTEN,) * 8)
                continue
            assert registers[0] == liar.numbers[unit], "a stale status"
        await asyncio.sleep(0.005)
    await transport.close()


@pytest.mark.parametrize("registers", [RTU_REGISTERS, TWO_FINGER_85.rtu], ids=["16", "23"])
async def test_a_serial_line(registers: RegisterMap, monkeypatch: pytest.MonkeyPatch) -> None:
    async with a_line(monkeypatch, 1) as (liar, port):
        await exchange_at_random(unopened(port, registers), registers.device_id, liar, REPLIES)
    assert all(liar.did[what] for what in ("late", "later", "damaged", "twice"))


async def test_a_shared_serial_line(monkeypatch: pytest.MonkeyPatch) -> None:
    maps = [replace(TWO_FINGER_85.rtu, device_id=9), replace(RTU_REGISTERS, device_id=12)]
    async with a_line(monkeypatch, 2) as (liar, port):
        pair = [(unopened(port, each, shares_line=True), each.device_id) for each in maps]
        async with asyncio.TaskGroup() as group:
            for transport, unit in pair:
                group.create_task(exchange_at_random(transport, unit, liar, REPLIES // 2))


async def test_modbus_tcp() -> None:
    await behind_a_socket(TcpLiar(3), "tcp", TCP_REGISTERS)


@pytest.mark.parametrize("registers", [RTU_REGISTERS, TWO_FINGER_85.rtu], ids=["16", "23"])
async def test_a_serial_server(registers: RegisterMap) -> None:
    await behind_a_socket(ServerLiar(4), "rtu+tcp", registers)


async def behind_a_socket(liar: BehindASocket, scheme: str, registers: RegisterMap) -> None:
    server = await asyncio.get_running_loop().create_server(lambda: liar, "127.0.0.1", 0)
    address = parse_address(f"{scheme}://127.0.0.1:{server.sockets[0].getsockname()[1]}")
    transport = ModbusTransport(address, registers, connect_timeout=1.0, response_timeout=RESPONSE_S)
    await exchange_at_random(transport, registers.device_id, liar, REPLIES)
    server.close()
    await asyncio.sleep(1)
