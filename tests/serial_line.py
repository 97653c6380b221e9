"""A serial line of two pseudo-terminals, with a person's hand on the cable; the checksum of its frames."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
from pathlib import Path
from types import TracebackType
from typing import Self

import pytest

if sys.platform != "win32":
    import pty
    import tty


def with_crc(frame: bytes) -> bytes:
    """The frame and its CRC-16/MODBUS, low byte first."""
    crc = 0xFFFF
    for byte in frame:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return frame + crc.to_bytes(2, "little")


class SerialLine:
    """Ports joined by a cable: what goes in at the near one comes out at the far ones, and the other way.

    The near port has a name of its own (a link in a folder), so that it can be pulled and put back. There is
    a far port for each device, as several hang on RS-485.
    """

    def __init__(self, folder: Path, devices: int = 1) -> None:
        if sys.platform == "win32":
            pytest.skip("Windows has no pseudo terminals")
        self.near = folder / "ttyNEAR"
        self.held: list[bytes] | None = None
        """Bytes on their way to the near end, while they are held back."""
        self._loop = asyncio.get_running_loop()
        self._near_master = -1
        self._near_slave = -1
        self._far = [self._pair() for _ in range(devices)]
        self.fars = [os.ttyname(slave) for _, slave in self._far]
        self.far = self.fars[0]
        for master, _ in self._far:
            self._loop.add_reader(master, self._from_far, master)

    def __enter__(self) -> Self:
        self.plug()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.pull()
        for master, slave in self._far:
            self._loop.remove_reader(master)
            os.close(master)
            os.close(slave)

    def plug(self) -> None:
        """Put the near port in place."""
        self._near_master, self._near_slave = self._pair()
        self.near.symlink_to(os.ttyname(self._near_slave))
        self._loop.add_reader(self._near_master, self._from_near)

    def pull(self) -> None:
        """Pull the near port out."""
        if self._near_master < 0:
            return
        self._loop.remove_reader(self._near_master)
        self.near.unlink()
        for descriptor in (self._near_master, self._near_slave):
            os.close(descriptor)
        self._near_master = -1

    def let_go(self) -> None:
        """Deliver what was held back."""
        held, self.held = self.held or [], None
        for data in held:
            self._to_near(data)

    @staticmethod
    def _pair() -> tuple[int, int]:
        master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        return master, slave

    def _from_near(self) -> None:
        with contextlib.suppress(OSError):
            data = os.read(self._near_master, 4096)
            for master, _ in self._far:
                os.write(master, data)

    def _from_far(self, master: int) -> None:
        with contextlib.suppress(OSError):
            data = os.read(master, 4096)
            if self.held is not None:
                self.held.append(data)
            else:
                self._to_near(data)

    def _to_near(self, data: bytes) -> None:
        if self._near_master >= 0:
            with contextlib.suppress(OSError):
                os.write(self._near_master, data)
