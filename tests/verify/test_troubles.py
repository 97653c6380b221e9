"""Each trouble alone is found as what it is: the tables of docs/hardware.md, row by row."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from robotiq_async.link.address import parse_address
from robotiq_async.simulator import SimulatorServer, Trouble
from robotiq_async.simulator.troubles.like_hardware import like_hardware, own_habits
from robotiq_async.tools.verify import CheckVerdict, Plan, Report, Runner
from robotiq_async.tools.verify.bench import Lengths
from robotiq_async.tools.verify.catalogue import HARMLESS, checks_of
from robotiq_async.tools.verify.motions import REACHED, UNREACHED
from robotiq_async.values.model import THREE_FINGER, TWO_FINGER_85, Model
from robotiq_async.values.registers import rGTO
from tests.verify.matrix import EVENTS, HABITS, options
from tests.verify.people import SHORT, Helper, Roll, assert_as_assumed, differing, served, verified
from tests.virtual import VirtualLoop

pytestmark = pytest.mark.virtual_time
AXES, STOPPING = 4, 5
"""The stages that move one axis after the other, and all of them at once."""
OUTSIDE_MOTIONS = {
    *("silence-fault", "slow-activation", "slow-activation 35", "function-3-only", "one-connection-only")
}
"""Habits that show in a connection, after a silence or in an activation: no motion is like or unlike them."""
SHORTER = {"slow-device": "slow-device 0.05"}
"""Troubles made shorter for a test: an echo is looked for a thousand times a second."""


@pytest.mark.parametrize(("trouble", "check", "option"), [row for row in HABITS if row[0] != "none"])
async def test_a_habit_is_found_and_nothing_else(trouble: str, check: str, option: str) -> None:
    """Up to motions, or the stage that finds it; like hardware, to the end (below). None: test_whole_run."""
    checks = checks_of(THREE_FINGER, "tcp")
    last = max(AXES if trouble in OUTSIDE_MOTIONS else STOPPING, checks[check].stage)
    async with served(SHORTER.get(trouble, trouble)) as server:
        helper = Helper(server)
        report = await verified(server, helper, last=last)
        assert not server.gripper.is_moving
    assert report.why == ("inactive" if trouble == "idle-reset" else "done"), report.words
    assert differing(report) == {check: options(option)}
    assert report.options == options(option)
    if report.why == "done":
        assert not report.inconclusive
        assert report.checks.keys() == {name for name, each in checks.items() if each.stage <= last}
    assert not helper.alarms


@pytest.mark.parametrize(
    ("model", "options"), [(THREE_FINGER, {}), (TWO_FINGER_85, {"write_function": 16})], ids=str
)
async def test_a_line_without_function_23(model: Model, options: dict[str, int]) -> None:
    """A jaw is written with it by default."""
    async with served("no-function-23", serial=True, model=model) as server:
        report = await verified(server, last=2)
    assert report.why == "done", report.words
    assert differing(report) == {"write.function_23": options}
    assert not report.inconclusive


async def test_a_gripper_like_hardware_has_its_three_habits() -> None:
    async with served(*map(str, like_hardware(THREE_FINGER)), habits=own_habits(THREE_FINGER)) as server:
        report = await verified(server)
    assert report.why == "done", report.words
    assert differing(report).keys() == {"read.silence", "write.spacing", "axis.lag"}
    assert not report.inconclusive


@pytest.mark.parametrize("first", range(1, 10))
async def test_every_stage_can_be_the_first(first: int) -> None:
    """One that was activated before, and left without rGTO. The very first: test_whole_run."""
    async with served(active=first > 3) as server:
        report = await verified(server, first=first, last=max(first, 3))
        assert_as_assumed(report)


class Cue(Roll):
    """Lets something happen after so many frames of a stage, and knows what was written from then on."""

    def __init__(self, count: int, act: Callable[[], object]) -> None:
        super().__init__()
        self.kept = 0
        self._count = count
        self._act = act
        self._at = 0

    def keep(self, frame: object) -> None:
        super().keep(frame)  # type: ignore[arg-type]
        if self.stages:
            self.kept += 1
            if self.kept == self._count:
                self._at = len(self.frames)
                self._act()

    def written_after(self) -> list[tuple[int, ...]]:
        frames = self.frames[self._at :]
        return [frame.registers for frame in frames if frame.registers and frame.kind != "status"]


async def with_trouble(
    server: SimulatorServer, helper: Helper, trouble: str, stage: int, lengths: Lengths = SHORT
) -> tuple[Report, Cue]:
    """A run of one stage in the middle of which something happens."""
    begun: list[asyncio.Future[object]] = []

    def act() -> None:
        kind, _, value = trouble.partition(" ")
        if trouble == "a key":
            helper.has_stopped = True
        elif trouble == "Ctrl-C":
            running.cancel()
        else:
            what = Trouble(kind, float(value) if value else None)
            begun.append(asyncio.ensure_future(server.fault_injector.begin(what)))

    cue = Cue(22, act)
    plan = Plan(parse_address(server.address), first=stage, last=stage, lengths=lengths)
    runner = Runner(plan, helper, cue, lambda _: None)
    running = asyncio.ensure_future(runner.run())
    with contextlib.suppress(asyncio.CancelledError):
        await running
    assert trouble in ("a key", "Ctrl-C") or begun, "the stage was over before it began"
    await asyncio.gather(*begun)
    return runner.report, cue


async def test_a_read_that_fails_in_a_soak_is_counted_even_if_it_is_the_last() -> None:
    found = 0
    for milliseconds in range(80, 125, 5):
        async with served(active=True) as server:
            lengths = replace(SHORT, soak=milliseconds / 1000)
            report, _ = await with_trouble(server, Helper(server), "drop", 9, lengths)
        if report.checks["soak.reads"].figures["failed"]:
            found += 1
            assert report.why == "done", (milliseconds, report.words)
    assert 0 < found < 9, "in some of them it is the last"


@pytest.mark.parametrize(("trouble", "stage", "cell"), EVENTS)
async def test_a_trouble_in_a_stage_ends_it(trouble: str, stage: int, cell: str) -> None:
    async with served(active=stage > 3) as server:
        helper = Helper(server)
        report, cue = await with_trouble(server, helper, trouble, stage)
        assert report.why == cell.rstrip("!"), report.words
        assert bool(helper.alarms) == cell.endswith("!")
        if not cell.endswith("!"):
            assert not server.gripper.is_moving
        if stage >= HARMLESS and report.why != "done":
            assert cue.written_after() or helper.alarms, "nothing was written after it"
            assert not any(rGTO.read(image) for image in cue.written_after())


@pytest.mark.parametrize("stage", range(3, 10))
async def test_a_key_stops_a_gripper_that_forgets_writes_and_shows_them_late(stage: int) -> None:
    """The last write may be a moment ago: the stop is written again until it is echoed."""
    habits = ("write-spacing 0.05", "status-lag 0.1", "slow-device 0.1")
    async with served(*habits, active=stage > 3) as server:
        helper = Helper(server)
        report, cue = await with_trouble(server, helper, "a key", stage)
        assert report.why == "stopped", report.words
        assert not server.gripper.is_moving
        assert not any(rGTO.read(image) for image in cue.written_after())
        assert report.last is not None
        assert not report.last.go_echo


async def test_a_stage_whose_stop_is_not_confirmed_ends_the_run() -> None:
    """It counted as done, and the command ended with 0."""
    async with served(active=True) as server:
        whole = Cue(10_000, lambda: None)
        await verified(server, roll=whole, first=5, last=5)
    async with served(active=True) as server:
        helper, injector = Helper(server), server.fault_injector
        begun: list[asyncio.Future[object]] = []
        # The last two frames are rGTO = 0 and the status with its echo.
        cue = Cue(
            whole.kept - 2, lambda: begun.append(asyncio.ensure_future(injector.begin(Trouble("silence"))))
        )
        report = await verified(server, helper, cue, first=5)
        await asyncio.gather(*begun)
    assert (report.why, report.entered, report.stages) == ("unstopped", [5], [])
    assert report.last is None
    assert helper.alarms == [UNREACHED.format("rGTO = 0 could not be sent")]


async def test_an_alarm_is_withdrawn_when_the_gripper_answers_again() -> None:
    async with served(active=True) as server:
        helper = Helper(server)
        injector, ending = server.fault_injector, list[asyncio.Future[None]]()

        def alarm(words: str) -> None:
            helper.alarms.append(words)
            ending.extend(asyncio.ensure_future(injector.end(each)) for each in injector.ongoing)

        helper.alarm = alarm  # type: ignore[method-assign]
        report, _ = await with_trouble(server, helper, "silence", 4)
        await asyncio.gather(*ending)
        assert report.why == "link"
        assert helper.alarms == [UNREACHED.format("rGTO = 0 could not be sent"), REACHED]
        assert not server.gripper.is_moving


class LateTimers(VirtualLoop):
    """A computer whose timers are late by 10 ms."""

    def call_at(  # type: ignore[override]
        self, when: float, callback: Any, *arguments: Any, **options: Any
    ) -> asyncio.TimerHandle:
        return super().call_at(when + 0.01, callback, *arguments, **options)


@pytest.mark.parametrize("is_late", [False, True])
def test_late_timers_of_this_computer_are_not_blamed_on_the_gripper(is_late: bool) -> None:
    async def main() -> None:
        async with served("delay") as server:
            report = await verified(server, last=1)
        check = report.checks["read.round_trip"]
        assert check.verdict is (CheckVerdict.INCONCLUSIVE if is_late else CheckVerdict.DIFFERS)
        assert ("poll_interval" in report.options) is not is_late
        assert "wired network" not in check.follows, "the simulator is on this computer"

    with asyncio.Runner(loop_factory=LateTimers if is_late else VirtualLoop) as runner:
        runner.run(main())


async def test_a_write_that_is_forgotten_is_told_with_the_distance_at_which_it_acts() -> None:
    async with served("write-spacing 0.008") as server:
        report = await verified(server, first=2, last=2)
    found = report.checks["write.spacing"].found
    assert found == "a write 5 ms after another is acknowledged and forgotten, and a write 11 ms later acts"
