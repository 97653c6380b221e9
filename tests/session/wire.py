"""A transport without a network: a simulated gripper in the time of the loop, that fails when told to."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence

from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values.errors import ResponseTimeoutError, RobotiqConnectionError
from robotiq_async.values.registers import Registers
from robotiq_async.values.request import Request

EXCHANGE_S = 0.001
SILENCE_S = 0.4
"""How long a transport waits for an answer."""


class Wire:
    """The transport.

    Attributes:
        calls: what was asked of it, in order.
        failing: the calls that fail, and with what; until taken out.
        silent: the calls that are not answered.
        closing_s: how long it takes to close.
    """

    def __init__(self, speedup: float = 1.0) -> None:
        self.gripper = SimulatedGripper(asyncio.get_running_loop().time, speedup=speedup)
        self.is_open = False
        self.calls: list[str] = []
        self.failing: dict[str, RobotiqConnectionError] = {}
        self.silent: set[str] = set()
        self.closing_s = 0.0

    async def open(self) -> None:
        await self._carry("open")
        self.is_open = True

    async def read(self) -> Registers:
        await self._carry("read")
        return self.gripper.status_registers()

    async def send(self, decide: Callable[[], Sequence[int] | None]) -> bool:
        """What a link does beyond a transport object."""
        registers = decide()
        if registers is None:
            return False
        await self.write(registers)
        return True

    async def write(self, registers: Sequence[int]) -> None:
        await self._carry("write")
        self.gripper.write(0, registers)

    async def close(self) -> None:
        self.calls.append("close")
        self.is_open = False
        await asyncio.sleep(self.closing_s)

    async def _carry(self, what: str) -> None:
        self.calls.append(what)
        if what in self.silent:
            await asyncio.sleep(SILENCE_S)
            self.is_open = False
            raise ResponseTimeoutError("no answer")
        await asyncio.sleep(EXCHANGE_S)
        if what in self.failing:
            self.is_open = False
            raise self.failing[what]

    async def activate(self) -> None:
        """Leave the gripper active, as another client would."""
        self.gripper.write(0, Request(activate=True).registers)
        await asyncio.sleep(10)
