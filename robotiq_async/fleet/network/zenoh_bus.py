"""ZenohBus: the bus over zenoh. No other module imports zenoh.

zenoh calls back in its own threads. The callbacks only put each message into a mailbox, which wakes the
event loop once for all that wait.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from ...runtime import addresses_of
from .endpoints import parse_endpoint

try:
    import zenoh
    from zenoh.handlers import Callback
except ModuleNotFoundError as error:
    from ...runtime import install

    raise ImportError(f"hands on other hosts need zenoh: {install('fleet')}") from error

from ...runtime import in_a_thread
from ...values import ConnectFailedError
from ..keys.credentials import common_name
from .bus import BusReply, MessageKind, PendingQuery, Query, Sort, Undo, Urgency, is_any, is_request
from .mailbox import Mailbox, ReplySender

CLOSE_S: Final = 1.0  # seconds for closing a session
LAST_ANSWERS_S: Final = 0.2  # seconds to send the answers to requests that are cancelled at the end
TOGETHER_S: Final = 0.02  # seconds from one report of dropped requests, or answer to a question, to the next
LONGEST_REQUEST: Final = 4096  # bytes of a request; a longer one is dropped unread
_PRIORITY: Final = {
    Urgency.STOP: zenoh.Priority.REAL_TIME,
    Urgency.COMMAND: zenoh.Priority.INTERACTIVE_HIGH,
    Urgency.TELEMETRY: zenoh.Priority.DATA,
    Urgency.QUESTION: zenoh.Priority.DATA_LOW,
}
_EXPRESS: Final = (Urgency.STOP, Urgency.COMMAND)  # sent at once, not batched
RESOLVED_S: Final = 1.0  # seconds to resolve a host name; one that takes longer counts as unknown


async def open_bus(configuration: Mapping[str, Any], what: str) -> ZenohBus:
    """Open a session, named ``what`` in messages; ConnectFailedError: an address in use, for example."""

    def open_session() -> zenoh.Session:
        return zenoh.open(zenoh.Config.from_json5(json.dumps(configuration)))

    opening = in_a_thread(open_session)  # blocks while a router is out of reach
    try:
        session = await asyncio.shield(opening)
    except zenoh.ZError as error:
        raise ConnectFailedError(what, " ".join(str(error).split())) from error
    except asyncio.CancelledError:
        opening.add_done_callback(_close_opened)
        raise
    tls = configuration["transport"]["link"].get("tls")
    who = common_name(Path(tls["connect_certificate"])) if tls else ""
    return ZenohBus(session, configuration["connect"]["endpoints"], who)


def _close_opened(opening: asyncio.Future[zenoh.Session]) -> None:
    if not opening.cancelled() and opening.exception() is None:
        opening.result().close()  # type: ignore[no-untyped-call]


def _drop(query: zenoh.Query) -> None:
    # Without an answer zenoh ends the query of the client at once.
    with contextlib.suppress(zenoh.ZError):
        query.drop()  # type: ignore[no-untyped-call]


def _reply(query: zenoh.Query, reply: BusReply) -> None:
    with contextlib.suppress(zenoh.ZError), query:  # the client is gone
        query.reply(str(query.key_expr), reply.payload, attachment=reply.attachment)


def _read(sample: zenoh.Sample) -> BusReply:
    attachment = b"" if sample.attachment is None else sample.attachment.to_bytes()
    return BusReply(sample.payload.to_bytes(), attachment)


class ZenohBus:
    """An open session: :class:`~robotiq_async.fleet.network.bus.Bus` over zenoh."""

    def __init__(self, session: zenoh.Session, endpoints: Sequence[str] = (), who: str = "") -> None:
        self.who = who
        self._session = session
        self._endpoints = endpoints
        self._mailbox = Mailbox()
        # A sender for each kind: clients that do not read their answers delay only answers of that kind.
        self._repliers = {
            kind: ReplySender(pause=TOGETHER_S if kind is MessageKind.QUESTION else 0.0)
            for kind in (MessageKind.HALT, MessageKind.REQUEST, MessageKind.OTHERS, MessageKind.QUESTION)
        }
        self._dropping = ReplySender(pause=TOGETHER_S)
        self._closing: asyncio.Future[None] | None = None

    def publisher(self, key: str, urgency: Urgency) -> Callable[[bytes], None]:
        publisher = self._session.declare_publisher(
            key,
            priority=_PRIORITY[urgency],
            # A stalled reader must not block the loop that polls.
            congestion_control=zenoh.CongestionControl.DROP,
            express=urgency in _EXPRESS,
        )

        put = publisher.put

        def publish(payload: bytes) -> None:
            try:  # noqa: SIM105  # the most frequent call, and suppress() takes 0.3 us
                put(payload)
            except zenoh.ZError:
                pass  # the session is closed

        return publish

    def subscribe(self, expression: str, listener: Callable[[str, bytes], None]) -> Undo:
        def deliver(sample: zenoh.Sample) -> None:
            delivery = functools.partial(_deliver, listener, sample)
            self._mailbox.put(delivery, MessageKind.TELEMETRY)

        return self._undo(self._session.declare_subscriber(expression, _direct(deliver)))

    def serve(
        self,
        expression: str,
        handler: Callable[[Query], None],
        sort: Sort = is_request,
    ) -> Undo:
        def deliver(query: zenoh.Query) -> None:
            # A flood is recognized by its key alone. This thread of zenoh has the interpreter meanwhile.
            key, drop = str(query.key_expr), functools.partial(_drop, query)
            payload = query.payload or zenoh.ZBytes(b"")
            kind = sort(key, payload.to_bytes) if len(payload) <= LONGEST_REQUEST else None
            if kind is not None and self._mailbox.has_room(kind):
                sender = self._repliers[kind]
                received = Query(
                    *(key, payload.to_bytes()),
                    lambda reply: sender.put(functools.partial(_reply, query, reply), drop),
                )
                if self._mailbox.put(lambda: handler(received), kind):
                    return
            # Dropping notifies the client, and blocks while that does not read, until its link is closed.
            # In this thread it would keep zenoh from receiving anything else.
            self._dropping.put(drop, drop)

        return self._undo(self._session.declare_queryable(expression, _direct(deliver)))

    def ask(
        self,
        key: str,
        payload: bytes,
        *,
        timeout: float,
        urgency: Urgency,
        decides: Callable[[BusReply], bool] = is_any,
    ) -> asyncio.Future[BusReply | None]:
        asking = PendingQuery(decides)

        def arrive(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                sample = reply.ok
                self._mailbox.put(lambda: asking.take(_read(sample)), MessageKind.ANSWER)

        def end() -> None:
            self._mailbox.put(asking.end, MessageKind.ANSWER)

        try:
            self._session.get(
                key,
                Callback(arrive, end, indirect=False),
                payload=payload,
                timeout=timeout,
                priority=_PRIORITY[urgency],
                express=urgency is Urgency.STOP,
                target=zenoh.QueryTarget.BEST_MATCHING,
                consolidation=zenoh.ConsolidationMode.NONE,
                congestion_control=zenoh.CongestionControl.DROP,
            )
        except zenoh.ZError:
            asking.end()  # the session is closed
        return asking.answered

    def announce(self, key: str) -> Undo:
        return self._undo(self._session.liveliness().declare_token(key))

    async def announced(self, expression: str, *, timeout: float) -> list[str]:
        found: list[str] = []
        ended = asyncio.Event()

        def arrive(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                found.append(str(reply.ok.key_expr))

        # Not a channel of zenoh: it holds 256, and get() fills it itself, so it would wait forever.
        handler = Callback(arrive, lambda: self._mailbox.put(ended.set, MessageKind.ANSWER), indirect=False)
        with contextlib.suppress(TimeoutError, zenoh.ZError):
            self._session.liveliness().get(expression, handler, timeout=timeout)
            async with asyncio.timeout(2 * timeout):
                await ended.wait()
        return list(found)

    def watch(self, expression: str, listener: Callable[[str, bool], None]) -> Undo:
        def deliver(sample: zenoh.Sample) -> None:
            key, is_there = str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT
            self._mailbox.put(lambda: listener(key, is_there), MessageKind.ANSWER)

        liveliness = self._session.liveliness()
        return self._undo(liveliness.declare_subscriber(expression, _direct(deliver), history=True))

    async def unreached(self) -> list[str]:
        there = {str(link.dst) for link in self._session.info.links()}
        where = await asyncio.gather(*map(locators, self._endpoints))  # a name may take RESOLVED_S
        return [each for each, known in zip(self._endpoints, where, strict=True) if there.isdisjoint(known)]

    async def close(self) -> None:
        if self._closing is None:
            self._closing = asyncio.ensure_future(asyncio.to_thread(self._close))
        with contextlib.suppress(TimeoutError, zenoh.ZError):
            await asyncio.wait_for(asyncio.shield(self._closing), CLOSE_S)

    def _close(self) -> None:
        repliers = [*self._repliers.values(), self._dropping]
        for reply_sender in repliers:
            reply_sender.close()
            reply_sender.join(LAST_ANSWERS_S)
        self._session.close()  # type: ignore[no-untyped-call]
        for reply_sender in repliers:
            reply_sender.join(CLOSE_S)

    def _undo(self, declared: Any) -> Undo:  # noqa: ANN401  # each kind has its own class
        def undo() -> None:
            with contextlib.suppress(zenoh.ZError):
                declared.undeclare()

        return undo


def _deliver(listener: Callable[[str, bytes], None], sample: zenoh.Sample) -> None:
    listener(str(sample.key_expr), sample.payload.to_bytes())


def _direct(deliver: Callable[[Any], None]) -> Any:  # noqa: ANN401
    # In zenoh's own thread: the thread that it would start otherwise does not end with the program.
    return Callback(deliver, indirect=False)


async def locators(endpoint: str) -> set[str]:
    """All locators that a connection to an endpoint may have; empty if its host name is unknown."""
    checked, port = parse_endpoint("connect", endpoint), endpoint.rpartition(":")[2]
    try:
        async with asyncio.timeout(RESOLVED_S):
            numbers = await addresses_of(checked.host, int(port))
    except (OSError, UnicodeError, TimeoutError):
        return set()
    return {f"{checked.protocol}/{f'[{number}]' if ':' in number else number}:{port}" for number in numbers}
