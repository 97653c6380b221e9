"""The link to the gripper under test: keeps every exchange with its time, and cuts none off."""

from __future__ import annotations

import asyncio
import math
from collections import deque
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import Any, Final, TypeVar

from ...link import CyclicLink, Link
from ...runtime import wait_shielded
from ...values import Echo, Model, Registers, Request, RobotiqConnectionError, RobotiqStatus

T = TypeVar("T")

RECENT_EXCHANGES_S: Final = 2.0
"""Seconds that an image may take to act: ten times as long as a slow gripper takes."""


@dataclass(frozen=True, slots=True)
class RecordedExchange:
    """One exchange."""

    began: float  # the loop's time of sending
    ended: float  # when the answer came, or the failure
    kind: str  # "status", "command", "failure", or "probe" for a read in another place
    registers: Registers = ()  # the registers read or written; empty for a probe and for a failed read
    words: str = ""  # the failure, or the finding of a probe


class RecordedLink:
    """Reads and writes on one transport.

    A cancellation waits for the end of an exchange. One that was cut off would cost the connection, and the
    stop that follows would have to make a new one first.
    """

    def __init__(self, link: Link, keep: Callable[[RecordedExchange], None], model: Model) -> None:
        self.model = model  # of the gripper
        self.link = link
        self.written: Request | None = None  # the last image that was written; None before the first
        self.shown: RobotiqStatus | None = None  # the last status that was read; None before the first
        self.asked: float = 0.0  # the loop's time at which that read was sent
        self.wrote: float = -math.inf  # the loop's time at which the last write was sent
        self._keep = keep
        self._echoes: deque[tuple[float, Echo]] = deque(maxlen=2000)

    @property
    def is_open(self) -> bool:
        return self.link.is_open

    async def open(self) -> None:
        await self._whole(self.link.open())

    async def close(self) -> None:
        await self._whole(self.link.close())

    async def read(self) -> RobotiqStatus:
        loop = asyncio.get_running_loop()
        began = loop.time()
        try:
            registers = await self._whole(self.link.read())
        except RobotiqConnectionError as error:
            self._keep(RecordedExchange(began, loop.time(), "failure", words=str(error)))
            raise
        ended = loop.time()
        self._keep(RecordedExchange(began, ended, "status", registers))
        self.asked = began
        self.shown = RobotiqStatus.from_registers(
            registers, timestamp=ended, model=self.model, has_current=self.link.has_current
        )
        return self.shown

    async def write(self, request: Request) -> float:
        """Write an image, once; returns the loop's time of its acknowledgement."""
        await self._sent(request, self.link.send(lambda: request.registers))
        ended = asyncio.get_running_loop().time()
        self._keep(RecordedExchange(self.wrote, ended, "command", request.registers))
        return ended

    async def write_and_read(self, request: Request) -> bool:
        """Write an image with function 23, or 16 where 23 is refused; return whether 23 was answered."""
        assert isinstance(self.link, CyclicLink), "the link is a serial line"
        answer = await self._sent(request, self.link.send_and_read(lambda: request.registers))
        assert answer is not None, "there was an image to write"
        ended = asyncio.get_running_loop().time()
        self._keep(RecordedExchange(self.wrote, ended, "command", request.registers))
        self._keep(RecordedExchange(self.wrote, ended, "status", answer.registers))
        return answer.doubt is None and self.link.reads_with_writes

    async def _sent(self, request: Request, exchange: Coroutine[Any, Any, T]) -> T:
        loop = asyncio.get_running_loop()
        began = loop.time()
        # Before it is sent: a write that is cut off may have arrived.
        self.written = request
        self.wrote = began
        self._echoes.append((began, request.echo))
        try:
            return await self._whole(exchange)
        except RobotiqConnectionError as error:
            self._keep(RecordedExchange(began, loop.time(), "failure", request.registers, str(error)))
            raise

    def expect(self, echo: Echo) -> None:
        """Take this echo for the image in force."""
        self._echoes.clear()
        self._echoes.append((asyncio.get_running_loop().time(), echo))

    def expected(self) -> list[Echo]:
        """The echoes that the gripper may show now: the last image's, and those of the last seconds."""
        since = asyncio.get_running_loop().time() - RECENT_EXCHANGES_S
        while len(self._echoes) > 1 and self._echoes[1][0] < since:
            self._echoes.popleft()
        return [echo for _, echo in self._echoes]

    async def _whole(self, work: Coroutine[Any, Any, T]) -> T:
        """Finish the work; a cancellation is raised after it."""
        task = asyncio.ensure_future(work)
        try:
            await wait_shielded(task)
        except BaseException:
            if task.done() and not task.cancelled():
                task.exception()  # retrieved, or the loop complains
            raise
        return task.result()
