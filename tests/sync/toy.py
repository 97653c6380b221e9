"""A small async hand, for the script that makes blocking ones."""

from __future__ import annotations

from collections.abc import AsyncIterator
from functools import cached_property

from robotiq_async.values.enums import CLOSED, Finger


class Gauge:
    """Measures."""

    async def read(self, finger: Finger = Finger.A) -> float:
        """Read it.

        Raises:
            RuntimeError: in another
                event loop.
        """
        return float(finger)


class Toy:
    """Has a gauge."""

    @property
    def gauge(self) -> Gauge:
        """The gauge."""
        return Gauge()

    async def find(self, *names: str, limit: int = CLOSED) -> Gauge:
        """Find another one.

        Raises:
            ValueError: there is none.
            RuntimeError: in another event loop.
        """
        raise ValueError(f"none of {names} within {limit}")

    def nod(self) -> None:
        """Nod."""


class WithIterator:
    def items(self) -> AsyncIterator[int]:
        raise NotImplementedError


class WithList:
    async def gauges(self) -> list[Gauge]:
        raise NotImplementedError


class WithDecorator:
    @cached_property
    def name(self) -> str:
        return ""


class WithField:
    name: str


class WithAttribute:
    def __init__(self) -> None:
        self.name = ""


class Context:
    async def __aenter__(self) -> None:
        raise NotImplementedError


class WithContext:
    def context(self) -> Context:
        raise NotImplementedError
