"""Streams and listeners: what a reader gets and misses, how it ends; callbacks in order, and harmless."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import logging
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import anyio
import pytest

from robotiq_async.session.streams import Channel, Listeners, Stream
from robotiq_async.values.errors import ConnectionLostError, RobotiqError


def lost() -> RobotiqError:
    return ConnectionLostError("gave up")


async def steps(count: int = 3) -> None:
    """Let everything run that can run."""
    for _ in range(count):
        await asyncio.sleep(0)


async def rest(stream: Stream[int]) -> list[int]:
    """What a stream still gives until it ends."""
    return [item async for item in stream]


async def reading(stream: Stream[int]) -> asyncio.Task[int]:
    """A reader that waits for the next item."""
    task = asyncio.create_task(stream.__anext__())
    await steps()
    assert not task.done()
    return task


@pytest.fixture
def channel() -> Channel[int]:
    return Channel(Listeners())


# -- stories of one stream after another -------------------------------------------------------------------

STORIES = {
    "a reader that waits gets each": "open 1, wait, push 0, got 0, wait, push 1, got 1, missed 0",
    "missed add up": "open 1, push 1 2 3, read 3, missed 2, push 4, read 4, missed 2, push 5 6, missed 3",
    "a buffer of the newest three": "open 3, push 1 2 3 4 5, end, missed 2, read 3, read 4, read 5, read end",
    "a buffer that is not full": "open 3, push 1 2, end, missed 0, read 1, read 2, read end",
    "a buffer for all": "open None, push 1 2 3 4, end, missed 0, read 1, read 2, read 3, read 4, read end",
    "nothing from before it was opened": "push 1, open None, push 2, end, read 2, read end",
    "the failure comes after what is left, and again": "open 3, push 1, lost, read 1, read lost, read lost",
    "after the end nothing is added": "open None, end, push 1, read end",
    "before a start it waits for one": "open 1, wait, start, waits, push 1, got 1",
    "after a quiet end it waits for a start": "end, open 1, wait, start, waits, push 1, got 1",
    "why the hand gave up, until a new start": "lost, open 1, read lost, start, open 1, push 1, read 1",
    "a new start is none for what has ended": "open 1, lost, start, push 1, read lost",
    "closing ends a reader that waits": "open 1, wait, close, got end",
    "an item comes as it is closed": "open 1, wait, push 1, close, got end",
    "closing drops what is left and what comes": "open 3, push 1, close, close, push 2, lost, read end",
    "an item, and cancelled": "open 1, wait, push 1, cancel, got cancelled, read 1, missed 0",
    "cancelled, and an item": "open 1, wait, cancel, push 1, got cancelled, read 1, missed 0",
    "a reader after one that was cancelled": "open 1, wait, cancel, got cancelled, wait, push 1, got 1",
    "a second reader is refused": "open 1, wait, read refused, push 1, got 1",
}
"""What happens to a channel, to the stream that was opened last and to the reader that last began to wait."""


@pytest.mark.parametrize("name", STORIES)
async def test_a_story(channel: Channel[int], name: str) -> None:
    streams: list[Stream[int]] = []
    readers: list[asyncio.Task[int]] = []
    for step in STORIES[name].split(", "):
        what, *arguments = step.split()
        match what:
            case "open":
                streams.append(channel.open(None if arguments == ["None"] else int(arguments[0])))
            case "push":
                for item in arguments:
                    channel.push(int(item))
            case "end" | "lost":
                channel.end(lost if what == "lost" else None)
            case "start":
                channel.reopen(asyncio.get_running_loop())
            case "close":
                await streams[-1].aclose()
            case "missed":
                assert [str(streams[-1].missed)] == arguments, step
            case "read":
                assert [await outcome(anext(streams[-1]))] == arguments, step
            case "wait":
                readers.append(await reading(streams[-1]))
            case "waits":
                await steps()
                assert not readers[-1].done()
            case "cancel":
                readers[-1].cancel()
            case "got":
                assert [await outcome(readers[-1])] == arguments, step


async def outcome(item: Awaitable[int]) -> str:
    try:
        return str(await item)
    except StopAsyncIteration:
        return "end"
    except ConnectionLostError as error:
        return "lost" if str(error) == "gave up" else str(error)
    except RuntimeError as error:
        return "refused" if "one reader" in str(error) else str(error)
    except asyncio.CancelledError:
        return "cancelled"


async def test_each_reader_gets_a_failure_of_its_own(channel: Channel[int]) -> None:
    streams = [channel.open(1), channel.open(1)]
    tasks = [await reading(stream) for stream in streams]
    channel.end(lost)
    one, other = await asyncio.gather(*tasks, return_exceptions=True)
    assert isinstance(one, ConnectionLostError)
    assert isinstance(other, ConnectionLostError)
    assert one is not other


async def test_what_is_pushed_into_a_stream_that_has_ended_is_dropped(channel: Channel[int]) -> None:
    stream = channel.open(None)
    channel.end()
    stream.push(2)
    assert await rest(stream) == []


async def test_a_second_reader_that_takes_the_item_does_not_end_the_first(channel: Channel[int]) -> None:
    """It is refused, or the first one waits on: but the stream has not ended."""
    stream = channel.open(1)
    first = await reading(stream)
    channel.push(1)
    with contextlib.suppress(RuntimeError):
        await anext(stream)
    await steps()
    if not first.done():
        channel.push(2)
    assert await first in (1, 2)


# -- garbage -----------------------------------------------------------------------------------------------


@pytest.fixture
def no_collector() -> Iterator[None]:
    """What goes has to go by itself."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


async def read(channel: Channel[int], seen: list[int]) -> None:
    async for item in channel.open(1):
        seen.append(item)
        return


async def never_begun(channel: Channel[int]) -> object:
    return channel.open(None).take_nowait()


async def derived_and_never_begun(channel: Channel[int]) -> object:
    return channel.derive(letters).take_nowait()


async def left_in_the_middle(channel: Channel[int]) -> object:
    stream = channel.open(None)
    channel.push(1)
    channel.push(2)
    async for _ in stream:
        break
    return None


async def timed_out_and_the_error_is_kept(channel: Channel[int]) -> object:
    try:
        async with asyncio.timeout(0):
            await read(channel, [])
    except TimeoutError as error:
        return error
    return None


async def in_a_group(channel: Channel[int]) -> object:
    async with anyio.create_task_group() as group:
        group.start_soon(read, channel, [])
        await steps()
        group.cancel_scope.cancel()
    return None


async def cancelled_and_the_task_is_kept(channel: Channel[int]) -> object:
    task = asyncio.create_task(read(channel, []))
    await steps()
    task.cancel()
    await asyncio.wait({task})
    return task


async def begun_and_never_awaited(channel: Channel[int]) -> object:
    coroutine = channel.open(1).__anext__()
    coroutine.send(None)
    return None


async def closed(channel: Channel[int]) -> object:
    stream = channel.open(1)
    task = await reading(stream)
    await stream.aclose()
    await asyncio.wait({task})
    return task.exception()


@pytest.mark.usefixtures("no_collector")
@pytest.mark.parametrize(
    "leave",
    [
        *(never_begun, derived_and_never_begun, left_in_the_middle, timed_out_and_the_error_is_kept),
        *(in_a_group, cancelled_and_the_task_is_kept, begun_and_never_awaited, closed),
    ],
)
async def test_a_stream_that_nobody_holds_is_forgotten_at_once(
    channel: Channel[int], leave: Callable[[Channel[int]], Awaitable[object]]
) -> None:
    kept = [await leave(channel) for _ in range(10)]
    assert len(kept) == 10
    assert held(channel) == 0
    assert not channel._waited_for


def held(channel: Channel[int]) -> int:
    """How many streams a channel knows of, once another one has been opened."""
    last = channel.open(None)
    assert channel._streams.pop()() is last
    return len(channel._streams)


def test_a_stream_that_another_thread_drops_takes_no_other_with_it(channel: Channel[int]) -> None:
    """The list was made anew in that thread, without what was opened at the same moment in the loop's."""
    dropped, before = [channel.open(1)], channel._streams
    with ThreadPoolExecutor(1) as pool:
        pool.submit(dropped.clear).result()
    assert channel._streams is before
    assert held(channel) == 0


async def test_a_waiting_reader_is_not_forgotten_though_nobody_keeps_its_task(channel: Channel[int]) -> None:
    """The loop holds its tasks weakly; what will wake one has to hold it."""
    # Python complains of a pending task that is destroyed; that is not what is asked here.
    asyncio.get_running_loop().set_exception_handler(lambda *_: None)
    seen: list[int] = []
    asyncio.create_task(read(channel, seen))  # noqa: RUF006
    await steps()
    gc.collect()
    channel.push(1)
    await steps()
    assert seen == [1]


# -- other loops -------------------------------------------------------------------------------------------


async def test_a_reader_whose_loop_was_closed_holds_up_nobody(channel: Channel[int]) -> None:
    """It waits in a loop that was closed without cancelling its tasks."""

    def leave_one_behind() -> asyncio.Task[None]:
        loop = asyncio.new_event_loop()
        task = loop.create_task(read(channel, []))
        loop.run_until_complete(steps())
        loop.close()
        return task

    left = await asyncio.to_thread(leave_one_behind)
    stream = channel.open(1)
    channel.push(1)
    assert await anext(stream) == 1
    assert not channel._waited_for
    assert not left.done()
    left._log_destroy_pending = False  # type: ignore[attr-defined]  # it will never run again


@pytest.mark.parametrize("debug", [False, True])
async def test_a_reader_in_the_loop_of_another_thread_harms_nobody(
    channel: Channel[int], debug: bool
) -> None:
    """In debug mode the loop refuses to be called from another thread."""
    stream = channel.open(None)
    reader = asyncio.create_task(asyncio.to_thread(lambda: asyncio.run(rest(stream), debug=debug)))
    for item in range(100):
        channel.push(item)
        await asyncio.sleep(0.0001)
    channel.end()
    assert await reader == [*range(100)]


# -- what is made of items ---------------------------------------------------------------------------------


def letters(count: int) -> list[str]:
    """So many of them."""
    return list("abcdefghij"[:count])


def noting(seen: list[int]) -> Callable[[int], list[int]]:
    """Make an item of itself, and note it."""

    def make(item: int) -> list[int]:
        seen.append(item)
        return [item]

    return make


async def test_a_derived_stream_gives_what_is_made_of_each_item(channel: Channel[int]) -> None:
    stream, plain = channel.derive(letters), channel.open(1)
    waiting = asyncio.create_task(stream.__anext__())
    await steps()
    channel.push(0)
    await steps()
    assert not waiting.done(), "nothing was made of it"
    for item in (2, 0, 1):
        channel.push(item)
    for item in range(3000):
        channel.push(item % 2)
    channel.end()
    assert [await waiting, *[made async for made in stream]] == ["a", "b", "a", *["a"] * 1500]
    assert stream.missed == 0
    assert await rest(plain) == [1]


async def test_a_derived_stream_that_was_closed_makes_nothing_any_more(channel: Channel[int]) -> None:
    seen: list[int] = []
    stream = channel.derive(noting(seen))
    channel.push(1)
    await stream.aclose()
    channel.push(2)
    assert seen == [1]
    assert await rest(stream) == []


async def test_a_derived_stream_ends_with_the_failure(channel: Channel[int]) -> None:
    stream = channel.derive(letters)
    channel.end(lost)
    with pytest.raises(ConnectionLostError):
        await anext(stream)


# -- listeners ---------------------------------------------------------------------------------------------


@pytest.fixture
def listeners() -> Listeners:
    return Listeners()


def test_each_is_told_everything_in_its_order(listeners: Listeners) -> None:
    one: list[object] = []
    other: list[object] = []
    listeners.add(one.append)
    listeners.tell(1)
    listeners.add(other.append)
    listeners.tell(2)
    assert (one, other) == ([1, 2], [2])


def test_one_that_is_removed_is_told_no_more(listeners: Listeners) -> None:
    told: list[object] = []
    remove = listeners.add(told.append)
    remove_other = listeners.add(told.append)
    remove()
    remove()
    listeners.tell(1)
    assert told == [1], "the same function was added twice"
    remove_other()
    listeners.tell(2)
    assert told == [1]


def test_one_that_is_removed_by_another_is_not_told_any_more(listeners: Listeners) -> None:
    told: list[object] = []
    listeners.add(lambda _: remove())
    remove = listeners.add(told.append)
    listeners.tell(1)
    assert told == []


def test_one_may_remove_itself_and_add_others(listeners: Listeners) -> None:
    told: list[object] = []

    def once(item: object) -> None:
        told.append(item)
        remove()
        listeners.add(told.append)

    remove = listeners.add(once)
    listeners.tell(1)
    listeners.tell(2)
    assert told == [1, 2]


def test_what_a_listener_brings_about_is_told_after_what_it_was_told(listeners: Listeners) -> None:
    told: list[object] = []
    listeners.add(lambda item: listeners.tell("then") if item == "first" else None)
    listeners.add(told.append)
    listeners.tell("first")
    assert told == ["first", "then"]


@pytest.mark.parametrize("error", [ValueError("no"), asyncio.CancelledError()], ids=repr)
def test_one_that_raises_is_logged_once_and_hurts_nobody(
    listeners: Listeners, caplog: pytest.LogCaptureFixture, error: BaseException
) -> None:
    told: list[object] = []

    def fail(_: object) -> None:
        raise error

    listeners.add(fail)
    listeners.add(told.append)
    listeners.tell(1)
    listeners.tell(2)
    assert told == [1, 2]
    (record,) = caplog.records
    assert record.levelno == logging.ERROR
    assert record.exc_info is not None
    assert record.exc_info[1] is error


def test_an_interrupt_is_not_held_back_and_telling_goes_on_afterwards(listeners: Listeners) -> None:
    told: list[object] = []
    errors = [KeyboardInterrupt()]

    def interrupted(item: object) -> None:
        told.append(item)
        if errors:
            raise errors.pop()

    listeners.add(interrupted)
    with pytest.raises(KeyboardInterrupt):
        listeners.tell(1)
    listeners.tell(2)
    assert told == [1, 2]
