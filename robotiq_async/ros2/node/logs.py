"""Forwards the library's log to that of the node."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager

from rclpy.impl.rcutils_logger import RcutilsLogger

LOGGERS = {"robotiq_async": logging.INFO, "asyncio": logging.WARNING}
"""Forwarded loggers, with the lowest level."""


class NodeHandler(logging.Handler):
    """Forwards records to the logger of a node."""

    def __init__(self, logger: RcutilsLogger) -> None:
        super().__init__()
        self._logger = logger

    def emit(self, record: logging.LogRecord) -> None:
        text = self.format(record)
        # A call for each level: ROS's logger permits only one level for each line that calls it.
        if record.levelno >= logging.CRITICAL:
            self._logger.fatal(text)
        elif record.levelno >= logging.ERROR:
            self._logger.error(text)
        elif record.levelno >= logging.WARNING:
            self._logger.warning(text)
        elif record.levelno >= logging.INFO:
            self._logger.info(text)
        else:
            self._logger.debug(text)


@contextmanager
def forwarded_to(logger: RcutilsLogger) -> Iterator[None]:
    """Forward the records of :data:`LOGGERS` to a logger of ROS during a block."""
    handler = NodeHandler(logger)
    for name, level in LOGGERS.items():
        source = logging.getLogger(name)
        source.addHandler(handler)
        source.setLevel(level)
        source.propagate = False
    try:
        yield
    finally:
        for name in LOGGERS:
            logging.getLogger(name).removeHandler(handler)
