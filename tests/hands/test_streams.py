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

from robotiq_async.hands.streams import Channel, Listeners, Stream
from robotiq_async.values.errors import ConnectionLostError, RobotiqError


def lost() -> RobotiqError:
    return ConnectionLostError("gave up")


async def steps(count: int = 3) -> None:
    """Let everything run that can run."""
    for _ in range(count):
        await asyncio.sleep(0)


async def rest(stream: Stream[int]) -> list[int]:
    """The items that a stream still gives until it ends."""
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


# -- newest wins -------------------------------------------------------------------------------------------


async def test_a_reader_that_waits_gets_each_item_and_misses_nothing(channel: Channel[int]) -> None:
    stream = channel.open(1)
    for item in range(5):
        task = await reading(stream)
        channel.push(item)
        assert await task == item
    assert stream.missed == 0


async def test_missed_items_add_up(channel: Channel[int]) -> None:
    stream = channel.open(1)
    for item in (1, 2, 3):
        channel.push(item)
    assert (await anext(stream), stream.missed) == (3, 2)
    channel.push(4)
    assert (await anext(stream), stream.missed) == (4, 2)
    for item in (5, 6):
        channel.push(item)
    assert (await anext(stream), stream.missed) == (6, 3)


@pytest.mark.parametrize("buffer", [1, 3, 10, None])
async def test_a_buffer_keeps_that_many_of_the_newest_items_in_order(
    channel: Channel[int], buffer: int | None
) -> None:
    stream = channel.open(buffer)
    for item in range(10):
        channel.push(item)
    channel.end()
    missed = 10 - (buffer or 10)
    assert stream.missed == missed
    assert await rest(stream) == list(range(missed, 10))


async def test_a_stream_gives_nothing_from_before_it_was_opened(channel: Channel[int]) -> None:
    channel.push(1)
    stream = channel.open(None)
    channel.push(2)
    channel.end()
    assert await rest(stream) == [2]


# -- the end -----------------------------------------------------------------------------------------------


async def test_a_stream_ends_with_the_failure_after_what_is_left_and_again(channel: Channel[int]) -> None:
    stream = channel.open(3)
    channel.push(1)
    channel.end(lost)
    assert await anext(stream) == 1
    for _ in range(2):
        with pytest.raises(ConnectionLostError, match="gave up"):
            await anext(stream)


async def test_each_reader_gets_a_failure_of_its_own(channel: Channel[int]) -> None:
    streams = [channel.open(1), channel.open(1)]
    tasks = [await reading(stream) for stream in streams]
    channel.end(lost)
    one, other = await asyncio.gather(*tasks, return_exceptions=True)
    assert isinstance(one, ConnectionLostError)
    assert isinstance(other, ConnectionLostError)
    assert one is not other


async def test_after_the_end_nothing_is_added(channel: Channel[int]) -> None:
    stream = channel.open(None)
    channel.end()
    channel.push(1)
    assert await rest(stream) == []


@pytest.mark.parametrize("when", ["before a start", "after a quiet end"])
async def test_a_stream_that_is_opened_while_the_hand_does_not_run_waits_for_the_next_start(
    channel: Channel[int], when: str
) -> None:
    if when == "after a quiet end":
        channel.end()
    task = await reading(channel.open(1))
    channel.reopen(asyncio.get_running_loop())
    await steps()
    assert not task.done()
    channel.push(1)
    assert await task == 1


async def test_a_stream_raises_why_the_hand_gave_up_until_a_new_start(channel: Channel[int]) -> None:
    before = channel.open(1)
    channel.end(lost)
    with pytest.raises(ConnectionLostError):
        await anext(channel.open(1))
    channel.reopen(asyncio.get_running_loop())
    stream = channel.open(1)
    channel.push(1)
    assert await anext(stream) == 1
    with pytest.raises(ConnectionLostError):
        await anext(before)


# -- closing -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("comes", [False, True])
async def test_closing_ends_a_waiting_reader_also_when_an_item_comes_at_the_same_moment(
    channel: Channel[int], comes: bool
) -> None:
    stream = channel.open(1)
    task = await reading(stream)
    if comes:
        channel.push(1)
    await stream.aclose()
    with pytest.raises(StopAsyncIteration):
        await task


async def test_closing_drops_what_is_left_and_what_comes_later_and_may_be_repeated(
    channel: Channel[int],
) -> None:
    stream = channel.open(3)
    channel.push(1)
    await stream.aclose()
    await stream.aclose()
    channel.push(2)
    channel.end(lost)
    assert await rest(stream) == []


# -- cancelling --------------------------------------------------------------------------------------------


async def test_a_wait_that_is_cancelled_together_with_an_item_loses_nothing(channel: Channel[int]) -> None:
    for item_first in (True, False):
        stream = channel.open(1)
        task = await reading(stream)
        if item_first:
            channel.push(1)
            task.cancel()
        else:
            task.cancel()
            channel.push(1)
        with pytest.raises(asyncio.CancelledError):
            await task
        assert await anext(stream) == 1
        assert stream.missed == 0


# -- one reader --------------------------------------------------------------------------------------------


async def test_a_second_reader_is_refused_unless_the_first_was_cancelled(channel: Channel[int]) -> None:
    stream = channel.open(1)
    first = await reading(stream)
    first.cancel()
    with pytest.raises(asyncio.CancelledError):
        await first
    second = await reading(stream)
    with pytest.raises(RuntimeError, match="one reader"):
        await anext(stream)
    channel.push(1)
    assert await second == 1


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
    """Run without the collector: an object that goes has to go by itself."""
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
async def test_a_dropped_stream_is_forgotten_at_once(
    channel: Channel[int], leave: Callable[[Channel[int]], Awaitable[object]]
) -> None:
    kept = [await leave(channel) for _ in range(10)]
    assert len(kept) == 10
    assert held(channel) == 0
    assert not channel._waited_for


def held(channel: Channel[int]) -> int:
    """The number of streams that a channel knows of, once another one has been opened."""
    last = channel.open(None)
    assert channel._intakes.pop()() is last._intake
    return len(channel._intakes)


async def test_a_stream_that_another_thread_drops_takes_no_other_with_it(channel: Channel[int]) -> None:
    """The list was rebuilt in that thread, without the one opened at the same moment in the loop's."""
    dropped, before = [channel.open(1)], channel._intakes
    with ThreadPoolExecutor(1) as pool:
        pool.submit(dropped.clear).result()
    assert channel._intakes is before
    assert held(channel) == 0


async def test_a_waiting_reader_is_kept_although_its_task_is_not_referenced(channel: Channel[int]) -> None:
    """The loop holds its tasks weakly; what will wake one has to hold it."""
    # Python complains of a pending task that is destroyed; that is not tested here.
    asyncio.get_running_loop().set_exception_handler(lambda *_: None)
    seen: list[int] = []
    asyncio.create_task(read(channel, seen))  # noqa: RUF006
    await steps()
    gc.collect()
    channel.push(1)
    await steps()
    assert seen == [1]


# -- other loops -------------------------------------------------------------------------------------------


async def test_a_stream_of_a_hand_that_runs_is_read_in_its_loop(channel: Channel[int]) -> None:
    stream = channel.open(None)
    channel.reopen(asyncio.get_running_loop())
    for each in (stream, channel.open(None)):
        with pytest.raises(RuntimeError, match="outside of the event loop"):
            await asyncio.to_thread(asyncio.run, rest(each))
    channel.push(1)
    channel.end()
    assert await asyncio.to_thread(asyncio.run, rest(stream)) == [1], "what is left is read anywhere"


def test_a_hand_does_not_start_while_a_reader_waits_in_another_loop(channel: Channel[int]) -> None:
    stream = channel.open(None)
    with asyncio.Runner() as here, asyncio.Runner() as other:
        task = other.get_loop().create_task(rest(stream))
        other.run(steps())
        with pytest.raises(RuntimeError, match="nothing was sent to the gripper"):
            channel.check_loop(here.get_loop())
        with pytest.raises(RuntimeError, match="outside of the event loop"):
            here.run(stream.aclose())
        channel.check_loop(other.get_loop())
        other.run(stream.aclose())
        assert other.get_loop().run_until_complete(task) == []
        channel.check_loop(here.get_loop())


# -- what is made of items ---------------------------------------------------------------------------------


def letters(count: int) -> list[str]:
    """So many letters."""
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


async def test_a_closed_derived_stream_makes_nothing(channel: Channel[int]) -> None:
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


def test_each_listener_gets_every_item_in_order(listeners: Listeners) -> None:
    one: list[object] = []
    other: list[object] = []
    listeners.add(one.append)
    listeners.tell(1)
    listeners.add(other.append)
    listeners.tell(2)
    assert (one, other) == ([1, 2], [2])


def test_a_removed_listener_gets_no_more_items(listeners: Listeners) -> None:
    heard: list[object] = []
    remove = listeners.add(heard.append)
    remove_other = listeners.add(heard.append)
    remove()
    remove()
    listeners.tell(1)
    assert heard == [1], "the same function was added twice"
    remove_other()
    listeners.tell(2)
    assert heard == [1]


def test_a_listener_removed_by_another_gets_no_more_items(listeners: Listeners) -> None:
    heard: list[object] = []
    listeners.add(lambda _: remove())
    remove = listeners.add(heard.append)
    listeners.tell(1)
    assert heard == []


def test_one_may_remove_itself_and_add_others(listeners: Listeners) -> None:
    heard: list[object] = []

    def once(item: object) -> None:
        heard.append(item)
        remove()
        listeners.add(heard.append)

    remove = listeners.add(once)
    listeners.tell(1)
    listeners.tell(2)
    assert heard == [1, 2]


def test_an_item_caused_by_a_listener_comes_after_the_present_one(listeners: Listeners) -> None:
    heard: list[object] = []
    listeners.add(lambda item: listeners.tell("then") if item == "first" else None)
    listeners.add(heard.append)
    listeners.tell("first")
    assert heard == ["first", "then"]


@pytest.mark.parametrize("error", [ValueError("no"), asyncio.CancelledError()], ids=repr)
def test_a_listener_that_raises_is_logged_once_and_removed(
    listeners: Listeners, caplog: pytest.LogCaptureFixture, error: BaseException
) -> None:
    heard: list[object] = []

    def fail(_: object) -> None:
        raise error

    listeners.add(fail)
    listeners.add(heard.append)
    listeners.tell(1)
    listeners.tell(2)
    assert heard == [1, 2]
    (record,) = caplog.records
    assert record.levelno == logging.ERROR
    assert record.exc_info is not None
    assert record.exc_info[1] is error


def test_an_interrupt_is_not_held_back_and_telling_goes_on_afterwards(listeners: Listeners) -> None:
    heard: list[object] = []
    errors = [KeyboardInterrupt()]

    def interrupted(item: object) -> None:
        heard.append(item)
        if errors:
            raise errors.pop()

    listeners.add(interrupted)
    with pytest.raises(KeyboardInterrupt):
        listeners.tell(1)
    listeners.tell(2)
    assert heard == [1, 2]
