"""A blocking hand when the program ends without stopping it, or is forked."""

from __future__ import annotations

import contextlib
import gc
import os
import threading

import pytest

from robotiq_async import Finger, NotStartedError, RobotiqConnectionError, State
from robotiq_async.sync import RobotiqHand, caller
from tests.forks import in_the_child
from tests.sync.conftest import Wire, run_to_its_end, until

SCRIPT = """
import sys
from robotiq_async.sync import RobotiqHand

hand = RobotiqHand(sys.argv[1], response_timeout=2.0)  # on a busy machine
hand.start()
hand.command(position=255, speed=0)
for status in hand.statuses():
    if status.position(1) > 10:
        break
"""


async def test_a_program_that_ends_without_stopping_stops_the_fingers() -> None:
    gripper, printed = await run_to_its_end(SCRIPT)
    assert "still running at exit: stopping it" in printed
    assert 10 < gripper.position(Finger.A) < 200


def test_hands_that_were_not_stopped_are_stopped_together(caplog: pytest.LogCaptureFixture) -> None:
    wires = [Wire(), Wire(), Wire()]
    for wire in wires:
        wire.activate()
    moving, looking, stopped = hands = [RobotiqHand(wire) for wire in wires]
    wires[1].command(255)
    for hand in hands:
        hand.start(activate=False)
    stopped.stop()
    for hand in (moving, looking):
        until(lambda hand=hand: hand.is_activated)  # type: ignore[misc]
    moving.set_speed(0)
    moving.set_position(255)
    until(wires[0].is_moving)
    before = [wire.writes() for wire in wires]
    caller._stop_all()
    assert [hand.state for hand in hands] == [State.SHUTDOWN] * 3
    assert [wire.is_moving() for wire in wires] == [False, True, False]
    stops = [wire.writes() - written for wire, written in zip(wires, before, strict=True)]
    assert stops[0] in (1, 2), "a stop that comes soon after another write is repeated"
    assert stops[1:] == [0, 0]
    logged = [record.message for record in caplog.records if "still running at exit" in record.message]
    assert len(logged) == 2
    caller._stop_all()


def test_a_hand_that_the_program_has_dropped_is_stopped_too(wire: Wire) -> None:
    """It ran on, and could not be stopped."""

    def begin() -> None:
        hand = RobotiqHand(wire)
        hand.start()
        hand.set_speed(0)
        hand.set_position(255)

    begin()
    gc.collect()
    until(wire.is_moving)
    caller._stop_all()
    assert not wire.is_moving()
    assert not caller._IN_USE


def test_a_hand_in_use_is_forgotten_when_it_ends(wire: Wire) -> None:
    hand = RobotiqHand(wire)
    for begin in (lambda: hand.start(activate=False), hand.halt, lambda: hand.move(256)):
        with contextlib.suppress(NotStartedError, ValueError):
            begin()
        hand.stop()
        assert not caller._IN_USE
        assert not hand._caller.has_commanded


def test_a_hand_that_gave_up_on_its_link_is_no_longer_in_use(
    wire: Wire, caplog: pytest.LogCaptureFixture
) -> None:
    """At the end of the program it was called one that still runs."""
    hand = RobotiqHand(wire, reconnect=False)

    def call() -> None:
        with pytest.raises(RobotiqConnectionError, match="unplugged"):
            hand.set_speed(0)

    for end in (call, hand.stop, caller._stop_all):
        hand.start()
        wire.breaks = True
        until(lambda: not hand._caller.is_running)
        end()
        assert not caller._IN_USE
    assert "still running at exit" not in caplog.text


def test_an_event_loop_that_stands_still_does_not_keep_the_program_from_ending(
    hand: RobotiqHand, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(caller, "EXIT_S", 0.1)
    goes_on = threading.Event()

    def stand_still(_: object) -> None:
        goes_on.wait(10)

    remove = hand.add_listener(stand_still)
    caller._stop_all()
    remove()
    goes_on.set()


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
class TestFork:
    def test_a_hand_that_runs_stays_with_the_parent(self, hand: RobotiqHand, wire: Wire) -> None:
        def check() -> None:
            for use in (hand.halt, hand.stop, lambda: hand.status, lambda: hand.state, hand.statuses):
                with pytest.raises(RuntimeError, match="stays with the parent"):
                    use()
            assert not caller._IN_USE, "it is not ours to stop"
            assert "RobotiqHand" in repr(hand)

        written = wire.writes()
        assert in_the_child(check) == 0
        assert hand.state is State.RUNNING_IDLE
        assert wire.writes() == written
        hand.set_position(30)

    def test_a_hand_that_does_not_run_may_be_started_in_the_child(self, hand: RobotiqHand) -> None:
        assert hand.is_activated
        other = RobotiqHand(Wire())

        def check() -> None:
            with pytest.raises(NotStartedError):
                other.halt()
            other.start(activate=False)
            assert other.state is State.RESET
            other.stop()

        assert in_the_child(check) == 0
