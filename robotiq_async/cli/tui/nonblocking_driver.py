"""A driver for textual that never blocks on the terminal.

Textual's own driver waits when its output thread falls behind. A terminal that has stopped reading (a stalled
ssh, a closed window) would block the event loop that polls the gripper, and the stop of the fingers.
"""

from __future__ import annotations

import contextlib
import queue
import threading
from typing import Any, Final

from textual.app import App
from textual.drivers.linux_driver import LinuxDriver

from ...runtime import write_all

TERMINAL_BACKLOG: Final = 30
"""Writes queued for the terminal; further ones are dropped."""
CLOSING_S: Final = 0.5
"""Seconds for which closing waits for the terminal."""


class NonblockingDriver(LinuxDriver):
    """Drops output that the terminal does not take."""

    def __init__(
        self,
        app: App[Any],
        *,
        debug: bool = False,
        mouse: bool = True,
        size: tuple[int, int] | None = None,
    ) -> None:
        super().__init__(app, debug=debug, mouse=mouse, size=size)
        self.is_behind = False  # output was dropped; repaint the screen when it has_caught_up()
        self._waiting: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="robotiq_async screen", daemon=True)

    @property
    def has_caught_up(self) -> bool:
        """Whether the queue is empty."""
        return self._waiting.empty()

    def paint_again(self) -> None:
        """Note that the whole screen is painted again."""
        self.is_behind = False

    def write(self, data: str) -> None:
        """Queue output for the terminal."""
        if not self._thread.is_alive() and self._thread.ident is None:
            self._thread.start()
        if self._waiting.qsize() >= TERMINAL_BACKLOG:
            self.is_behind = True
        else:
            self._waiting.put(data.encode())

    def close(self) -> None:
        """Write the queued output, if the terminal takes it."""
        super().close()  # its thread is idle and ends at once
        self._waiting.put(None)
        if self._thread.is_alive():
            self._thread.join(CLOSING_S)

    def _run(self) -> None:
        assert self._file is not None
        terminal = self._file.fileno()
        with contextlib.suppress(OSError):  # the terminal has gone
            while (data := self._waiting.get()) is not None:
                write_all(terminal, data)
