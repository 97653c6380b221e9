"""Calls while the interpreter ends, and calls that are refused: neither hangs, nor leaves a trace."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

import pytest

from robotiq_async import Finger, RobotiqError, State
from robotiq_async.sync import RobotiqHand, caller
from robotiq_async.sync.loop_thread import LOOP_THREAD
from tests.sync.conftest import Wire, adopting, in_a_thread, run_to_its_end, until

PROGRAM = """
import atexit, contextlib, functools, gc, sys, threading, weakref

ADDRESS = sys.argv[1]
{before}
from robotiq_async.sync import RobotiqHand

# The gripper is in another process, which a busy machine may keep from answering.
RobotiqHand = functools.partial(RobotiqHand, response_timeout=2.0)

class Station:
    def __init__(self, late, *, runs=True):
        self.hand, self.late = RobotiqHand(ADDRESS), late
        if runs:
            self.hand.start()
            self.hand.command(position=255, speed=0)
            for status in self.hand.statuses():
                if status.is_moving:
                    break

    def __del__(self):
        self.late(self.hand)

@contextlib.contextmanager
def session():
    with RobotiqHand(ADDRESS) as hand:
        hand.command(position=255, speed=0)
        yield hand

{program}
"""
LATE = """
def park():
    {0}

atexit.register(park)
"""
# A thread that prints its error while the interpreter ends can abort CPython itself: so it prints none.
THREAD = """
hand = RobotiqHand(ADDRESS)
hand.start()

def wait():
    with contextlib.suppress(Exception):
        hand.move(255, speed=0)

threading.Thread(target=wait, daemon=True).start()
while not hand.is_moving:
    pass
"""
OTHERS = """
hand = RobotiqHand(ADDRESS)
hand.start()

def again():
    while True:
        try:
            hand.command(position=255, speed=0)
        except Exception:
            with contextlib.suppress(Exception):
                hand.start()

threading.Thread(target=again, daemon=True).start()
while not hand.is_moving:
    pass
"""
ENDINGS = {
    "the end": ("", "Station(lambda hand: None)"),
    "an error": ("", "station = Station(lambda hand: None); raise SystemExit(0)"),
    "del stops": ("", "station = Station(lambda hand: hand.stop())"),
    "del stops one that never started": ("", "station = Station(lambda hand: hand.stop(), runs=False)"),
    "del moves": ("", "station = Station(lambda hand: hand.move(0))"),
    "del commands": ("", "station = Station(lambda hand: hand.command(position=0))"),
    "del reads": ("", "station = Station(lambda hand: hand.is_moving)"),
    "del starts": ("", "station = Station(lambda hand: hand.start(), runs=False)"),
    "del waits": ("", "station = Station(lambda hand: next(hand.statuses()))"),
    "a cycle": ("", "station = Station(lambda hand: hand.halt()); station.itself = station"),
    "entered and not left": ("", "context = session(); context.__enter__()"),
    "with in a generator": (
        "",
        "def run():\n  with RobotiqHand(ADDRESS) as hand: yield\nsteps = run(); next(steps)",
    ),
    "an exit stack": ("", "stack = contextlib.ExitStack(); hand = stack.enter_context(RobotiqHand(ADDRESS))"),
    "finalize": ("", "hand = RobotiqHand(ADDRESS); hand.start(); weakref.finalize(Station, hand.stop)"),
    "atexit stops": (LATE.format("hand.stop()"), "hand = RobotiqHand(ADDRESS); hand.start()"),
    "atexit starts": (LATE.format("RobotiqHand(ADDRESS).start()"), ""),
    "a thread waits": ("", THREAD),
    "a thread starts it again": (LATE.format("threading.Event().wait(0.5)"), OTHERS),
}


@pytest.mark.parametrize("ending", ENDINGS.values(), ids=ENDINGS)
async def test_a_call_while_the_interpreter_ends_ends_too_and_nothing_goes_on(
    ending: tuple[str, str],
) -> None:
    """On Python 3.11 it waited for ever for a thread that never began."""
    await run_to_its_end(PROGRAM.format(before=ending[0], program=ending[1]))


def test_stopping_a_hand_that_never_started_needs_no_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LOOP_THREAD, "is_closing", True)
    hand = RobotiqHand(Wire())
    hand.stop()
    hand.stop(halt=False)
    with pytest.raises(TypeError, match="halt"):
        hand.stop(halt=3)  # type: ignore[arg-type]
    with pytest.raises(RuntimeError, match="the program is ending"):
        hand.start()
    assert hand.state is State.DISCONNECTED


def test_a_hand_that_starts_while_the_others_are_stopped_at_exit_is_refused(
    wire: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another thread had it move, and it was not among those that the end stops."""
    monkeypatch.setattr(LOOP_THREAD, "is_closing", False)  # and is so again after the test
    slow, other = RobotiqHand(wire), RobotiqHand(Wire())
    slow.start()
    slow.set_speed(0)
    slow.set_position(255)  # what has moved nothing may be stopped before the test looks
    wire.is_slow = True
    ending, _ = in_a_thread(caller._at_exit)
    until(lambda: slow.state is State.DO_SHUTDOWN)
    with pytest.raises(RuntimeError, match="the program is ending"):
        other.start()
    wire.is_slow = False
    ending.join()
    assert other.state is State.DISCONNECTED


REFUSED: dict[str, Callable[[RobotiqHand], Any]] = {
    "move": lambda hand: hand.move(999),
    "grasp": lambda hand: hand.grasp(at_least=9),
    "command": lambda hand: hand.command(),
    "set_position": lambda hand: hand.set_position(-1),
    "set_speed": lambda hand: hand.set_speed(256),
    "set_force": lambda hand: hand.set_force(1.5),  # type: ignore[arg-type]
    "hold": lambda hand: hand.hold(0),
    "atr": lambda hand: hand.atr(),
    "recover": lambda hand: hand.recover(timeout=-1),
    "activate": lambda hand: hand.activate(),
}


@pytest.mark.parametrize("refused", REFUSED.values(), ids=REFUSED)
def test_a_call_that_is_refused_does_not_count_as_commanding(
    refused: Callable[[RobotiqHand], Any], wire: Wire
) -> None:
    """At the end of the program rGTO was cleared under the motion of another client."""
    hand = adopting(wire)
    with contextlib.suppress(ValueError, TypeError, RobotiqError):
        refused(hand)
    before = wire.writes()
    caller._stop_all()
    assert wire.writes() == before
    assert wire.is_moving()


def test_a_hold_of_what_another_client_moves_counts_as_commanding(wire: Wire) -> None:
    hand = adopting(wire)
    hand.hold()
    assert hand._caller.has_commanded
    hand.stop()


def test_has_commanded_lasts_until_the_next_start(hand: RobotiqHand, wire: Wire) -> None:
    hand.set_position(100, Finger.A)
    assert hand._caller.has_commanded
    hand.stop()
    hand.start()
    assert not hand._caller.has_commanded
