"""Iterators over what happens to a blocking hand."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Generic, Self, TypeVar

from ..session.streams import Stream as AsyncStream
from .caller import Caller

T = TypeVar("T")


class Stream(Generic[T]):
    """An iterator with one reader; dropping it ends it. Made by a hand."""

    def __init__(self, stream: AsyncStream[T], caller: Caller) -> None:
        self._stream = stream
        self._caller = caller

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> T:
        """The next item; waits for it. An interrupted wait loses nothing.

        Raises:
            StopIteration: the hand was stopped, or the stream was closed.
            RobotiqConnectionError: the hand gave up on its link.
            RuntimeError: another thread is waiting on the same stream.
        """
        items = self._caller.wait(self._next)
        if not items:
            raise StopIteration
        return items[0]

    async def _next(self) -> tuple[T, ...]:
        try:
            return (await anext(self._stream),)
        except StopAsyncIteration:
            return ()

    @property
    def missed(self) -> int:
        """Items that were dropped, the oldest first, because the reader was slow."""
        return self._stream.missed

    def take_nowait(self) -> T | None:
        """The next item if there is one now, or None."""
        return self._caller.tell(self._stream.take_nowait)

    def drain(self) -> Iterator[T]:
        """Iterate over the items that are there now."""
        return iter(self._caller.tell(lambda: list(self._stream.drain())))

    def close(self) -> None:
        """End the stream; a waiting reader ends too. Idempotent."""
        self._caller.wait(self._stream.aclose)
