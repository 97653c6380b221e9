"""A link that does not carry the motor current: nothing around a hand makes a 0 of that."""

from __future__ import annotations

import asyncio
import json
import math
from pathlib import Path

import pytest

from robotiq_async import JAW, TWO_FINGER_85, RobotiqHand, RobotiqStatus
from robotiq_async.cli.output.tables import print_outcomes, print_status
from robotiq_async.ros2.translation.diagnosis import diagnose
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.measure.recording_plot import PANELS
from robotiq_async.tools.recording.curves import read_curves
from robotiq_async.tools.recording.payloads import efforts
from robotiq_async.tools.recording.recorder import Recorder
from robotiq_async.tools.recording.recordings import read_recording
from robotiq_async.tools.recording.table import COLUMNS, Table
from robotiq_async.tools.web.page.mirror import HandMirror
from robotiq_async.tools.web.server import HandUpdates
from tests.fleet.lab import lab
from tests.local.test_urcap import OldUrcapServer, at_a_ur

pytestmark = pytest.mark.virtual_time


async def test_there_is_no_current_and_not_a_current_of_0(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "ur.mcap"
    async with at_a_ur(kind=OldUrcapServer) as (_, hand):
        async with Recorder(hand, path):
            result = await hand.close()
        status, updates = hand.status, HandUpdates(hand)
        print_status(hand)
        print_outcomes(result)
        shown = [each.values for each in diagnose(hand, now=status.timestamp)]
        update = json.loads(json.dumps(updates.take(0)))
    assert (status.has_current, status.current(JAW), status.current_ma(JAW)) == (False, None, None)
    assert "mA" not in repr(status) + repr(result)
    assert result.peak_current_ma == {JAW: None}
    assert "peak_current_ma" not in result.as_dict()["A"]
    assert "current_ma" not in status.as_dict()["A"]
    assert RobotiqStatus.from_registers(status.registers, has_current=False).current(JAW) is None
    assert all(map(math.isnan, efforts(status)))

    printed = capsys.readouterr().out
    assert [line.split()[-1] for line in printed.splitlines() if line.strip().startswith("jaw ")] == [
        "-",
        "-",
    ]
    assert not any("current" in name for values in shown for name in values)

    mirror = HandMirror(0, "urcap://192.168.1.20")
    mirror.hear(update)
    assert mirror.status is not None
    assert mirror.status.current_ma(JAW) is None
    assert mirror.samples[-1].currents is None

    rows, table = [], Table("status")
    for entry in read_recording(path):
        if entry.topic == "/gripper/status":
            assert "current_ma" not in entry.fields["A"]
            rows.append(table.row("status", entry.nanoseconds, entry.fields))
    named = dict(zip(COLUMNS["status"], rows[-1] or [], strict=True))
    assert (named["A.current_ma"], named["A.position"]) == (None, status.position(JAW))
    curves = read_curves("it", read_recording(path))
    assert curves is not None
    assert [bool(panel.axes_of(curves)) for panel in PANELS if panel.what == "current"] == [False]


async def test_a_remote_hand_has_none_either() -> None:
    async with (
        lab(model=TWO_FINGER_85, kind_of_server=OldUrcapServer) as here,
        here.client() as hand,
    ):
        result = await hand.close()
        assert (hand.status.has_current, hand.status.current(JAW)) == (False, None)
        assert result.status.current(JAW) is None
        assert result.peak_current_ma == {JAW: None}


async def test_a_current_that_is_told_is_there_as_ever() -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=TWO_FINGER_85)
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address) as hand:
        result = await hand.close()
        assert result.peak_current_ma[JAW]
        assert hand.status.has_current
        assert hand.status.current_ma(JAW) == 0
