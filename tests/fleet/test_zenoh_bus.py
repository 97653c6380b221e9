"""Each class of requests has a sender of replies and a priority of its own; over a session that is none."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from types import SimpleNamespace
from typing import Any, cast

import zenoh

from robotiq_async.fleet.network.bus import MessageKind, Query, Urgency
from robotiq_async.fleet.network.zenoh_bus import ZenohBus
from tests.fleet.lab import LEFT
from tests.patience import patience

PATIENCE_S = 10.0
KEYS = {
    name: LEFT.key(*parts)
    for name, parts in {"info": ("info", "x"), "lease": ("lease",), "halt": ("halt",)}.items()
}


class Session:
    """Keeps what is declared and sent."""

    def __init__(self) -> None:
        self.served: dict[str, Callable[[Any], None]] = {}
        self.priorities: list[zenoh.Priority] = []

    def declare_queryable(self, expression: str, handler: Any) -> object:
        self.served[expression] = handler.callback
        return SimpleNamespace(undeclare=lambda: None)

    def declare_publisher(self, _key: str, *, priority: zenoh.Priority, **_: object) -> object:
        self.priorities.append(priority)
        return SimpleNamespace(put=lambda _: None)

    def get(self, _key: str, _handler: object, *, priority: zenoh.Priority, **_: object) -> None:
        self.priorities.append(priority)

    def close(self) -> None: ...


class Asked:
    """A request; its reply waits until somebody reads it."""

    payload = None

    def __init__(self, key: str) -> None:
        self.key_expr = key
        self.replies = threading.Event()
        self.is_read = threading.Event()

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...

    def reply(self, _key: str, _payload: bytes, **_: object) -> None:
        self.replies.set()
        self.is_read.wait(6 * patience(PATIENCE_S))


@asynccontextmanager
async def opened() -> AsyncIterator[tuple[ZenohBus, Session]]:
    session = Session()
    bus = ZenohBus(cast("zenoh.Session", session))
    try:
        yield bus, session
    finally:
        await bus.close()


async def test_a_client_that_does_not_read_the_answers_to_its_questions_delays_no_command_and_no_halt() -> (
    None
):
    def answer(query: Query) -> None:
        query.reply(b"!")

    async with opened() as (bus, session):
        for verb, kind in {
            "info": MessageKind.QUESTION,
            "lease": MessageKind.REQUEST,
            "halt": MessageKind.HALT,
        }.items():
            bus.serve(KEYS[verb], answer, lambda *_, kind=kind: kind)
        asked = {verb: Asked(key) for verb, key in KEYS.items()}
        try:
            for verb, each in asked.items():  # each sticks, and the next class goes on
                session.served[KEYS[verb]](each)
                async with asyncio.timeout(patience(PATIENCE_S)):
                    while not each.replies.is_set():  # noqa: ASYNC110
                        await asyncio.sleep(0.001)
        finally:
            for each in asked.values():
                each.is_read.set()


async def test_questions_travel_behind_telemetry_and_halts_before_all() -> None:
    async with opened() as (bus, session):
        for urgency in (Urgency.STOP, Urgency.COMMAND, Urgency.QUESTION):
            bus.ask(LEFT.key("x"), b"?", timeout=1.0, urgency=urgency)
        bus.publisher(LEFT.key("feed"), Urgency.TELEMETRY)
    stop, command, question, telemetry = [int(each) for each in session.priorities]  # type: ignore[call-overload]
    assert stop < command < telemetry < question  # 1 is the highest of zenoh's
