"""What unknown clients call themselves and send is harmless in logs, in answers and on terminals."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import State
from robotiq_async.fleet.limited_log import EVERY_S
from robotiq_async.fleet.network.bus import Urgency
from robotiq_async.fleet.wire.envelope import Call, unpack_answer
from robotiq_async.fleet.wire.status_message import StatusMessage
from robotiq_async.fleet.wire.values import read_error
from robotiq_async.values.errors import AgentError, ControlLostError
from tests.fleet.by_hand import LEFT
from tests.fleet.lab import lab
from tests.virtual import virtual

NAME = "eve\nrobotiq-async: all is well\x1b[2J"
OTHERS = StatusMessage(LEFT.mark + 1, 2, 3.0, State.RUNNING_IDLE, 4, False, 5, False, 6, 0.5, None)


@virtual
async def test_what_a_client_calls_itself(caplog: pytest.LogCaptureFixture) -> None:
    async with lab() as here, here.client("reader", control=False) as reader:
        session = reader._session
        assert session is not None
        seen = session.mirror.stamp
        bus = here.network.bus("eve")
        for verb, number in (("lease", 1), ("halt", 2), ("lease", 3)):
            what = {"what": "acquire", "label": NAME}
            call = Call(LEFT.base, "eve", 0, 0, number, seen, what)
            reply = await bus.ask(LEFT.key(verb), call.pack(), timeout=1.0, urgency=Urgency.COMMAND)
            assert reply is not None
            unpack_answer(reply.payload).outcome(lambda stamp: stamp)
        told = await session.ask("info", timeout=1.0)
        assert told["holder"].isprintable(), "who shows it elsewhere may not look at it first"
        with pytest.raises(ControlLostError) as refused:
            await reader.acquire()
        assert "eve" in str(refused.value)
        assert str(refused.value).isprintable()
    assert all(record.getMessage().isprintable() for record in caplog.records)
    assert "eve" in caplog.text


@pytest.mark.parametrize("kind", ["ControlLostError", "ConnectFailedError", "of the future\n", "ValueError"])
def test_what_an_agent_says_of_a_failure(kind: str) -> None:
    fields = {"kind": kind, "message": "a\nb\x1b", "reason": "\n", "address": "\r", "state": None}
    error = read_error(fields, lambda stamp: stamp)
    for words in (str(error), *map(str, vars(error).values())):
        assert words.isprintable()
    assert "a\\nb\\x1b" in str(error)


@virtual
@pytest.mark.parametrize(
    ("payload", "words"),
    [
        (OTHERS.pack(), "about another gripper"),
        (b"?", "a message was dropped: not a status"),
        (b"{", "cannot be read"),
        (b"{" + b'"a":[' * 3000, "cannot be read"),
        (OTHERS._replace(mark=LEFT.mark, stamp=float("inf")).pack(), "no time"),
    ],
)
async def test_a_flood_of_messages_that_are_none_fills_no_log(
    payload: bytes, words: str, caplog: pytest.LogCaptureFixture
) -> None:
    async with lab() as here, here.client() as hand:
        publish = here.network.bus("stranger").publisher(LEFT.key("feed"), Urgency.TELEMETRY)
        for _ in range(300):
            publish(payload)
            await asyncio.sleep(0.001)
        assert caplog.text.count(words) == 1
        await asyncio.sleep(EVERY_S)
        publish(payload)
        await asyncio.sleep(0.01)
        assert caplog.text.count(words) == 2
        assert "300 similar" in caplog.text
        about = {getattr(record, "hand", "") for record in caplog.records if words in record.getMessage()}
        assert about == {hand.name}
        await hand.move(30, 1)


def test_words_that_are_none_are_refused() -> None:
    assert "cannot be read" in str(read_error({"kind": "AgentError", "message": 3}, lambda stamp: stamp))
    assert not isinstance(read_error({"kind": 3, "message": "?"}, lambda stamp: stamp), AgentError)
