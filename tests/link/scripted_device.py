"""A device at the far end of a serial line, scripted frame by frame, and what can happen to its replies."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable

import serial

from robotiq_async import RobotiqConnectionError
from robotiq_async.link.address import parse_address
from robotiq_async.link.modbus import ModbusTransport
from robotiq_async.values.registers import RTU_REGISTERS, RegisterMap
from tests.serial_line import with_crc


def request_size(inbox: bytes) -> int:
    """Bytes of the first request in eight bytes or more: at the least, while they do not suffice."""
    counts_at = {16: 6, 23: 10}.get(inbox[1])
    if counts_at is None:
        return 8
    return counts_at + 3 + inbox[counts_at] if len(inbox) > counts_at else counts_at + 3


class Device:
    """Answers reads with the number of the request in every register; replies can be kept back."""

    def __init__(self, port: serial.Serial) -> None:
        self._port = port
        self.requests: list[bytes] = []
        self.asked_at = 0.0
        self.keep = 0
        """Replies to be kept back from here on."""
        self.kept: list[bytes] = []
        self.spoil: Callable[[bytes], bytes] | None = None
        """A change of the next reply; of every one, if :attr:`spoils_all`."""
        self.loses = 0
        """Requests that are lost from here on."""
        self.late: dict[int, float] = {}
        """Delay in seconds of answers, by unit id; beyond all time-outs: silent."""
        self.least_pause = 0.0
        """Requests that come sooner than this after a reply are not heard."""
        self.most = 8
        """A read of more registers than this gets no answer."""
        self.has_23 = True
        """Whether function 23 is served."""
        self.refuses = False
        """Whether a function that is not served gets an exception; else it gets no answer."""
        self.echoes = False
        """Whether the line echoes the bytes that are sent."""
        self._answered_at = 0.0
        self.spoils_all = False
        self._inbox = b""
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(port.fileno(), self._ready)

    def send(self, data: bytes) -> None:
        """Put bytes on the line."""
        self._port.write(data)

    def close(self) -> None:
        self._loop.remove_reader(self._port.fileno())
        self._port.close()

    def _ready(self) -> None:
        self._inbox += self._port.read(4096)
        while len(self._inbox) >= 8:
            size = request_size(self._inbox)
            if len(self._inbox) < size:
                return
            request, self._inbox = self._inbox[:size], self._inbox[size:]
            pause = self._loop.time() - self._answered_at
            self.requests.append(request)
            self.asked_at = self._loop.time()
            if self.echoes:
                self.send(request)
            if self.loses:
                self.loses -= 1
                continue
            if (late := self.late.get(request[0])) is not None:
                self._loop.call_later(late, self.send, self._reply(request))
                continue
            if request[1] == 23 and not self.has_23:
                if self.refuses:
                    self.send(with_crc(bytes((9, 0x80 | 23, 1))))
                continue
            if pause < self.least_pause or (request[1] == 3 and request[5] > self.most):
                continue
            reply = self._reply(request)
            if self.spoil is not None:
                reply = self.spoil(reply)
                self.spoil = self.spoil if self.spoils_all else None
            if self.keep:
                self.keep -= 1
                self.kept.append(reply)
            else:
                # A serial device answers in order: what was late comes first.
                kept, self.kept = self.kept, []
                self.send(b"".join(kept) + reply)
                self._answered_at = self._loop.time()

    def _reply(self, request: bytes) -> bytes:
        if request[1] == 16:
            return with_crc(request[:6])
        count = int.from_bytes(request[4:6], "big")
        return with_crc(
            bytes((request[0], request[1], 2 * count)) + len(self.requests).to_bytes(2, "big") * count
        )


def unopened(
    device: str, registers: RegisterMap = RTU_REGISTERS, *, shares_line: bool = False
) -> ModbusTransport:
    address = parse_address(f"rtu://{device}")
    return ModbusTransport(
        address, registers, connect_timeout=1.0, response_timeout=0.05, shares_line=shares_line
    )


async def reopened(transport: ModbusTransport) -> int:
    """Open again until it works; returns the failures before."""
    for failures in range(10):
        with contextlib.suppress(RobotiqConnectionError):
            await transport.open()
            return failures
    raise AssertionError("never in step again")


def wrong_checksum(reply: bytes) -> bytes:
    return reply[:-1] + bytes((reply[-1] ^ 1,))


SPOILT = {
    "lost": lambda reply: reply[:0],
    "wrong checksum": wrong_checksum,
    "first byte": lambda reply: bytes((reply[0] ^ 4,)) + reply[1:],
    "byte count": lambda reply: reply[:2] + bytes((reply[2] ^ 1,)) + reply[3:],
    "last byte lost": lambda reply: reply[:-1],
    "first byte lost": lambda reply: reply[1:],
    "all but one byte lost": lambda reply: reply[:1],
}
