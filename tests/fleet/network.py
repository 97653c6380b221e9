"""A network in one virtual loop, with the troubles that networks have, for agents and clients to meet in.

Between each two buses there are two streams, one in each direction, and what is sent on one arrives in its
order, as over TCP: whatever is lost is only late, and so is all that follows.
"""

from __future__ import annotations

import asyncio
import functools
import random
import re
from collections.abc import Callable
from dataclasses import dataclass, field

from robotiq_async.fleet.network.bus import Question, Reply, Undo, Urgency

LATENCY_S = 0.0002
IN_ORDER_S = 1e-8
"""From one message to the next: timers of the same instant come in any order."""


def matches(expression: str, key: str) -> bool:
    """Whether a key matches: ``*`` is one part of it, ``**`` any number."""
    pattern = re.escape(expression).replace(r"\*\*", ".+").replace(r"\*", "[^/]+")
    return re.fullmatch(pattern, key) is not None


@dataclass
class Stream:
    """What goes from one bus to another.

    Attributes:
        is_cut: nothing arrives; what is sent meanwhile arrives when it is mended, or never.
        keeps: whether it arrives then. News are dropped in any case.
        delay: seconds, added to every message.
        loss: share of messages that have to be sent again.
        rate: bytes a second.
        copies: times each message arrives.
        lateness: seconds by which the second copy is late.
    """

    is_cut: bool = False
    keeps: bool = True
    delay: float = 0.0
    loss: float = 0.0
    rate: float = float("inf")
    copies: int = 1
    lateness: float = 0.1
    free_at: float = 0.0
    kept: list[Callable[[], None]] = field(default_factory=list)


class Network:
    """All streams, and all that is announced."""

    def __init__(self, seed: int = 1) -> None:
        self.streams: dict[tuple[str, str], Stream] = {}
        self.buses: list[MemoryBus] = []
        self.random = random.Random(seed)
        self.wrong_key: Callable[[str], str] = lambda key: key
        """Under which key something arrives."""

    def stream(self, source: str, target: str) -> Stream:
        return self.streams.setdefault((source, target), Stream())

    def both(self, one: str, other: str) -> list[Stream]:
        return [self.stream(one, other), self.stream(other, one)]

    def mend(self, *streams: Stream) -> None:
        for stream in streams:
            stream.is_cut = False
            kept, stream.kept = stream.kept, []
            for deliver in kept:
                asyncio.get_running_loop().call_later(LATENCY_S, deliver)

    def carry(
        self, source: str, target: str, size: int, deliver: Callable[[], None], urgency: Urgency
    ) -> None:
        loop, stream = asyncio.get_running_loop(), self.stream(source, target)
        if stream.is_cut:
            if stream.keeps and urgency is not Urgency.NEWS:
                stream.kept.append(deliver)
            return
        if urgency is Urgency.NEWS and stream.free_at - loop.time() > 0.05:
            return  # dropped rather than waited for
        again = 0.0
        while self.random.random() < stream.loss:
            again = 2 * again or 0.2
        begins = max(loop.time(), stream.free_at - stream.delay) + again + size / stream.rate
        stream.free_at = begins + stream.delay + IN_ORDER_S
        for copy in range(stream.copies):
            loop.call_at(stream.free_at + LATENCY_S + copy * stream.lateness, deliver)

    def bus(self, name: str) -> MemoryBus:
        bus = MemoryBus(self, name)
        self.buses.append(bus)
        return bus


class _Question:
    def __init__(self, key: str, payload: bytes, reply: Callable[[bytes, bytes], None]) -> None:
        self.key, self.payload, self._reply = key, payload, reply

    def reply(self, payload: bytes, attachment: bytes = b"") -> None:
        self._reply(payload, attachment)


@dataclass(frozen=True)
class _Reply:
    payload: bytes
    attachment: bytes


class MemoryBus:
    """One side's bus."""

    def __init__(self, network: Network, name: str) -> None:
        self.name = name
        self.network = network
        self.subscribers: list[tuple[str, Callable[[str, bytes], None]]] = []
        self.queryables: list[tuple[str, Callable[[Question], None]]] = []
        self.tokens: set[str] = set()
        self.watchers: list[tuple[str, Callable[[str, bool], None]]] = []
        self.is_closed = False

    def _others(self) -> list[MemoryBus]:
        return [bus for bus in self.network.buses if bus is not self and not bus.is_closed]

    def publisher(self, key: str, urgency: Urgency) -> Callable[[bytes], None]:
        def publish(payload: bytes) -> None:
            for other in self._others():
                if self.is_closed or not any(matches(each, key) for each, _ in other.subscribers):
                    continue
                deliver = functools.partial(other.hear, key, payload)
                self.network.carry(self.name, other.name, len(payload), deliver, urgency)

        return publish

    def hear(self, key: str, payload: bytes) -> None:
        key = self.network.wrong_key(key)
        for expression, listener in list(self.subscribers):
            if matches(expression, key) and not self.is_closed:
                listener(key, payload)

    def subscribe(self, expression: str, listener: Callable[[str, bytes], None]) -> Undo:
        entry = (expression, listener)
        self.subscribers.append(entry)
        return lambda: self.subscribers.remove(entry) if entry in self.subscribers else None

    def serve(self, expression: str, handler: Callable[[Question], None]) -> Undo:
        entry = (expression, handler)
        self.queryables.append(entry)
        return lambda: self.queryables.remove(entry) if entry in self.queryables else None

    def ask(
        self, key: str, payload: bytes, *, timeout: float, urgency: Urgency
    ) -> asyncio.Future[Reply | None]:
        return asyncio.ensure_future(self._ask(key, payload, timeout=timeout, urgency=urgency))

    async def _ask(self, key: str, payload: bytes, *, timeout: float, urgency: Urgency) -> Reply | None:
        answered: asyncio.Future[Reply | None] = asyncio.get_running_loop().create_future()
        for other in self._others():
            for expression, handler in other.queryables:
                if matches(expression, key) and not self.is_closed:
                    self._carry_question(other, handler, key, payload, answered, urgency)
                    break
            else:
                continue
            break
        else:
            return None
        try:
            async with asyncio.timeout(timeout):
                return await answered
        except TimeoutError:
            return None

    def _carry_question(
        self,
        other: MemoryBus,
        handler: Callable[[Question], None],
        key: str,
        payload: bytes,
        answered: asyncio.Future[Reply | None],
        urgency: Urgency,
    ) -> None:
        network = self.network

        def take(reply: Reply) -> None:
            if not answered.done():
                answered.set_result(reply)

        def back(data: bytes, attachment: bytes) -> None:
            deliver = functools.partial(take, _Reply(data, attachment))
            network.carry(other.name, self.name, len(data) + len(attachment), deliver, urgency)

        def arrive() -> None:
            if not other.is_closed:
                handler(_Question(network.wrong_key(key), payload, back))

        network.carry(self.name, other.name, len(payload), arrive, urgency)

    def announce(self, key: str) -> Undo:
        self.tokens.add(key)
        self._show(key, True)

        def undo() -> None:
            if key in self.tokens:
                self.tokens.discard(key)
                self._show(key, False)

        return undo

    def _show(self, key: str, is_there: bool) -> None:
        loop = asyncio.get_running_loop()
        for bus in self.network.buses:
            for expression, listener in bus.watchers:
                if matches(expression, key):
                    loop.call_later(LATENCY_S, listener, key, is_there)

    async def announced(self, expression: str, *, timeout: float) -> list[str]:  # noqa: ARG002
        await asyncio.sleep(LATENCY_S)
        return sorted(
            key
            for other in self._others()
            if not self.network.stream(other.name, self.name).is_cut
            for key in other.tokens
            if matches(expression, key)
        )

    def watch(self, expression: str, listener: Callable[[str, bool], None]) -> Undo:
        entry = (expression, listener)
        self.watchers.append(entry)
        for bus in self.network.buses:
            for key in bus.tokens:
                if matches(expression, key):
                    asyncio.get_running_loop().call_later(LATENCY_S, listener, key, True)
        return lambda: self.watchers.remove(entry) if entry in self.watchers else None

    async def close(self) -> None:
        self.is_closed = True
        for key in list(self.tokens):
            self._show(key, False)
        self.tokens.clear()
