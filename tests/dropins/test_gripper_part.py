"""The part for learning stacks on every wire: its keys, and a wait that is reported."""

from __future__ import annotations

import pytest

from robotiq_async import Convention
from robotiq_async.dropins.lerobot import GripperPart
from robotiq_async.sync import RobotiqHand
from tests.dropins.lockstep import WIRES, bad, line, rest


@pytest.mark.parametrize("wire", WIRES)
def test_an_observation_has_the_keys_that_were_promised_before_connecting(wire: str) -> None:
    """Also over a URCap that tells a current: a dataset has its features before the robot connects."""
    with line(wire) as here:
        part = GripperPart(RobotiqHand(here.address), Convention.LEROBOT)
        promised = part.observations
        part.connect()
        assert tuple(part.observe()) == part.observations == promised
        part.disconnect()


def test_a_wait_for_a_status_is_reported(caplog: pytest.LogCaptureFixture) -> None:
    with line("tcp") as here:
        part = GripperPart(RobotiqHand(here.address, response_timeout=0.3), Convention.LEROBOT)
        part.connect()
        here.server.policy = lambda _: ()
        rest(0.05)
        here.server.policy = bad(0, 0)
        part.observe()
        assert "a frame is late, and none is old" in caplog.text
        part.disconnect()
