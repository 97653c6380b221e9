"""The first two status bytes that the manual's examples show."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.simulator.stories import tell

if TYPE_CHECKING:
    from tests.simulator.conftest import Bench

STORIES = {
    "closing": "active, go 255, wait 0.5, words 39 C0, write rGTO=0, words 31 C0",
    "closed": "active, reach 255, words F9 FF, write rGTO=0, words F1 FF",
    "two stopped": "active, place AB 150, go 255, wait 1.6, words 39 CA, write rGTO=0, words 31 CA",
    "one stopped": "active, place B 150, reach 255, words 79 FB, write rGTO=0, words 71 FB",
    "all stopped": "active, place ABC 150, reach 255, words B9 EA, write rGTO=0, words B1 EA",
    "two stopped while opening": "active, reach 255, place AC 100 opening, reach 0, words 79 DD",
    "the scissor is not part of the summary": "individual, place S 150, reach S=255, words F9 BF",
}


@pytest.mark.parametrize("name", STORIES)
def test_a_story(name: str) -> None:
    tell(STORIES[name])


def test_switched_on(bench: Bench) -> None:
    assert bench.gripper.status_registers() == (0, 0, 0x0600, 6, 0, 0x0600, 137, 0)
