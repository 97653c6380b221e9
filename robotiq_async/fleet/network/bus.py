"""Bus: what agents and clients need of a network, in one event loop. zenoh is one; tests have another."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from enum import Enum
from typing import Protocol

Undo = Callable[[], None]
"""Takes back what was declared."""


class Urgency(Enum):
    """What goes first when there is not room for all."""

    STOP = "stop"
    """Halts: before everything else."""
    COMMAND = "command"
    """Commands, leases, their answers."""
    TELEMETRY = "telemetry"
    """Statuses, events, summaries: dropped rather than waited for."""


class Query(Protocol):
    """A request that has arrived; it is answered once."""

    @property
    def key(self) -> str:
        """The key it came under; it may be a wrong one."""

    @property
    def payload(self) -> bytes:
        """What was asked."""

    def reply(self, payload: bytes, attachment: bytes = b"") -> None:
        """Answer, without waiting for the network. Nothing happens when nobody waits any more."""


class Reply(Protocol):
    """What came back."""

    @property
    def payload(self) -> bytes:
        """The answer."""

    @property
    def attachment(self) -> bytes:
        """What was sent beside it; may be empty."""


def is_any(_reply: Reply) -> bool:
    """The first reply will do."""
    return True


def is_anything(_payload: bytes) -> bool:
    """Every request is taken."""
    return True


class Bus(Protocol):
    """One open session. All calls and all callbacks belong to the event loop it was opened in."""

    def publisher(self, key: str, urgency: Urgency) -> Callable[[bytes], None]:
        """Something that publishes under a key, and never waits."""

    def subscribe(self, expression: str, listener: Callable[[str, bytes], None]) -> Undo:
        """Call a listener with key and payload of whatever is published under matching keys."""

    def serve(
        self,
        expression: str,
        handler: Callable[[Query], None],
        allows: Callable[[bytes], bool] = is_anything,
    ) -> Undo:
        """Call a handler with each request under matching keys.

        Args:
            expression: the keys.
            handler: belongs to the loop.
            allows: whether a request with this payload is taken. It may be called in any thread, before
                anything else is done; what it does not allow is dropped.
        """

    def ask(
        self,
        key: str,
        payload: bytes,
        *,
        timeout: float,
        urgency: Urgency,
        decides: Callable[[Reply], bool] = is_any,
    ) -> asyncio.Future[Reply | None]:
        """Ask everybody who serves the key, once: after a partition there may be two.

        What is asked first, of the same urgency, arrives first: the request goes out in this call.

        Args:
            key: of whoever is asked.
            payload: what is asked.
            timeout: seconds.
            urgency: of the request and its answers.
            decides: whether a reply is the one that is waited for. When all have answered, or the time is
                over, it is the last one that came.

        Returns:
            The reply; None when nobody serves the key, or may be asked, or answers in time.
        """

    def announce(self, key: str) -> Undo:
        """Let others see this key for as long as this process lives and can be reached."""

    async def announced(self, expression: str, *, timeout: float) -> list[str]:
        """The matching keys that are announced now."""

    def watch(self, expression: str, listener: Callable[[str, bool], None]) -> Undo:
        """Call a listener with each matching key that is announced, also before this, and that is gone."""

    async def unreached(self) -> list[str]:
        """The endpoints that it was told to connect to, and to which there is no connection now."""

    async def close(self) -> None:
        """Take back everything and close. Idempotent; takes a second at most."""
