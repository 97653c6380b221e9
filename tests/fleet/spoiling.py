"""Buses that lose requests of one kind, or answer them with something else."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

from robotiq_async.fleet.network.bus import Reply, Urgency
from robotiq_async.fleet.wire.envelope import unpack_answer
from robotiq_async.fleet.wire.values import error_fields
from tests.fleet.network import MemoryBus


class Spoiling:
    """A bus whose answers to one kind of request are spoiled: lost once, or another's."""

    def __init__(
        self,
        bus: MemoryBus,
        verb: str,
        *,
        times: int = 1_000_000,
        answer: bytes | None = None,
        is_sent: bool = True,
    ) -> None:
        self._bus, self._verb, self._answer, self.left = bus, verb, answer, times
        self._is_sent = is_sent

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bus, name)

    def ask(
        self, key: str, payload: bytes, *, timeout: float, urgency: Urgency, **how: Any
    ) -> asyncio.Future[Reply | None]:
        if not key.endswith(self._verb) or not self.left:
            return self._bus.ask(key, payload, timeout=timeout, urgency=urgency, **how)
        self.left -= 1
        if self._answer is None:  # never sent
            return asyncio.ensure_future(_nothing(timeout))
        return asyncio.ensure_future(self._another(key, payload, timeout, urgency))

    async def _another(self, key: str, payload: bytes, timeout: float, urgency: Urgency) -> Reply | None:
        if self._is_sent:
            asking = self._bus.ask(key, payload, timeout=timeout, urgency=urgency)
            await asyncio.sleep(0.1)
            asking.cancel()
        assert self._answer is not None
        return _Answered(self._answer)


class Garbling:
    """A bus whose answers to one kind of request are others: by default, that it is not understood."""

    def __init__(self, bus: MemoryBus, **others: Any) -> None:
        self._bus = bus
        self._others = others or {"value": None, "error": error_fields(TypeError("what?"))}
        self.verb = "nothing yet"

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bus, name)

    def ask(self, key: str, payload: bytes, **how: Any) -> asyncio.Future[Reply | None]:
        asking = self._bus.ask(key, payload, **how)
        return asyncio.ensure_future(self._garbled(asking)) if key.endswith(self.verb) else asking

    async def _garbled(self, asking: asyncio.Future[Reply | None]) -> Reply | None:
        reply = await asking
        if reply is None:
            return None
        return _Answered(replace(unpack_answer(reply.payload), **self._others).pack())


class _Answered:
    attachment = b""

    def __init__(self, payload: bytes) -> None:
        self.payload = payload


async def _nothing(timeout: float) -> None:
    await asyncio.sleep(timeout)
