"""Async iterators over the statuses, transitions and requests of a hand, and callbacks for them.

The iterators are plain classes and not async generators: a reader that drops one leaves nothing to clean up.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import weakref
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any, Final, Generic, Self, TypeVar

from ..runtime.concurrency import check_loop
from ..runtime.log import Log, log
from ..values.checks import check_int, check_seconds
from ..values.errors import ConnectionLostError, RobotiqError
from ..values.events import SentRequest, Transition
from ..values.status import RobotiqStatus

T = TypeVar("T")
U = TypeVar("U")
Listener = Callable[[Any], None]
LONGEST_BUFFER: Final = 1_000_000  # items: over an hour of statuses at 200 Hz
SHORTEST_LIMIT_S: Final = 0.01  # two usual polls
LONGEST_LIMIT_S: Final = 3600.0


def check_buffer(buffer: object) -> int:
    """The number of items that a stream keeps."""
    return check_int("buffer", buffer, 1, LONGEST_BUFFER)


def check_limit(name: str, value: object) -> float | None:
    """The seconds that a reader may be left without an item; None for no limit."""
    return None if value is None else check_seconds(name, value, SHORTEST_LIMIT_S, LONGEST_LIMIT_S)


class Stream(Generic[T]):
    """An async iterator with one reader; made by a :class:`Channel`.

    It keeps the newest items, up to the buffer with which it was opened.

    Attributes:
        missed: items that were dropped because the reader was slow.
    """

    def __init__(self, buffer: int | None, kept: set[Stream[Any]]) -> None:
        self._kept = kept
        """Streams with a waiting reader: a strong reference, because nothing else may hold the task of the
        reader."""
        self._loop: asyncio.AbstractEventLoop | None = None
        """The loop of the hand, while it runs: items come from there."""
        self.missed = 0
        self._items: deque[T] = deque(maxlen=buffer)
        self._waiting: asyncio.Future[None] | None = None
        self._ended = False
        self._failure: Callable[[], RobotiqError] | None = None

    def __aiter__(self) -> Self:
        return self

    if not TYPE_CHECKING:  # type checkers report the mistake themselves

        def __iter__(self) -> None:
            raise TypeError("a stream of a hand is read with 'async for', in a coroutine")

    async def __anext__(self) -> T:
        """The next item. A cancelled wait loses nothing.

        Raises:
            StopAsyncIteration: the hand was stopped, or the stream was closed.
            RobotiqConnectionError: the hand gave up on its link.
            RuntimeError: another task is waiting on the same stream, or the hand runs in another event loop.
        """
        while True:
            if self._loop is not None:
                check_loop(self._loop, "a stream of the hand")
            if self._items or self._ended:
                break
            if self._waiting is not None:
                raise RuntimeError("a stream has one reader; open another with statuses() or transitions()")
            self._waiting = asyncio.get_running_loop().create_future()
            self._kept.add(self)
            try:
                if not self._items and not self._ended:  # once more: the hand may run in another thread
                    await self._waiting
            except BaseException:
                self._wait_no_longer()
                # A cancelled task keeps the traceback, which must not keep the stream alive.
                del self
                raise
            self._wait_no_longer()
        if self._items:
            return self._items.popleft()
        failure = self._failure
        del self  # as above
        if failure is None:
            raise StopAsyncIteration
        # A loop that reads on after any error gets this one again at once, and must leave the others a turn.
        await asyncio.sleep(0)
        raise failure()

    def take_nowait(self) -> T | None:
        """The next item if there is one now, or None."""
        return self._items.popleft() if self._items else None

    def drain(self) -> Iterator[T]:
        """Iterate over the items that are there now."""
        while self._items:
            yield self._items.popleft()

    async def aclose(self) -> None:
        """End the stream; a waiting reader ends too. Idempotent."""
        self._items.clear()
        self.end(None)

    def push(self, item: T) -> None:
        """Add an item; a full buffer drops its oldest one."""
        if self._ended:
            return
        if len(self._items) == self._items.maxlen:
            self.missed += 1
        self._items.append(item)
        self._wake()

    def end(self, failure: Callable[[], RobotiqError] | None) -> None:
        """End the stream: the reader gets the remaining items, then the end or the failure."""
        if self._ended:
            return
        self._ended, self._failure, self._loop = True, failure, None
        self._wake()

    def belong_to(self, loop: asyncio.AbstractEventLoop) -> None:
        """Set the loop of the hand. A reader that waits in another loop wakes up and gets RuntimeError."""
        self._loop = loop
        if self._waiting is not None and self._waiting.get_loop() is not loop:
            self._wake()

    def _wait_no_longer(self) -> None:
        self._kept.discard(self)
        self._waiting = None

    def _wake(self) -> None:
        waiting = self._waiting
        if waiting is None or waiting.done():
            return
        loop = waiting.get_loop()
        if loop.is_closed():
            self._wait_no_longer()  # the reader in that loop never wakes up
        elif loop is asyncio.get_running_loop():
            waiting.set_result(None)
        else:
            with contextlib.suppress(RuntimeError):  # closed at this moment
                loop.call_soon_threadsafe(_wake, waiting)


class LimitedStream(Stream[T]):
    """A stream whose reader gets an error if no item comes for some time, and may then read on.

    The time counts from the last item, or from the last error; before the first item from the opening, if the
    hand runs then. A reader that waits for the start waits for the first item without a limit.

    Args:
        buffer: as that of a stream.
        kept: as that of a stream.
        limit: seconds.
        make_error: makes the error for these seconds.
        since: when the time begins, by the clock of the loop; None if the hand does not run.
    """

    def __init__(
        self,
        buffer: int | None,
        kept: set[Stream[Any]],
        limit: float,
        make_error: Callable[[float], RobotiqError],
        since: float | None,
    ) -> None:
        super().__init__(buffer, kept)
        self._limit = limit
        self._make_error = make_error
        self._since = since
        """From when the time counts, by the clock of the loop; None before the first item after a start."""

    async def __anext__(self) -> T:
        if self._items or self._ended or self._since is None:
            return await super().__anext__()
        timer = asyncio.get_running_loop().call_at(self._since + self._limit, self._expire)
        try:
            return await super().__anext__()
        finally:
            timer.cancel()

    def push(self, item: T) -> None:
        self._since = asyncio.get_running_loop().time()
        super().push(item)

    def _expire(self) -> None:
        if self._waiting is not None and not self._waiting.done():
            self._since = self._waiting.get_loop().time()
            self._waiting.set_exception(self._make_error(self._limit))


class DerivedStream(Stream[T]):
    """A stream of items that ``make`` derives from those of a channel; it drops none.

    ``make`` is called in the turn of each push, so it must be quick and must not fail.
    """

    def __init__(self, make: Callable[[Any], Iterable[T]], kept: set[Stream[Any]]) -> None:
        super().__init__(None, kept)
        self._make = make

    def push(self, item: Any) -> None:  # noqa: ANN401  # the items of the channel, not of this stream
        if not self._ended:
            for made in self._make(item):
                super().push(made)


def _wake(waiting: asyncio.Future[None]) -> None:
    if not waiting.done():
        waiting.set_result(None)


class Listeners:
    """Calls every listener with every item, in order. A listener that raises is logged and removed."""

    def __init__(self, log: Log = log) -> None:
        self._log = log
        self._listeners: dict[object, Listener] = {}
        """By a key of their own: the same callback may be added twice."""
        self._interrupted: set[object] = set()
        """The keys of those in which the program was interrupted."""
        self._items: deque[object] = deque()
        self._is_telling = False

    def add(self, listener: Listener) -> Callable[[], None]:
        """Add a listener; return a function that removes it, and may be called twice."""
        key = object()
        self._listeners[key] = listener
        return lambda: self._remove(key)

    def tell(self, item: object) -> None:
        """Call every listener. What a listener itself causes comes after the present item."""
        if not self._listeners:
            return  # the common case, at every poll
        self._items.append(item)
        if self._is_telling:
            return
        self._is_telling = True
        try:
            while self._items:
                self._tell(self._items.popleft())
        finally:
            self._is_telling = False

    def _tell(self, item: object) -> None:
        for key, listener in list(self._listeners.items()):
            if key not in self._listeners:
                continue  # removed by another one, just now
            try:
                listener(item)
            except (Exception, asyncio.CancelledError):  # noqa: BLE001  # no listener may end the poller task
                self._remove(key)
                self._log.exception("a listener raised, and is no longer called: %r", listener)
            except BaseException:
                # A Ctrl-C, perhaps by chance in this one. But one that ends the program at every item would
                # keep the fingers from being stopped.
                if key not in self._interrupted:
                    self._interrupted.add(key)
                    raise
                self._remove(key)
                self._log.exception("a listener interrupts again, and is no longer called: %r", listener)

    def _remove(self, key: object) -> None:
        self._listeners.pop(key, None)


class Channel(Generic[T]):
    """Gives every item to any number of streams, and to the listeners. A dropped stream is forgotten."""

    def __init__(self, listeners: Listeners) -> None:
        self._listeners = listeners
        # A list of references and not a WeakSet, which takes several times as long, at every poll.
        self._streams: list[weakref.ref[Stream[Any]]] = []
        self._has_dropped = False  # whether some of these were dropped by their readers
        self._waited_for: set[Stream[Any]] = set()
        self._failure: Callable[[], RobotiqError] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None

    def open(
        self,
        buffer: int | None,
        limit: float | None = None,
        make_error: Callable[[float], RobotiqError] = ConnectionLostError,
    ) -> Stream[T]:
        """Open a stream. Before a start it waits; after the link was given up it raises the reason.

        With a ``limit`` its reader gets the error for these seconds if no item comes in them.
        """
        if limit is None:
            return self._begin(Stream(buffer, self._waited_for))
        since = None if self._loop is None else self._loop.time()
        return self._begin(LimitedStream(buffer, self._waited_for, limit, make_error, since))

    def derive(self, make: Callable[[T], Iterable[U]]) -> Stream[U]:
        """Open a stream of the items that ``make`` derives from each item from now on."""
        return self._begin(DerivedStream(make, self._waited_for))

    def _begin(self, stream: Stream[U]) -> Stream[U]:
        if self._failure is not None:
            stream.end(self._failure)
        else:
            if self._loop is not None:
                stream.belong_to(self._loop)
            self._let_go()
            self._streams.append(weakref.ref(stream, self._forget))
        return stream

    def reopen(self, loop: asyncio.AbstractEventLoop) -> None:
        """The hand starts in this loop: forget an earlier failure."""
        self._failure, self._loop = None, loop
        for stream in self._living():
            stream.belong_to(loop)

    def push(self, item: T) -> None:
        for stream in self._living():
            stream.push(item)
        if self._has_dropped:
            self._let_go()
        self._listeners.tell(item)

    def end(self, failure: Callable[[], RobotiqError] | None = None) -> None:
        """End every stream, quietly or with a failure."""
        self._failure, self._loop = failure, None
        streams, self._streams = self._streams, []
        for reference in streams:
            stream = reference()
            if stream is not None:
                stream.end(failure)

    def _living(self) -> Iterator[Stream[Any]]:
        for reference in self._streams:
            if (stream := reference()) is not None:
                yield stream

    def _let_go(self) -> None:
        self._has_dropped = False
        self._streams = [each for each in self._streams if each() is not None]

    def _forget(self, _: weakref.ref[Stream[Any]]) -> None:
        # Called in the thread that drops the last reference; only a flag, because another may open a stream
        # now.
        self._has_dropped = True


class Channels:
    """The statuses, changes of state and written requests of a hand.

    Attributes:
        numbers: the sequence numbers of the statuses, from the first start on.
    """

    def __init__(self, log: Log = log) -> None:
        self.numbers = itertools.count()
        self.listeners = Listeners(log)
        self.statuses: Channel[RobotiqStatus] = Channel(self.listeners)
        self.transitions: Channel[Transition] = Channel(self.listeners)
        self.requests: Channel[SentRequest] = Channel(self.listeners)
        self._all: tuple[Channel[Any], ...] = (self.statuses, self.transitions, self.requests)

    def reopen(self, loop: asyncio.AbstractEventLoop) -> None:
        for channel in self._all:
            channel.reopen(loop)

    def end(self, failure: Callable[[], RobotiqError] | None = None) -> None:
        """End every stream, quietly or with a failure."""
        for channel in self._all:
            channel.end(failure)
