"""Jaws as they were recorded, and what a slow link makes of a sound one."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robotiq_async.values import registers as reg
from robotiq_async.values.enums import JAW
from robotiq_async.values.model import TWO_FINGER_85, TWO_FINGER_140
from robotiq_async.values.registers import Registers
from tests.verify.people import FOAM, SHORT, Helper, assert_as_assumed, differing, served, verified

pytestmark = pytest.mark.virtual_time


@pytest.mark.parametrize("ends", [(2, 224), (3, 225), (13, 226)])
async def test_ends_that_were_recorded_are_healthy(ends: tuple[int, int]) -> None:
    async with served(active=True, model=TWO_FINGER_85, ends=ends) as server:
        report = await verified(server, first=6, last=7)
    assert_as_assumed(report)
    assert report.checks["stroke.force"].figures == {"least": ends[1] + 1, "greatest": ends[1] + 5}
    figures = report.checks["soft.speed"].figures
    assert 4 <= figures["speed_255"] - figures["speed_0"] <= 9  # type: ignore[operator]


async def test_a_contact_that_is_shown_while_the_jaw_goes_on_is_named() -> None:
    """One 2F-85 showed a contact 13 counts before its end."""
    async with served(active=True, model=TWO_FINGER_85) as server:
        gripper, status = server.gripper, server.gripper.status_registers

        def early() -> Registers:
            registers = status()
            if reg.gGTO.read(registers) and FOAM - 13 <= gripper.position(JAW) < FOAM + 10:
                return (registers[0] | 0x8000, *registers[1:])  # gOBJ 2 on the way
            return registers

        gripper.status_registers = early  # type: ignore[method-assign]
        report = await verified(server, first=7, last=7, lengths=replace(SHORT, interval=0.01))
    assert differing(report).keys() == {"soft.standstill"}
    figures = report.checks["soft.standstill"].figures
    assert 10 <= figures["counts"] <= 16  # type: ignore[operator]
    assert figures["seconds"] < 0  # type: ignore[operator]


@pytest.mark.parametrize("model", [TWO_FINGER_85, TWO_FINGER_140], ids=str)
async def test_a_sound_jaw_on_a_slow_link_stops_in_time(model: object) -> None:
    """Recorded links take 20 to 60 ms, with a tail of 260: a jaw at speed 64 makes 11 counts in 80 ms."""
    async with served("delay 0.12", active=True, model=model) as server:
        report = await verified(server, first=5, last=5)
    assert report.why == "done", report.words
    assert not differing(report)
    figures = report.checks["stop.halt"].figures
    assert 10 < figures["counts"] <= figures["allowed_counts"]  # type: ignore[operator]


async def test_a_gripper_that_stops_late_is_still_found() -> None:
    async with served("slow-device 0.2", active=True, model=TWO_FINGER_85) as server:
        report = await verified(server, first=5, last=5)
    assert report.why == "deviation"
    assert "stop.halt" in differing(report)


async def test_an_activation_that_is_lost_while_the_client_is_away_is_named() -> None:
    async with served("idle-reset 3", active=True) as server:
        report = await verified(server, first=8)
    assert report.why == "inactive"
    assert differing(report).keys() == {"loss.idle"}
    assert report.checks["loss.idle"].figures == {"seconds": 4.0}


async def test_a_slow_line_without_function_23_is_named() -> None:
    async with served("no-function-23", "delay 0.07", serial=True, model=TWO_FINGER_85) as server:
        report = await verified(server, last=2)
    assert report.why == "done", report.words
    assert differing(report)["write.function_23"] == {"write_function": 16}


@pytest.mark.parametrize("serial", [False, True])
async def test_a_device_that_does_not_answer_is_a_matter_of_the_link(serial: bool) -> None:
    async with served("silence", serial=serial, model=TWO_FINGER_85) as server:
        report = await verified(server, last=1)
    assert report.why == "link"
    async with served(serial=serial, model=TWO_FINGER_85) as server:
        server.gripper.controller_fault = 12
        report = await verified(server, Helper(server), last=1)
    assert report.why == "done", "the fault of a controller is no stranger's"
