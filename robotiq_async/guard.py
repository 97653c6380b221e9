"""Holds a transport that somebody else has written to what a hand relies on."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Sequence
from typing import TypeVar

import anyio

from .errors import (
    ConnectFailedError,
    ConnectionLostError,
    ProtocolError,
    ResponseTimeoutError,
    RobotiqConnectionError,
)
from .link import Transport
from .log import log
from .registers import Registers, check_registers

T = TypeVar("T")


class GuardedTransport:
    """Bounds every call in time, lets no foreign exception through, and closes after a failure."""

    def __init__(
        self, inner: Transport, name: str, *, connect_timeout: float, response_timeout: float
    ) -> None:
        """Wrap a transport.

        Args:
            inner: the transport.
            name: how messages call it.
            connect_timeout: seconds for opening it.
            response_timeout: seconds for a read or a write.
        """
        self._inner = inner
        self._is_open = False
        self._name = name
        self._connect_timeout = connect_timeout
        self._response_timeout = response_timeout

    @property
    def is_open(self) -> bool:
        """Whether requests can be sent."""
        return self._is_open and self._inner.is_open

    async def open(self) -> None:
        """Connect.

        Raises:
            RobotiqConnectionError: that failed, or took too long.
        """
        try:
            await self._bounded(self._inner.open(), self._connect_timeout)
        except (ResponseTimeoutError, ConnectionLostError) as error:
            raise ConnectFailedError(self._name, str(error)) from error
        self._is_open = True

    async def read(self) -> Registers:
        """The eight status registers.

        Raises:
            RobotiqConnectionError: that failed or took too long, or what came is not eight registers.
        """
        registers = await self._bounded(self._inner.read(), self._response_timeout)
        try:
            return check_registers(registers)
        except (TypeError, ValueError) as error:
            await self.close()
            raise ProtocolError(f"{self._name}: {error}") from error

    async def write(self, registers: Sequence[int]) -> None:
        """Write the eight request registers.

        Raises:
            RobotiqConnectionError: that failed, or took too long.
        """
        await self._bounded(self._inner.write(registers), self._response_timeout)

    async def close(self) -> None:
        """Disconnect; never fails."""
        # Whatever becomes of this, what comes later from the old connection is no answer to a new request.
        self._is_open = False
        try:
            with anyio.CancelScope(shield=True):
                async with asyncio.timeout(self._response_timeout):
                    await self._inner.close()
        except Exception as error:  # noqa: BLE001  # there is nothing left to do about it
            log.warning("%s did not close: %r", self._name, error)

    async def _bounded(self, call: Awaitable[T], seconds: float) -> T:
        limit = asyncio.timeout(seconds)
        try:
            async with limit:
                return await call
        except RobotiqConnectionError:
            raise
        except Exception as error:
            await self.close()
            if limit.expired():
                raise ResponseTimeoutError(f"{self._name} did not answer within {seconds:g} s") from None
            raise ConnectionLostError(f"{self._name}: {error!r}") from error
        except asyncio.CancelledError:
            # In the middle of an exchange: its answer must not become that of another one.
            await self.close()
            raise
