"""Recorded and published objects name their hand."""

from __future__ import annotations

from robotiq_async import RobotiqHand
from robotiq_async.tools.recording.payloads import reading_fields, state_fields, title


def test_a_title_has_the_name_and_the_address() -> None:
    assert title(RobotiqHand("192.168.1.11", name="left")) == "left (tcp://192.168.1.11:502)"
    assert title(RobotiqHand("192.168.1.11")) == "tcp://192.168.1.11:502"


async def test_published_fields_carry_the_name(hand: RobotiqHand) -> None:
    named = RobotiqHand("192.168.1.11", name="left 100% %s")
    assert state_fields(named, 0.0)["name"] == "left 100% %s"
    for fields in (reading_fields(hand), state_fields(hand, 0.0)):
        assert (fields["name"], fields["address"]) == (hand.name, hand.address)
