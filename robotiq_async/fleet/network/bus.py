"""Bus: the network as agents and clients use it, in one event loop. Over zenoh, or simulated in tests.

PendingQuery is for implementations of a bus.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

Undo = Callable[[], None]  # ends a declaration


class Urgency(Enum):
    """Priority of a message on a full link."""

    STOP = "stop"  # halts: before everything else
    COMMAND = "command"  # commands, leases, their answers
    QUESTION = "question"  # of any client, and the answers: behind telemetry
    TELEMETRY = "telemetry"  # statuses, events, summaries: dropped when the link is full


@dataclass(frozen=True, slots=True)
class BusReply:
    """An answer to a request, and the data sent with it."""

    payload: bytes
    attachment: bytes = b""


class Query:
    """A request that has arrived.

    Attributes:
        key: that it arrived under; may be a wrong one.
        payload: the request.
    """

    def __init__(self, key: str, payload: bytes, answer: Callable[[BusReply], object]) -> None:
        """``answer`` sends a reply without waiting for the network."""
        self.key = key
        self.payload = payload
        self._answer = answer

    def reply(self, payload: bytes, attachment: bytes = b"") -> None:
        """Answer it, once. No effect when the client no longer waits."""
        self._answer(BusReply(payload, attachment))


def is_any(_reply: BusReply) -> bool:
    return True


class MessageKind(Enum):
    """Kind of a message. It decides which message is handled first."""

    HALT = "halt"  # before all others
    ANSWER = "answer"  # to a request of this process: never dropped
    REQUEST = "request"
    TELEMETRY = "telemetry"  # may wait 1 ms
    # These come last, one in a turn, and each kind gets a share of the loop:
    OTHERS = "others"  # requests of clients that do not command, while a client does
    QUESTION = "question"  # of anybody


Sort = Callable[[str, Callable[[], bytes]], MessageKind | None]


def is_request(_key: str, _read: Callable[[], bytes]) -> MessageKind:
    return MessageKind.REQUEST


class Bus(Protocol):
    """One open session. Calls, and callbacks unless noted, belong to the event loop it was opened in."""

    @property
    def who(self) -> str:
        """The name that this side has proven, with its certificate; empty without keys."""

    def publisher(self, key: str, urgency: Urgency) -> Callable[[bytes], None]:
        """Return a function that publishes a payload under a key. It never blocks."""

    def subscribe(self, expression: str, listener: Callable[[str, bytes], None]) -> Undo:
        """Call a listener with key and payload of each message under matching keys.

        Returns the function that ends it.
        """

    def serve(
        self,
        expression: str,
        handler: Callable[[Query], None],
        sort: Sort = is_request,
    ) -> Undo:
        """Call a handler with each request under matching keys. Returns the function that ends it.

        Args:
            expression: the keys.
            handler: called in the event loop.
            sort: the kind of a request with this key, from a function that reads its payload; None drops it.
                Called first, in any thread.
        """

    def ask(
        self,
        key: str,
        payload: bytes,
        *,
        timeout: float,
        urgency: Urgency,
        decides: Callable[[BusReply], bool] = is_any,
    ) -> asyncio.Future[BusReply | None]:
        """Send a request, once, to every process that serves the key: after a partition there may be two.

        The request leaves within this call: requests of the same urgency arrive in the order of the calls.

        Args:
            key: its destination.
            payload: the request.
            timeout: seconds.
            urgency: of the request and its answers.
            decides: whether a reply ends the wait. Without such a reply, the result is the last one that
                came, once all processes have answered or the time is over.

        Returns:
            The reply; None if no process serves the key, access is denied, or no answer came in time.
        """

    def announce(self, key: str) -> Undo:
        """Announce a key while this process lives and can be reached. Returns the function that ends it."""

    async def announced(self, expression: str, *, timeout: float) -> list[str]:
        """The matching keys that are announced now; ``timeout`` is in seconds."""

    def watch(self, expression: str, listener: Callable[[str, bool], None]) -> Undo:
        """Call ``listener(key, True)`` when a matching key is announced, with False when it is gone.

        Keys announced before this call are included. Returns the function that ends it.
        """

    async def unreached(self) -> list[str]:
        """The endpoints of the configuration that have no connection now."""

    async def close(self) -> None:
        """End all declarations and close; takes a second at most. Idempotent."""


class PendingQuery:
    """Waits for the reply that decides; without such a reply, the result is the last one, or None."""

    def __init__(self, decides: Callable[[BusReply], bool]) -> None:
        self.answered: asyncio.Future[BusReply | None] = asyncio.get_running_loop().create_future()
        self._decides = decides
        self._last: BusReply | None = None

    def take(self, reply: BusReply) -> None:
        if not self.answered.done():
            self._last = reply
            if self._decides(reply):
                self.answered.set_result(reply)

    def end(self) -> None:
        if not self.answered.done():
            self.answered.set_result(self._last)
