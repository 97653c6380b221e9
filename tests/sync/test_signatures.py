"""The blocking hand has the calls of the async one, and lacks none."""

from __future__ import annotations

import inspect
import re

import pytest

import robotiq_async
from robotiq_async import sync
from robotiq_async.hands.streams import Stream as AsyncStream

ASYNC, BLOCKING = robotiq_async.RobotiqHand, sync.RobotiqHand
NAMES = [name for name in dir(ASYNC) if not name.startswith("_")]


def test_it_has_the_names_of_the_async_hand_and_no_others() -> None:
    assert [name for name in dir(BLOCKING) if not name.startswith("_")] == NAMES
    assert inspect.signature(BLOCKING) == inspect.signature(ASYNC)


@pytest.mark.parametrize("name", NAMES)
def test_a_call_has_the_signature_and_the_docstring_of_the_async_one(name: str) -> None:
    here, there = inspect.getattr_static(BLOCKING, name), inspect.getattr_static(ASYNC, name)
    assert isinstance(here, property) == isinstance(there, property)
    if not isinstance(here, property):
        assert not inspect.iscoroutinefunction(here)
        assert inspect.signature(here) == inspect.signature(there)
    assert here.__doc__ == there.__doc__


def test_a_stream_has_the_names_of_the_async_one() -> None:
    there = {name for name in dir(AsyncStream) if not name.startswith("_")}
    here = {name for name in dir(sync.Stream) if not name.startswith("_")}
    assert here == {re.sub("^aclose$", "close", name) for name in there}
