"""Millimetres on a hand of another host, and that counts alone are sent."""

from __future__ import annotations

from typing import Any

import pytest

from robotiq_async import JAW, TWO_FINGER_85
from robotiq_async.calibration.amounts import UNITS
from robotiq_async.fleet.remote.mirror import Mirror
from robotiq_async.fleet.wire.values import reading
from robotiq_async.hands.streams import Channels
from robotiq_async.runtime.limit import Limit
from robotiq_async.runtime.logger import log
from robotiq_async.values.errors import ProtocolError
from tests.fleet.lab import lab
from tests.virtual import virtual

POINTS = ((13, 100.0), (213, 2.0))


@virtual
async def test_the_points_of_the_agents_hand_are_those_of_the_client() -> None:
    async with lab(model=TWO_FINGER_85, stroke=POINTS) as here, here.client("client") as hand:
        assert hand.units.stroke == here.local.units.stroke
        assert hand._remote.session is not None
        hand._remote.session.mirror.points = ()
        limit = Limit(1.0)
        assert await hand._remote.session._ask_info(limit), "an answer tells them, without a summary"
        limit.stop()
        assert hand.units.stroke == here.local.units.stroke
        result = await hand.move(mm=40)
        assert here.gripper.writes[-1].registers[1] & 0xFF == hand.units.position(mm=40)
        for status in (hand.status, result.status, await anext(hand.statuses())):
            assert status.opening_mm(JAW) == here.local.status.opening_mm(JAW)
        assert result.opening_mm(JAW) == pytest.approx(40, abs=1)
        with pytest.raises(ValueError, match=r"mm must be millimetres in 2\.0\.\.100\.0, got 1"):
            await hand.move(mm=1)


@virtual
async def test_an_agent_takes_requests_in_counts_alone() -> None:
    """After a restart of the agent a client's speeds and forces are restored as it saw them."""
    requests: list[tuple[str, dict[str, Any]]] = [
        *(("move", {name: 0, "fingers": 1}) for name in UNITS),
        ("move", {"position": 40, "fingers": 1, "mm_per_s": 40}),
        ("set_force", {"label_n": 40, "fingers": 1}),
        ("command", {"axes": {"1": {"open_fraction": 1}}}),
    ]
    async with lab(model=TWO_FINGER_85) as here, here.client("client") as hand:
        writes = len(here.gripper.writes)
        for name, arguments in requests:
            with pytest.raises(TypeError, match="requests are in counts, got"):
                await hand._remote._ask(name, **arguments)
        assert len(here.gripper.writes) == writes


@pytest.mark.parametrize("stroke", ["x", 3, [[3, 85]], [[3, "85"], [228, 0]], [[228, 0], [3, 85]]])
def test_points_that_are_none_are_unreadable(stroke: object) -> None:
    mirror = Mirror(0, Channels(log), lambda _: None)
    with pytest.raises(ProtocolError, match="its figures"), reading("its figures"):
        mirror.receive_points({"stroke": stroke})
    nothings: list[dict[str, object]] = [{}, {"stroke": []}, {"stroke": None}]
    for nothing in nothings:
        mirror.receive_points(nothing)
    assert mirror.points == ()
