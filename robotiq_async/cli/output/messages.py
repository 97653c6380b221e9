"""Messages of a command beside its output, among them the library's warnings."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

from ...runtime import printable


def forget(stream: TextIO) -> None:
    """Redirect a stream without a reader to the null device: its last flush must not fail."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


class _Forwarder(logging.Handler):
    def __init__(self, to: Callable[[str], object], of: str) -> None:
        super().__init__(logging.WARNING)
        self._to = to
        self._known = f"{of}: "

    def emit(self, record: logging.LogRecord) -> None:
        try:
            self._to(record.getMessage().removeprefix(self._known))
        except Exception:  # noqa: BLE001  # it runs in the hand's own task, which must not end
            self.handleError(record)


@contextmanager
def forwarded_warnings(to: Callable[[str], object], *, of: str = "") -> Iterator[None]:
    """Forward warnings of the library and of foxglove-sdk to a function, and not to outer ones.

    ``of`` is the name of the only hand there, which is then left out of the warnings.
    """
    foxglove = logging.getLogger("foxglove")
    log, forwarder = logging.getLogger("robotiq_async"), _Forwarder(to, of)
    others = [handler for handler in log.handlers if isinstance(handler, _Forwarder)]
    for other in others:
        log.removeHandler(other)
    log.addHandler(forwarder)
    foxglove.addHandler(forwarder)
    try:
        yield
    finally:
        foxglove.removeHandler(forwarder)
        log.removeHandler(forwarder)
        for other in others:
            log.addHandler(other)


def tell(words: str) -> None:
    """Print a line on stderr. Makes text of clients and agents printable."""
    print("robotiq-async:", printable(words), file=sys.stderr, flush=True)
