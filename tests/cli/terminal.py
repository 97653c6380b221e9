"""A terminal for commands, and a person who types."""

from __future__ import annotations

import asyncio
import fcntl
import os
import pty
import signal
import struct
import sys
import termios
from pathlib import Path
from typing import ClassVar

from tests.patience import patience

ROOT = Path(__file__).parents[2]


class Terminal:
    """Python on a terminal of its own (Linux, macOS)."""

    running: ClassVar[set[int]] = set()

    def __init__(self, *arguments: str) -> None:
        self.out = b""
        self._process, self._fd = pty.fork()
        if self._process == 0:
            fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 0, 0))
            os.environ |= {"TERM": "xterm-256color", "PYTHONPATH": str(ROOT)}
            os.execv(sys.executable, [sys.executable, *arguments])
        self.running.add(self._process)
        asyncio.get_running_loop().add_reader(self._fd, self._read)
        self._read_something = asyncio.Event()

    def _read(self) -> None:
        try:
            self.out += os.read(self._fd, 65536)
        except OSError:  # the command has ended
            asyncio.get_running_loop().remove_reader(self._fd)
        self._read_something.set()

    async def shows(self, words: bytes, after: bytes = b"") -> None:
        async with asyncio.timeout(patience(30)):
            while words not in self.out[self.out.find(after) :]:
                self._read_something.clear()
                await self._read_something.wait()

    def press(self, keys: str) -> None:
        os.write(self._fd, os.fsencode(keys))

    def kill(self, number: signal.Signals) -> None:
        os.kill(self._process, number)

    def stop_reading(self) -> None:
        asyncio.get_running_loop().remove_reader(self._fd)

    def read_on(self) -> None:
        asyncio.get_running_loop().add_reader(self._fd, self._read)

    def hang_up(self) -> None:
        asyncio.get_running_loop().remove_reader(self._fd)
        os.close(self._fd)

    async def end(self) -> int:
        async with asyncio.timeout(patience(30)):
            return await asyncio.to_thread(self._wait)

    def _wait(self) -> int:
        _, status = os.waitpid(self._process, 0)
        self.running.discard(self._process)
        return os.waitstatus_to_exitcode(status)
