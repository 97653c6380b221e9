"""Ways without a network: a simulated gripper that hears, and one that does not follow at first."""

from __future__ import annotations

import asyncio
import math
import struct
from collections.abc import Callable, Sequence
from typing import Any

from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values.errors import (
    ConnectFailedError,
    ConnectionLostError,
    ResponseTimeoutError,
)
from robotiq_async.values.registers import REGISTER_COUNT, Registers, gPR
from robotiq_async.values.request import Request

EXCHANGE_S = 0.001
SILENCE_S = 0.4
"""Seconds that a transport waits for an answer."""
DEVICE_CYCLE_S = 0.005
"""Seconds until a write acts on a simulated gripper."""
WRITE, WRITE_AND_READ = 16, 23
"""Functions; the second is refused."""
LOST = ConnectionLostError("unplugged")


class Exchanging:
    """A tunnel made of reads and writes of whole blocks. It refuses function 23.

    A read of more or fewer registers than a poll has is answered with zeros: nothing that the gripper shows
    is spent on bringing a link in step.
    """

    count = REGISTER_COUNT
    """Registers of a poll, and of a write."""

    async def read(self) -> Registers:
        raise NotImplementedError

    async def write(self, registers: Sequence[int]) -> None:
        raise NotImplementedError

    async def probe(self) -> None:
        """A read of another length."""

    async def exchange(self, pdu: bytes) -> bytes:
        if pdu[0] == WRITE_AND_READ:
            return bytes((WRITE_AND_READ | 0x80, 1))
        count = int.from_bytes(pdu[3:5], "big")
        if pdu[0] == WRITE:
            image = struct.unpack_from(f">{count}H", pdu, 6)
            await self.write((*image, *(0,) * (REGISTER_COUNT - count)))
            return pdu[:5]
        words: Registers = (0,) * count
        if count == self.count:
            words = (await self.read())[:count]
        else:
            await self.probe()
        return struct.pack(f">BB{count}H", pdu[0], 2 * count, *words)


class Wire(Exchanging):
    """A gripper in the time of the loop; the transport fails on demand.

    Attributes:
        calls: of it, in order.
        written: the images that have reached the gripper.
        failing: the calls that fail, and with what; until taken out.
        silent: the calls that are not answered.
        exchange_s: how long each exchange takes.
        closing_s: how long it takes to close.
    """

    exchange_s = EXCHANGE_S
    has_current = True

    def __init__(self, speedup: float = 1.0, **options: Any) -> None:
        time = asyncio.get_running_loop().time
        self.gripper = SimulatedGripper(time, spread=False, speedup=speedup, **options)
        self.count = self.gripper.model.rtu.count
        self.is_open = False
        self.asked_at = -math.inf
        self.calls: list[str] = []
        self.written: list[Request] = []
        self.failing: dict[str, Exception] = {}
        self.silent: set[str] = set()
        self.closing_s = 0.0

    async def open(self) -> None:
        await self._carry("open")
        self.is_open = True

    async def read(self) -> Registers:
        await self._carry("read")
        return self.shown()

    async def probe(self) -> None:
        await self._carry("read")

    async def send(self, decide: Callable[[], Sequence[int] | None]) -> bool:
        registers = decide()
        if registers is None:
            return False
        await self.write(registers)
        return True

    async def write(self, registers: Sequence[int]) -> None:
        await self._carry("write")
        self.written.append(Request.from_registers(registers))
        self.take(tuple(registers))

    async def close(self) -> None:
        self.calls.append("close")
        self.is_open = False
        if self.closing_s:
            await asyncio.sleep(self.closing_s)

    async def _carry(self, what: str) -> None:
        self.calls.append(what)
        self.asked_at = asyncio.get_running_loop().time()
        if what in self.silent:
            await asyncio.sleep(SILENCE_S)
            self.is_open = False
            raise ResponseTimeoutError("no answer")
        await asyncio.sleep(self.exchange_s)
        if what in self.failing:
            self.is_open = False
            raise self.failing[what]

    def shown(self) -> Registers:
        """The status of the gripper."""
        return self.gripper.status_registers()

    def take(self, registers: Registers) -> None:
        """The gripper gets an image."""
        self.gripper.write(0, registers)

    def pull(self) -> None:
        """Pull the cable out."""
        self.failing = {"open": ConnectFailedError("wire", "unplugged"), "read": LOST, "write": LOST}

    def plug(self) -> None:
        self.failing.clear()

    async def activate(self) -> None:
        """Leave the gripper active, as another client would."""
        self.gripper.write(0, Request(activate=True).registers)
        await asyncio.sleep(10)

    @property
    def now(self) -> float:
        return asyncio.get_running_loop().time()


class Asleep(Wire):
    """The first images on a new connection are echoed, and move nothing.

    ``shows`` is the gDT of an axis that does not follow; None for the one it had.
    """

    def __init__(self, images: float = 1, shows: int | None = None) -> None:
        super().__init__()
        self._images = images
        self._shows = shows
        self._left = images
        self._swallowed: Registers | None = None
        self._follows_at = math.inf

    async def open(self) -> None:
        await super().open()
        self._left, self._swallowed = self._images, None

    def take(self, registers: Registers) -> None:
        if not Request.from_registers(registers).go or self._left <= 0:
            if self._swallowed is not None:
                self._follows_at = self.now + DEVICE_CYCLE_S  # until then it echoes what it has swallowed
            super().take(registers)
            return
        self._left -= 1
        self._swallowed, self._follows_at = registers, math.inf

    def shown(self) -> Registers:
        words = list(super().shown())
        if self.now >= self._follows_at:
            self._swallowed = None
        if self._swallowed is None:
            return tuple(words)
        image = Request.from_registers(self._swallowed)
        words[0] |= image.go << 11
        for axis, field in zip(image.axes, gPR, strict=True):
            field.write(words, axis.position)
        if self._shows is not None:
            words[0] = words[0] & 0x3F00 | self._shows * 0x55
        return tuple(words)
