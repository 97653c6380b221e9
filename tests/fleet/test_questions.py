"""Questions are free, and a client that asks thousands a second gets no more answers than others leave it."""

from __future__ import annotations

import asyncio
import logging

import pytest

from robotiq_async.fleet.agent.agent import Questions
from robotiq_async.fleet.control.budget import ALL, EACH, Budget
from robotiq_async.fleet.network.bus import Urgency
from robotiq_async.fleet.wire.envelope import Call
from tests.fleet.by_hand import LEFT
from tests.fleet.lab import Lab, lab
from tests.virtual import virtual

FLOOD = 8000
"""Questions a second: they took an agent from 203 polls a second to 119."""


def test_each_client_has_a_second_s_worth_and_then_its_rate() -> None:
    budget = Budget()
    assert sum(budget.allows("a", 10.0) for _ in range(FLOOD)) == EACH
    assert budget.allows("b", 10.0), "others are not concerned"
    assert sum(budget.allows("a", 11.0 + each / 1000) for each in range(1000)) in range(190, 202)
    assert sum(budget.allows("a", 99.0) for _ in range(FLOOD)) == EACH, "what was not used is not saved up"


def test_all_together_have_one_as_well() -> None:
    """Who calls itself something else each time."""
    budget = Budget()
    assert sum(budget.allows(f"client {each}", 5.0) for each in range(FLOOD)) == ALL
    assert len(budget._each) <= 1000


def test_a_client_is_told_by_what_it_says() -> None:
    questions = Questions(lambda: 1.0)
    payloads = [Call(LEFT.base, "one").pack(), b'{"client":"one"}', b"", b"{}", b'{"client": 3}', b"\xff"]
    for payload, left in zip(payloads, (EACH, 0, EACH, 0, 0, 0), strict=True):
        assert sum(questions.allow(payload) for _ in range(FLOOD)) == left


def test_what_is_dropped_is_said_once_in_a_while(caplog: pytest.LogCaptureFixture) -> None:
    at = 1.0
    questions = Questions(lambda: at)
    with caplog.at_level(logging.WARNING):
        for _ in range(3000):
            questions.allow(b"")
            at += 0.005
    assert caplog.text.count("were dropped: a client asks too many") in (0, 1, 2)
    with caplog.at_level(logging.WARNING):
        for _ in range(FLOOD):
            questions.allow(b"")
    assert caplog.text.count("were dropped: a client asks too many") in (1, 2)


@virtual
async def test_a_flood_of_questions_leaves_other_clients_and_the_log_alone(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async with lab() as here, here.client() as hand:
        flooding = asyncio.create_task(flood(here))
        await asyncio.sleep(0.5)
        async with here.client("reader", control=False) as reader:
            await hand.move(30)
            await reader.halt()
        answered = await flooding
        assert answered <= 4 * EACH < FLOOD
        assert caplog.text.count("questions were dropped") == 1


async def flood(here: Lab) -> int:
    """Ask for a second; returns how many answers came."""
    bus, answers = here.network.bus("flooding"), []
    for number in range(FLOOD // 8):
        call = Call(LEFT.base, "curious", number=number)
        answers += [
            bus.ask(LEFT.key("info"), call.pack(), timeout=1.0, urgency=Urgency.COMMAND) for _ in range(8)
        ]
        await asyncio.sleep(0.001)
    return sum(reply is not None for reply in await asyncio.gather(*answers))
