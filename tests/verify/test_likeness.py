"""A report becomes a simulator, and the report of that simulator is the same."""

from __future__ import annotations

import asyncio
import json
import os
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import pytest

from robotiq_async.calibration import MotionProfile
from robotiq_async.simulator import (
    Habits,
    Likeness,
    RtuOverTcpSimulatorServer,
    SimulatedGripper,
    SimulatorServer,
)
from robotiq_async.simulator.physics.controller import usual_motion
from robotiq_async.simulator.troubles.likeness import SCHEMA
from robotiq_async.simulator.troubles.trouble import Trouble
from robotiq_async.tools.verify import Report
from robotiq_async.values.model import MODELS, TWO_FINGER_85, Model
from tests.verify.people import SHORT, Helper, verified
from tests.virtual import run

FIRST, SETS = (int(each) for each in os.environ.get("HABIT_SETS", "0:20").split(":"))
"""``HABIT_SETS=100:200`` in the environment tries 200 from number 100 on. About one in a hundred may fail:
effects shorter than an exchange do not show."""
LENGTHS = replace(SHORT, interval=0.02)
UNSTEADY = ("host.", "soak.")
"""Checks of this computer, and of chance."""
VARIES = ("soft.standstill", "seconds")
"""A figure that differs from grip to grip."""


class Set:
    """The habits of one gripper and its link, drawn at random."""

    def __init__(self, number: int) -> None:
        draw = self._draw = Random(number)
        self.model: Model = draw.choice([*MODELS.values()])
        self.serial = draw.random() < 0.5
        self.is_jaw = len(self.model.axes) == 1
        self.habits = Habits(
            activation_time=draw.choice([4.2, 6.0, 12.0, 22.0, 31.0]),
            status_lag=draw.choice([0.0, 0.0, 0.03, 0.05, 0.12]),
            silence_fault=draw.choice([float("inf"), 1.0, 1.0]),
            write_spacing=draw.choice([0.0, 0.0, 0.01, 0.03]),
            echoes_limits=draw.random() < 0.2 and not self.is_jaw,
            lets_go_on_halt=draw.random() < 0.2,
        )
        self.delay = draw.choice([0.0, 0.0, 0.0, 0.008, 0.02, 0.035])
        self.cycle = draw.choice([None, 0.0, 0.005, 0.015, 0.05])
        self.ends = draw.choice([None, (2, 224), (3, 226), (12, 228)]) if self.is_jaw else None
        self.seed = draw.randrange(50)
        self.kinds = [kind for kind in self._usable() if draw.random() < 0.15]

    def _usable(self) -> list[str]:
        kinds = ["wake-needed", "one-connection-only"]
        return [*kinds, "no-function-23"] if self.serial else [*kinds, "function-3-only"]

    def _motion(self, usual: MotionProfile) -> MotionProfile:
        factor, draw = self._draw.choice([0.7, 1.0, 1.0, 1.5]), self._draw
        return MotionProfile(
            "drawn",
            0,
            tuple(rate * factor for rate in usual.rates),
            start_closing_s=usual.start_closing_s,
            start_opening_s=usual.start_opening_s * draw.choice([0.7, 1.0, 1.5]) if self.is_jaw else 0.0,
            landing=usual.landing,
            pressing=usual.pressing,
            pressing_s=usual.pressing_s,
            overrun=float(draw.choice([4, 6, 8])) if self.is_jaw else 0.0,
            give=float(draw.choice([2, 4, 5])) if self.is_jaw else 0.0,
        )

    async def report(self) -> Report:
        gripper = SimulatedGripper(
            asyncio.get_running_loop().time,
            model=self.model,
            habits=self.habits,
            device_cycle=self.cycle,
            ends=self.ends,
            seed=self.seed if not self.is_jaw else 4,
            motion=self._motion(usual_motion(self.model)),
        )
        make = RtuOverTcpSimulatorServer if self.serial else SimulatorServer
        async with make(gripper) as server:
            if self.delay:
                await server.fault_injector.begin(Trouble("delay", self.delay))
            for kind in self.kinds:
                await server.fault_injector.begin(Trouble(kind))
            return await verified(server, Helper(server), lengths=LENGTHS)


async def again(report: dict[str, Any]) -> Report:
    """The report of a simulator that is like another report."""
    return await reported(Likeness.from_report(report))


async def reported(likeness: Likeness) -> Report:
    gripper = likeness.gripper(asyncio.get_running_loop().time)
    make = SimulatorServer if likeness.link == "tcp" else RtuOverTcpSimulatorServer
    async with make(gripper) as server:
        await likeness.begin(server)
        return await verified(server, Helper(server), lengths=LENGTHS)


def as_json(report: Report) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(json.dumps(report.as_dict()))
    return content


def differences(first: dict[str, Any], second: dict[str, Any]) -> list[str]:
    """The verdicts and figures in which two reports differ."""
    found = []
    if first["ended"]["why"] != second["ended"]["why"]:
        found.append(f"ended: {first['ended']} and {second['ended']}")
    checks = [{each["name"]: each for each in report["checks"]} for report in (first, second)]
    trip = next(
        (each["figures"]["at_20_ms_p50_ms"] for each in first["checks"] if each["name"] == "read.round_trip"),
        0,
    )
    for name in checks[0].keys() | checks[1].keys():
        if name.startswith(UNSTEADY):
            continue
        here, there = (each.get(name, {"verdict": "missing", "figures": {}}) for each in checks)
        if here["verdict"] != there["verdict"]:
            found.append(
                f"{name}: {here['verdict']} ({here.get('found')}), {there['verdict']} ({there.get('found')})"
            )
            continue
        if here["options"].keys() != there["options"].keys():
            found.append(f"{name}: {here['options']} and {there['options']}")
        for figure, value in here["figures"].items():
            if (name, figure) != VARIES and not _are_alike(figure, value, there["figures"].get(figure), trip):
                found.append(f"{name} {figure}: {value} and {there['figures'].get(figure)}")
    return found


_LOOSE = (
    "counts",
    "allowed_counts",
    "open",
    "closed",
    "readings",
    "least",
    "greatest",
    "speed_0",
    "speed_255",
)


def _are_alike(figure: str, here: Any, there: Any, trip_ms: float) -> bool:
    """Within 5 % and what a client can tell: a count or two, and the time of a read and an exchange."""
    if (
        isinstance(here, list)
        and isinstance(there, list)
        and not figure.endswith(("histogram", "acted", "faults"))
    ):
        return len(here) == len(there) and all(
            _are_alike(figure, one, other, trip_ms) for one, other in zip(here, there, strict=True)
        )
    if isinstance(here, bool | str | list | None) or isinstance(there, bool | str | list | None):
        return type(here) is type(there)
    resolution = 2.0 if figure in _LOOSE else 0.06 + 2 * trip_ms / 1000
    if figure.endswith("_ms"):
        resolution = 5.0 + 2 * trip_ms
    return bool(here == pytest.approx(there, rel=0.05, abs=resolution))


@pytest.mark.parametrize("number", range(FIRST, FIRST + SETS))
def test_a_report_comes_back_from_the_simulator_that_is_like_it(number: int) -> None:
    """Grippers drawn at random, of all models, over TCP and a line."""

    async def both() -> list[str]:
        first = as_json(await Set(number).report())
        return differences(first, as_json(await again(first)))

    assert not run(both)


def test_the_plain_simulator_has_another_report() -> None:
    """Or the comparison would be blind."""
    for number in range(3):

        async def both(number: int = number) -> list[str]:
            drawn = Set(number)
            first = as_json(await drawn.report())
            plain = Likeness(drawn.model, "rtu+tcp" if drawn.serial else "tcp")
            return differences(first, as_json(await reported(plain)))

        assert run(both)


def _checks_of(**figures: dict[str, Any]) -> dict[str, Any]:
    return {
        "schema": SCHEMA,
        "model": "2f85",
        "link": "tcp",
        "registers": None,
        "ended": {"why": "link", "words": ""},
        "checks": [
            {"name": name.replace("__", "."), "verdict": "differs", "figures": each}
            for name, each in figures.items()
        ],
    }


def test_an_empty_report_is_the_usual_gripper() -> None:
    likeness = Likeness.from_report(_checks_of())
    assert (likeness.model, likeness.motion, likeness.ends) == (TWO_FINGER_85, None, None)
    assert likeness.exchange_s is likeness.device_cycle is None
    assert not likeness.troubles
    assert not likeness.unknown


@pytest.mark.parametrize(("units", "device_id"), [([0, 1, 9, 255], None), ([9], 9)])
def test_a_gripper_that_answers_as_any_unit_does_so_again(units: list[int], device_id: int | None) -> None:
    """A program with another unit than that of the report was not answered."""
    report = _checks_of(read__others={"units": units}) | {"registers": {"device_id": 9}}
    assert Likeness.from_report(report).device_id == device_id


def test_what_no_simulator_can_have_is_named() -> None:
    likeness = Likeness.from_report(_checks_of(stop__resume={}, host__timer={}, read__silence={}))
    assert likeness.unknown == ("stop.resume",)


@pytest.mark.parametrize(
    ("report", "words"),
    [
        ([], "report must be an object, got list"),
        ({"schema": 2}, "the schema of report must be 1, got 2"),
        ({"schema": 1}, "this is no report of robotiq-async verify"),
    ],
)
def test_what_is_no_report_is_refused(report: object, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Likeness.from_report(report)


def test_a_file_that_is_no_report_is_named(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    path.write_text("{", encoding="utf-8")
    with pytest.raises(ValueError, match=r"report\.json is no report of robotiq-async verify"):
        Likeness.from_file(path)
    with pytest.raises(OSError, match="none"):
        Likeness.from_file(tmp_path / "none")
