"""A person at a terminal: questions answered by one key, and keys that stop the fingers.

While no question is open, every key counts as a stop, from the last answer on. So the terminal passes on each
key at once, also keys that would suspend or quit the program or hold up its output: a suspended program stops
no fingers. Ctrl-C works as everywhere else. Linux and macOS.
"""

from __future__ import annotations

import asyncio
import os
import shutil
import sys
import textwrap
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Final, Self

from ..runtime import in_a_thread

ENTER: Final = "\n"
END: Final = "q"
PROMPT: Final = "> "
WIDEST: Final = 100
"""Maximum width of a line in columns."""
AGREE: Final = "Enter continues; any other key ends with the report so far."


def has_terminal() -> bool:
    """Whether a person can answer questions and stop the fingers."""
    streams = (sys.stdin, sys.stdout)
    with suppress(ImportError):  # Windows has no such terminal
        import termios  # noqa: F401

        return all(stream is not None and stream.isatty() for stream in streams)
    return False


def wrapped(text: str, columns: int | None = None) -> str:
    """Wrap text for the terminal, keeping the indentation of each line."""
    width = min(WIDEST, columns or shutil.get_terminal_size().columns) - 1
    lines = []
    for line in text.splitlines():
        indent = " " * (len(line) - len(line.lstrip()) + (2 if line.startswith(" ") else 0))
        lines += textwrap.wrap(line, width, subsequent_indent=indent, break_on_hyphens=False) or [""]
    return "\n".join(lines)


class Keyboard:
    """A :class:`~robotiq_async.tools.verify.Person`; use it as a context manager, in a running loop."""

    def __init__(self) -> None:
        self._file = sys.stdin.fileno()
        self._before: list[Any] = []
        self._is_gone = False
        self._was_pressed = False
        self._answer: asyncio.Future[str] | None = None
        self._loop: asyncio.AbstractEventLoop

    def __enter__(self) -> Self:
        import termios

        self._loop = asyncio.get_running_loop()
        self._before = termios.tcgetattr(self._file)
        raw = termios.tcgetattr(self._file)
        raw[0] &= ~termios.IXON
        raw[3] &= ~(termios.ICANON | termios.ECHO)
        for name in ("VSUSP", "VQUIT", "VDSUSP", "VSTOP", "VSTART"):
            if hasattr(termios, name):
                raw[6][getattr(termios, name)] = b"\0"
        raw[6][termios.VMIN], raw[6][termios.VTIME] = 1, 0
        termios.tcsetattr(self._file, termios.TCSANOW, raw)
        self._loop.add_reader(self._file, self._read)
        return self

    def __exit__(self, *_: object) -> None:
        import termios

        self._loop.remove_reader(self._file)
        with suppress(termios.error, OSError):  # the terminal is gone
            termios.tcsetattr(self._file, termios.TCSADRAIN, self._before)

    @property
    def has_stopped(self) -> bool:
        """Whether a key was pressed since the last answer, or the terminal has gone."""
        return self._was_pressed or self._is_gone

    def tell(self, words: str) -> None:
        """Print. Notices if the terminal has gone."""
        self._print(f"{wrapped(words)}\n")

    def _print(self, text: str) -> None:
        try:
            print(text, end="", flush=True)
        except OSError:
            self._is_gone = True

    def alarm(self, words: str) -> None:
        """Print from a thread: a terminal that does not read must not block the loop."""
        text = f"\n\a{words}\n".encode()
        in_a_thread(lambda: os.write(sys.stderr.fileno(), text))

    async def consents(self, words: str) -> bool:
        """Ask; only Enter agrees."""
        self.tell(f"\n{words}\n{AGREE}")
        return await self._key() == ENTER

    async def chooses(self, question: str, answers: Mapping[str, str]) -> str | None:
        """Ask for one of some keys; ``q`` ends."""
        names = {key: "Enter" if key == ENTER else key for key in answers}
        choice = "\n".join(f"  {names[key]}: {meaning}" for key, meaning in answers.items())
        self.tell(f"\n{question}\n{choice}\n  {END}: end with the report so far")
        while True:
            key = await self._key()
            if key in answers:
                return key
            if key in (END, ""):
                return None
            self.tell(f"Please press one of {', '.join([*names.values(), END])}.")

    async def _key(self) -> str:
        import termios

        with suppress(termios.error):
            termios.tcflush(self._file, termios.TCIFLUSH)
        self._print(PROMPT)  # after the flush: keys count from now on
        if self._is_gone:
            return ""
        self._answer = self._loop.create_future()
        try:
            return await self._answer
        finally:
            self._answer = None
            self._print("\n")

    def _read(self) -> None:
        try:
            data = os.read(self._file, 1024)
        except OSError:
            data = b""
        keys = data.decode(errors="replace").lower().replace("\r", ENTER)
        if not data:
            self._is_gone = True
            self._loop.remove_reader(self._file)
        if self._answer is not None and not self._answer.done():
            self._was_pressed = len(keys) > 1
            self._answer.set_result(keys[:1])
        elif keys:
            self._was_pressed = True
