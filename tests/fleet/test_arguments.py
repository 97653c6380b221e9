"""The calls of a remote hand describe the same parameters as those of a hand beside its gripper."""

from __future__ import annotations

import pytest

from robotiq_async.fleet import RemoteHand
from tests.hand.test_arguments import MOTIONS, assert_constructor_describes, assert_describes


@pytest.mark.parametrize("name", MOTIONS)
def test_a_motion_describes_what_it_takes(name: str) -> None:
    assert_describes(getattr(RemoteHand, name))


def test_the_constructor_describes_what_it_takes() -> None:
    assert_constructor_describes(RemoteHand)
