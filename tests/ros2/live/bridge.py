"""What crosses from the executor's thread into the event loop."""

from __future__ import annotations

import asyncio
import threading
import time
from concurrent.futures import Future

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

from robotiq_async.ros2.node.bridge import Bridge, ClosedError
from tests.ros2.live.processes import PATIENCE_S


async def test_calls_begin_in_their_order() -> None:
    """Also if the loop was held up meanwhile: a cancel does not overtake its goal."""
    bridge, order = Bridge(asyncio.get_running_loop(), None), []

    async def note(what: str) -> None:
        order.append(what)

    def ask() -> None:
        for what in ("goal", "cancel", "another goal"):
            bridge.submit(note(what))

    thread = threading.Thread(target=ask)
    thread.start()
    time.sleep(0.05)  # noqa: ASYNC251  # holds up the loop
    thread.join()
    for _ in range(3):
        await asyncio.sleep(0)
    assert order == ["goal", "cancel", "another goal"]


async def test_calls_are_answered_and_none_crosses_after_the_end() -> None:
    context = Context()
    rclpy.init(context=context)
    executor = SingleThreadedExecutor(context=context)
    bridge = Bridge(asyncio.get_running_loop(), executor)
    answers: Future[list[object]] = Future()

    async def fail() -> None:
        raise ValueError("no")

    async def ask() -> None:
        results: list[object] = [await bridge.ask(asyncio.sleep(0, "well"))]
        with pytest.raises(ValueError, match="no"):
            await bridge.ask(fail())
        bridge.close()
        with pytest.raises(ClosedError):
            await bridge.ask(fail())
        answers.set_result(results)

    executor.create_task(ask)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    assert await asyncio.wait_for(asyncio.wrap_future(answers), PATIENCE_S) == ["well"]
    await asyncio.to_thread(executor.shutdown, PATIENCE_S)
    await asyncio.to_thread(thread.join, PATIENCE_S)
    rclpy.shutdown(context=context)
