"""The process of the node: the event loop in the main thread, ROS's executor in a second one.

It ends in this order: the hand stops, results are sent, also if clients request them a little later, the
executor ends, then the node, then ROS.
"""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Final

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.signals import SignalHandlerOptions

from ...runtime import ending_signals, log
from .bridge import Bridge
from .gripper_node import GripperNode

ANSWERS_S: Final = 2.0  # seconds to answer the aborted goals: milliseconds, unless the executor hangs
LINGER_S: Final = 0.1  # seconds for sent messages to leave: of services ROS does not report when they have
JOIN_S: Final = 2.0  # seconds for the executor to shut down, and for its thread to end
MOST_FAILURES: Final = 20  # failing callbacks per second: with more, the executor itself is broken


class Spinner(threading.Thread):
    """Runs an executor. An error in a callback of ROS itself is logged and does not end it.

    ``died`` is called, in this thread, if it cannot continue.
    """

    def __init__(self, executor: SingleThreadedExecutor, died: Callable[[BaseException], object]) -> None:
        super().__init__(name="robotiq_async executor", daemon=True)
        self._executor = executor
        self._died = died
        self._is_ending = threading.Event()

    def run(self) -> None:
        failures: list[float] = []
        while not self._is_ending.is_set():
            try:
                self._executor.spin_once()
            except BaseException as error:  # noqa: BLE001  # if the thread ended unnoticed, no halt would get through
                if self._is_ending.is_set():
                    return
                moment = time.monotonic()
                failures = [*(each for each in failures if moment - each < 1.0), moment]
                is_broken = len(failures) > MOST_FAILURES or not self._executor.context.ok()
                if is_broken or not isinstance(error, Exception):
                    self._died(error)
                    return
                log.error("a callback of ROS failed: %r", error)

    async def end(self) -> None:
        """End the executor and the thread; call it in the loop."""
        self._is_ending.set()
        await asyncio.to_thread(self._executor.shutdown, JOIN_S)
        await asyncio.to_thread(self.join, JOIN_S)


async def serve(arguments: Sequence[str]) -> None:
    """Run the node, with the command line for ROS (``PROGRAM --ros-args ...``), until a signal arrives.

    Raises:
        RuntimeError: the executor, or publishing, failed; the hand has been stopped.
    """
    loop = asyncio.get_running_loop()
    ended: asyncio.Future[None] = loop.create_future()

    def fail(error: BaseException) -> None:
        if not ended.done():
            ended.set_exception(RuntimeError(f"the node cannot continue: {error!r}"))

    context = Context()
    # ROS's own handlers would end the context before the results are sent.
    rclpy.init(args=list(arguments), context=context, signal_handler_options=SignalHandlerOptions.NO)
    try:
        with _signals(loop, ended):
            executor = SingleThreadedExecutor(context=context)
            bridge = Bridge(loop, executor)
            node = GripperNode(context, bridge, fail)
            executor.add_node(node)
            spinner = Spinner(executor, lambda error: loop.call_soon_threadsafe(fail, error))
            with forwarded_to(node.get_logger()):
                executor.create_task(node.start_automatically)
                spinner.start()
                try:
                    await ended
                finally:
                    await _end(node, bridge, spinner)
                    node.destroy_node()
    finally:
        rclpy.shutdown(context=context)


async def _end(node: GripperNode, bridge: Bridge, spinner: Spinner) -> None:
    bridge.close()
    try:
        await node.close()
        await bridge.drained(ANSWERS_S)
        await node.results_requested()
        await asyncio.sleep(LINGER_S)
        await node.results_received()
    finally:
        await spinner.end()


@contextmanager
def _signals(loop: asyncio.AbstractEventLoop, ended: asyncio.Future[None]) -> Iterator[None]:
    # The first signal ends the node in order. Further ones are ignored, because launchers send several.
    def end() -> None:
        if not ended.done():
            ended.set_result(None)

    numbers = ending_signals()
    for number in numbers:
        loop.add_signal_handler(number, end)
    try:
        yield
    finally:
        for number in numbers:
            loop.remove_signal_handler(number)


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
