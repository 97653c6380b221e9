"""A person's halt stays: nothing asked before or during it moves a finger, until a person permits it."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from robotiq_async import (
    ConnectionLostError,
    Fault,
    GripperFaultError,
    MotionInhibitedError,
    NotStartedError,
    RobotiqError,
    RobotiqHand,
    RobotiqStateError,
    State,
)
from robotiq_async.hands import Hand
from tests.contract.bench import LOCAL, A, Bench, at_rest, bench, contract, ended
from tests.virtual import inside, until

REASON, WHO = "HALT was pressed", "the page"
MOVES: dict[str, Callable[[Hand], Awaitable[object]]] = {
    "move": lambda hand: hand.move(200),
    "open": lambda hand: hand.open(),
    "close": lambda hand: hand.close(),
    "grasp": lambda hand: hand.grasp(),
    "set_position": lambda hand: hand.set_position(200),
    "set_force": lambda hand: hand.set_force(255),
    "activate": lambda hand: hand.activate(),
    "atr": lambda hand: hand.atr(),
    "recover": lambda hand: hand.recover(),
}
"""Calls that may move or press."""


async def stays(here: Bench, seconds: float = 0.5) -> None:
    """Nothing moves for a while."""
    travels = here.travels
    await asyncio.sleep(seconds)
    assert here.travels == travels


async def refused(work: Awaitable[object]) -> MotionInhibitedError:
    with pytest.raises(MotionInhibitedError, match="HALT was pressed") as caught:
        await work
    return caught.value


@contract
async def test_what_may_move_or_press_is_refused_and_the_rest_passes(here: Bench, hand: Hand) -> None:
    assert hand.inhibited is None
    await hand.inhibit(REASON, who=WHO)
    writes = here.writes
    for call in MOVES.values():
        error = await refused(call(hand))
        assert error.reason == REASON
        assert error.who.startswith(WHO)
        assert error.since > 1e9
    with pytest.raises(MotionInhibitedError):
        hand.command(position=200)
    with pytest.raises(MotionInhibitedError):
        hand.command(force=255)
    await asyncio.sleep(0.1)
    assert here.writes == writes
    await hand.inhibit("another reason")
    await hand.halt()
    await hand.hold()
    await hand.set_speed(7)
    hand.command(speed=9)
    await until(lambda: here.last_write.axes[0].speed == 9)
    await hand.reset()
    assert hand.state is State.RESET
    await refused(hand.activate())
    assert hand.inhibited is not None
    assert hand.inhibited.reason == REASON  # the first one stays
    await stays(here)
    await hand.permit(who=WHO)
    assert hand.inhibited is None
    await hand.activate()
    assert (await hand.move(100, A)).reached == A


@contract
async def test_a_permit_lifts_the_halt_that_was_seen_and_no_later_one(here: Bench, hand: Hand) -> None:
    """The later one may have the same words: it was lifted by a yes to the question of the one before."""
    await hand.inhibit(REASON, who=WHO)
    seen = hand.inhibited
    await hand.inhibit(REASON, who=WHO)
    for _ in range(2):
        with pytest.raises(RobotiqStateError, match="look at the gripper, then permit it again"):
            await hand.permit(seen=seen)
        await refused(hand.move(200))
    await hand.permit(seen=hand.inhibited)
    await hand.move(100, A)
    await hand.permit(seen=seen)  # there is nothing to permit
    await hand.inhibit(REASON, who=WHO)
    with pytest.raises(RobotiqStateError, match="look at the gripper"):
        await hand.permit(seen=seen)
    await refused(hand.move(200))
    with pytest.raises(TypeError, match="seen must be an Inhibit"):
        await hand.permit(seen=REASON)  # type: ignore[arg-type]


@contract
async def test_calls_that_wait_end_with_it(here: Bench, hand: Hand) -> None:
    moving = await here.moving(hand.move(255, speed=0))
    tightening = asyncio.create_task(hand.set_force(90))
    await asyncio.sleep(0)
    await hand.inhibit(REASON)
    assert not here.gripper.is_moving
    assert isinstance(await ended(moving), MotionInhibitedError)
    assert isinstance(await ended(tightening), MotionInhibitedError)
    await stays(here)
    assert not here.last_write.go


@contract
async def test_commands_that_are_not_sent_yet_are_dropped(here: Bench, hand: Hand) -> None:
    await hand.set_force(3)
    hand.command(position=255, force=90)
    await hand.inhibit(REASON)
    await stays(here)
    await hand.set_speed(9)
    assert not here.last_write.go
    assert here.last_write.axes[0].force == 3
    await stays(here)


@contract(active=False)
async def test_an_activation_ends_in_reset_and_a_recovery_does_not_go_on(here: Bench, hand: Hand) -> None:
    recovering = await here.moving(hand.recover())
    activating = asyncio.create_task(hand.activate())
    await asyncio.sleep(0.02)
    await hand.inhibit(REASON)
    assert hand.state is State.RESET
    assert isinstance(await ended(recovering), MotionInhibitedError)
    assert isinstance(await ended(activating), MotionInhibitedError)
    await stays(here)
    await refused(hand.recover())


@contract
async def test_a_recovery_that_waits_for_a_fault_ends(here: Bench, hand: Hand) -> None:
    here.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
    await hand.wait_for_state(State.FAULT)
    recovering = asyncio.create_task(hand.recover())
    await asyncio.sleep(0.1)
    await hand.inhibit(REASON)
    assert isinstance(await ended(recovering), MotionInhibitedError)


@contract
async def test_it_outlasts_the_link_and_a_restart_and_adoption_stays_passive(here: Bench, hand: Hand) -> None:
    await hand.inhibit(REASON)
    await here.unplug(hand)
    await here.plug(hand)
    await refused(hand.move(200))
    await hand.stop()
    writes = here.writes
    await hand.start()  # an active gripper is adopted
    assert here.writes == writes
    assert hand.inhibited is not None
    await refused(hand.move(200))
    await hand.stop()
    await asyncio.sleep(0.1)
    here.gripper.write(0, [0] * 8)
    await asyncio.sleep(0.2)
    await refused(hand.start())  # a reset one is not activated
    await stays(here)


@contract
async def test_while_the_link_is_down_what_moves_is_held_once_it_is_back(here: Bench, hand: Hand) -> None:
    await hand.set_position(255)
    await hand.set_speed(0)
    await here.moves()
    await here.unplug(hand)
    with pytest.raises(RobotiqError):  # the fingers may still move
        await hand.inhibit(REASON)
    await until(lambda: hand.inhibited is not None)
    await here.plug(hand)
    await until(lambda: not here.gripper.is_moving)
    await at_rest(hand)
    assert here.gripper.position(A) < 240


@pytest.mark.parametrize("where", [LOCAL])
@inside(bench, "where")
async def test_a_hand_that_runs_no_more_says_that_the_fingers_may_still_move(here: Bench) -> None:
    """It is inhibited all the same, from its next start on."""
    hand = RobotiqHand(here.server.address, reconnect=False)
    await hand.inhibit(REASON)  # never started: it has moved nothing
    await hand.permit()
    await hand.start()
    hand.command(position=255, speed=0)
    await here.moves()
    await here.unplug(hand)
    await until(lambda: hand.state is State.SHUTDOWN)
    with pytest.raises(ConnectionLostError):  # the link was given up
        await hand.inhibit(REASON)
    await here.server.accept()
    await hand.start()
    await refused(hand.move(200))
    await hand.permit()
    hand.command(position=255, speed=0)
    await hand.stop(halt=False)
    with pytest.raises(NotStartedError):
        await hand.inhibit(REASON)
    assert hand.inhibited is not None


@pytest.mark.parametrize("where", [LOCAL])
@inside(bench, "where")
async def test_it_strengthens_a_stop_that_would_leave_the_fingers_moving(here: Bench) -> None:
    hand = RobotiqHand(here.server.address)
    await hand.start()
    hand.command(position=255, speed=0)
    await here.moves()
    stopping = asyncio.create_task(hand.stop(halt=False))
    await asyncio.sleep(0)
    with pytest.raises(NotStartedError):
        await hand.inhibit(REASON)
    assert hand.inhibited is not None
    assert not here.gripper.is_moving
    await stopping
    await stays(here)


@contract(active=False)
async def test_while_the_link_is_down_an_activation_is_reset_once_it_is_back(here: Bench, hand: Hand) -> None:
    """Only what moves was held, and that ends no activation."""
    activating = await here.moving(hand.activate())
    await here.unplug(hand)
    with pytest.raises(RobotiqError):
        await hand.inhibit(REASON)
    assert isinstance(await ended(activating), RobotiqError)
    await until(lambda: hand.inhibited is not None)
    await here.server.accept()
    await hand.wait_for_state(State.RESET)
    await stays(here)
    await refused(hand.activate())


@contract(active=False)
async def test_an_activation_that_has_failed_does_not_go_on_as_its_fault_clears(
    here: Bench, hand: Hand
) -> None:
    """A halt only cleared rGTO then, and 442 counts followed."""
    activating = await here.moving(hand.activate())
    here.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    assert isinstance(await ended(activating), GripperFaultError)
    await hand.inhibit(REASON)
    assert hand.state is State.RESET
    here.gripper.clear_faults()
    await stays(here)


@contract
async def test_the_reason_is_for_people(here: Bench, hand: Hand) -> None:
    for bad in ("", "two\nlines", "x" * 201):
        with pytest.raises(ValueError, match="reason must be"):
            await hand.inhibit(bad)
    with pytest.raises(TypeError, match="reason must be a str"):
        await hand.inhibit(3)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="who must be"):
        await hand.permit(who="x" * 201)
    assert hand.inhibited is None
