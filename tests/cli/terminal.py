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
from typing import ClassVar

from tests.forked import CAN_FORK, ROOT, fork
from tests.patience import patience

SIZE = struct.pack("HHHH", 30, 100, 0, 0)
"""Lines and columns."""


class Terminal:
    """Python on a terminal of its own (Linux, macOS)."""

    running: ClassVar[set[int]] = set()

    def __init__(self, *arguments: str) -> None:
        self.out = b""
        environment = os.environ | {"TERM": "xterm-256color", "PYTHONPATH": str(ROOT)}
        if CAN_FORK:
            self._fd, there = pty.openpty()
            fcntl.ioctl(there, termios.TIOCSWINSZ, SIZE)
            self._process = fork(arguments, environment, [there] * 3, terminal=True)
            os.close(there)
        else:
            self._process, self._fd = pty.fork()
            if self._process == 0:
                fcntl.ioctl(0, termios.TIOCSWINSZ, SIZE)
                os.execve(sys.executable, [sys.executable, *arguments], environment)
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
