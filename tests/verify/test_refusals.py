"""Devices that are not written to: another one, another client's gripper, one that moves or holds a part."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from robotiq_async.link.address import parse_address
from robotiq_async.simulator import SimulatedGripper, SimulatorServer, Trouble
from robotiq_async.tools.verify import ENTER, Plan, Report, Runner
from robotiq_async.tools.verify.runner import LEFT_SET
from robotiq_async.tools.verify.stages import first_motions, loss, soft_part
from robotiq_async.values.enums import Finger
from robotiq_async.values.model import TWO_FINGER_85
from robotiq_async.values.request import AxisRequest, Request
from tests.tools.test_doctor import answering, registers_in, reply
from tests.verify.people import SHORT, Helper, Roll, differing, served, verified

pytestmark = pytest.mark.virtual_time

CLOSING = Request(activate=True, go=True, axes=(AxisRequest(255, 0, 0),) * 3 + (AxisRequest(137),))


async def from_stage_2(server: SimulatorServer, helper: Helper | None = None, **plan: Any) -> Report:
    """A run that begins with the first stage that writes; it is refused, and nothing was written."""
    before = server.gripper.writes
    report = await verified(server, helper, **{"first": 2, "last": 2} | plan)
    assert server.gripper.writes == before
    assert 2 not in report.entered
    return report


async def test_another_client_that_commands() -> None:
    async with served(active=True) as server:
        gripper = server.gripper

        async def command() -> None:
            for position in range(1000):
                image = CLOSING.with_positions({Finger.A: 6 + position % 2, Finger.B: 6, Finger.C: 6})
                gripper.write(0, replace(image, go=False).registers)
                await asyncio.sleep(0.5)

        commanding = asyncio.ensure_future(command())
        report = await verified(server, first=2, last=2)
        commanding.cancel()
        assert (report.why, report.entered) == ("refused", [])
        assert "another client" in report.words


ACTIVATING = Request(activate=True)


@pytest.mark.parametrize(
    ("active", "image", "speedup", "words"),
    [
        (True, CLOSING, 1.0, "the fingers move"),
        (False, ACTIVATING, 1.0, "the fingers move"),
        (False, ACTIVATING, 0.005, "an activation or a change of mode is under way"),  # they hardly move
    ],
)
async def test_a_motion_or_an_activation_under_way(
    active: bool, image: Request, speedup: float, words: str
) -> None:
    async with served(active=active, speedup=speedup) as server:
        server.gripper.write(0, image.registers)
        await asyncio.sleep(0.5)
        report = await from_stage_2(server)
        assert report.why == "refused"
        assert words in report.words


@pytest.mark.parametrize("go", [True, False])
async def test_a_part_that_is_held(go: bool) -> None:
    async with served(active=True) as server:
        server.gripper.place_object(Finger.ABC, 100)
        server.gripper.write(0, CLOSING.registers)
        await asyncio.sleep(15)
        server.gripper.write(0, replace(CLOSING, go=go).registers)
        report = await from_stage_2(server)
        assert report.why == "refused"
        assert "holds something" in report.words
        assert server.gripper.holds


@pytest.mark.parametrize("fault", [9, 14])
async def test_a_fault(fault: int) -> None:
    async with served() as server:
        await server.fault_injector.begin(Trouble("fault", fault))
        report = await from_stage_2(server)
        assert report.why == "refused"
        assert "fault" in report.words


async def test_a_program_that_was_killed_in_a_full_stroke() -> None:
    """The rGTO it left set is reported, and cleared only on consent; the next run begins with no motion."""
    async with served(active=True) as server:
        server.gripper.write(0, CLOSING.registers)
        await asyncio.sleep(15)
        assert server.gripper.status_registers()[0] & 0x0800
        helper = Helper(server)
        helper.before = lambda words: False if words == LEFT_SET else None
        report = await from_stage_2(server, helper)
        assert report.why == "declined"
        assert "rGTO is set" in helper.said[-1]

        assert (await from_stage_2(server, agreed=2)).why == "refused"

        helper, roll, travel = Helper(server), Roll(), server.gripper.travel(Finger.A)
        report = await verified(server, helper, roll, first=2, last=2)
        assert helper.asked[0] == LEFT_SET
        assert report.why == "done", report.words
        assert not roll.written()[0][0] & 0x0800
        assert server.gripper.travel(Finger.A) == travel


async def test_a_stage_that_needs_an_active_gripper() -> None:
    async with served() as server:
        report = await verified(server, first=4, last=4)
        assert (report.why, report.entered) == ("inactive", [])
        assert "--from 3" in report.words
        assert not server.gripper.writes


async def test_a_gripper_that_loses_its_activation_between_two_stages() -> None:
    """It happens while the person reads about the next stage."""
    async with served() as server:
        helper = Helper(server)

        def lose(words: str) -> None:
            if "Stage 4" in words:
                server.gripper.power_cycle()

        helper.before = lose
        report = await verified(server, helper, first=3, last=5)
        assert report.why == "inactive"
        assert not server.gripper.is_moving


# -- other devices -----------------------------------------------------------------------------------------


@contextlib.asynccontextmanager
async def device(block: Callable[[], bytes]) -> AsyncIterator[tuple[str, list[bytes]]]:
    """Another Modbus server; its address, and the writes to it."""
    written: list[bytes] = []

    def answer(request: bytes) -> bytes:
        if request[7] in (5, 6, 15, 16, 23):
            written.append(request)
            return reply(request, request[7:12])
        return registers_in(request, block())

    async with answering(answer) as address:
        yield address, written


CLOCK = iter(range(10**9))
STRANGERS = {
    "all zeros": lambda: bytes(16),
    "all ones": lambda: b"\xff" * 16,
    "text": lambda: b"Power meter  v1.",
    "a constant": lambda: bytes((0, 7)) * 8,
    "one value everywhere": lambda: bytes((1, 0, 0, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 0)),
    "small counters": lambda: b"\0\0\0" + bytes([next(CLOCK) % 200]) + bytes(12),
    "active while not activated": lambda: b"\x30\0\0" + bytes((9, 6, 0, 9, 6, 0, 9, 6, 0, 9, 137, 0, 0)),
    "a fault that there is not": lambda: b"\x31\0\x08" + bytes((9, 6, 0, 9, 6, 0, 9, 6, 0, 9, 137, 0, 0)),
}


async def run_alone(address: str) -> Report:
    """A run at what is not a gripper of this process."""
    helper = Helper(SimpleNamespace(gripper=SimulatedGripper()))  # type: ignore[arg-type]
    return await Runner(Plan(parse_address(address), lengths=SHORT), helper, Roll(), lambda _: None).run()


async def test_nothing_answers() -> None:
    report = await run_alone("127.0.0.1:1")
    assert (report.why, report.stages) == ("link", [0]), "silence is no state of a gripper"
    assert "refused" in report.words, "by the host, and the words say so"


@pytest.mark.parametrize("block", STRANGERS.values(), ids=STRANGERS)
async def test_another_device_is_not_written_to(block: Callable[[], bytes]) -> None:
    async with device(block) as (address, written):
        report = await run_alone(address)
        assert not written
        assert report.why in ("refused", "foreign"), report.words
        assert 2 not in report.entered


async def test_another_model_is_refused_with_the_names_that_fit() -> None:
    async with served(model=TWO_FINGER_85) as server:
        report = await run_alone(f"127.0.0.1:{server.port}")
        assert not server.gripper.writes
    assert report.why == "refused"
    assert "name its model: ?model=2f85 or ?model=2f140 or ?model=hand-e" in report.words


# -- the person --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", range(10))
async def test_a_stage_without_consent_is_not_run(number: int) -> None:
    async with served(active=number > 3) as server:
        helper = Helper(server)
        helper.before = lambda words: False if words.startswith(f"Stage {number}:") else None
        before = server.gripper.writes
        report = await verified(server, helper, first=number)
        assert (report.why, report.entered) == ("declined", [])
        assert server.gripper.writes == before


async def stage_4(answers: str, *, is_sure: bool = True) -> Report:
    """A run of it with these answers about A, B, C and the scissor."""
    async with served(active=True) as server:
        helper, keys = Helper(server), iter(answers)

        def answer(words: str) -> object:
            if words == first_motions.QUESTION:
                return next(keys)
            return is_sure if words.startswith("Commanded was") else None

        helper.before = answer
        report = await verified(server, helper, first=4, last=4)
        assert not server.gripper.is_moving
        return report


@pytest.mark.parametrize("answers", ["l", "n", "an", "aa", "all", "alrl"])
async def test_a_finger_that_is_not_the_one_asked_for_ends_the_run(answers: str) -> None:
    report = await stage_4(answers)
    assert (report.why, report.entered) == ("deviation", [4])
    assert "Do not use" in report.checks["axis.finger"].follows


@pytest.mark.parametrize(("answers", "side"), [("alrs", "the left"), ("arls", "the right")])
async def test_b_may_be_on_either_side_and_the_report_says_which(answers: str, side: str) -> None:
    report = await stage_4(answers)
    assert report.why == "done"
    assert f"B is {side} finger of the pair" in report.checks["axis.finger"].found


async def test_a_wrong_key_is_not_held_against_the_gripper() -> None:
    report = await stage_4("n", is_sure=False)
    assert report.why == "declined"
    assert "axis.finger" not in differing(report)


async def test_an_emergency_stop_that_does_not_reach_the_gripper_ends_the_run() -> None:
    async with served(active=True) as server:
        helper = Helper(server)
        helper.before = lambda words: ENTER if words == loss.ESTOP else None
        report = await verified(server, helper, first=8, last=8)
        assert report.why == "deviation"
        assert "loss.estop" in differing(report)


async def test_after_a_stop_with_the_foam_held_the_run_says_how_to_go_on() -> None:
    async with served(active=True) as server:
        helper = Helper(server)
        helper.before = lambda words: False if words == soft_part.RELEASE else None
        assert (await verified(server, helper, first=7, last=7)).why == "declined"
        report = await verified(server, first=7, last=7)
        assert report.why == "refused"
        assert "robotiq-async move 0" in report.words
