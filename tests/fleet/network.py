"""A network in one virtual loop, with the troubles that networks have, for agents and clients to meet in.

Between each two buses there are two streams, one in each direction, and what is sent on one arrives in its
order, as over TCP: whatever is lost is only late, and so is all that follows. A link over which one side has
not heard the other for LINK_LEASE_S is closed, with every message on it; it is up again soon after
the trouble is over. A network that ``keeps_links`` closes none, and delivers all of it then, as routers do.
"""

from __future__ import annotations

import asyncio
import functools
import random
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from robotiq_async.fleet.network.bus import (
    BusReply,
    PendingQuery,
    Query,
    Sort,
    Undo,
    Urgency,
    is_any,
    is_request,
)
from tests.fleet.hosts import Host

T = TypeVar("T")
LATENCY_S = 0.0002
LINK_LEASE_S = 1.0
RECONNECT_S = 0.2
IN_ORDER_S = 1e-8
"""Seconds from one message to the next: timers of the same instant come in any order."""


@functools.cache
def matches(expression: str, key: str) -> bool:
    """Whether a key matches: ``*`` is one part of it, ``**`` any number."""
    pattern = re.escape(expression).replace(r"\*\*", ".+").replace(r"\*", "[^/]+")
    return re.fullmatch(pattern, key) is not None


@dataclass
class Stream:
    """The messages from one bus to another.

    Attributes:
        is_cut: nothing arrives; messages sent in that time arrive when it is mended, or never.
        keeps: whether it arrives then. Telemetry is dropped in any case.
        delay: seconds, added to every message.
        loss: share of messages that have to be sent again.
        rate: bytes a second.
        jitter: seconds, at most; each message has its own, and the order is lost.
        copies: times each message arrives.
        lateness: seconds by which the second copy is late.
    """

    is_cut: bool = False
    keeps: bool = True
    delay: float = 0.0
    loss: float = 0.0
    rate: float = float("inf")
    jitter: float = 0.0
    copies: int = 1
    lateness: float = 0.1
    free_at: float = 0.0
    kept: list[Callable[[], None]] = field(default_factory=list)


class Network:
    """All streams, and all that is announced.

    Attributes:
        keeps_links: whether no link is ever closed.
    """

    def __init__(self, seed: int = 1) -> None:
        self.loop = asyncio.get_running_loop()
        self.streams: dict[tuple[str, str], Stream] = {}
        self.buses: list[MemoryBus] = []
        self.random = random.Random(seed)
        self.wrong_key: Callable[[str], str] = lambda key: key
        """Under which key something arrives."""
        self.keeps_links = False
        self.pending: set[_Query] = set()
        self._parted: set[frozenset[str]] = set()

    def stream(self, source: str, target: str) -> Stream:
        return self.streams.setdefault((source, target), Stream())

    def both(self, one: str, other: str) -> list[Stream]:
        return [self.stream(one, other), self.stream(other, one)]

    def delay(self, one: str, other: str, seconds: float) -> None:
        for stream in self.both(one, other):
            stream.delay = seconds

    def cut(self, *ways: tuple[str, str]) -> None:
        """Let nothing arrive from now on; each way is a source and a target."""
        for source, target in ways:
            self.stream(source, target).is_cut = True
            self.loop.call_later(LINK_LEASE_S, self._part_if_cut, source, target)

    def _part_if_cut(self, source: str, target: str) -> None:
        if self.stream(source, target).is_cut and not self.keeps_links:
            self.part(source, target)

    def mend(self, *streams: Stream) -> None:
        for stream in streams:
            stream.is_cut = False
            kept, stream.kept = stream.kept, []
            for deliver in kept:
                self.loop.call_later(LATENCY_S, deliver)
        for (source, target), stream in self.streams.items():
            if stream in streams and not self.is_up(source, target):
                self.loop.call_later(RECONNECT_S, self.join, source, target)

    def is_up(self, one: str, other: str) -> bool:
        """Whether there is a link between two buses."""
        return frozenset((one, other)) not in self._parted

    def part(self, one: str, other: str) -> None:
        """Close a link: requests over it end without an answer, and neither side sees the other."""
        if not self.is_up(one, other):
            return
        self._parted.add(frozenset((one, other)))
        for stream in self.both(one, other):
            stream.kept.clear()
        for query in list(self.pending):
            if query.source.name in (one, other):
                query.end(one, other)
        self._show_each_other(one, other, is_there=False)

    def join(self, one: str, other: str) -> None:
        """Open it again, unless its cause lasts."""
        if not self.is_up(one, other) and not any(each.is_cut for each in self.both(one, other)):
            self._parted.discard(frozenset((one, other)))
            self._show_each_other(one, other, is_there=True)

    def _show_each_other(self, one: str, other: str, *, is_there: bool) -> None:
        for bus in self.buses:
            for peer in self.buses:
                if {bus.name, peer.name} == {one, other}:
                    for key in peer.tokens:
                        bus.see(key, is_there)

    def carry(
        self, source: str, target: MemoryBus, size: int, deliver: Callable[[], None], urgency: Urgency
    ) -> None:
        loop, stream = self.loop, self.stream(source, target.name)
        if not self.is_up(source, target.name):
            return

        # The host it is for may stand still.
        here = target.loop
        arrive = functools.partial(here.call_now, deliver) if isinstance(here, Host) else deliver
        if stream.is_cut:
            if stream.keeps and urgency is not Urgency.TELEMETRY:
                stream.kept.append(arrive)
            return
        if urgency is Urgency.TELEMETRY and stream.free_at - loop.time() > 0.05 + stream.delay:
            return  # dropped rather than waited for
        again = 0.0
        while self.random.random() < stream.loss:
            again = 2 * again or 0.2
        begins = max(loop.time(), stream.free_at - stream.delay) + again + size / stream.rate
        stream.free_at = begins + stream.delay + IN_ORDER_S
        for copy in range(stream.copies):
            jitter = self.random.uniform(0.0, stream.jitter)
            loop.call_at(stream.free_at + LATENCY_S + jitter + copy * stream.lateness, arrive)

    def bus(self, name: str, host: asyncio.AbstractEventLoop | None = None) -> MemoryBus:
        bus = MemoryBus(self, name, host or self.loop)
        self.buses.append(bus)
        return bus


class _Query:
    """A request on its way to all who serve its key, until each has answered or is out of reach."""

    def __init__(
        self, source: MemoryBus, targets: list[str], urgency: Urgency, decides: Callable[[BusReply], bool]
    ) -> None:
        self.source = source
        self.asking = PendingQuery(decides)
        self._left = targets
        self._urgency = urgency

    def carry_back(self, target: str, reply: BusReply | None) -> None:
        network = self.source.network
        size = 0 if reply is None else len(reply.payload) + len(reply.attachment)
        if not network.loop.is_closed():
            take = functools.partial(self.take, target, reply)
            network.carry(target, self.source, size, take, self._urgency)

    def take(self, target: str, reply: BusReply | None) -> None:
        """It is answered, or is not going to be."""
        if target in self._left:
            self._left.remove(target)
            if reply is not None:
                self.asking.take(reply)
            if not self._left:
                self.asking.end()

    def end(self, *names: str) -> None:
        """Some of the processes that got the request are gone."""
        for name in names:
            self.source.loop.call_soon(self.take, name, None)


class _Received(Query):
    def __init__(self, key: str, payload: bytes, reply: Callable[[BusReply | None], None]) -> None:
        super().__init__(key, payload, reply)
        self._is_answered = False

    def reply(self, payload: bytes, attachment: bytes = b"") -> None:
        self._is_answered = True
        super().reply(payload, attachment)

    def __del__(self) -> None:
        """A dropped query is reported to its client."""
        if not self._is_answered:
            self._answer(None)  # type: ignore[arg-type]


def _entered(entries: list[T], entry: T) -> Undo:
    entries.append(entry)
    return lambda: entries.remove(entry) if entry in entries else None


class MemoryBus:
    """One side's bus."""

    who = ""

    def __init__(self, network: Network, name: str, loop: asyncio.AbstractEventLoop) -> None:
        self.name = name
        self.loop = loop
        self.network = network
        self.subscribers: list[tuple[str, Callable[[str, bytes], None]]] = []
        self.queryables: list[tuple[str, Callable[[Query], None]]] = []
        self.tokens: set[str] = set()
        self.watchers: list[tuple[str, Callable[[str, bool], None]]] = []
        self.is_closed = False
        self.endpoints: list[str] = []
        """Names of buses that it connects to."""
        self.listen: Callable[[str, bytes], object] = lambda *_: None
        """Hears what is asked here."""

    def _others(self) -> list[MemoryBus]:
        return [
            bus
            for bus in self.network.buses
            if bus is not self and not bus.is_closed and self.network.is_up(self.name, bus.name)
        ]

    def publisher(self, key: str, urgency: Urgency) -> Callable[[bytes], None]:
        def publish(payload: bytes) -> None:
            for other in self._others():
                if self.is_closed or not any(matches(each, key) for each, _ in other.subscribers):
                    continue
                deliver = functools.partial(other.hear, key, payload)
                self.network.carry(self.name, other, len(payload), deliver, urgency)

        return publish

    def hear(self, key: str, payload: bytes) -> None:
        key = self.network.wrong_key(key)
        for expression, listener in list(self.subscribers):
            if matches(expression, key) and not self.is_closed:
                listener(key, payload)

    def subscribe(self, expression: str, listener: Callable[[str, bytes], None]) -> Undo:
        return _entered(self.subscribers, (expression, listener))

    def serve(
        self,
        expression: str,
        handler: Callable[[Query], None],
        sort: Sort = is_request,
    ) -> Undo:
        return _entered(
            self.queryables,
            (expression, lambda query: handler(query) if sort(query.key, lambda: query.payload) else None),
        )

    def ask(
        self,
        key: str,
        payload: bytes,
        *,
        timeout: float,
        urgency: Urgency,
        decides: Callable[[BusReply], bool] = is_any,
    ) -> asyncio.Future[BusReply | None]:
        return asyncio.ensure_future(self._ask(key, payload, timeout, urgency, decides))

    async def _ask(
        self, key: str, payload: bytes, timeout: float, urgency: Urgency, decides: Callable[[BusReply], bool]
    ) -> BusReply | None:
        network = self.network
        self.listen(key, payload)
        found = [
            (other, handler)
            for other in self._others()
            for expression, handler in other.queryables
            if matches(expression, key)
        ]
        if not found or self.is_closed:
            return None
        query = _Query(self, [other.name for other, _ in found], urgency, decides)
        network.pending.add(query)

        def arrive(other: MemoryBus, handler: Callable[[Query], None]) -> None:
            if not other.is_closed:
                answer = functools.partial(query.carry_back, other.name)
                handler(_Received(network.wrong_key(key), payload, answer))

        for other, handler in found:
            network.carry(self.name, other, len(payload), functools.partial(arrive, other, handler), urgency)
        timer = self.loop.call_later(timeout, query.asking.end)
        try:
            return await query.asking.answered
        finally:
            timer.cancel()
            network.pending.discard(query)

    def announce(self, key: str) -> Undo:
        self.tokens.add(key)
        self._show(key, True)

        def undo() -> None:
            if key in self.tokens:
                self.tokens.discard(key)
                self._show(key, False)

        return undo

    def _show(self, key: str, is_there: bool) -> None:
        for bus in self.network.buses:
            if self.network.is_up(self.name, bus.name):
                bus.see(key, is_there)

    def see(self, key: str, is_there: bool) -> None:
        """A token has come or gone."""
        for expression, listener in self.watchers:
            if matches(expression, key) and not self.loop.is_closed():
                self.loop.call_later(LATENCY_S, listener, key, is_there)

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
        for bus in self.network.buses:
            for key in bus.tokens:
                if matches(expression, key) and self.network.is_up(self.name, bus.name):
                    self.loop.call_later(LATENCY_S, listener, key, True)
        return _entered(self.watchers, (expression, listener))

    async def unreached(self) -> list[str]:
        there = {bus.name for bus in self._others() if not self.network.stream(bus.name, self.name).is_cut}
        return [each for each in self.endpoints if each not in there]

    async def close(self) -> None:
        self.is_closed = True
        for query in list(self.network.pending):
            query.end(*([bus.name for bus in self.network.buses] if query.source is self else [self.name]))
        for key in list(self.tokens):
            self._show(key, False)
        self.tokens.clear()
