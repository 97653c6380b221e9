"""A hand belongs to the event loop it was started in: what happens from other threads, loops, frameworks."""

from __future__ import annotations

import asyncio
import gc
import sys
import threading
import time
from asyncio.subprocess import PIPE
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from robotiq_async import (
    ConnectFailedError,
    Finger,
    Inhibit,
    MotionInhibitedError,
    NotStartedError,
    RobotiqHand,
    State,
    Transition,
    Tunnel,
)
from robotiq_async.simulator import SerialSimulatorServer, SimulatedGripper, SimulatorServer
from tests.calls import COMMANDS, called
from tests.link.test_tunnel import Arm
from tests.patience import patience
from tests.serial_line import SerialLine
from tests.virtual import run

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("debug", [False, True], ids=["", "debug"])
async def test_a_command_from_another_thread_is_an_error_and_asks_for_nothing(
    hand: RobotiqHand, gripper: SimulatedGripper, debug: bool
) -> None:
    """The fingers went: the request was merged before the state changed. In debug mode the poller failed."""
    asyncio.get_running_loop().set_debug(debug)
    writes = len(gripper.writes)
    for call, advice in (
        (lambda: hand.command(position=255), "call_soon_threadsafe"),
        (lambda: asyncio.run(hand.set_position(255)), "run_coroutine_threadsafe"),
        (lambda: asyncio.run(hand.stop()), "run_coroutine_threadsafe"),
    ):
        async with asyncio.timeout(patience(5)):
            with pytest.raises(RuntimeError, match=advice):
                await asyncio.to_thread(call)
    for _ in range(3):
        await anext(hand.statuses())
    assert len(gripper.writes) == writes
    assert hand.state is State.RUNNING_IDLE
    await hand.move(20, Finger.A)


async def test_a_start_from_another_loop_is_refused(hand: RobotiqHand) -> None:
    with pytest.raises(RuntimeError, match=r"hand.start\(\) was used outside of the event loop"):
        await asyncio.to_thread(lambda: asyncio.run(hand.start()))
    assert hand.state is State.RUNNING_IDLE


async def test_a_halt_of_an_inhibit_from_another_loop_ends_no_move(hand: RobotiqHand) -> None:
    move = asyncio.create_task(hand.move(255, Finger.A, speed=0))
    await asyncio.sleep(0)
    hand.resume_inhibit(Inhibit("HALT", "", 0.0))
    with pytest.raises(RuntimeError, match="outside of the event loop"):
        await asyncio.to_thread(lambda: asyncio.run(hand.halt_inhibited()))
    await hand.permit()
    await hand.set_speed(9, Finger.B)
    await asyncio.sleep(0)
    assert not move.done()
    await hand.inhibit("HALT")
    with pytest.raises(MotionInhibitedError):
        await move


class _Handle:
    """A timer handle as qasync has it: it can be cancelled, and does not know its time."""

    def __init__(self, handle: asyncio.TimerHandle) -> None:
        self.cancel = handle.cancel
        self.cancelled = handle.cancelled


class _ForeignLoop(asyncio.SelectorEventLoop):
    def call_later(self, delay: float, callback: Any, *arguments: Any, **options: Any) -> Any:  # type: ignore[override]
        return self.call_at(self.time() + delay, callback, *arguments, **options)

    def call_at(self, when: float, callback: Any, *arguments: Any, **options: Any) -> Any:  # type: ignore[override]
        return _Handle(super().call_at(when, callback, *arguments, **options))


def test_a_loop_whose_timer_handles_cannot_tell_their_time_runs_a_hand() -> None:
    async def program() -> None:
        gripper = SimulatedGripper(asyncio.get_running_loop().time, speedup=100)
        async with SimulatorServer(gripper) as server, RobotiqHand(server.address) as hand:
            await hand.move(100, Finger.A, speed=255)

    with asyncio.Runner(loop_factory=_ForeignLoop) as runner:
        runner.run(program())


@pytest.mark.skipif(sys.version_info < (3, 12), reason="has no eager tasks")
def test_a_start_that_failed_does_not_stop_the_next_one_of_a_listener() -> None:
    """An eager task starts in the listener itself, before the failed call goes on."""

    async def program() -> None:
        loop = asyncio.get_running_loop()
        loop.set_task_factory(getattr(asyncio, "eager_task_factory"))  # noqa: B009  # mypy checks for 3.11
        hand, again = RobotiqHand("tcp://127.0.0.1:1"), list[asyncio.Task[None]]()

        def start_again(item: object) -> None:
            if isinstance(item, Transition) and item.target is State.SHUTDOWN and not again:
                again.append(loop.create_task(hand.start(wait=1.0)))

        hand.add_listener(start_again)
        began = loop.time()
        for starting in (hand.start(), None):
            with pytest.raises(ConnectFailedError):
                await (starting or again[0])
        assert loop.time() - began > 0.9

    run(program)


async def test_the_advice_works(hand: RobotiqHand, gripper: SimulatedGripper) -> None:
    loop = asyncio.get_running_loop()

    def elsewhere() -> None:
        result = asyncio.run_coroutine_threadsafe(hand.move(60, Finger.A), loop).result(timeout=patience(10))
        assert result.positions[Finger.A] == pytest.approx(60, abs=3)
        loop.call_soon_threadsafe(lambda: hand.command(Finger.B, position=33))

    await asyncio.to_thread(elsewhere)
    async for status in hand.statuses():
        if status.requested_position(Finger.B) == 33:
            break


@pytest.mark.parametrize("name", ["statuses", "transitions", "requests"])
async def test_a_stream_is_neither_opened_nor_read_in_another_loop(hand: RobotiqHand, name: str) -> None:
    async def read() -> object:
        return await anext(stream)

    stream = getattr(hand, name)()
    for call in (getattr(hand, name), lambda: asyncio.run(read())):
        async with asyncio.timeout(patience(5)):
            with pytest.raises(RuntimeError, match="event loop"):
                await asyncio.to_thread(call)


async def test_a_start_is_refused_while_a_reader_waits_in_another_loop(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    stream = hand.statuses()
    waiting = threading.Event()

    async def read() -> object:
        asyncio.get_running_loop().call_soon(waiting.set)
        async with asyncio.timeout(0.1):
            return await anext(stream)

    other = asyncio.create_task(asyncio.to_thread(asyncio.run, read()))
    await asyncio.to_thread(waiting.wait)
    with pytest.raises(RuntimeError, match="read in another event loop than the hand starts in"):
        await hand.start()
    with pytest.raises(TimeoutError):
        await other
    async with hand:
        await anext(stream)


def test_without_an_asyncio_loop_a_start_says_what_is_needed() -> None:
    """Under trio, for example, which drives coroutines itself."""
    hand = RobotiqHand("127.0.0.1:9")
    with pytest.raises(RuntimeError, match="trio is not supported"):
        hand.start().send(None)
    with pytest.raises(NotStartedError):
        hand.command(position=3)
    assert hand.state is State.DISCONNECTED


async def test_the_first_start_imports_nothing(server: SimulatorServer) -> None:
    # An import holds up the loop: anyio's backend, loaded at first use, did so for 20 ms.
    program = f"""
import asyncio, sys
from robotiq_async import RobotiqHand

async def main():
    before = set(sys.modules)
    async with RobotiqHand({server.address!r}) as hand:
        await hand.move(30)
    print(*(set(sys.modules) - before))

asyncio.run(main())
"""
    process = await asyncio.create_subprocess_exec(sys.executable, "-c", program, stdout=PIPE, cwd=ROOT)
    out, _ = await process.communicate()
    assert (process.returncode, out.decode().split()) == (0, [])


# -- a loop that is closed under a hand ---------------------------------------------------------------------


@contextmanager
def served(place: Callable[[], AbstractAsyncContextManager[str]]) -> Iterator[str]:
    """The address of a simulated gripper whose server has a loop and a thread of its own."""
    ready: dict[str, Any] = {}
    listens = threading.Event()

    async def serve() -> None:
        ready["loop"], ready["end"] = asyncio.get_running_loop(), asyncio.Event()
        async with place() as ready["address"]:
            listens.set()
            await ready["end"].wait()

    thread = threading.Thread(target=lambda: asyncio.run(serve()))
    thread.start()
    listens.wait()
    yield ready["address"]
    ready["loop"].call_soon_threadsafe(ready["end"].set)
    thread.join()


@asynccontextmanager
async def over_tcp() -> AsyncIterator[str]:
    async with SimulatorServer(SimulatedGripper(speedup=20)) as server:
        yield server.address


@asynccontextmanager
async def over_a_line(folder: Path) -> AsyncIterator[str]:
    with SerialLine(folder) as line:
        async with SerialSimulatorServer(line.far, SimulatedGripper(speedup=20), paced=False):
            yield f"rtu://{line.near}"


@pytest.fixture
def address() -> Iterator[str]:
    with served(over_tcp) as address:
        yield address


def abandoned(address: str | Tunnel) -> RobotiqHand:
    """A hand whose loop has been closed while it ran."""
    hand = RobotiqHand(address)
    loop = asyncio.new_event_loop()
    loop.run_until_complete(hand.start(activate=False))
    assert hand.state is State.RESET
    loop.close()
    return hand


NO_LINE = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo terminals")


@pytest.fixture(params=["tcp", pytest.param("rtu", marks=NO_LINE), "sim", "tunnel"])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str | Tunnel]:
    if request.param == "sim":
        yield "sim://"
        return
    if request.param == "tunnel":
        tunnel = Arm(SimulatedGripper(time.monotonic))
        yield tunnel
        assert (tunnel.opened, tunnel.closed) == (2, 1), "nothing is called for a loop that is closed"
        return
    with served(over_tcp if request.param == "tcp" else partial(over_a_line, tmp_path)) as address:
        yield address


@pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
class TestClosedLoop:
    @pytest.fixture(autouse=True)
    def nothing_kept(self) -> Iterator[None]:
        """Collect what was left open in that loop: Python warns of it then."""
        yield
        gc.collect()

    def test_every_call_says_so_and_another_hand_takes_the_gripper_over(self, place: str | Tunnel) -> None:
        """A serial port that the closed loop had left open was that of another program for ever."""
        left: RobotiqHand | None = abandoned(place)
        assert left is not None
        for call in (*COMMANDS, "wait_for_state"):
            with pytest.raises(NotStartedError, match="closed"):
                asyncio.run(called(left, call))
        with pytest.raises(NotStartedError, match="closed"):
            left.is_moving  # noqa: B018
        for begun in (left.start, left.stop):
            with pytest.raises(RuntimeError, match=r"closed before stop\(\), and the fingers may still move"):
                asyncio.run(begun())

        async def other() -> None:
            nonlocal left
            async with asyncio.timeout(patience(5)):
                another = RobotiqHand(place)
                await another.start(activate=False)
                left = None
                gc.collect()  # it ends the task of the closed loop, whenever it comes
                await anext(another.statuses())
                assert another.state is State.RESET
                await another.stop()

        asyncio.run(other())
