"""The library's log while a command runs."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO


def forget(stream: TextIO) -> None:
    """Redirect a stream that nobody reads any more to the null device: its last flush must not fail."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


class _Forwarder(logging.Handler):
    """Calls a function with the message of each record."""

    def __init__(self, to: Callable[[str], object], of: str) -> None:
        super().__init__(logging.WARNING)
        self._to = to
        self._known = f"{of}: "

    def emit(self, record: logging.LogRecord) -> None:
        try:
            self._to(record.getMessage().removeprefix(self._known))
        except Exception:  # noqa: BLE001  # it is called in the hand's own task, which must not end
            self.handleError(record)


@contextmanager
def collected_warnings() -> Iterator[list[str]]:
    """Collect the library's warnings, to be printed when the command has ended."""
    messages: list[str] = []
    with forwarded_warnings(messages.append):
        yield messages


@contextmanager
def forwarded_warnings(to: Callable[[str], object], *, of: str = "") -> Iterator[None]:
    """Forward the library's warnings, and those of foxglove-sdk, to a function, and to no outer one.

    Args:
        to: the function.
        of: the name of the one hand that is shown there: it need not be said with every warning.
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
