"""Async iterators over the statuses, transitions and requests of a hand, and callbacks for them.

The iterators are plain classes and not async generators: a reader that drops an iterator leaves nothing to
clean up.
"""

from __future__ import annotations

import asyncio
import itertools
import weakref
from collections import deque
from collections.abc import Callable, Coroutine, Iterable, Iterator
from typing import TYPE_CHECKING, Any, Final, Generic, Self, TypeVar

from ..runtime.concurrency import check_loop
from ..runtime.logger import Log, log
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
    """An async iterator with one reader, in the event loop of the hand.

    It keeps the newest items, up to the buffer with which it was opened.
    """

    def __init__(self, intake: Intake[T]) -> None:
        self._intake = intake

    def __aiter__(self) -> Self:
        return self

    if not TYPE_CHECKING:  # type checkers report the mistake themselves

        def __iter__(self) -> None:
            raise TypeError("a stream of a hand is read with 'async for', in a coroutine")

    def __anext__(self) -> Coroutine[Any, Any, T]:
        """The next item. A cancelled wait loses nothing.

        Raises:
            StopAsyncIteration: the hand was stopped, or the stream was closed.
            RobotiqConnectionError: the hand gave up on its link.
            RuntimeError: another task is waiting on the same stream, or the hand runs in another event loop.
        """
        return self._intake.next()

    @property
    def missed(self) -> int:
        """Items that were dropped because the reader was slow."""
        return self._intake.missed

    def take_nowait(self) -> T | None:
        """The next item if there is one now, or None."""
        return self._intake.take()

    def drain(self) -> Iterator[T]:
        """Iterate over the items that are there now."""
        return self._intake.drain()

    async def aclose(self) -> None:
        """End the stream; a waiting reader ends too. Idempotent."""
        self._intake.close()


class Intake(Generic[T]):
    """The inside of a stream: a :class:`Channel` puts items in, and its reader waits here.

    Attributes:
        missed: items that were dropped because the reader was slow.
    """

    def __init__(self, buffer: int | None, kept: set[Intake[Any]]) -> None:
        self.missed: int = 0
        self._loop: asyncio.AbstractEventLoop | None = None
        """The loop of the hand, while it runs: items come from there."""
        self._kept: Final = kept
        """Intakes with a waiting reader: strong references, as nothing else may hold the reader's task."""
        self._items: Final[deque[T]] = deque(maxlen=buffer)
        self._waiting: asyncio.Future[None] | None = None
        self._ended = False
        self._failure: Callable[[], RobotiqError] | None = None

    async def next(self) -> T:
        """Wait for the next item."""
        if self._loop is not None:
            check_loop(self._loop, "a stream of the hand")
        while not self._items and not self._ended:
            if self._waiting is not None:
                raise RuntimeError("a stream has one reader; open another with statuses() or transitions()")
            self._waiting = asyncio.get_running_loop().create_future()
            self._kept.add(self)
            try:
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

    def take(self) -> T | None:
        """The next item if there is one now."""
        return self._items.popleft() if self._items else None

    def drain(self) -> Iterator[T]:
        """Iterate over the items that are there now."""
        while self._items:
            yield self._items.popleft()

    def push(self, item: T) -> None:
        """Add an item; a full buffer drops its oldest one."""
        if self._ended:
            return
        if len(self._items) == self._items.maxlen:
            self.missed += 1
        self._items.append(item)
        self._wake()

    def close(self) -> None:
        """Drop the items, and end."""
        if self._waiting is not None:
            check_loop(self._waiting.get_loop(), "a stream of the hand")
        self._items.clear()
        self.end(None)

    def end(self, failure: Callable[[], RobotiqError] | None) -> None:
        """End the stream: the reader gets the remaining items, then the end or the failure."""
        if self._ended:
            return
        self._ended, self._failure, self._loop = True, failure, None
        self._wake()

    def waits_outside_of(self, loop: asyncio.AbstractEventLoop) -> bool:
        """Whether its reader waits in another loop than this."""
        return self._waiting is not None and self._waiting.get_loop() is not loop

    def belong_to(self, loop: asyncio.AbstractEventLoop) -> None:
        """The hand runs in this loop, in which the reader waits if it does."""
        self._loop = loop

    def _wait_no_longer(self) -> None:
        self._kept.discard(self)
        self._waiting = None

    def _wake(self) -> None:
        if self._waiting is not None and not self._waiting.done():
            self._waiting.set_result(None)


class LimitedIntake(Intake[T]):
    """The inside of a stream whose reader gets an error if no item comes for some time, and may then read on.

    The timer starts at the last item or error, or at the opening if the hand runs then. A reader that waits
    for the start waits for the first item without a limit.

    Args:
        buffer: as of a stream.
        kept: as of a stream.
        limit: seconds.
        make_error: makes the error for these seconds.
        since: when the time begins, by the clock of the loop; None if the hand does not run.
    """

    def __init__(
        self,
        buffer: int | None,
        kept: set[Intake[Any]],
        limit: float,
        make_error: Callable[[float], RobotiqError],
        since: float | None,
    ) -> None:
        super().__init__(buffer, kept)
        self._limit = limit
        self._make_error = make_error
        self._since = since
        """From when the time counts, by the clock of the loop; None before the first item after a start."""

    async def next(self) -> T:
        if self._items or self._ended or self._since is None:
            return await super().next()
        timer = asyncio.get_running_loop().call_at(self._since + self._limit, self._expire)
        try:
            return await super().next()
        finally:
            timer.cancel()

    def push(self, item: T) -> None:
        self._since = asyncio.get_running_loop().time()
        super().push(item)

    def _expire(self) -> None:
        if self._waiting is not None and not self._waiting.done():
            self._since = self._waiting.get_loop().time()
            self._waiting.set_exception(self._make_error(self._limit))


class DerivedIntake(Intake[T]):
    """The inside of a stream of items that ``make`` derives from a channel's items; it drops none.

    ``make`` is called in the turn of each push, so it must be quick and must not fail.
    """

    def __init__(self, make: Callable[[Any], Iterable[T]], kept: set[Intake[Any]]) -> None:
        super().__init__(None, kept)
        self._make = make

    def push(self, item: Any) -> None:  # noqa: ANN401  # the items of the channel, not of this stream
        if not self._ended:
            for made in self._make(item):
                super().push(made)


class Listeners:
    """Calls every listener with every item, in order. A listener that raises is logged and removed."""

    def __init__(self, log: Log = log) -> None:
        self._log = log
        self._listeners: dict[object, Listener] = {}
        """Each has a key, because the same callback may be added twice."""
        self._interrupted: set[object] = set()
        """The keys of the listeners in which the program was interrupted."""
        self._items: deque[object] = deque()
        self._is_telling = False

    def add(self, listener: Listener) -> Callable[[], None]:
        """Add a listener; return a function that removes it, and may be called twice."""
        key = object()
        self._listeners[key] = listener
        return lambda: self._remove(key)

    def tell(self, item: object) -> None:
        """Call every listener. Items that a listener itself causes come after the present item."""
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

    def __init__(self, listeners: Listeners | None = None) -> None:
        self._listeners = listeners or Listeners()
        # A list of references and not a WeakSet, which takes several times as long, at every poll.
        self._intakes: list[weakref.ref[Intake[Any]]] = []
        self._has_dropped = False  # whether some of these were dropped by their readers
        self._waited_for: set[Intake[Any]] = set()
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
            return self._begin(Intake(buffer, self._waited_for))
        since = None if self._loop is None else self._loop.time()
        return self._begin(LimitedIntake(buffer, self._waited_for, limit, make_error, since))

    def derive(self, make: Callable[[T], Iterable[U]]) -> Stream[U]:
        """Open a stream of the items that ``make`` derives from each item from now on."""
        return self._begin(DerivedIntake(make, self._waited_for))

    def _begin(self, intake: Intake[U]) -> Stream[U]:
        if self._failure is not None:
            intake.end(self._failure)
        else:
            if self._loop is not None:
                intake.belong_to(self._loop)
            self._let_go()
            self._intakes.append(weakref.ref(intake, self._forget))
        return Stream(intake)

    def check_loop(self, loop: asyncio.AbstractEventLoop) -> None:
        """Refuse a loop to start in, if a reader waits in another one."""
        if any(each.waits_outside_of(loop) for each in self._living()):
            raise RuntimeError(
                "a stream of the hand is read in another event loop than the hand starts in, and nothing was "
                "sent to the gripper"
            )

    def reopen(self, loop: asyncio.AbstractEventLoop) -> None:
        """The hand starts in this loop, which was checked: forget an earlier failure."""
        self._failure, self._loop = None, loop
        for intake in self._living():
            intake.belong_to(loop)

    def push(self, item: T) -> None:
        for intake in self._living():
            intake.push(item)
        if self._has_dropped:
            self._let_go()
        self._listeners.tell(item)

    def end(self, failure: Callable[[], RobotiqError] | None = None) -> None:
        """End every stream, quietly or with a failure."""
        self._failure, self._loop = failure, None
        ended = [*self._living()]
        self._intakes = []
        for intake in ended:
            intake.end(failure)

    def _living(self) -> Iterator[Intake[Any]]:
        for reference in self._intakes:
            if (intake := reference()) is not None:
                yield intake

    def _let_go(self) -> None:
        self._has_dropped = False
        self._intakes = [each for each in self._intakes if each() is not None]

    def _forget(self, _: weakref.ref[Intake[Any]]) -> None:
        # Called in the thread that drops the last reference; only a flag, because another may open a stream
        # now.
        self._has_dropped = True


class Channels:
    """The statuses, changes of state and written requests of a hand.

    Attributes:
        numbers: the sequence numbers of the statuses, from the first start on.
    """

    def __init__(self, log: Log = log) -> None:
        self.numbers: itertools.count[int] = itertools.count()
        self.listeners: Listeners = Listeners(log)
        self.statuses: Channel[RobotiqStatus] = Channel(self.listeners)
        self.transitions: Channel[Transition] = Channel(self.listeners)
        self.requests: Channel[SentRequest] = Channel(self.listeners)
        self._all: tuple[Channel[Any], ...] = (self.statuses, self.transitions, self.requests)

    def check_loop(self, loop: asyncio.AbstractEventLoop) -> None:
        """Refuse a loop to start in, if a reader waits in another one."""
        for channel in self._all:
            channel.check_loop(loop)

    def reopen(self, loop: asyncio.AbstractEventLoop) -> None:
        """The hand starts in this loop."""
        for channel in self._all:
            channel.reopen(loop)

    def end(self, failure: Callable[[], RobotiqError] | None = None) -> None:
        """End every stream, quietly or with a failure."""
        for channel in self._all:
            channel.end(failure)
