"""Calls from the executor's thread into the event loop."""

from __future__ import annotations

import asyncio
import threading
import time
from concurrent.futures import Future

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.task import Future as Answer

from robotiq_async.ros2.node.bridge import Bridge, ClosedError
from tests.ros2.live.processes import PATIENCE_S


async def test_calls_begin_in_their_order() -> None:
    """Also if the loop was held up: a cancel does not overtake its goal."""
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


async def test_the_end_waits_for_an_executor_that_is_held_up() -> None:
    """On a busy machine, a goal had ended in the loop and its result was never sent."""
    context = Context()
    rclpy.init(context=context)
    executor = SingleThreadedExecutor(context=context)
    bridge = Bridge(asyncio.get_running_loop(), executor)
    is_held, goes_on = Future[None](), threading.Event()
    sent, answers = Answer(executor=executor), []
    sent.add_done_callback(lambda done: answers.append(done.result()))

    def hold() -> None:
        is_held.set_result(None)
        assert goes_on.wait(PATIENCE_S)

    async def ends_when_held() -> str:
        await asyncio.wrap_future(is_held)
        return "aborted"

    async def ask() -> None:
        executor.create_task(hold)
        sent.set_result(await bridge.ask(ends_when_held()))

    executor.create_task(ask)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    await asyncio.wrap_future(is_held)
    ends = asyncio.create_task(bridge.drained(PATIENCE_S))
    for _ in range(100):
        await asyncio.sleep(0)
    assert not ends.done()
    goes_on.set()
    await ends
    assert answers == ["aborted"]
    await asyncio.to_thread(executor.shutdown, PATIENCE_S)
    await asyncio.to_thread(thread.join, PATIENCE_S)
    rclpy.shutdown(context=context)
