"""Fixtures of the tests under fault."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest


@pytest.fixture(scope="package", autouse=True)
def nothing_old_to_collect() -> Iterator[None]:
    """Keep the garbage collector off what other tests have left: a look at all of that takes 20 ms."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()
