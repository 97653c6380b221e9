"""Makes a transport object of an application keep the promises that a hand relies on."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from typing import TypeVar

import anyio

from ..runtime.concurrency import LateError
from ..runtime.log import Log, log
from ..values.errors import (
    ConnectFailedError,
    ConnectionLostError,
    ProtocolError,
    ResponseTimeoutError,
    RobotiqConnectionError,
)
from ..values.registers import Registers, check_registers
from .transport import Transport
from .worker import Worker

T = TypeVar("T")


class GuardedTransport:
    """Limits the time of every call, converts foreign exceptions, and closes after a failure."""

    has_current = True

    def __init__(
        self, inner: Transport, name: str, *, connect_timeout: float, response_timeout: float, log: Log = log
    ) -> None:
        self._log = log
        self._inner = inner
        self._is_open = False
        self._name = name
        self._connect_timeout = connect_timeout
        self._response_timeout = response_timeout
        self._worker = Worker("robotiq_async transport")
        self._is_begun = False  # whether open() was called without a close() since

    @property
    def is_open(self) -> bool:
        try:
            return self._is_open and bool(self._inner.is_open)
        except Exception as error:  # noqa: BLE001  # treated as not open
            self._log.warning("is_open of the transport raised %r", error)
            return False

    async def open(self) -> None:
        self._drop()
        try:
            await self._bounded(self._open_inner, self._connect_timeout)
        except (ResponseTimeoutError, ConnectionLostError) as error:
            raise ConnectFailedError(self._name, str(error)) from error
        self._is_open = True

    async def read(self) -> Registers:
        """The eight status registers.

        Raises:
            RobotiqConnectionError: the call failed, took too long, or did not return eight registers.
        """
        registers = await self._bounded(self._inner.read, self._response_timeout)
        try:
            return check_registers(registers)
        except Exception as error:  # the result may be any iterable
            self._drop()
            raise ProtocolError(f"{self._name}: {error}") from error

    async def send(self, decide: Callable[[], Sequence[int] | None]) -> bool:
        """Write what ``decide`` returns, if anything. The worker's task calls it just before the write.

        Raises:
            RobotiqConnectionError: the call failed or took too long.
        """

        async def write() -> bool:
            registers = decide()
            if registers is None:
                return False
            await self._inner.write(registers)
            return True

        return await self._bounded(write, self._response_timeout)

    async def close(self) -> None:
        self._drop()
        with anyio.CancelScope(shield=True):
            if not await self._worker.ended(self._response_timeout):
                self._log.warning("transport abandoned: its last call did not return")

    def _drop(self) -> None:
        """Close it after its present call. Only the next open() waits for that."""
        # Replies that this connection still delivers must not answer a new request.
        self._is_open = False
        if self._is_begun:
            self._is_begun = False
            self._worker.end(self._close_inner)

    async def _open_inner(self) -> None:
        self._is_begun = True
        await self._inner.open()

    async def _close_inner(self) -> None:
        try:
            async with asyncio.timeout(self._response_timeout):
                await self._inner.close()
        except Exception as error:  # noqa: BLE001  # nothing is left to do
            self._log.warning("the transport did not close: %r", error)

    async def _bounded(self, call: Callable[[], Awaitable[T]], seconds: float) -> T:
        try:
            return await self._worker.call(call, seconds)
        except RobotiqConnectionError:
            self._drop()
            raise
        except LateError as error:
            self._drop()
            raise ResponseTimeoutError(f"{self._name} did not answer {error}") from None
        except Exception as error:
            self._drop()
            raise ConnectionLostError(f"{self._name}: {error!r}") from error
        except asyncio.CancelledError:
            # Cancelled in the middle of an exchange: its answer must not become that of another one.
            self._drop()
            raise
