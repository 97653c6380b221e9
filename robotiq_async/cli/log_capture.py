"""What the library's log says while a command runs."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO


def forget(stream: TextIO) -> None:
    """Nobody reads this any more: let its last flush, at the interpreter's end, not fail over that."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


class _Teller(logging.Handler):
    """Tells messages."""

    def __init__(self, tell: Callable[[str], object]) -> None:
        super().__init__(logging.WARNING)
        self._tell = tell

    def emit(self, record: logging.LogRecord) -> None:
        try:
            self._tell(record.getMessage())
        except Exception:  # noqa: BLE001  # whoever listens must not hurt who speaks: the hand's own task
            self.handleError(record)


@contextmanager
def collected() -> Iterator[list[str]]:
    """Collect the library's warnings instead of printing them between the lines of the command."""
    messages: list[str] = []
    with told(messages.append):
        yield messages


@contextmanager
def told(tell: Callable[[str], object]) -> Iterator[None]:
    """Tell the library's warnings at once, and nowhere else while this lasts; those of foxglove-sdk too."""
    foxglove = logging.getLogger("foxglove")
    log, teller = logging.getLogger("robotiq_async"), _Teller(tell)
    others = [handler for handler in log.handlers if isinstance(handler, _Teller)]
    for other in others:
        log.removeHandler(other)
    log.addHandler(teller)
    foxglove.addHandler(teller)
    try:
        yield
    finally:
        foxglove.removeHandler(teller)
        log.removeHandler(teller)
        for other in others:
            log.addHandler(other)
