"""Signals that end a program of blocking hands: the fingers stop first."""

from __future__ import annotations

import asyncio
import signal
import sys
import threading
import time

import pytest

from robotiq_async import RobotiqHand as AsyncRobotiqHand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.sync import RobotiqHand, stops_on_signals
from robotiq_async.values.request import Request
from tests.patience import patience

PROGRAM = """
import sys, time
from robotiq_async.sync import RobotiqHand, stops_on_signals

hand = RobotiqHand(sys.argv[1])
with stops_on_signals(hand):
    hand.start()
    hand.set_speed(0)
    hand.set_position(255)
    print("moving", flush=True)
    {waits}
    print("not reached", flush=True)
print(hand.state.name, flush=True)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("waits", ["hand.close()", "time.sleep(60)"])
async def test_a_signal_stops_the_fingers_and_leaves_the_block(number: signal.Signals, waits: str) -> None:
    """A SIGTERM ended the program, and the fingers moved on; process 1 of a container did not get it."""
    passed = [0.0]
    gripper = SimulatedGripper(lambda: time.monotonic() + passed[0], spread=False)
    gripper.write(0, Request(activate=True).registers)
    passed[0] += 30.0  # it is active
    async with SimulatorServer(gripper) as server:
        program = await asyncio.create_subprocess_exec(
            sys.executable, "-c", PROGRAM.format(waits=waits), server.address, stdout=asyncio.subprocess.PIPE
        )
        assert program.stdout is not None
        async with asyncio.timeout(patience(30)):
            assert await program.stdout.readline() == b"moving\n"
            program.send_signal(number)
            assert await program.stdout.read() == b"SHUTDOWN\n"
            assert await program.wait() == 0
        assert not Request.from_registers(gripper.request_registers).go
        assert not gripper.is_moving


def test_a_hand_for_asyncio_is_refused() -> None:
    with (
        pytest.raises(TypeError, match="blocking hands, got <RobotiqHand sim://"),
        stops_on_signals(AsyncRobotiqHand()),  # type: ignore[arg-type]
    ):
        raise AssertionError("not entered")


def test_signals_reach_the_main_thread_alone() -> None:
    errors: list[Exception] = []

    def enter() -> None:
        try:
            with stops_on_signals(RobotiqHand()):
                pass
        except RuntimeError as error:
            errors.append(error)

    thread = threading.Thread(target=enter)
    thread.start()
    thread.join()
    assert "main thread" in str(errors[0])


def test_a_hand_that_does_not_run_is_left_alone() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with stops_on_signals(RobotiqHand()):
        signal.raise_signal(signal.SIGTERM)
        raise AssertionError("the signal has left the block")
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_hand_starts_once_there_is_a_thread_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def start(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    hand = RobotiqHand("sim://?speedup=100")
    with monkeypatch.context() as patch:
        patch.setattr(threading.Thread, "start", start)
        with pytest.raises(RuntimeError, match="the event loop of the hand cannot be started: can't start"):
            hand.start()
    with hand:
        assert hand.is_activated
