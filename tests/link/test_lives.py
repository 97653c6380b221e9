"""Random lives of a line end as they always have: every third of them, and all with lives.py."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import pytest

from tests.link.lives import LIVES, every_life, known, live

BLOCK = 10
"""Lives in one test."""


@pytest.fixture(autouse=True)
def quiet() -> Iterator[None]:
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


@pytest.mark.parametrize(("kind", "first"), [each for each in every_life() if each[1] % (3 * BLOCK) == 0])
def test_lives_of_a_line_end_as_they_did(kind: str, first: int) -> None:
    seeds = range(first, min(first + 3 * BLOCK, LIVES[kind]), 3)
    before = known()
    assert {seed: str(live(kind, seed)) for seed in seeds} == {seed: before[kind, seed] for seed in seeds}


def test_a_life_is_the_same_each_time() -> None:
    assert live("shared", 1) == live("shared", 1)
