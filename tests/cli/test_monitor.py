"""The screen of ``robotiq-async monitor``, driven by textual's pilot."""

from __future__ import annotations

import contextlib
import re
from collections.abc import AsyncIterator, Mapping
from typing import TYPE_CHECKING

import pytest
from textual.pilot import Pilot
from textual.widgets import RichLog, Static

from robotiq_async import (
    JAW,
    Fault,
    Finger,
    GripperFaultError,
    MoveSupersededError,
    RobotiqError,
    RobotiqHand,
    RobotiqStatus,
    State,
)
from robotiq_async.cli.tui.asking import NO, Question, TargetQuestion
from robotiq_async.cli.tui.screen import Monitor
from robotiq_async.cli.tui.widgets import HINTS, Axes, position_bar, sparkline
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.actions import Operator
from robotiq_async.tools.wording import refusal_words
from robotiq_async.values.enums import Trigger
from robotiq_async.values.model import THREE_FINGER, TWO_FINGER_85
from robotiq_async.values.states import refusal
from tests.grippers import active_gripper, shows, until

if TYPE_CHECKING:
    Screen = Pilot[None]


SLOWLY = 0.05
"""The pilot waits for a moment in which the process does nothing: at 200 Hz there is none."""


@pytest.fixture
async def operator(server: SimulatorServer) -> AsyncIterator[Operator]:
    hand = RobotiqHand(server.address, poll_interval=SLOWLY)
    operator = Operator(hand)
    await hand.start(activate=False)
    yield operator
    await hand.stop()


@pytest.fixture
async def active(operator: Operator) -> Operator:
    await operator.hand.activate()
    return operator


@contextlib.asynccontextmanager
async def shown(operator: Operator) -> AsyncIterator[Screen]:
    async with Monitor(operator).run_test(size=(100, 20)) as pilot:
        yield pilot


def log(pilot: Screen) -> str:
    return "\n".join(line.text for line in pilot.app.query_one("#log", RichLog).lines)


def text(pilot: Screen, where: str) -> str:
    return str(pilot.app.query_one(where, Static).render())


async def sees(pilot: Screen, where: str, words: str) -> None:
    """Wait until these words are in a part of the screen."""
    await until(lambda: words in (log(pilot) if where == "#log" else text(pilot, where)))


def asked(pilot: Screen) -> Question | None:
    """The question that waits for a key."""
    assert isinstance(pilot.app, Monitor)
    asking = pilot.app.asking
    assert asking is None or isinstance(asking, Question)
    return asking


def axes(pilot: Screen) -> list[str]:
    return pilot.app.query_one(Axes).render().plain.split("\n")[1:]


# -- the screen --------------------------------------------------------------------------------------------


async def test_it_shows_the_gripper_before_anything_happens(operator: Operator) -> None:
    async with shown(operator) as pilot:
        assert operator.hand.address in text(pilot, "#state")
        assert "RESET   not active; a activates it" in text(pilot, "#state")
        assert "no fault" in text(pilot, "#state")
        assert [line.split()[0] for line in axes(pilot)] == ["A", "B", "C", "SCISSOR"]
        assert "6 → 0" in axes(pilot)[0]
        await sees(pilot, "#link", "reconnects 0")
        await until(lambda: 15 < float(text(pilot, "#link").split()[0]) < 25)
        assert "speed 128  force 64" in text(pilot, "#link")
    assert not operator.has_moved


async def test_it_follows_the_axes() -> None:
    gripper = active_gripper(spread=False)  # slow enough for some polls that come late
    gripper.place_object(Finger.A, 60, soft=60)
    async with (
        SimulatorServer(gripper) as server,
        RobotiqHand(server.address, poll_interval=SLOWLY) as hand,
        shown(Operator(hand)) as pilot,
    ):
        await hand.close(Finger.A, speed=0, force=255)
        await until(lambda: "120 → 255 CONTACT closing" in axes(pilot)[0])
        assert set(sparkline_of(axes(pilot)[0])) & set("▅▆▇█"), "half an ampere before it grips"
        await hand.close(Finger.B, speed=255)
        await until(lambda: "241 → 255 there" in axes(pilot)[1])
        assert "▁" in sparkline_of(axes(pilot)[3])
        assert set(sparkline_of(axes(pilot)[3])) <= {"▁", " "}, "a gap is a poll that came late"


def sparkline_of(line: str) -> str:
    return line.rpartition(" mA")[0][-30:-5].strip()


async def test_a_fault_is_shown_in_words_and_stays_in_the_log(
    active: Operator, gripper: SimulatedGripper
) -> None:
    async with shown(active) as pilot:
        gripper.inject_fault(Fault.SCISSOR_BLOCKED)
        await sees(pilot, "#state", "major fault 0x0E: interference on the scissor")
        gripper.clear_faults()
        await sees(pilot, "#state", "no fault")
        await sees(pilot, "#log", "fault (gripper reports a fault)")
        assert "SCISSOR_BLOCKED" in log(pilot)
        assert "0x00 NONE" in log(pilot)


async def test_a_lost_gripper_is_a_state_and_comes_back(active: Operator, server: SimulatorServer) -> None:
    async with shown(active) as pilot:
        server.refuse()
        server.cut()
        await sees(pilot, "#state", "LOST")
        old = re.compile(r"no gripper answers: what you see is \d+\.\d s old")
        await until(lambda: old.search(text(pilot, "#state")) is not None)
        assert all(span.style == "dim" for span in pilot.app.query_one(Axes).render().spans[-1:])
        await pilot.press("o")
        await sees(pilot, "#log", "open: the link is down")
        await server.accept()
        await sees(pilot, "#state", "READY")
        await sees(pilot, "#link", "reconnects 1")
        assert pilot.app.is_running


async def test_an_activation_is_shown_as_a_motion() -> None:
    async with SimulatorServer(SimulatedGripper(speedup=2)) as slow:
        hand = RobotiqHand(slow.address, poll_interval=SLOWLY)
        await hand.start(activate=False)
        async with shown(Operator(hand)) as pilot:
            await confirmed(pilot, "a")
            await sees(pilot, "#state", "the fingers MOVE")
            await until(lambda: " moving " in axes(pilot)[0])
            await sees(pilot, "#state", "active, not moving")
            await until(lambda: " moving " not in axes(pilot)[0])
        await hand.stop()


async def test_a_current_that_is_not_told_is_not_shown_as_0(active: Operator) -> None:
    async with shown(active) as pilot:
        axes, words = pilot.app.query_one(Axes), active.hand.status.registers
        for has_current in (True, False):
            axes.show(RobotiqStatus(words, has_current=has_current), dict.fromkeys(THREE_FINGER.axes, -1))
            assert ("mA" in axes.render().plain) is has_current


async def test_of_the_currents_between_two_paints_the_highest_is_shown(active: Operator) -> None:
    async with shown(active) as pilot:
        assert isinstance(pilot.app, Monitor)
        still = active.hand.status.registers
        strong = RobotiqStatus((*still[:2], still[2] & 0xFF00 | 9, *still[3:]))
        peaks = [strong.current_ma(axis) or 0 for axis in THREE_FINGER.axes]
        assert max(peaks) == 90
        for status in (strong, active.hand.status):
            active.hand._backend.channels.statuses.push(status)
        pilot.app._look()
        assert "   90 mA" in pilot.app.query_one(Axes).render().plain


async def test_another_client_is_shown(active: Operator, gripper: SimulatedGripper) -> None:
    async with shown(active) as pilot:
        request = list(gripper.request_registers)
        request[1] = 77
        gripper.write(0, request)
        await sees(pilot, "#link", "ANOTHER CLIENT")


async def test_it_paints_a_dozen_times_a_second_and_not_at_every_poll(server: SimulatorServer) -> None:
    painted: list[object] = []

    class Counted(Axes):
        def show(self, status: RobotiqStatus, peaks_ma: Mapping[Finger, int]) -> None:
            painted.append(status)
            super().show(status, peaks_ma)

    async with RobotiqHand(server.address) as hand, shown(Operator(hand)) as pilot:
        panel = pilot.app.query_one(Axes)
        panel.__class__ = Counted
        statuses = hand.statuses(1000)
        first = newest = await anext(statuses)
        for _ in range(200):
            newest = await anext(statuses)
        seconds = newest.timestamp - first.timestamp  # 1, and more on a busy machine
        assert 2 <= len(painted) <= 2 + 16 * seconds
        assert painted[-1] is not painted[0], "the newest one"


# -- keys --------------------------------------------------------------------------------------------------


async def test_keys_open_close_and_spread(active: Operator) -> None:
    hand = active.hand
    async with shown(active) as pilot:
        for key, axis, target in (
            ("c", Finger.B, 255),
            ("o", Finger.B, 0),
            ("1", Finger.SCISSOR, 0),
            ("3", Finger.SCISSOR, 255),
            ("2", Finger.SCISSOR, 100),
        ):
            await pilot.press(key)
            await until(lambda: hand.status.requested_position(axis) == target)  # noqa: B023
        await sees(pilot, "#log", "normal: SCISSOR at")
    assert active.has_moved


async def test_speed_and_force_by_keys(active: Operator) -> None:
    bracket = "square_bracket"
    async with shown(active) as pilot:
        keys = ("plus", "minus", f"left_{bracket}", f"right_{bracket}")
        for key, speed, force in zip(keys, (144, 128, 128, 128), (64, 64, 48, 64), strict=True):
            await pilot.press(key)
            await sees(pilot, "#link", f"speed {speed}  force {force}")


async def test_dangerous_keys_ask_first(active: Operator, gripper: SimulatedGripper) -> None:
    requests = active.hand.requests()
    async with shown(active) as pilot:
        for key, warning in (("r", "DROPS"), ("l", "OPEN slowly"), ("a", "MOVE"), ("v", "DROPS")):
            for answer in ("n", "escape"):
                await pilot.press(key)
                assert asked(pilot) is not None, key
                assert warning in text(pilot, "#question")
                await pilot.press("o", "r")  # nothing else works until then
                assert asked(pilot) is not None
                assert warning in text(pilot, "#question")
                await pilot.press(answer)
                assert asked(pilot) is None, (key, answer)
        assert not gripper.is_moving
    assert requests.take_nowait() is None


async def confirmed(pilot: Screen, key: str) -> None:
    await pilot.press(key)
    await answered(pilot)


async def answered(pilot: Screen) -> None:
    """Say yes, once the question could be read."""
    await until(lambda: (question := asked(pilot)) is not None and question.is_open)
    await pilot.press("y")


async def test_a_yes_resets_and_activates(active: Operator) -> None:
    async with shown(active) as pilot:
        await confirmed(pilot, "r")
        await until(lambda: active.hand.state is State.RESET)
        await confirmed(pilot, "a")
        await sees(pilot, "#log", "activate: the gripper is active")


async def test_a_yes_permits_motion_after_the_halt_that_the_question_showed(active: Operator) -> None:
    hand = active.hand
    async with shown(active) as pilot:
        await pilot.press("m")
        await sees(pilot, "#log", "permit: motion is not inhibited")
        assert asked(pilot) is None
        await hand.inhibit("the guard is open", who="PLC")
        await pilot.press("m")
        assert "motion is inhibited: the guard is open (PLC), since" in text(pilot, "#question")
        await hand.inhibit("a hand is in the gripper")
        await answered(pilot)
        await until(lambda: "as a halt came after the one that was seen" in " ".join(log(pilot).split()))
        assert hand.inhibited is not None
        await confirmed(pilot, "m")
        await sees(pilot, "#log", "permit: motion is permitted again")
        assert hand.inhibited is None


async def test_a_question_lies_on_the_same_screen(operator: Operator) -> None:
    """Over a screen of its own every paint drew both: 9 ms twelve times a second, 10 to 50 polls a second."""
    async with shown(operator) as pilot:
        await pilot.press("r")
        assert pilot.app.query_one("#question").display
        assert asked(pilot) is not None
        assert pilot.app.screen_stack == [pilot.app.screen]
        assert pilot.app.query_one("#question").region.bottom == pilot.app.size.height


async def test_any_axes_are_sent_to_any_position(active: Operator) -> None:
    hand = active.hand
    async with shown(active) as pilot:
        await pilot.press("p")
        assert "Enter MOVES them" in text(pilot, "#question")
        await pilot.press("enter", "b", "enter")  # neither axes nor position; no position
        await pilot.press("1", "3", "7")
        assert "position 137" in text(pilot, "#question")
        assert not active.has_moved
        await pilot.press("enter")
        await sees(pilot, "#log", "B to 137: B at 137")
        await pilot.press("p", "s", "a", "a", "9", "9", "9", "backspace", "enter")
        await sees(pilot, "#log", "SCISSOR to 9: SCISSOR at")
        await pilot.press("p", "a", "c", "6", "0", "enter")
        await sees(pilot, "#log", "A|C to 60: A at 60, C at 60")
        positions = [hand.status.requested_position(axis) for axis in THREE_FINGER.axes]
        assert positions == [60, 137, 60, 9]


async def test_of_a_jaw_the_one_axis_is_chosen_and_no_other_can_be() -> None:
    jaw = active_gripper(model=TWO_FINGER_85)
    async with SimulatorServer(jaw) as server:
        hand = RobotiqHand(server.address, poll_interval=SLOWLY)
        async with hand, shown(Operator(hand)) as pilot:
            await pilot.press("p", "b", "s", "6", "0", "enter")
            await sees(pilot, "#log", "A to 60: A at")
            await pilot.press("1")
            await sees(pilot, "#log", "a 2F-85 has no scissor")


async def test_a_position_that_is_not_entered_moves_nothing(active: Operator) -> None:
    requests = active.hand.requests()
    async with shown(active) as pilot:
        for key in sorted(NO):
            await pilot.press("p", "a", "9", key)
            assert not pilot.app.query_one("#question").display, key
            assert pilot.app.is_running, "it ends the question and not the monitor"
    assert requests.take_nowait() is None


def test_a_position_is_in_its_range() -> None:
    """A digit that would leave it is not taken, and is not moved to its end either."""
    moved: list[tuple[Finger, int]] = []
    target = TargetQuestion(THREE_FINGER, lambda axes, position: moved.append((axes, position)))
    for key in ("a", "b", "2", "5", "6", "x", "²"):
        assert not target.press(key)
    assert "position 25_" in target.text.plain
    assert not target.press("5")
    assert target.press("enter")
    assert moved == [(Finger.A | Finger.B, 255)]


async def test_it_speaks_of_keys_and_not_of_methods_and_states(active: Operator) -> None:
    async with shown(active) as pilot:
        await pilot.press("c")
        await sees(pilot, "#log", "close: A at")
        await confirmed(pilot, "l")
        await sees(pilot, "#log", "release: not now, as it is 'ready'; only when 'fault'")
        await confirmed(pilot, "r")
        await sees(pilot, "#log", "reset: not active (gripper is reset)")
        shows = log(pilot) + text(pilot, "#state")
    for name in (*State.__members__, *(f"{each}()" for each in ("reset", "atr", "activate"))):
        assert name == "RESET" or name not in shows, name


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (MoveSupersededError("a release took over"), "a release took over"),
        (MoveSupersededError("it moved", advice="call move() again"), "it moved"),
        (GripperFaultError(Fault.SCISSOR_BLOCKED, "major fault"), "major fault; v recovers it"),
        (refusal(Trigger.ASK_COMMAND, State.RESET), "the gripper is not activated; a activates it"),
        (
            refusal(Trigger.ASK_RELEASE, State.RUNNING_IDLE),
            "not now, as it is 'ready'; only when 'fault'",
        ),
    ],
)
def test_a_refusal_names_the_key_that_helps(error: RobotiqError, words: str) -> None:
    assert refusal_words(error, HINTS) == words


async def test_the_log_keeps_clear_of_its_scroll_bar(operator: Operator) -> None:
    async with Monitor(operator).run_test(size=(80, 24)) as pilot:
        assert isinstance(pilot.app, Monitor)
        history = pilot.app.query_one("#log", RichLog)
        for number in range(40):
            pilot.app.write_log(f"{number} " + "x" * 150)
        await until(lambda: history.max_scroll_y > 0)
        assert (
            max(len(line.text.rstrip()) for line in history.lines) <= history.scrollable_content_region.width
        )
        assert history.max_scroll_x == 0


# -- in a motion -------------------------------------------------------------------------------------------


@pytest.fixture
async def closing() -> AsyncIterator[tuple[RobotiqHand, Screen]]:
    """A hand whose monitor has just closed it; that takes long enough for any machine to see it move."""
    async with SimulatorServer(active_gripper(speedup=0.05)) as slow:
        hand = RobotiqHand(slow.address, poll_interval=SLOWLY)
        async with hand, shown(Operator(hand)) as pilot:
            await pilot.press("c")
            await until(lambda: hand.is_moving)
            yield hand, pilot


async def test_halt_is_one_key_also_during_a_question(closing: tuple[RobotiqHand, Screen]) -> None:
    hand, pilot = closing
    assert isinstance(pilot.app, Monitor)
    for open_question in ([], ["r"], ["p", "a", "1"]):
        for key in ("space", "h"):
            await until(lambda: hand.is_moving)
            halts = log(pilot).count("halt: every axis has stopped")
            await pilot.press(*open_question, key)
            await until(lambda: log(pilot).count("halt: every axis has stopped") > halts)  # noqa: B023
            assert not hand.is_moving
            assert (pilot.app.asking is not None) is bool(open_question), key
            await pilot.press(*["escape"] * bool(open_question), "c")
    await sees(pilot, "#log", "close: ")


@pytest.mark.parametrize("key", ["q", "ctrl+c"])
async def test_quitting_in_a_motion_holds_it(key: str, closing: tuple[RobotiqHand, Screen]) -> None:
    hand, pilot = closing
    await pilot.press(key)
    await until(lambda: not pilot.app.is_running)
    status = await shows(hand, lambda status: not status.is_moving)
    assert status.position(Finger.A) < 200


def test_a_jaw_is_called_so_and_has_its_opening() -> None:
    panel = Axes(TWO_FINGER_85)
    own = TWO_FINGER_85.stroke.measured(((3, 60.0), (228, 10.0)))
    for stroke, source, opening in ((None, "nominal", "46.2 mm"), (own, "measured", "37.2 mm")):
        status = RobotiqStatus((0xF900, 255, 113 << 8, 0, 0, 0, 0, 0), model=TWO_FINGER_85, stroke=stroke)
        panel.show(status, {JAW: 30})
        head, line = panel.render().plain.split("\n")
        assert line.startswith("jaw ")
        assert opening in line
        assert head.index(source) + len(source) <= line.index(opening) + len(opening)


# -- pictures of numbers -----------------------------------------------------------------------------------


def test_the_bar() -> None:
    assert position_bar(0, 0, 10).plain == "▼·········"
    assert position_bar(255, 255, 10).plain == "█████████▼"
    assert position_bar(128, 255, 10).plain == "█████····▼"
    assert position_bar(255, 128, 10).plain.index("▼") in (4, 5)


def test_the_sparkline() -> None:
    assert sparkline([0, 500, 250], 5) == "  ▁█▄"
    assert sparkline([0, 20, 0], 3) == "▁▁▁"
    assert sparkline([0, 1000, 500, 2000], 2) == "▄█"
    assert sparkline(range(0, 1000, 10), 10) == "▁▂▃▃▄▅▅▆▇█"
