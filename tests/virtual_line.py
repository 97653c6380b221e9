"""A serial line for the virtual loop: what pyserial would open is made of memory."""

from __future__ import annotations

import asyncio
import itertools
import warnings
from typing import Any

import pytest
import serial
from pymodbus.transport.serialtransport import SerialTransport

from tests.virtual import MemoryFile, VirtualLoop

_NUMBERS = itertools.count(1)


class VirtualLine:
    """Serial ports and the cable between them, which can be pulled and put back.

    One port is at the near end, and any number at the far end, as several devices hang on RS-485.

    Attributes:
        near: The near port under a name that no other line has. A hand must be given this one: the process
            remembers by the address what the last hand has left on its way, also beyond the end of a test.
    """

    NEAR, FAR = "/dev/ttyNEAR", "/dev/ttyFAR"

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        self.near = f"{self.NEAR}{next(_NUMBERS)}"
        self._loop = loop
        self._ports: list[_Port] = []
        self._is_plugged = True
        # pyserial is below the code under test; pymodbus requests a port of it and gets one of ours.
        patch.setattr(serial, "serial_for_url", self._open)
        # On Windows pymodbus looks at its ports again and again: they cannot be watched there. Ours can.
        patch.setattr(SerialTransport, "force_poll", False)

    def pull(self) -> None:
        """Pull the near port out, as one pulls a USB adapter."""
        self._is_plugged = False
        for port in self._at(is_near=True):
            port.lose()

    def plug(self) -> None:
        """Put it back."""
        self._is_plugged = True

    def _open(self, url: str, **_: Any) -> _Port:
        is_near = url in (self.NEAR, self.near)
        if is_near and not self._is_plugged:
            raise serial.SerialException(2, f"could not open port {url}")
        port = _Port(self, url, is_near, self._loop)
        self._ports.append(port)
        return port

    def carry(self, is_from_near: bool, data: bytes) -> None:
        """Bring bytes to the other end, where it is open."""
        if self._is_plugged:
            for port in self._at(is_near=not is_from_near):
                port.arrive(data)

    def closed(self, port: _Port) -> None:
        if port in self._ports:
            self._ports.remove(port)

    def _at(self, *, is_near: bool) -> list[_Port]:
        return [port for port in self._ports if port.is_near is is_near]


class _Port(MemoryFile):
    """The part of serial.Serial that pymodbus uses."""

    def __init__(self, line: VirtualLine, url: str, is_near: bool, loop: VirtualLoop) -> None:
        super().__init__(loop)
        self.url = url
        self.is_near = is_near
        self.timeout = self.write_timeout = 0
        self._line = line
        self._is_closed = False

    def read(self, size: int) -> bytes:
        data = super().read(size)
        if not data and self._has_ended:
            raise serial.SerialException("device reports readiness to read but returned no data")
        return data

    def write(self, data: bytes) -> int:
        # The simulator's end takes the time that bytes take, both ways.
        self._loop.call_soon(self._line.carry, self.is_near, data)
        return len(data)

    def lose(self) -> None:
        self._line.closed(self)
        self.end()

    def close(self) -> None:
        self._line.closed(self)
        self._is_closed = True

    def __del__(self) -> None:
        if not self._is_closed:
            warnings.warn(f"unclosed port {self.url}", ResourceWarning, source=self, stacklevel=1)
