"""Runs at a URCap and through a tunnel: every stage, and the checks that such a link cannot have."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from robotiq_async.link.address import parse_address
from robotiq_async.simulator import SimulatorServer
from robotiq_async.tools.verify.catalogue import CATALOGUE, checks_of
from robotiq_async.tools.verify.report import page
from robotiq_async.values.model import TWO_FINGER_85
from tests.arms import CONTROLLERS, ToolLine, install_schemes
from tests.verify.people import Helper, Roll, assert_as_assumed, differing, served, verified

pytestmark = pytest.mark.virtual_time

OF_A_JAW = {name for name, each in CATALOGUE.items() if not each.of_several}


async def test_every_stage_at_a_urcap() -> None:
    async with served(urcap=True, model=TWO_FINGER_85) as server:
        helper, roll = Helper(server), Roll()
        report = await verified(server, helper, roll)
        assert_as_assumed(report)
        assert report.stages == roll.stages == list(range(10))
        assert not helper.alarms
        assert not server.gripper.is_moving
    assert report.registers is None
    assert checks_of(TWO_FINGER_85, "urcap").keys() | report.left_out.keys() == OF_A_JAW
    assert "- `read.counts`: the text port has variables and no registers" in page(report)
    assert report.as_dict()["left_out"] == report.left_out


async def test_a_urcap_that_takes_its_time_needs_another_poll_interval() -> None:
    async with served("delay 0.006", urcap=True, model=TWO_FINGER_85) as server:
        report = await verified(server, last=2)
    assert report.why == "done", report.words
    assert differing(report).keys() == {"read.round_trip"}
    assert 0.006 < differing(report)["read.round_trip"]["poll_interval"] < 0.012


async def test_a_urcap_that_cannot_read_its_gripper_is_a_matter_of_the_link() -> None:
    async with served("unreadable", urcap=True, model=TWO_FINGER_85) as server:
        report = await verified(server, last=1)
    assert report.why == "link"
    assert "cannot be read" in report.words


@asynccontextmanager
async def at_an_arm(
    name: str, patch: pytest.MonkeyPatch, folder: Path
) -> AsyncIterator[tuple[SimulatorServer, str]]:
    """A jaw at the tool of an arm, and the address through it."""
    install_schemes(patch, folder)
    async with served(serial=True, model=TWO_FINGER_85) as server:
        line = ToolLine(parse_address(server.address).port)
        async with CONTROLLERS[name](line) as arm:
            yield server, f"{name.lower()}://127.0.0.1:{arm.port}?model=2f85"


async def test_every_stage_through_a_tunnel(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    async with at_an_arm("XArm", monkeypatch, tmp_path) as (server, address):
        helper, roll = Helper(server), Roll()
        report = await verified(server, helper, roll, address=address)
        assert_as_assumed(report)
        assert report.stages == roll.stages == list(range(10))
        assert not helper.alarms
        assert not server.gripper.is_moving
    assert report.link == "tunnel"
    assert report.checks.keys() == OF_A_JAW
    assert not report.left_out


async def test_a_tunnel_that_refuses_function_23_is_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    async with at_an_arm("Dobot", monkeypatch, tmp_path) as (server, address):
        report = await verified(server, address=address, last=2)
    assert report.why == "done", report.words
    assert differing(report) == {"write.function_23": {"write_function": 16}}
