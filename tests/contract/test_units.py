"""The units of a hand, here or on another host: they are by the calibrations that it is made with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from robotiq_async import HAND_E, THREE_FINGER, TWO_FINGER_85, RobotiqHand, Units
from robotiq_async.calibration import ForceCalibration, SpeedCalibration
from robotiq_async.calibration.csv_tables import FORCE, SPEED_LAYOUT, write_table
from robotiq_async.fleet import RemoteHand
from robotiq_async.hands import Hand

THESIS = Units()
HANDS: list[Callable[..., Hand]] = [RobotiqHand, partial(RemoteHand, "zenoh://lab/cell/left")]


def test_a_hand_has_them_before_it_is_started() -> None:
    assert [make().units for make in HANDS] == [THESIS, THESIS]


def test_they_are_by_the_owners_calibrations(tmp_path: Path) -> None:
    write_table(tmp_path / "speed.csv", SPEED_LAYOUT, {0: (20_000,), 255: (5_000,)})
    write_table(tmp_path / "force.csv", FORCE, {50: (1000,), 100: (3000,)})
    speeds = SpeedCalibration.from_csv(tmp_path / "speed.csv")
    forces = ForceCalibration.from_csv(tmp_path / "force.csv")
    for make in HANDS:
        hand = make(calibration=speeds, force_calibration=forces)
        assert hand.units == Units(replace(speeds, model=THREE_FINGER), forces)
        assert hand.units.closing_s(255) == 5
        assert hand.units.force(label_n=19.62) == 75
        with pytest.raises(ValueError, match=r"newton of a label \(no measured force\) in 9\.81\.\.29\.43"):
            hand.units.force(label_n=30)
        with pytest.raises(ValueError, match=r"force 10 lies outside the measured range: 50\.\.100"):
            hand.units.label_n(10)


def test_a_calibration_of_another_model_is_refused(tmp_path: Path) -> None:
    write_table(tmp_path / "speed.csv", SPEED_LAYOUT, {0: (4_000,), 255: (1_000,)}, HAND_E)
    write_table(tmp_path / "force.csv", FORCE, {0: (1000,), 255: (3000,)}, TWO_FINGER_85)
    speeds = SpeedCalibration.from_csv(tmp_path / "speed.csv")
    forces = ForceCalibration.from_csv(tmp_path / "force.csv")
    assert (speeds.model, speeds.mm_per_s(255), forces.model) == (HAND_E, 50, TWO_FINGER_85)
    assert RobotiqHand("sim://?model=hand-e", calibration=speeds).units.speeds == speeds
    with pytest.raises(ValueError, match=r"^calibration \(.*speed.csv\) is of a Hand-E, and the gripper"):
        RobotiqHand("sim://?model=2f85", calibration=speeds)
    with pytest.raises(ValueError, match=r"^force_calibration \(.*\) is of a 2F-85, and the gripper"):
        RobotiqHand("sim://", force_calibration=forces)
    with pytest.raises(ValueError, match=r"is of a 3-Finger, and the gripper is a 2F-140"):
        RobotiqHand("sim://?model=2f140", calibration=SpeedCalibration.thesis())
    remote = RemoteHand("zenoh://lab/cell/left", force_calibration=forces)
    assert remote.model is TWO_FINGER_85, "until its agent says it"
    with pytest.raises(ValueError, match=r"is of a 2F-85, and the gripper is a Hand-E"):
        RemoteHand("zenoh://lab/cell/left", calibration=speeds, force_calibration=forces)


def test_objects_that_are_no_calibration_are_refused() -> None:
    for make in HANDS:
        with pytest.raises(TypeError, match="force_calibration must be None or a ForceCalibration"):
            make(force_calibration=30)
        with pytest.raises(TypeError, match="calibration must be None or a SpeedCalibration"):
            make(calibration="mine.csv")
