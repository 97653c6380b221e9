"""Ctrl-C while a blocking hand waits: nothing keeps moving, and the event loop runs on."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import random
import threading
import time
from collections.abc import Callable

import pytest

from robotiq_async import Fault, Finger, State
from robotiq_async.sync import RobotiqHand
from tests.sync.conftest import PATIENCE, Interrupt, Striker, Wire, adopting, in_a_thread, until

A, B = Finger.A, Finger.B


def when(condition: Callable[[], bool], strike: Striker) -> None:
    """Strike as soon as something is so."""

    def watch() -> None:
        until(condition)
        strike()

    in_a_thread(watch)


def polled(hand: RobotiqHand) -> None:
    """Wait for some polls."""
    polls = hand.statistics.polls
    until(lambda: hand.statistics.polls > polls + 3)


def wait_and_be_struck(hand: RobotiqHand, strike: Striker) -> None:
    """Strike while a call waits: some polls after it has begun."""

    def watch() -> None:
        until(lambda: bool(hand._caller._calls))
        polled(hand)
        strike()

    in_a_thread(watch)
    with pytest.raises(Interrupt):
        hand.wait_for_state(State.FAULT)


def test_a_move_is_held_and_the_hand_goes_on(hand: RobotiqHand, wire: Wire, interrupt: Striker) -> None:
    when(wire.is_moving, interrupt)
    with pytest.raises(Interrupt):
        hand.move(255, A, speed=0)
    until(lambda: not wire.is_moving())
    assert wire.targets()[0] < 100
    assert hand.state is State.RUNNING_IDLE
    assert hand.statistics.moves == {"cancelled": 1}
    wire.ahead += 1
    hand.set_position(200, A)


def test_moving_axes_are_held_in_every_wait(hand: RobotiqHand, wire: Wire, interrupt: Striker) -> None:
    hand.set_speed(0)
    hand.set_position(255, B)
    wait_and_be_struck(hand, interrupt)
    until(lambda: not wire.is_moving())
    assert wire.targets()[1] < 100


def test_a_call_that_does_not_end_keeps_no_finger_moving(
    hand: RobotiqHand, wire: Wire, interrupt: Striker
) -> None:
    """A recorder that closed its file on a slow disk: the fingers were held only after it."""
    hand.set_speed(0)
    hand.set_position(255, B)
    held = threading.Event()

    async def close_the_file() -> None:
        while not held.is_set():
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.sleep(0.01)

    def watch() -> None:
        until(lambda: bool(hand._caller._calls))
        polled(hand)
        interrupt()
        until(lambda: not wire.is_moving())
        held.set()

    in_a_thread(watch)
    with pytest.raises(Interrupt):
        hand._caller.wait(close_the_file)
    assert held.is_set()
    assert wire.targets()[1] < 100


def test_an_unsent_request_never_begins(hand: RobotiqHand, wire: Wire, interrupt: Striker) -> None:
    """Ctrl-C came before it was written, as on a slow link: the fingers began to move after it."""
    is_caught = threading.Event()

    def strike() -> None:
        until(lambda: bool(hand._caller._calls))
        interrupt()
        session = hand._inner._local.session
        assert session is not None
        until(lambda: is_caught.is_set() or session.controller.has_open_stop)
        wire.is_slow = False

    before = wire.targets()
    wire.is_slow = True
    until(lambda: wire.is_awaited)  # before a read a command may leave at once
    hand.command(position=255)
    thread, _ = in_a_thread(strike)
    with pytest.raises(Interrupt):
        hand.wait_for_state(State.FAULT)
    is_caught.set()
    thread.join()
    polled(hand)
    assert not wire.is_moving()
    assert wire.targets() == before


def test_a_grip_is_kept(hand: RobotiqHand, wire: Wire, interrupt: Striker) -> None:
    wire.look(lambda gripper: gripper.place_object(A, 50))
    hand.set_position(255, A)
    until(wire.is_moving)
    wire.ahead += 5
    until(lambda: hand.status.contacts == A)
    wait_and_be_struck(hand, interrupt)
    assert hand.status.contacts == A
    assert hand.status.requested_position(A) == 255


def test_a_hand_that_only_watches_writes_nothing(wire: Wire, interrupt: Striker) -> None:
    hand = adopting(wire)
    before = wire.writes()
    wait_and_be_struck(hand, interrupt)
    hand.stop(halt=False)
    assert wire.writes() == before
    assert wire.is_moving()


def test_an_activation_is_taken_back(interrupt: Striker) -> None:
    wire = Wire()
    hand = RobotiqHand(wire)
    hand.start(activate=False)
    when(wire.is_moving, interrupt)
    with pytest.raises(Interrupt):
        hand.activate()
    assert hand.state is State.RESET
    assert not wire.is_moving()
    hand.stop()


def test_a_start_is_taken_back(interrupt: Striker) -> None:
    wire = Wire()
    when(wire.is_moving, interrupt)
    with pytest.raises(Interrupt), RobotiqHand(wire) as hand:
        pytest.fail(f"it never began: {hand}")
    assert not wire.is_moving()
    assert not wire.is_open


def test_a_release_goes_on(hand: RobotiqHand, wire: Wire, interrupt: Striker) -> None:
    """It frees what may be trapped, and takes its time."""
    hand.set_position(200)
    until(wire.is_moving)
    wire.ahead += 5
    wire.look(lambda gripper: gripper.inject_fault(Fault.SCISSOR_BLOCKED))
    until(lambda: hand.state is State.FAULT)
    when(lambda: hand.state is State.WF_ATR and wire.is_moving(), interrupt)
    with pytest.raises(Interrupt):
        hand.atr()
    assert hand.state is State.WF_ATR
    assert wire.is_moving()
    wire.ahead += 60
    hand.wait_for_state(State.ATR_DONE, timeout=PATIENCE)


def test_a_stop_still_ends(wire: Wire, interrupt: Striker) -> None:
    hand = RobotiqHand(wire)
    hand.start()
    hand.set_speed(0)
    hand.set_position(255)
    until(wire.is_moving)

    def strike() -> None:
        until(lambda: hand.state is State.DO_SHUTDOWN)
        interrupt()
        until(lambda: interrupt.struck == 1)
        wire.is_slow = False  # until here no status shows that it has stopped

    wire.is_slow = True
    thread, _ = in_a_thread(strike)
    with pytest.raises(Interrupt):
        hand.stop()
    thread.join()
    assert hand.state is State.SHUTDOWN
    assert not wire.is_moving()


def test_a_hand_that_had_just_started_is_stopped(wire: Wire) -> None:
    class Late(RobotiqHand):
        def start(self, activate: bool = True, *, wait: float = 0.0) -> None:
            super().start(activate, wait=wait)
            raise Interrupt

    hand = Late(wire)
    with pytest.raises(Interrupt), hand:
        pytest.fail("it never began")
    assert hand.state is State.SHUTDOWN


def test_polling_goes_on_wherever_the_interrupt_strikes(
    hand: RobotiqHand, wire: Wire, interrupt: Striker
) -> None:
    """A lock that the main thread holds when it is struck would keep the event loop for ever."""
    chance, numbers = random.Random(7), itertools.count()
    interrupt.is_armed = False

    def strike_often() -> None:
        while interrupt.struck < 15:
            until(lambda: interrupt.is_armed or interrupt.struck >= 15)
            time.sleep(chance.uniform(0, 0.003))
            interrupt()

    thread, _ = in_a_thread(strike_often)
    while interrupt.struck < 15:
        with contextlib.suppress(Interrupt):
            interrupt.is_armed = True
            hand.command(A, speed=next(numbers) % 256)
            hand.set_force(next(numbers) % 256)
            next(hand.statuses())
            interrupt.is_armed = False
    thread.join()
    polled(hand)
    assert hand.state is State.RUNNING_IDLE
