"""A small part of the fuzzing: every run the same. The long one is ``make fuzz``."""

from __future__ import annotations

import logging
import random

import pytest

from robotiq_async.values.model import THREE_FINGER, TWO_FINGER_85, Model
from tests.adversity.fuzz import Line, decoder, live
from tests.adversity.world import world
from tests.virtual import run


def test_the_decoder() -> None:
    figures = decoder(10_000)
    assert min(figures.values()) > 400, f"one-sided: {figures}"


@pytest.mark.parametrize(
    ("link", "model", "least"),
    [
        ("tcp", THREE_FINGER, 35),
        ("rtu", THREE_FINGER, 35),
        ("tcp", TWO_FINGER_85, 35),
        ("rtu", TWO_FINGER_85, 12),  # with function 23 damage costs a link less often
    ],
    ids=str,
)
def test_a_live_link(
    link: str, model: Model, least: int, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def main() -> dict[str, int]:
        async with world(link, monkeypatch=monkeypatch, model=model) as here:
            await here.activate_beforehand()
            line = Line(random.Random(1), serial=link == "rtu", share=0.25, model=model)
            address = here.server.address if here.line is None else f"rtu://{here.line.near}"
            return await live(here.server, address, line, 500)

    caplog.set_level(logging.CRITICAL, logger="robotiq_async")
    figures = run(main)
    assert figures["reconnects"] > least
    assert figures["statuses"] > 125
