"""A blocking hand at a gripper in memory, and Ctrl-C as a signal that pytest does not take for its own."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
import threading
import time
from asyncio.subprocess import DEVNULL, PIPE, STDOUT
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

import pytest

from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.sync import RobotiqHand, caller
from robotiq_async.sync.loop_thread import THREAD_NAME
from robotiq_async.values.enums import Finger
from robotiq_async.values.errors import ConnectionLostError
from robotiq_async.values.registers import Registers
from robotiq_async.values.request import AxisRequest, Request
from tests.conftest import Clock
from tests.fake_transport import Exchanging
from tests.forked import CORE, ROOT, forking
from tests.patience import patience

T = TypeVar("T")
PATIENCE = 5.0


class Wire(Exchanging):
    """A tunnel without a network; its gripper has a clock that the test moves ahead.

    The hand calls it in its own thread, and the test in another one: one at a time.
    """

    def __init__(self) -> None:
        self.ahead = 0.0
        self._gripper = SimulatedGripper(lambda: time.monotonic() + self.ahead, spread=False)
        self._asking = threading.Lock()
        self.is_open = False
        self.breaks = False
        """At the next reading, once."""
        self.is_slow = False
        """Whether answers are on their way until this is False again."""
        self.is_awaited = False
        """Whether an answer is on its way for that reason."""

    async def open(self) -> None:
        self.is_open = True

    async def read(self) -> Registers:
        if self.breaks:
            self.breaks = self.is_open = False
            raise ConnectionLostError("unplugged")
        while self.is_slow:
            self.is_awaited = True
            await asyncio.sleep(0.001)
        self.is_awaited = False
        return self.look(lambda gripper: gripper.status_registers())

    async def write(self, registers: Sequence[int]) -> None:
        self.look(lambda gripper: gripper.write(0, registers))

    async def close(self) -> None:
        self.is_open = False

    def look(self, what: Callable[[SimulatedGripper], T]) -> T:
        """Read something of the gripper, or do something to it."""
        with self._asking:
            return what(self._gripper)

    def activate(self) -> None:
        """Let it be active already."""
        self.look(lambda gripper: gripper.write(0, Request(activate=True).registers))
        self.ahead += 10

    def command(self, position: int) -> None:
        """Let another client send all axes somewhere, slowly."""
        axes = (AxisRequest(position, 0, 0),) * 4
        self.look(lambda gripper: gripper.write(0, Request(activate=True, go=True, axes=axes).registers))

    def targets(self) -> list[int]:
        """Targets of the fingers A, B and C."""
        return self.look(lambda gripper: [gripper.target(axis) for axis in (Finger.A, Finger.B, Finger.C)])

    def is_moving(self) -> bool:
        return self.look(lambda gripper: gripper.is_moving)

    def writes(self) -> int:
        """The number of writes of the hand."""
        return self.look(lambda gripper: len(gripper.writes)) - 1


def adopting(wire: Wire) -> RobotiqHand:
    """A hand at a gripper that another client moves; it has only looked."""
    wire.command(255)
    hand = RobotiqHand(wire)
    hand.start(activate=False)
    until(lambda: wire.is_moving() and hand.is_moving)  # a hold decides on the status that there is
    return hand


async def run_to_its_end(program: str) -> tuple[SimulatedGripper, str]:
    """Run a program at an active gripper, whose address is its argument; gives that and what it printed."""
    clock = Clock()
    gripper = SimulatedGripper(clock)
    gripper.write(0, Request(activate=True).registers)
    clock.ahead += 10
    async with SimulatorServer(gripper) as server:
        with forking(CORE):
            process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-c", program, server.address),
                env=os.environ | {"PYTHONPATH": str(ROOT)},
                stdin=DEVNULL,
                stdout=PIPE,
                stderr=STDOUT,
            )
        try:
            async with asyncio.timeout(patience(20)):
                printed, _ = await process.communicate()
        finally:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
        assert process.returncode == 0, printed.decode()
        assert not gripper.is_moving, printed.decode()
    return gripper, printed.decode()


class Interrupt(KeyboardInterrupt):
    """The test's own Ctrl-C: pytest ends with the real one."""


@pytest.fixture
def wire() -> Wire:
    wire = Wire()
    wire.activate()
    return wire


@pytest.fixture
def hand(wire: Wire) -> Iterator[RobotiqHand]:
    """It has adopted a gripper that is active."""
    with RobotiqHand(wire) as hand:
        yield hand


class Striker:
    """Strikes the main thread as Ctrl-C does, whatever it does; once, until it is armed again."""

    def __init__(self) -> None:
        self.is_armed = True
        self.struck = 0

    def __call__(self) -> None:
        main = threading.main_thread().ident
        assert main is not None
        signal.pthread_kill(main, signal.SIGUSR1)

    def handle(self, *_: Any) -> None:
        if self.is_armed:
            self.is_armed = False
            self.struck += 1
            raise Interrupt


@pytest.fixture
def interrupt() -> Iterator[Striker]:
    if not hasattr(signal, "SIGUSR1"):
        pytest.skip("Windows has no signals from thread to thread")
    striker = Striker()
    before = signal.signal(signal.SIGUSR1, striker.handle)
    yield striker
    signal.signal(signal.SIGUSR1, before)


@pytest.fixture(autouse=True)
def no_thread_is_left() -> Iterator[None]:
    """The thread of the event loop ends with the last hand and the last call."""
    yield
    left = [each.hand for each in caller._IN_USE]
    caller._stop_all()  # what a test that failed has left must not fail the others
    assert not left
    for thread in loop_threads():
        thread.join(patience(PATIENCE))
        assert not thread.is_alive()


def loop_threads() -> list[threading.Thread]:
    return [each for each in threading.enumerate() if each.name == THREAD_NAME]


def until(condition: Callable[[], bool]) -> None:
    """Wait for what happens in another thread."""
    due = time.monotonic() + patience(PATIENCE)
    while not condition():
        assert time.monotonic() < due, "it did not happen"
        time.sleep(0.001)


def in_a_thread(work: Callable[[], object]) -> tuple[threading.Thread, list[object]]:
    """Begin something in another thread; gives what it returned or raised when the thread has ended."""
    outcome: list[object] = []

    def run() -> None:
        try:
            outcome.append(work())
        except Exception as error:  # noqa: BLE001  # it is looked at in the test
            outcome.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    return thread, outcome
