"""The process of the node: the event loop in the main thread, ROS's executor in one beside it, and the end.

The end has an order: the hand stops, results go out, the executor ends, the node, ROS.
"""

from __future__ import annotations

import asyncio
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Final

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from ...runtime.log import log
from .bridge import Bridge
from .gripper_node import GripperNode
from .logs import handed_to

ANSWERS_S: Final = 0.5
"""For the answers to what the end has ended; they take milliseconds."""
LINGER_S: Final = 0.1
"""For what has been sent to leave: ROS does not tell when it has."""
JOIN_S: Final = 2.0
MOST_FAILURES: Final = 20
"""Callbacks that may fail in a second. More, and the executor is broken, and not what it was asked."""


class Spinner(threading.Thread):
    """Runs an executor. A callback of ROS's own that raises is logged, and does not end it."""

    def __init__(self, executor: SingleThreadedExecutor, died: Callable[[BaseException], object]) -> None:
        """Prepare.

        Args:
            executor: is spun.
            died: is called, in this thread, if it cannot go on.
        """
        super().__init__(name="robotiq_async executor", daemon=True)
        self._executor = executor
        self._died = died
        self._is_ending = threading.Event()

    def run(self) -> None:
        """Spin until told to end."""
        failures: list[float] = []
        while not self._is_ending.is_set():
            try:
                self._executor.spin_once()
            except BaseException as error:  # noqa: BLE001  # nobody could halt any more if it ended unheard
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
        """End it, from the loop."""
        self._is_ending.set()
        await asyncio.to_thread(self._executor.shutdown, JOIN_S)
        await asyncio.to_thread(self.join, JOIN_S)


async def serve(arguments: Sequence[str]) -> None:
    """Run the node until a signal comes.

    Args:
        arguments: the command line with the program's name, for ROS: ``--ros-args ...``.

    Raises:
        RuntimeError: the executor died, or publishing did; the hand has been stopped then.
    """
    loop = asyncio.get_running_loop()
    ended: asyncio.Future[None] = loop.create_future()

    def fail(error: BaseException) -> None:
        if not ended.done():
            ended.set_exception(RuntimeError(f"the node cannot go on: {error!r}"))

    context = Context()
    # ROS's own handlers would end the context before the results are out.
    rclpy.init(args=list(arguments), context=context, signal_handler_options=SignalHandlerOptions.NO)
    try:
        with _signals(loop, ended):
            executor = SingleThreadedExecutor(context=context)
            bridge = Bridge(loop, executor)
            node = GripperNode(context, bridge, fail)
            executor.add_node(node)
            spinner = Spinner(executor, lambda error: loop.call_soon_threadsafe(fail, error))
            with handed_to(node.get_logger()):
                executor.create_task(node.start_by_itself)
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
        await asyncio.sleep(LINGER_S)
    finally:
        await spinner.end()


@contextmanager
def _signals(loop: asyncio.AbstractEventLoop, ended: asyncio.Future[None]) -> Iterator[None]:
    """The first signal ends the node well; further ones are not heard, for launchers send several."""

    def end() -> None:
        if not ended.done():
            ended.set_result(None)

    numbers = [
        number
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        # A SIGINT that is ignored stays so: that is how a shell keeps Ctrl-C from its background jobs.
        if signal.getsignal(number) is not signal.SIG_IGN
    ]
    for number in numbers:
        loop.add_signal_handler(number, end)
    try:
        yield
    finally:
        for number in numbers:
            loop.remove_signal_handler(number)
