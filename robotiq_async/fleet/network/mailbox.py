"""Mailbox and ReplySender: between zenoh's threads and the event loop; neither waits for the other."""

from __future__ import annotations

import asyncio
import contextlib
import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Final

from ..limited_log import LimitedLog
from .bus import MessageKind

GATHER_S: Final = 0.001
"""Seconds for which telemetry is collected under load, to wake the loop once for all of it."""
TURN_S: Final = 0.002  # seconds of deliveries in one turn of the loop: the rest of the program must run, too
MOST: Final = 2000  # Requests and telemetry that may wait. Beyond that they are dropped, as on a full network
MOST_QUESTIONS: Final = 64  # of each kind that comes last. Beyond that they are dropped: clients ask again
SHARE: Final = 0.1  # of the loop's time, at most, goes to each kind that comes last
MOST_REPLIES: Final = 1000
"""Replies that may wait. Beyond that the query is dropped, also in this thread: zenoh notifies the client of
it, which can block for as long. Clients repeat their requests."""


class _Last:
    """The messages of a kind that comes last."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.deliveries: deque[Callable[[], None]] = deque()
        self.due = 0.0  # when the next may be delivered
        self._loop = loop

    def deliver_one(self, deliver: Callable[[Callable[[], None]], None]) -> None:
        """And then none for as long as its share demands. Nothing that moves fingers waits for it."""
        if self.deliveries and self._loop.time() >= self.due:
            begun = time.perf_counter()
            deliver(self.deliveries.popleft())
            self.due = self._loop.time() + (time.perf_counter() - begun) * (1 / SHARE - 1)


class Mailbox:
    """Deliveries in the order of arrival, halts first, questions last.

    Waking the loop costs more than handling a status. Under load, with telemetry from dozens of hands, the
    loop is woken once for all that arrives within a millisecond. Requests, answers and the telemetry of a
    single hand never wait for this millisecond.
    """

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._halts: deque[Callable[[], None]] = deque()
        self._deliveries: deque[Callable[[], None]] = deque()
        self._last = {kind: _Last(self._loop) for kind in (MessageKind.OTHERS, MessageKind.QUESTION)}
        self._queues = {MessageKind.HALT: self._halts} | {
            kind: last.deliveries for kind, last in self._last.items()
        }
        self._is_due = False
        self._gathering: asyncio.TimerHandle | None = None
        self._opened_at = 0.0
        self._failed = LimitedLog()
        self._full = LimitedLog(clock=self._loop.time)

    def has_room(self, kind: MessageKind) -> bool:
        """Whether a delivery of this kind is not dropped now; thread-safe."""
        waiting = len(self._queues.get(kind, self._deliveries))
        if kind is MessageKind.ANSWER or waiting < (MOST_QUESTIONS if kind in self._last else MOST):
            return True
        if kind not in self._last:
            self._full.warn("a fleet message was dropped: queue full")
        return False

    def put(self, delivery: Callable[[], None], kind: MessageKind) -> bool:
        """Call a function in the loop; thread-safe. False if the mailbox is full: the call is dropped."""
        if not self.has_room(kind):
            return False
        self._queues.get(kind, self._deliveries).append(delivery)
        # Telemetry, and the kinds that come last, wait for a timer that is already set. Any other kind wakes
        # the loop earlier.
        waits = kind is MessageKind.TELEMETRY or kind in self._last
        if not self._is_due or (not waits and self._gathering is not None):
            self._is_due = True
            with contextlib.suppress(RuntimeError):  # the loop is closed
                self._loop.call_soon_threadsafe(self._open)
        return True

    def _open(self) -> None:
        if self._gathering is not None:
            self._gathering.cancel()
        self._is_due, self._gathering = False, None
        before, self._opened_at = self._opened_at, self._loop.time()
        count, until = 0, time.perf_counter() + TURN_S
        while self._halts or self._deliveries:
            self._deliver((self._halts or self._deliveries).popleft())
            count += 1
            if time.perf_counter() > until:
                break
        else:
            for last in self._last.values():
                last.deliver_one(self._deliver)
        # A delivery may have put another one, so _is_due may be set again.
        if (self._halts or self._deliveries) and not self._is_due:
            self._is_due = True
            self._loop.call_soon(self._open)
        elif (due := [last.due for last in self._last.values() if last.deliveries]) and not self._is_due:
            self._is_due = True
            self._gathering = self._loop.call_at(max(min(due), self._opened_at), self._open)
        # Two openings in close succession mean load: collect, instead of waking the loop for each message.
        elif count and not self._is_due and self._opened_at - before < 2 * GATHER_S:
            self._is_due = True
            self._gathering = self._loop.call_later(GATHER_S, self._open)

    def _deliver(self, delivery: Callable[[], None]) -> None:
        try:
            delivery()
        except Exception:  # noqa: BLE001  # must not stop the deliveries after it
            self._failed.warn("handling a fleet message failed", exc_info=True)


class ReplySender:
    """Sends replies from a separate thread, started with the first one.

    A reply takes the priority and the congestion control of its query, which the client chooses. Sending one
    to a client that does not read can block until the connection is closed; the event loop must not wait for
    that.
    """

    def __init__(self, pause: float = 0.0) -> None:
        """``pause`` is in seconds: replies of so long a time go out together, after the first.

        Each time that the thread wakes, the event loop may wait for the interpreter. On a busy machine that
        lasts as long as the thread is kept from the processor.
        """
        self._pause = pause
        self._waiting: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None

    def put(self, send: Callable[[], None], drop: Callable[[], None]) -> None:
        """Send a reply after the earlier replies, or drop its query if too many wait."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="robotiq_async fleet", daemon=True)
            self._thread.start()
        self._waiting.put(send if self._waiting.qsize() < MOST_REPLIES else drop)

    def close(self) -> None:
        """Send the waiting replies, then end the thread."""
        self._waiting.put(None)

    def join(self, timeout: float) -> None:
        # Blocks: call it outside the event loop.
        if self._thread is not None:
            self._thread.join(timeout)

    def _run(self) -> None:
        while (send := self._waiting.get()) is not None:
            send()
            if self._pause and self._waiting.empty():
                time.sleep(self._pause)
