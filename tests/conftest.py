"""Fixtures of every test: nothing is left running, and the loop's complaints are failures."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import inspect
import logging
import os
import signal
from collections.abc import AsyncIterator, Callable, Generator, Iterator
from typing import Any
from zlib import crc32

import pytest
import pytest_asyncio
from hypothesis import HealthCheck, settings

from robotiq_async import RobotiqHand, State
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.patience import HangWatch
from tests.virtual import VirtualLoop

# The suite tries the same examples every time; HYPOTHESIS_PROFILE=explore tries new ones, and more.
NO_QUICK_MACHINE: dict[str, Any] = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("suite", derandomize=True, **NO_QUICK_MACHINE)
settings.register_profile("explore", max_examples=1000, print_blob=True, **NO_QUICK_MACHINE)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "suite"))

MADE_ONCE = (
    "test_replay.py",
    "test_report.py",
    "test_guard.py",
    "test_access.py",
    "test_roles.py",
    "test_examination.py",
    "fleet/test_processes.py",
)
"""Files with fixtures that take long and are made once for all of their tests: these stay together."""
HANG_WATCH = pytest.StashKey[HangWatch]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addini(
        "hangs_after", "seconds after which a test hangs, and ends the run; 0 for never", default="60"
    )


def pytest_configure(config: pytest.Config) -> None:
    config.stash[HANG_WATCH] = HangWatch(float(config.getini("hangs_after")))
    hear_ignored_signals()


def hear_ignored_signals() -> None:
    """A signal that is ignored here, under nohup or in the background, is heard by what the tests start.

    A program inherits what is ignored, and not what is handled.
    """
    for name in ("SIGHUP", "SIGINT"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, lambda *_: None)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """In place of pytest's own limit, which knows nothing of the machine."""
    watch = item.config.stash[HANG_WATCH]
    watch.begin()
    try:
        return (yield)
    finally:
        watch.end()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_call(item: pytest.Item) -> None:
    item.config.stash[HANG_WATCH].go_on()


@pytest.hookimpl(trylast=True)
def pytest_exception_interact(node: pytest.Item | pytest.Collector) -> None:
    """After a failure pytest calls off every alarm, and the end of the test may hang, too."""
    node.config.stash[HANG_WATCH].begin()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """More than there are cores: half of the time a worker waits for a process, a motion or a network."""
    return (os.cpu_count() or 1) * 2


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Keep the garbage collector off ten thousand tests and all that they import: none of it is garbage."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Watch over every test that has an event loop (giving one to the others would take a while)."""
    for item in items:
        if isinstance(item, pytest.Function) and inspect.iscoroutinefunction(item.function):
            item.fixturenames.insert(0, "nothing_left_running")
    if hasattr(config, "workerinput"):
        # In a fixed disorder: the tests of the command line wait for processes, and by their names they would
        # be the last ones, while the workers have nothing else to do.
        items.sort(key=_place)


def _place(item: pytest.Item) -> int:
    file, _, test = item.nodeid.partition("[")[0].partition("::")
    return crc32((file if file.endswith(MADE_ONCE) else file + test).encode())


def pytest_asyncio_loop_factories(item: pytest.Item) -> dict[str, Callable[[], asyncio.AbstractEventLoop]]:
    """Let what is marked so run in virtual time, fixtures and all."""
    if item.get_closest_marker("virtual_time"):
        return {"virtual": VirtualLoop}
    return {"real": asyncio.new_event_loop}


@pytest.fixture(scope="session", autouse=True)
def state_of_its_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Agents keep their records there, and not in the home of the person who runs the tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STATE_DIRECTORY", str(tmp_path_factory.mktemp("state")))
        yield


@pytest_asyncio.fixture  # type: ignore[type-var]  # gives plain ones the loop of the test, too
def nothing_left_running(caplog: pytest.LogCaptureFixture) -> Iterator[None]:
    """Not asynchronous, which would run the loop twice, with a handler of signals each time."""
    with watched(caplog):
        yield
        loop = asyncio.get_event_loop()
        # One more turn: what ends in it is not left, and what it complains about counts.
        loop.call_soon(loop.stop)
        loop.run_forever()


@contextlib.contextmanager
def watched(caplog: pytest.LogCaptureFixture, *, tasks: bool = True) -> Iterator[None]:
    """Fail a test that the event loop had to complain about, or that leaves a task behind."""
    caplog.set_level(logging.ERROR, logger="asyncio")
    loop = asyncio.get_event_loop()
    before = asyncio.all_tasks(loop)
    yield
    here = {asyncio.current_task(loop)}
    left = [task for task in asyncio.all_tasks(loop) - before - here if not task.done()]
    for task in left if tasks else ():
        task.cancel()
    assert not (tasks and left), f"tasks left running: {left}"
    records = [*caplog.get_records("call"), *caplog.get_records("teardown")]
    complaints = [record.getMessage() for record in records if record.name == "asyncio"]
    if isinstance(loop, VirtualLoop):
        complaints += loop.complaints
    assert not complaints, f"the event loop complained: {complaints}"


class Clock:
    """The time of the loop, that can be moved ahead."""

    def __init__(self) -> None:
        self.ahead = 0.0
        self._loop = asyncio.get_running_loop()

    def __call__(self) -> float:
        return self._loop.time() + self.ahead


async def started(hand: RobotiqHand, clock: Clock) -> None:
    """Start a hand; the seconds in which it activates its gripper are skipped."""
    transitions = hand.transitions()
    starting = asyncio.create_task(hand.start())
    while (await anext(transitions)).target is not State.WF_ACTIVATION:
        pass
    clock.ahead += 10
    await starting


@pytest.fixture
async def clock() -> Clock:
    """The gripper's."""
    return Clock()


@pytest.fixture
async def gripper(clock: Clock) -> SimulatedGripper:
    """A fast one that stops exactly at its request."""
    return SimulatedGripper(clock, speedup=20, spread=False)


@pytest.fixture
async def server(gripper: SimulatedGripper) -> AsyncIterator[SimulatorServer]:
    """It, behind Modbus TCP."""
    async with SimulatorServer(gripper) as server:
        yield server


@pytest.fixture
async def hand(server: SimulatorServer, clock: Clock) -> AsyncIterator[RobotiqHand]:
    """A hand at it, active."""
    hand = RobotiqHand(server.address)
    await started(hand, clock)
    yield hand
    await hand.stop()
