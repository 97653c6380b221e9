"""The library's log in that of the node."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager

from rclpy.impl.rcutils_logger import RcutilsLogger

LOGGERS = {"robotiq_async": logging.INFO, "asyncio": logging.WARNING}
"""Whose records are handed on, from which level."""


class NodeHandler(logging.Handler):
    """Hands records to the logger of a node."""

    def __init__(self, logger: RcutilsLogger) -> None:
        super().__init__()
        self._logger = logger

    def emit(self, record: logging.LogRecord) -> None:
        """Hand a record on."""
        text = self.format(record)
        # A line for each level: ROS's logger remembers the level of the line it is called from.
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
def handed_to(logger: RcutilsLogger) -> Iterator[None]:
    """Hand the records of :data:`LOGGERS` to a logger of ROS meanwhile."""
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
