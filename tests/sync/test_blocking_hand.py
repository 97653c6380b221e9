"""The blocking hand does what the async one does."""

from __future__ import annotations

import asyncio
import threading
from typing import assert_type

import pytest

import robotiq_async
from robotiq_async import (
    ConnectFailedError,
    ConnectionLostError,
    Finger,
    InvalidStateError,
    MotionInhibitedError,
    MoveResult,
    NotStartedError,
    RobotiqStatus,
    State,
    Transition,
)
from robotiq_async.sync import RobotiqHand, Stream
from tests.patience import patience
from tests.sync.conftest import PATIENCE, Wire, in_a_thread, loop_threads, until

A, B = Finger.A, Finger.B


def test_a_script() -> None:
    with RobotiqHand("sim://?speedup=100&object=150") as hand:
        result = hand.close(speed=255)
        assert_type(result, MoveResult)
        assert result.contacts == Finger.ABC
        assert hand.state is State.RUNNING_IDLE
        assert hand.is_activated
        assert not hand.is_moving
        hand.set_speed(255)
        assert hand.open(A).positions[A] < 10
        assert hand.statistics.moves == {"contact": 1, "reached": 1}
    assert hand.state is State.SHUTDOWN
    with pytest.raises(NotStartedError):
        hand.move(3)


def test_explicit_start_and_stop_and_again(wire: Wire) -> None:
    hand = RobotiqHand(wire)
    for _ in range(2):
        hand.start(activate=False)
        assert hand.is_activated
        until(lambda: len(loop_threads()) == 1)  # that of the first time may still be about to end
        hand.stop(halt=False)
        hand.stop()
        assert hand.state is State.SHUTDOWN
    assert wire.writes() == 0


def test_arguments_of_the_constructor_are_checked_at_once() -> None:
    with pytest.raises(ValueError, match=r"speed must be in 0\.\.255, got 256"):
        RobotiqHand("sim://", speed=256)
    assert not loop_threads()


def test_errors_are_those_of_the_async_hand(hand: RobotiqHand, wire: Wire) -> None:
    with pytest.raises(ValueError, match=r"position must be in 0\.\.255, got 300"):
        hand.move(300)
    with pytest.raises(TypeError, match="position must be an int"):
        hand.command(position=1.5)  # type: ignore[arg-type]
    with pytest.raises(InvalidStateError, match="this hand runs on"):
        hand.start()
    with pytest.raises(InvalidStateError):
        hand.atr()
    assert hand.is_activated, "and it runs on"
    wire.breaks = True
    with pytest.raises(ConnectionLostError):
        hand.move(255, speed=255)


def test_a_failed_start_leaves_nothing_running() -> None:
    hand = RobotiqHand("tcp://127.0.0.1:9", connect_timeout=1)
    with pytest.raises(ConnectFailedError):
        hand.start()
    assert hand.state is State.SHUTDOWN
    with pytest.raises(ConnectFailedError), hand:
        pytest.fail("it never began")


def test_a_call_before_the_start_says_so(wire: Wire) -> None:
    hand = RobotiqHand(wire)
    for call in (hand.halt, lambda: hand.move(3), lambda: hand.command(position=3), lambda: hand.is_moving):
        with pytest.raises(NotStartedError):
            call()
    hand.stop()
    assert hand.state is State.DISCONNECTED


def test_a_command_is_sent_and_not_waited_for(hand: RobotiqHand, wire: Wire) -> None:
    hand.command(A, position=200)
    until(wire.is_moving)
    assert hand.is_moving


def test_the_repr_of_a_hand(hand: RobotiqHand) -> None:
    assert repr(hand) == f"<RobotiqHand {hand.address} RUNNING_IDLE>"


# -- streams -----------------------------------------------------------------------------------------------


def test_statuses_are_iterated_over_until_the_hand_is_stopped(hand: RobotiqHand) -> None:
    stream = hand.statuses(buffer=3)
    assert_type(stream, Stream[RobotiqStatus])
    numbers = []
    for status in stream:
        numbers.append(status.sequence)
        if len(numbers) == 5:
            hand.stop()
    assert numbers == sorted(set(numbers))
    assert len(numbers) >= 5
    assert stream.missed >= 0


def test_a_loop_that_asks_for_it_hears_of_a_gripper_that_falls_silent(hand: RobotiqHand, wire: Wire) -> None:
    stream = hand.statuses(lost_after=0.2)
    assert next(stream).is_activated
    wire.is_slow = True
    with pytest.raises(ConnectionLostError, match=r"no status for 0\.2 s"):
        for _ in stream:
            pass
    wire.is_slow = False
    while not next(stream).is_activated:
        pass


def test_a_stream_that_waits_ends_when_another_thread_stops_the_hand(hand: RobotiqHand) -> None:
    thread, outcome = in_a_thread(lambda: [each.target for each in hand.transitions()])
    until(lambda: len(loop_threads()) == 1)
    hand.stop()
    thread.join(patience(PATIENCE))
    (targets,) = outcome
    assert targets == [] or targets[-1] is State.SHUTDOWN  # type: ignore[index]


def test_transitions_and_requests_may_be_opened_before_the_start(wire: Wire) -> None:
    hand = RobotiqHand(wire)
    transitions, requests = hand.transitions(), hand.requests()
    assert_type(transitions, Stream[Transition])
    with hand:
        hand.set_position(100, A)
    assert [each.target for each in transitions][-1] is State.SHUTDOWN
    sent = [each.request.axes[0].position for each in requests]
    assert sent[0] == 100
    assert list(requests) == []


def test_items_that_are_there_are_taken_without_waiting(hand: RobotiqHand) -> None:
    requests = hand.requests()
    assert requests.take_nowait() is None
    hand.set_position(100, A)
    hand.set_position(110, A)
    first = requests.take_nowait()
    assert first is not None
    assert first.request.axes[0].position == 100
    assert [each.request.axes[0].position for each in requests.drain()] == [110]
    requests.close()
    assert list(requests) == []


def test_a_stream_tells_that_the_hand_gave_up(wire: Wire) -> None:
    with RobotiqHand(wire, reconnect=False) as hand:
        stream = hand.statuses()
        wire.breaks = True
        with pytest.raises(ConnectionLostError):
            for _ in stream:
                pass


# -- threads and loops -------------------------------------------------------------------------------------


def test_hands_share_one_thread() -> None:
    with RobotiqHand("sim://?speedup=1000") as one, RobotiqHand("sim://?speedup=1000") as other:
        assert len(loop_threads()) == 1
        one.close(speed=255)
        other.close(speed=255)


def test_threads_that_begin_at_once_share_one_thread() -> None:
    barrier = threading.Barrier(8)
    hands = [RobotiqHand(wire) for wire in (Wire() for _ in range(8))]

    def begin(hand: RobotiqHand) -> int:
        barrier.wait()
        hand.start(activate=False)
        return len(loop_threads())

    begun = [in_a_thread(lambda hand=hand: begin(hand)) for hand in hands]  # type: ignore[misc]
    for thread, _ in begun:
        thread.join(patience(PATIENCE))
    until(lambda: len(loop_threads()) == 1)
    assert all(hand.state is State.RESET for hand in hands)
    for hand in hands:
        hand.stop()


def test_it_may_be_started_and_stopped_at_any_moment() -> None:
    """The thread ends and begins again; a call that comes at that moment is made all the same."""
    hands = [RobotiqHand(Wire()) for _ in range(4)]

    def again_and_again(hand: RobotiqHand) -> None:
        for _ in range(25):
            hand.start(activate=False)
            assert hand.state is State.RESET
            hand.stop(halt=False)

    begun = [in_a_thread(lambda hand=hand: again_and_again(hand)) for hand in hands]  # type: ignore[misc]
    for thread, outcome in begun:
        thread.join(patience(20))
        assert outcome == [None]


def test_calls_of_several_threads_go_side_by_side(hand: RobotiqHand, wire: Wire) -> None:
    threads = [in_a_thread(lambda axis=axis: hand.move(200, axis, speed=255)) for axis in (A, B)]  # type: ignore[misc]
    until(lambda: wire.targets()[:2] == [200, 200])
    wire.ahead += 10
    for thread, outcome in threads:
        thread.join(patience(PATIENCE))
        assert isinstance(outcome[0], MoveResult)


async def test_another_event_loop_may_run_in_the_thread_that_calls(wire: Wire) -> None:
    """A notebook does that: its kernel runs one."""
    with RobotiqHand(wire) as hand:
        hand.set_position(100, A)
        assert next(hand.statuses()).is_activated
        assert asyncio.get_running_loop().is_running()


def test_a_listener_may_command_but_not_wait(hand: RobotiqHand, wire: Wire) -> None:
    heard: list[object] = []

    def listen(item: object) -> None:
        if isinstance(item, RobotiqStatus) and not heard:
            heard.append(threading.current_thread())
            hand.command(A, position=120)
            with pytest.raises(RuntimeError, match="would wait for itself") as caught:
                hand.move(3)
            heard.append(caught.value)

    remove = hand.add_listener(listen)
    until(lambda: len(heard) == 2 and wire.targets()[0] == 120)
    assert heard[0] is loop_threads()[0]
    remove()


def test_the_async_hand_tells_a_stranger_of_it() -> None:
    """A program that uses the async one in its place gets an error about a loop."""
    with pytest.raises(RuntimeError, match="needs a running asyncio event loop"):
        robotiq_async.RobotiqHand().start().send(None)


def test_a_halt_of_a_person_in_another_thread_stays() -> None:
    with RobotiqHand("sim://?speedup=5") as hand:
        moving, outcome = in_a_thread(lambda: hand.close(speed=0))
        until(lambda: hand.is_moving)
        hand.inhibit("HALT was pressed", who="a window")
        moving.join(patience(PATIENCE))
        assert isinstance(outcome[0], MotionInhibitedError)
        for refused in (hand.open, hand.recover, hand.activate):
            with pytest.raises(MotionInhibitedError):
                refused()
        assert hand.inhibited is not None
        hand.set_speed(255)
        hand.permit()
        assert hand.inhibited is None
        hand.open()
