"""The package in a zip: no part of it looks for files beside its own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import robotiq_async

PACKAGE = Path(robotiq_async.__file__).parent
PROGRAM = """
import asyncio, sys
sys.path.insert(0, sys.argv[1])
import robotiq_async
from robotiq_async import RobotiqHand
from robotiq_async.calibration import SpeedCalibration
from robotiq_async.tools.description import urdf

async def grip():
    async with RobotiqHand("sim://?model=2f85&object=120&speedup=20") as hand:
        grasp = await hand.grasp()
        print("holds" if grasp else "misses", f"{grasp.width_mm:.0f} mm")

assert robotiq_async.__file__.startswith(sys.argv[1])
SpeedCalibration.thesis()
assert "<robot" in urdf()
asyncio.run(grip())
"""


def test_a_simulated_gripper_works_from_a_zip(tmp_path: Path) -> None:
    archive = str(tmp_path / "robotiq_async.zip")
    subprocess.run([sys.executable, "-m", "zipfile", "-c", archive, str(PACKAGE)], check=True)
    command = [sys.executable, "-c", PROGRAM, archive]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.stdout, done.returncode) == ("holds 43 mm\n", 0), done.stderr
