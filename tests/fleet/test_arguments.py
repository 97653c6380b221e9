"""The calls of a remote hand describe the same parameters as those of a hand beside its gripper."""

from __future__ import annotations

from robotiq_async.fleet import RemoteHand
from tests.hands.test_arguments import assert_calls_describe, assert_constructor_describes


def test_its_calls_describe_what_they_take() -> None:
    assert_calls_describe(RemoteHand)


def test_the_constructor_describes_what_it_takes() -> None:
    assert_constructor_describes(RemoteHand)
