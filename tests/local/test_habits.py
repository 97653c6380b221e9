"""A hand on grippers with the habits of real ones."""

from __future__ import annotations

import asyncio
import logging
import math
from dataclasses import replace

import pytest

from robotiq_async import (
    ActivationTimeoutError,
    ConnectFailedError,
    ConnectionLostError,
    Fault,
    Finger,
    GripChange,
    MoveTimeoutError,
    NotActivatedError,
    ObjectStatus,
    RobotiqHand,
    State,
    StateTimeoutError,
)
from robotiq_async.hands.options import ACTIVATION_TIMEOUT_S
from robotiq_async.hands.waiting import STALLED_S, TOLD_EVERY_S
from robotiq_async.runtime.clock import now
from robotiq_async.simulator import Habits
from robotiq_async.values.model import HAND_E, THREE_FINGER, TWO_FINGER_85, Model
from robotiq_async.values.registers import Registers
from tests.fake_transport import LOST, Asleep, Wire
from tests.grippers import activate_beforehand
from tests.virtual import VirtualLoop

pytestmark = pytest.mark.virtual_time

ABC = Finger.ABC
SELDOM_S = 0.1
"""Between two polls, where seconds pass in which nothing depends on the next status."""


async def silent(*, active: bool = True) -> Wire:
    """One with 0x09 in the first status after a second without a message."""
    wire = Wire(habits=Habits(silence_fault=1.0))
    if active:
        await wire.activate()
    await asyncio.sleep(2)
    return wire


async def pressed(wire: Wire, resets: int | None = None, *, active: bool = True) -> Wire:
    """One whose emergency stop is pressed, or was, if the number of resets needed since is given."""
    if active:
        await wire.activate()
    wire.gripper.emergency_stop(resets or 9)
    if resets is not None:
        wire.gripper.end_emergency_stop()
    return wire


# -- a late object status ----------------------------------------------------------------------------------


@pytest.mark.parametrize("lag", [0.005, 0.04])  # a poll, and some
async def test_a_hand_with_a_late_object_status_is_used_as_any(lag: float) -> None:
    late = Wire(habits=Habits(status_lag=lag))
    await activate_beforehand(late.gripper)
    async with RobotiqHand(late, speed=255) as hand:
        assert set((await hand.open()).outcomes) == {Finger.A, Finger.B, Finger.C}
        closed = await hand.close()
        assert not closed.object_detected
        assert min(closed.positions.values()) >= 240
        assert max((await hand.open()).positions.values()) <= 7
        late.gripper.place_object(ABC, 150)
        assert await hand.grasp()
        events = hand.grip_events()
        opened = await hand.open()
        assert not opened.object_detected
        assert max(opened.positions.values()) <= 7
        assert {event.change for event in events.drain()} == {GripChange.RELEASED}


@pytest.mark.parametrize(
    ("model", "lag", "counts", "pause"),
    [
        *((TWO_FINGER_85, 0.02, 3, 0.03), (TWO_FINGER_85, 0.2, 8, 0.0)),
        *((THREE_FINGER, 0.02, 8, 0.03), (THREE_FINGER, 0.2, 3, 0.0)),
    ],
    ids=["2f85-0.02", "2f85-0.2", "3f-0.02", "3f-0.2"],
)  # every pair is tried in tests/control/test_late_status.py
async def test_a_move_and_a_grasp_after_a_short_move_end_when_the_fingers_have_arrived(
    model: Model, lag: float, counts: int, pause: float
) -> None:
    """At 20 ms of lag, a move to 200 after one of 8 counts ended after 0.03 s, at 117."""
    late = Wire(model=model, habits=Habits(status_lag=lag))
    await activate_beforehand(late.gripper)
    async with RobotiqHand(late, model=model.name, speed=255) as hand:
        await hand.move(100, Finger.A)
        await asyncio.sleep(0.5)
        await hand.move(100 + counts, Finger.A)
        await asyncio.sleep(pause)
        result = await hand.move(200, Finger.A)
        assert result.reached == Finger.A
        assert not hand.is_moving
        await hand.move(200 - counts, Finger.A)
        await asyncio.sleep(pause)
        late.gripper.place_object(Finger.A, 215)
        assert await hand.grasp(Finger.A)
        assert (await hand.open(Finger.A)).reached == Finger.A


# -- a fault in passing ------------------------------------------------------------------------------------


async def test_a_start_is_entered_active_although_the_silence_before_shows_as_a_fault() -> None:
    wire = await silent(active=False)
    for _ in range(2):
        async with RobotiqHand(wire) as hand:
            assert hand.state is State.RUNNING_IDLE
            assert (await hand.move(100)).positions[Finger.A] == 100
            assert hand.statistics.passing_faults == 1
            assert hand.statistics.faults == 0
        await asyncio.sleep(3)


async def test_a_loop_that_is_held_up_does_not_end_a_motion() -> None:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    async with RobotiqHand(await silent()) as hand:
        loop.call_later(0.5, loop.hold_up, 1.2)
        closed = await hand.close(speed=60)
        assert min(closed.positions.values()) >= 240
        assert hand.statistics.passing_faults == 2


async def test_a_reconnect_after_a_silence_goes_on() -> None:
    wire = await silent()
    async with RobotiqHand(wire) as hand:
        transitions = hand.transitions()
        wire.pull()
        await asyncio.sleep(2)
        wire.plug()
        await hand.wait_for_state(State.RUNNING_IDLE)
        assert [each.target for each in transitions.drain()] == [State.DISCONNECTED, State.RUNNING_IDLE]
        assert hand.statistics.passing_faults == 2


# -- an activation that takes its time ---------------------------------------------------------------------


async def test_an_activation_may_take_half_a_minute_and_logs_its_progress(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO)
    slow = Wire(speedup=4.2 / 30)  # 4.2 s is the simulator's own
    began = now()
    async with RobotiqHand(slow, poll_interval=SELDOM_S) as hand:
        assert hand.state is State.RUNNING_IDLE
        assert 25 < now() - began < ACTIVATION_TIMEOUT_S
    logged = [record.getMessage() for record in caplog.records if "so far" in record.getMessage()]
    assert len(logged) == int((now() - began) // TOLD_EVERY_S)
    assert "activating, 12 s so far" in logged[2]
    await asyncio.sleep(100)
    assert len(logged) == caplog.text.count("so far"), "the end is the end"


async def test_at_the_limit_an_activation_goes_on_and_can_be_waited_for_again() -> None:
    slow = Wire(speedup=4.2 / 50)
    hand = RobotiqHand(slow, poll_interval=SELDOM_S)
    await hand.start(activate=False)
    with pytest.raises(ActivationTimeoutError, match="within 40 s"):
        await hand.activate()
    assert [request.activate for request in slow.written] == [True], "nothing is taken back"
    await hand.activate()
    assert hand.state is State.RUNNING_IDLE
    await hand.stop()


async def test_an_activation_that_times_out_is_taken_back() -> None:
    slow = Wire(speedup=4.2 / 50)
    with pytest.raises(ActivationTimeoutError):
        await RobotiqHand(slow, poll_interval=SELDOM_S).start()
    assert [request.activate for request in slow.written] == [True, False]


# -- a gripper that does not follow, or whose fingertips end elsewhere ---------------------------------------

FAR = "its range ends there (a software limit, custom fingertips), or it did not follow"


async def test_a_motion_that_moves_nothing_and_is_reported_as_done_has_reached_nothing(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.WARNING, "robotiq_async")
    asleep = Asleep(shows=3)
    await activate_beforehand(asleep.gripper)
    async with RobotiqHand(asleep) as hand:
        result = await hand.close()
        assert not result.reached
        assert set(result.outcomes.values()) == {ObjectStatus.AT_POSITION}
        assert caplog.text.count(FAR) == 1
        await hand.close()  # this one it follows
        await asyncio.sleep(3)
        assert (await hand.close()).reached == ABC
        assert caplog.text.count(FAR) == 1


async def test_a_motion_that_never_begins_and_never_ends_times_out() -> None:
    asleep = Asleep(images=math.inf, shows=0)
    await activate_beforehand(asleep.gripper)
    async with RobotiqHand(asleep) as hand:
        with pytest.raises(MoveTimeoutError):
            await hand.close(timeout=3.0)


def with_ends(model: Model, low: int, high: int) -> Model:
    """The readings of a gripper whose fingertips end elsewhere, open and closed."""
    return replace(model, stroke=replace(model.stroke, open_reading=low, closed_reading=high))


@pytest.mark.parametrize(
    ("model", "low", "high"),
    [(TWO_FINGER_85, 20, 210), (HAND_E, 40, 180), (THREE_FINGER, 10, 215)],
    ids=["2f85", "hand-e", "3f"],
)
async def test_ends_that_read_otherwise_end_a_move_and_loosen_nothing(
    model: Model, low: int, high: int, caplog: pytest.LogCaptureFixture
) -> None:
    """The first motions after an adoption and after a reconnect, begun where the jaw stands already."""
    caplog.set_level(logging.WARNING, "robotiq_async")
    wire = Wire(model=with_ends(model, low, high))
    await activate_beforehand(wire.gripper)
    for target, end in ((0, low), (255, high), (0, low)):
        async with RobotiqHand(wire, model=model.name, speed=255, poll_interval=0.02) as hand:
            for _ in range(2):
                result = await hand.move(target, model.all_axes & ABC)
                assert result.positions[Finger.A] == pytest.approx(end, abs=3)
                assert set(result.outcomes.values()) == {ObjectStatus.AT_POSITION}
                assert not result.reached
            wire.pull()
            await hand.wait_for_state(State.DISCONNECTED)
            wire.plug()
            await hand.wait_for_state(State.RUNNING_IDLE)
            assert not (await hand.move(target, model.all_axes & ABC)).reached
            await asyncio.sleep(1)
            assert hand.status.requested_position(Finger.A) == target, "it keeps pressing"
    assert caplog.text.count(FAR) == 3, "once a hand"


@pytest.mark.parametrize(("target", "fingers"), [(0, ABC), (255, Finger.SCISSOR), (130, Finger.SCISSOR)])
async def test_a_first_motion_of_nothing_ends_at_once(
    target: int, fingers: Finger, caplog: pytest.LogCaptureFixture
) -> None:
    """The scissor stands at its software limit, which is reported as reached."""
    caplog.set_level(logging.WARNING, "robotiq_async")
    wire = Wire(scissor_limit=(6, 228))
    await activate_beforehand(wire.gripper)
    async with RobotiqHand(wire) as hand:
        await hand.move(255 if target == 255 else 130, Finger.SCISSOR)
    async with RobotiqHand(wire) as hand:
        began = now()
        await hand.move(target, fingers)
        assert now() - began < 0.5
    assert FAR not in caplog.text, "the range of a scissor ends there"


# -- a link that does not come back ------------------------------------------------------------------------


async def test_the_newest_reason_is_given_and_since_when_the_link_is_down(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """The adapter was pulled out, which is not in the first reason."""
    caplog.set_level(logging.WARNING, "robotiq_async")
    wire = Wire()
    await activate_beforehand(wire.gripper)
    async with RobotiqHand(wire) as hand:
        wire.failing = {"read": LOST, "open": ConnectFailedError("wire", "there is no such device")}
        await hand.wait_for_state(State.DISCONNECTED)
        await asyncio.sleep(5)
        for call in (hand.move(100), hand.recover()):
            with pytest.raises(ConnectionLostError, match=r"no such device \(down since \d\d:\d\d:\d\d\)"):
                await call
        assert caplog.text.count("still no link: ") == 1
        wire.failing.clear()


# -- an emergency stop -------------------------------------------------------------------------------------


@pytest.mark.parametrize("resets", [1, 2])
async def test_a_gripper_that_waits_for_its_activation_is_reset_and_activated(resets: int) -> None:
    stopped = await pressed(Wire(), resets)
    hand = RobotiqHand(stopped, poll_interval=SELDOM_S)
    await hand.start(activate=False)
    assert hand.state is State.WF_ACTIVATION
    began = now()
    await hand.recover()
    assert hand.state is State.RUNNING_IDLE
    assert [each.activate for each in stopped.written].count(False) == resets
    assert now() - began < resets * (STALLED_S + 1) + 10
    assert (await hand.move(100)).positions[Finger.A] == 100
    await hand.stop()


@pytest.mark.parametrize("call", ["start", "activate", "recover"])
async def test_a_gripper_that_keeps_ract_without_an_activation_is_reset_and_activated(call: str) -> None:
    wire = Wire()
    await activate_beforehand(wire.gripper)
    wire.gripper.strand()
    hand = RobotiqHand(wire, poll_interval=SELDOM_S)
    if call != "start":
        await hand.start(activate=False)
        assert hand.state is State.RESET
    await getattr(hand, call)()
    assert hand.state is State.RUNNING_IDLE
    assert [each.activate for each in wire.written] == [False, True]
    assert (await hand.move(100)).positions[Finger.A] == 100
    await hand.stop()


class Deaf(Wire):
    """After an emergency stop, the first rACT = 0 clears gACT and leaves gIMC = 1 (activating)."""

    def __init__(self, resets: int = 2) -> None:
        super().__init__()
        self._resets = resets

    def shown(self) -> Registers:
        words = super().shown()
        is_deaf = 0 < self.resets < self._resets
        return (0x1000, 0, *words[2:]) if is_deaf else words

    @property
    def resets(self) -> int:
        return [each.activate for each in self.written].count(False)


@pytest.mark.parametrize("needed", [1, 2])
async def test_a_reset_that_does_not_show_is_tried_once_more(needed: int) -> None:
    deaf = await pressed(Deaf(needed), 1)
    assert isinstance(deaf, Deaf)
    hand = RobotiqHand(deaf, poll_interval=SELDOM_S)
    await hand.start(activate=False)
    await hand.recover()
    assert hand.state is State.RUNNING_IDLE
    assert deaf.resets == needed
    await hand.stop()


async def test_a_gripper_that_shows_no_reset_is_reset_twice_at_most() -> None:
    deaf = await pressed(Deaf(9), 1)
    assert isinstance(deaf, Deaf)
    hand = RobotiqHand(deaf, poll_interval=SELDOM_S)
    await hand.start(activate=False)
    with pytest.raises(StateTimeoutError, match="did not report the reset"):
        await hand.recover()
    assert deaf.resets == 2
    await hand.stop()


async def test_a_release_that_a_reset_and_a_fault_end_between_two_polls_is_not_waited_for() -> None:
    """Another client resets and activates the gripper, and the activation fails: only FAULT is ever seen."""
    wire = Wire(device_cycle=0.0, speedup=0.2)
    await wire.activate()
    wire.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    async with RobotiqHand(wire) as hand:
        releasing = asyncio.create_task(hand.atr())
        await hand.wait_for_state(State.WF_ATR)
        await asyncio.sleep(1.0)
        assert not releasing.done()
        wire.gripper.clear_faults()
        wire.gripper.write(0, [0x0000])
        wire.gripper.write(0, [0x0100])
        wire.gripper.inject_fault(Fault.ACTIVATION_FAULT)
        began = now()
        with pytest.raises(NotActivatedError, match="reset during the release"):
            await releasing
        assert now() - began < 1.0
        assert hand.state is State.FAULT


async def test_a_gripper_that_never_recovers_is_reset_twice_and_left_to_a_person() -> None:
    stopped = await pressed(Wire())
    hand = RobotiqHand(stopped, poll_interval=SELDOM_S)
    await hand.start(activate=False)
    began = now()
    with pytest.raises(StateTimeoutError, match="emergency stop released") as caught:
        await hand.recover()
    assert "0x05" in str(caught.value)
    assert [each.activate for each in stopped.written].count(False) == 2
    assert now() - began < 4 * STALLED_S
    await hand.stop()


async def test_an_activation_that_shows_nothing_new_is_not_reset() -> None:
    """Without a priority code it may well continue; here it ends after 20 s."""

    class Quiet(Wire):
        def shown(self) -> tuple[int, ...]:
            words = super().shown()
            return words if words[0] >> 12 & 0b11 == 0b11 else (words[0], 0, 0, 0, 0, 0, 0, 0)

    quiet = Quiet(speedup=4.2 / 20)
    hand = RobotiqHand(quiet, poll_interval=SELDOM_S)
    await hand.start(activate=False)
    await hand.recover()
    assert [request.activate for request in quiet.written] == [True]
    await hand.stop()


STUCK = r"makes no progress.*0x05.*emergency stop.*start\(activate=False\).*recover\(\)"


async def test_a_start_on_such_a_gripper_ends_soon_and_says_what_helps() -> None:
    stopped = await pressed(Wire())
    began = now()
    with pytest.raises(ActivationTimeoutError, match=STUCK):
        await RobotiqHand(stopped, poll_interval=SELDOM_S).start()
    assert STALLED_S <= now() - began < STALLED_S + 2
    assert stopped.written == [], "the activation is not ours to take back"


@pytest.mark.parametrize("resets", [1, None])
async def test_so_does_the_activation_of_one_that_comes_back_from_a_power_cut(resets: int | None) -> None:
    """Its emergency stop is pressed: rACT is taken, and nothing moves."""
    stopped = await pressed(Wire(), resets, active=False)
    began = now()
    with pytest.raises(ActivationTimeoutError, match=STUCK):
        await RobotiqHand(stopped, poll_interval=SELDOM_S).start()
    assert STALLED_S <= now() - began < STALLED_S + 2
    assert [request.activate for request in stopped.written] == [True, False], "taken back on leaving"


async def test_a_recovery_in_vain_names_the_fault_of_the_controller() -> None:
    """In an emergency stop the Universal Controller before a jaw shows why; the gripper alone does not."""
    stopped = await pressed(Wire(model=TWO_FINGER_85))
    stopped.gripper.controller_fault = 0x0C
    hand = RobotiqHand(stopped, model=TWO_FINGER_85, poll_interval=SELDOM_S)
    await hand.start(activate=False)
    told = r"its controller reports: emergency stop \(kFLT 0x0C\)"
    with pytest.raises(StateTimeoutError, match=f"no progress.*; {told}, also after 2 resets"):
        await hand.recover()
    with pytest.raises(StateTimeoutError, match=f"not active after .*; {told}.*look at the controller"):
        await hand.recover(timeout=1)
    await hand.stop()


async def test_activate_ends_soon_as_well_and_recover_goes_on_from_there() -> None:
    stopped = await pressed(Wire(), 1, active=False)
    hand = RobotiqHand(stopped, poll_interval=SELDOM_S)
    await hand.start(activate=False)
    with pytest.raises(ActivationTimeoutError, match=STUCK):
        await hand.activate()
    assert [request.activate for request in stopped.written] == [True]
    await hand.recover()
    assert hand.state is State.RUNNING_IDLE
    await hand.stop()


async def test_a_reserved_byte_that_counts_is_no_progress() -> None:
    class Counting(Wire):
        def shown(self) -> tuple[int, ...]:
            words = super().shown()
            number = int(self.now - began)  # 0 at the first reading: else it is another device
            return (*words[:7], words[7] & 0xFF00 | number)

    counting = await pressed(Counting())
    began = now()
    with pytest.raises(ActivationTimeoutError, match=STUCK):
        await RobotiqHand(counting, poll_interval=SELDOM_S).start()
    assert now() - began < STALLED_S + 2


async def test_one_whose_currents_change_is_waited_for_until_the_limit() -> None:
    class Humming(Wire):
        def shown(self) -> tuple[int, ...]:
            words = super().shown()
            return (*words[:7], words[7] & 0x00FF | int(self.now) % 9 << 8)

    humming = await pressed(Humming())
    began = now()
    with pytest.raises(ActivationTimeoutError, match=r"0x05\): recover\(\) resets it"):
        await RobotiqHand(humming, poll_interval=SELDOM_S).start()
    assert now() - began >= ACTIVATION_TIMEOUT_S
