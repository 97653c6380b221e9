"""Malformed requests: each is answered with an error, and none of them moves a finger."""

from __future__ import annotations

import json
from typing import Any

import pytest

from robotiq_async.errors import AgentError, ProtocolError, RobotiqError
from robotiq_async.fleet.network.bus import Urgency
from robotiq_async.fleet.wire.envelope import unpack_answer
from tests.fleet.lab import lab
from tests.virtual import virtual

INFINITE = float("inf")  # JSON of Python has it
STRANGE: list[tuple[str, Any]] = [
    ("cmd/cancel", {"number": INFINITE}),
    ("cmd/cancel", {"number": [1]}),
    ("cmd/cancel", {"number": "x"}),
    ("cmd/move", {"position": 255, "fingers": INFINITE}),
    ("cmd/move", {"position": 255.0}),
    ("cmd/move", {"position": 255, "timeout": "soon"}),
    ("cmd/move", {"position": 255, "more": 1}),
    ("cmd/command", {}),
    ("cmd/command", {"axes": 3}),
    ("cmd/command", {"axes": {"16": {"position": 255}}}),
    ("cmd/command", {"axes": {"1": {"position": 256}}}),
    ("cmd/command", {"axes": {"1": 3}}),
    ("cmd/stop", {}),
    ("cmd/_session", {}),
    ("cmd/__init__", {}),
    ("lease", {"what": "steal"}),
    ("lease", {}),
]


@virtual
@pytest.mark.parametrize(("verb", "arguments"), STRANGE)
async def test_from_who_holds_the_lease(verb: str, arguments: Any) -> None:
    async with lab() as here, here.client() as hand:
        session = hand._session
        assert session is not None
        writes = len(here.gripper.writes)
        call = session.call(arguments)
        reply = await here.network.bus("stranger").ask(
            session.name.key(verb), call.pack(), timeout=1.0, urgency=Urgency.COMMAND
        )
        assert reply is not None
        answer = unpack_answer(reply.payload)
        assert answer.number == call.number
        with pytest.raises((RobotiqError, TypeError, ValueError)):
            answer.outcome(lambda stamp: stamp)
        assert len(here.gripper.writes) == writes
        await hand.move(20, 1)


@virtual
@pytest.mark.parametrize(
    "payload", [b"", b"{}", b"[1", b"null", b"\xff", json.dumps({"version": 9}).encode()]
)
@pytest.mark.parametrize("verb", ["info", "lease", "halt", "cmd/move"])
async def test_that_are_none(verb: str, payload: bytes) -> None:
    async with lab() as here, here.client() as hand:
        session = hand._session
        assert session is not None
        bus = here.network.bus("stranger")
        reply = await bus.ask(session.name.key(verb), payload, timeout=1.0, urgency=Urgency.COMMAND)
        assert reply is not None
        with pytest.raises((ProtocolError, AgentError)):
            unpack_answer(reply.payload).outcome(lambda stamp: stamp)
        await hand.move(20, 1)
