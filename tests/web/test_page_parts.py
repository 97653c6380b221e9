"""The parts of the page, without a browser: commands, updates, the mirror, the heartbeat."""

# ruff: noqa: E402  # what follows needs(...) cannot be imported without the extra

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from tests.extras import needs

needs("nicegui", "the page needs the extra web")

from robotiq_async import CLOSED, HAND_E, Fault, Finger, RobotiqHand, RobotiqStatus, State
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.actions import Operator
from robotiq_async.tools.web.commands import BUTTONS, COMMAND_AGE_S, MAX_COMMANDS, PageCommands
from robotiq_async.tools.web.page.heartbeat import PAGE_LOST_S, Heartbeat
from robotiq_async.tools.web.page.mirror import HISTORY_S, HandMirror, PageMirror
from robotiq_async.tools.web.page.widgets.words import event_words, fault_words, state_words
from robotiq_async.tools.web.server import HandUpdates, PageServer
from robotiq_async.tools.web.settings import PageSettings
from robotiq_async.tools.wording import refusal_words
from robotiq_async.values.enums import Trigger
from robotiq_async.values.states import TABLE, Verdict, refusal
from tests.fake_hand import FakeHand
from tests.forked import PAGE, forking
from tests.grippers import active_gripper, shows, until
from tests.patience import patience

# -- commands ----------------------------------------------------------------------------------------------


class Pages:
    """Requests of pages, and their answers."""

    def __init__(self, *hands: Any) -> None:
        self.answers: list[dict[str, Any]] = []
        self.commands = PageCommands([Operator(hand) for hand in hands], self.answers.append)

    def do(self, name: str, page: str = "one", hand: int = 0, ago: float = 0.0, **arguments: object) -> None:
        asked = {"page": page, "number": 1, "at": monotonic() - ago, "hand": hand, "name": name}
        self.commands.do({**asked, "arguments": arguments})

    async def answer(self) -> dict[str, Any]:
        await until(lambda: bool(self.answers))
        return self.answers.pop(0)


async def test_a_command_is_carried_out_and_answered(hand: RobotiqHand) -> None:
    pages = Pages(hand)
    pages.do("close")
    answer = await pages.answer()
    assert answer["ok"]
    assert answer["words"].startswith("A at 24")
    pages.do("reset")
    assert "reset takes confirm" in (await pages.answer())["words"]
    pages.do("reset", confirm=True)
    assert (await pages.answer())["words"] == "the gripper is reset"


@pytest.mark.parametrize(
    ("name", "hand", "words"),
    [
        ("explode", 0, "there is no command 'explode'"),
        ("close", 1, "there is no hand 1"),
        ("close", -1, "there is no hand -1"),
    ],
)
async def test_unknown_actions_and_hands_are_refused(name: str, hand: int, words: str) -> None:
    pages = Pages(FakeHand())
    pages.do(name, hand=hand)
    answer = await pages.answer()
    assert (answer["ok"], answer["words"]) == (False, words)


async def test_it_speaks_of_buttons_and_not_of_python() -> None:
    """It said: call activate() or recover(). The button is named activate."""
    gripper = SimulatedGripper(speedup=20)
    async with SimulatorServer(gripper) as server:
        hand = RobotiqHand(server.address, name="left")
        await hand.start(activate=False)
        pages, said = Pages(hand), []
        for name, arguments in (
            ("close", {}),
            ("move", {"position": 9, "fingers": "A"}),
            ("release", {"confirm": True}),
        ):
            pages.do(name, **arguments)
            said.append((await pages.answer())["words"])
        await hand.activate()
        gripper.inject_fault(Fault.SCISSOR_BLOCKED)
        await hand.wait_for_state(State.FAULT)
        pages.do("close")
        said.append((await pages.answer())["words"])
        await hand.stop()
        pages.do("close")
        said.append((await pages.answer())["words"])
    assert said == [
        "the gripper is not activated; press activate",
        "the gripper is not activated; press activate",
        "not now, as it is 'reset: not active'; only when 'fault'",
        f"major fault 0x0E: {Fault.SCISSOR_BLOCKED.description}; press recover",
        "the hand is not started",
    ]


@pytest.mark.parametrize("trigger", [each for each in Trigger if each.name.startswith("ASK_")])
@pytest.mark.parametrize("state", State)
def test_no_refusal_has_a_method_or_a_state_of_the_library(trigger: Trigger, state: State) -> None:
    if isinstance(TABLE[state][trigger], Verdict):
        words = refusal_words(refusal(trigger, state), BUTTONS)
        assert "()" not in words
        assert not [each.name for each in State if "_" in each.name and each.name in words]


async def test_a_permit_is_of_the_halt_that_the_page_showed() -> None:
    hand = RobotiqHand("sim://")
    pages = Pages(hand)

    async def permit(seen: object) -> str:
        pages.do("permit", confirm=True, seen=seen)
        return str((await pages.answer())["words"])

    await hand.inhibit("HALT was pressed", who="the page")
    assert hand.inhibited is not None
    seen = json.loads(json.dumps(hand.inhibited.as_dict()))
    await hand.inhibit("HALT was pressed", who="the page")
    assert "a halt came after the one that was seen: look at the gripper" in await permit(seen)
    assert "seen must be the inhibit that was shown" in await permit(None)
    assert "unexpected keyword" in await permit({**seen, "more": 1})
    pages.do("permit", confirm=True)
    assert "permit takes confirm, seen" in (await pages.answer())["words"]
    assert hand.inhibited is not None
    assert await permit(hand.inhibited.as_dict()) == "motion is permitted again"
    assert hand.inhibited is None


async def test_without_operators_nothing_is_carried_out() -> None:
    """Whatever the process of the page sends: looking only is decided in the process of the hand."""
    pages = Pages()
    for name in ("close", "halt"):
        pages.do(name)
        assert "only watches" in (await pages.answer())["words"]


MOVING: tuple[tuple[str, dict[str, Any]], ...] = (
    ("close", {}),
    ("set_speed", {"value": 9}),
    ("reset", {"confirm": True}),
)


@pytest.mark.parametrize("ago", [COMMAND_AGE_S + 0.1, 1e9, -1.0])
async def test_late_requests_move_nothing_but_a_halt_is_never_too_late(hand: RobotiqHand, ago: float) -> None:
    """It may have waited in the browser, on the network, or for this loop, which something had held up."""
    await assert_only_a_halt(Pages(hand), hand, "arrived too late", ago=ago)


async def test_a_page_that_is_ending_takes_nothing_but_a_halt(hand: RobotiqHand) -> None:
    """With several hands the others were still commanded while the first one stopped."""
    pages = Pages(hand)
    pages.commands.refuse()
    await assert_only_a_halt(pages, hand, "the page is closing")


async def assert_only_a_halt(pages: Pages, hand: RobotiqHand, words: str, ago: float = 0.0) -> None:
    requests = hand.requests()
    for name, arguments in MOVING:
        pages.do(name, ago=ago, **arguments)
        answer = await pages.answer()
        assert (answer["ok"], words in answer["words"]) == (False, True)
    assert requests.take_nowait() is None
    assert hand.state is State.RUNNING_IDLE
    pages.do("halt", ago=ago)
    pages.commands.gone("one")  # and a halt of a page that has gone is completed
    assert (await pages.answer())["words"] == "every axis has stopped"


async def test_a_page_that_is_gone_has_its_motion_held_and_no_other() -> None:
    gripper = active_gripper(spread=False)
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address) as hand:
        pages = Pages(hand)
        pages.do("move", page="one", position=CLOSED, fingers="A")
        pages.do("move", page="two", position=100, fingers="B")
        await shows(hand, lambda status: Finger.A | Finger.B in status.moving)
        pages.commands.gone("one")
        answers = [await pages.answer(), await pages.answer()]
        assert [each["page"] for each in answers] == ["one", "two"]
        assert (answers[0]["ok"], answers[1]["words"].partition(";")[0]) == (False, "B at 100")
        assert hand.status.position(Finger.A) < 200
        assert not pages.commands.under_way


async def test_a_command_is_answered_whenever_its_page_is_gone() -> None:
    """Also in the same turn of the loop, before it has begun, as after a process that stood still."""
    pages = Pages(FakeHand())
    pages.do("close")
    pages.commands.gone("one")
    assert (await pages.answer())["words"] == "the page is gone: the axes are held"
    assert not pages.commands.under_way


async def test_a_halt_finds_its_way_through_a_crowd() -> None:
    async with SimulatorServer(active_gripper()) as server, RobotiqHand(server.address) as hand:
        server.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
        await hand.wait_for_state(State.FAULT)
        pages = Pages(hand)
        for _ in range(MAX_COMMANDS + 1):
            pages.do("recover", confirm=True)
        assert "already running" in (await pages.answer())["words"]
        pages.do("halt")
        words = [(await pages.answer())["words"] for _ in range(MAX_COMMANDS + 1)]
        assert "every axis has stopped" in words
        await pages.commands.close()


# -- updates and mirror -----------------------------------------------------------------------------------


def mirrored(updates: HandUpdates, mirror: PageMirror) -> None:
    updates.gather()
    mirror.hear(json.dumps({"hands": [updates.take(0)], "answers": []}).encode())


async def test_the_mirror_shows_what_the_hand_is(hand: RobotiqHand, gripper: SimulatedGripper) -> None:
    updates, mirror = HandUpdates(hand), PageMirror(("here",), control=False, say=lambda _: None)
    shown = mirror.hands[0]
    assert state_words(shown, is_quiet=False)[0] == "lost"
    await hand.move(90)
    gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    await hand.wait_for_state(State.FAULT)
    mirrored(updates, mirror)
    assert shown.status == hand.status
    assert (state_words(shown, is_quiet=False), fault_words(shown)[1]) == (("fault", "negative"), True)
    assert Fault.SCISSOR_BLOCKED.description in fault_words(shown)[0]
    lines = [event_words(event) for _, event in shown.events]
    assert any("fault 0x0E" in line for line in lines)
    assert not any("RUNNING_CC" in line for line in lines), "every command would be two of them"
    assert shown.statistics["polls"] == pytest.approx(hand.statistics.polls, abs=20)
    assert state_words(shown, is_quiet=True)[0].endswith("silent")
    mirrored(updates, mirror)
    assert len(shown.events) == len(lines), "each event is shown once"


@pytest.mark.parametrize(
    ("query", "parts"), [("&physics=box:30x40x60,0.3", 1), ("&physics=table", 0), ("", None)]
)
async def test_what_a_simulation_knows_reaches_the_page(query: str, parts: int | None) -> None:
    pytest.importorskip("mujoco", reason="needs the extra physics")
    mirror = PageMirror(("here",), control=False, say=lambda _: None)

    def known() -> int | None:
        mirrored(HandUpdates(jaw), mirror)
        return None if mirror.hands[0].joints is None else len(mirror.hands[0].parts)

    async with RobotiqHand(f"sim://?model=2f85&speedup=10{query}") as jaw:
        await until(lambda: known() == parts)  # bodies have a thread of their own


async def test_a_gripper_elsewhere_tells_no_more_than_its_registers(hand: RobotiqHand) -> None:
    mirror = PageMirror(("here",), control=False, say=lambda _: None)
    mirrored(HandUpdates(hand), mirror)
    assert mirror.hands[0].status is not None
    assert (mirror.hands[0].joints, mirror.hands[0].parts) == (None, ())


@pytest.mark.virtual_time
async def test_a_peak_of_the_current_is_not_lost_between_two_looks(hand: RobotiqHand) -> None:
    updates = HandUpdates(hand)
    peak = 0
    moving = asyncio.create_task(hand.close())
    async for status in hand.statuses():
        updates.gather()
        peak = max(peak, status.current_ma(Finger.A) or 0)
        if moving.done():
            break
    assert updates.take(0)["peaks"][0] >= peak > 0
    assert updates.take(0)["peaks"] == [0, 0, 0, 0]


def test_the_curves_are_of_the_last_half_minute() -> None:
    mirror = PageMirror(("here",), control=False, say=lambda _: None)
    shown = mirror.hands[0]
    for tick in range(1000):
        shown._sample(tick * 0.1)
    assert shown.samples[-1].at - shown.samples[0].at <= HISTORY_S
    assert 140 <= len(shown.samples) <= 152
    assert shown.samples[-1].positions is None, "nothing is known: a gap in the curve"


async def test_a_silence_is_a_gap_in_the_curves_and_no_line(hand: RobotiqHand) -> None:
    updates, mirror = HandUpdates(hand), PageMirror(("here",), control=False, say=lambda _: None)
    mirrored(updates, mirror)
    shown = mirror.hands[0]
    shown._sample(shown.samples[-1].at + 10)
    assert [sample.positions is None for sample in shown.samples] == [False, True, False]


def test_an_answer_goes_to_the_page_that_asked() -> None:
    said: list[dict[str, Any]] = []
    answers: list[tuple[bool, str]] = []
    mirror = PageMirror(("here",), control=True, say=said.append)
    mirror.ask("page", 0, "close", {}, lambda ok, words: answers.append((ok, words)), at=1.0)
    number = said[0]["do"]["number"]
    answer = {"number": number, "ok": True, "words": "A"}
    for _ in range(2):
        mirror.hear(json.dumps({"hands": [], "answers": [answer]}).encode())
    assert answers == [(True, "A")]


def test_what_a_browser_sends_at_length_ends_no_page() -> None:
    """The other process took the line for an invalid message, and ignored all commands from then on."""
    said: list[dict[str, Any]] = []
    answers: list[tuple[bool, str]] = []
    mirror = PageMirror(("here",), control=True, say=said.append)
    many = {"position": "\u00e9" * 20_000}
    mirror.ask("page", 0, "move", many, lambda ok, words: answers.append((ok, words)), at=1.0)
    assert not said
    assert answers == [(False, "a command is not that long")]


# -- the process -------------------------------------------------------------------------------------------


async def test_operators_are_those_of_the_hands() -> None:
    one, other = FakeHand(), FakeHand()
    with pytest.raises(ValueError, match="operators must belong to the hands"):
        PageServer([one], PageSettings(control=True), operators=[Operator(other)])
    with pytest.raises(ValueError, match="control needs operators"):
        PageServer([one], PageSettings(control=True))
    with pytest.raises(ValueError, match="control needs operators"):
        PageServer([one], PageSettings(), operators=[Operator(one)])


async def test_a_process_that_dies_is_noticed_and_its_motions_are_held() -> None:
    gripper = active_gripper(spread=False)
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address) as hand:
        settings = PageSettings(port=0, control=True, addresses=(hand.address,))
        with forking(PAGE):
            async with PageServer([hand], settings, operators=[Operator(hand)]) as page:
                asked = {"page": "p", "number": 1, "at": monotonic(), "hand": 0, "name": "close"}
                page._hear({"do": {**asked, "arguments": {}}})
                await shows(hand, lambda status: status.is_moving)
                page._process.kill()
                async with asyncio.timeout(patience(20)):
                    await page.ended()
                stood = await shows(hand, lambda status: not status.is_moving)
                assert stood.position(Finger.A) < 200


# -- in touch ----------------------------------------------------------------------------------------------


def test_any_heartbeat_of_a_browser_is_tolerated() -> None:
    heartbeat, now = Heartbeat(), monotonic()
    assert heartbeat.heard(now) == now
    nothing: tuple[object, ...] = (None, "now", [now], True, {}, now + 60, -1, float("nan"), float("-inf"))
    assert [heartbeat.heard(each) for each in nothing] == [0.0] * len(nothing), "which is too long ago"


def test_a_browser_is_lost_once_and_found_again() -> None:
    heartbeat = Heartbeat()
    assert not heartbeat.check()
    heartbeat._newest -= PAGE_LOST_S + 1
    assert heartbeat.check()
    assert not heartbeat.check(), "reported once"
    heartbeat.heard(monotonic() - PAGE_LOST_S - 1)
    assert heartbeat.is_lost, "what it sent was long under way"
    heartbeat.heard(monotonic())
    assert not heartbeat.is_lost
    heartbeat._newest -= PAGE_LOST_S + 1
    assert heartbeat.check(), "and lost once more, with whatever it has set in motion since"


def test_a_browser_that_comes_back_has_caught_up_when_it_knows_a_time_since() -> None:
    heartbeat = Heartbeat()
    heartbeat.begin()
    heartbeat.heard(monotonic())
    assert not heartbeat.has_caught_up(), "it was never away"
    told_before = monotonic()
    heartbeat.begin()
    heartbeat.heard(told_before)
    assert not heartbeat.has_caught_up(), "what it missed is still to come"
    heartbeat.heard(monotonic())
    assert heartbeat.has_caught_up()
    assert not heartbeat.has_caught_up(), "reported once"


def test_a_process_of_the_page_without_settings_ends_and_leaves_no_folder(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "robotiq_async.tools.web.page"]
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    assert subprocess.call(command, stdin=subprocess.DEVNULL, env=environment) == 1
    assert not list(tmp_path.iterdir())


def test_a_row_without_a_current_shows_none() -> None:
    from robotiq_async.tools.web.page.widgets.panels import _axis_row  # noqa: PLC0415  # it imports NiceGUI

    told, untold = (
        _axis_row(
            HandMirror(
                0, "", status=RobotiqStatus((0xF900, 0, 0, 0, 0, 0, 0, 0), model=HAND_E, has_current=has)
            ),
            0,
        )
        for has in (True, False)
    )
    assert "0 mA" in told
    assert "mA" not in untold
