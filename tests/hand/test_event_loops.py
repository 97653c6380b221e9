"""A hand belongs to the event loop it was started in: what happens from other threads, loops, frameworks."""

from __future__ import annotations

import asyncio
import gc
import threading
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from robotiq_async import Finger, NotStartedError, RobotiqHand, State
from robotiq_async.simulator import SimulatedGripper, SimulatorServer


async def in_a_thread(work: Callable[[], object]) -> BaseException | None:
    """What a call from another thread raises, or None."""

    def run() -> BaseException | None:
        try:
            work()
        except Exception as error:  # noqa: BLE001  # it is looked at in the test
            return error
        return None

    with ThreadPoolExecutor(1) as pool:
        return await asyncio.get_running_loop().run_in_executor(pool, run)


CALLS: dict[str, Callable[[RobotiqHand], Coroutine[Any, Any, object]]] = {
    "set_position": lambda hand: hand.set_position(200),
    "set_speed": lambda hand: hand.set_speed(3),
    "set_force": lambda hand: hand.set_force(3),
    "move": lambda hand: hand.move(200),
    "close": lambda hand: hand.close(),
    "hold": lambda hand: hand.hold(),
    "halt": lambda hand: hand.halt(),
    "reset": lambda hand: hand.reset(),
    "activate": lambda hand: hand.activate(),
    "atr": lambda hand: hand.atr(),
    "recover": lambda hand: hand.recover(),
    "wait_for_state": lambda hand: hand.wait_for_state(State.FAULT),
    "stop": lambda hand: hand.stop(),
}


async def assert_nothing_happened(hand: RobotiqHand, gripper: SimulatedGripper, writes: int) -> None:
    for _ in range(3):
        await anext(hand.statuses())
    assert len(gripper.writes) == writes
    assert hand.state is State.RUNNING_IDLE
    await hand.move(20, Finger.A)


@pytest.mark.parametrize("debug", [False, True], ids=["", "debug"])
async def test_a_command_from_another_thread_is_an_error_and_asks_for_nothing(
    hand: RobotiqHand, gripper: SimulatedGripper, debug: bool
) -> None:
    """It raised an error, and the fingers went: the request was merged before the state changed."""
    asyncio.get_running_loop().set_debug(debug)
    writes = len(gripper.writes)
    error = await in_a_thread(lambda: hand.command(position=255))
    assert isinstance(error, RuntimeError)
    assert "call_soon_threadsafe" in str(error)
    await assert_nothing_happened(hand, gripper, writes)


@pytest.mark.parametrize("name", CALLS)
async def test_a_call_from_another_loop_is_refused_at_once_in_debug_mode_too(
    hand: RobotiqHand, gripper: SimulatedGripper, name: str
) -> None:
    """There the task that owns the link died of it."""
    asyncio.get_running_loop().set_debug(True)
    writes = len(gripper.writes)
    async with asyncio.timeout(5):
        error = await in_a_thread(lambda: asyncio.run(CALLS[name](hand)))
    assert isinstance(error, RuntimeError), error
    assert "run_coroutine_threadsafe" in str(error)
    await assert_nothing_happened(hand, gripper, writes)


async def test_the_advice_works(hand: RobotiqHand, gripper: SimulatedGripper) -> None:
    loop = asyncio.get_running_loop()

    def elsewhere() -> None:
        result = asyncio.run_coroutine_threadsafe(hand.move(60, Finger.A), loop).result(timeout=10)
        assert result.positions[Finger.A] == pytest.approx(60, abs=3)
        loop.call_soon_threadsafe(lambda: hand.command(Finger.B, position=33))

    assert await in_a_thread(elsewhere) is None
    async for status in hand.statuses():
        if status.requested_position(Finger.B) == 33:
            break


@pytest.mark.parametrize("name", ["statuses", "transitions", "requests"])
async def test_a_stream_is_neither_opened_nor_read_in_another_loop(hand: RobotiqHand, name: str) -> None:
    async def read() -> object:
        return await anext(stream)

    stream = getattr(hand, name)()
    for call in (getattr(hand, name), lambda: asyncio.run(read())):
        async with asyncio.timeout(5):
            error = await in_a_thread(call)
        assert isinstance(error, RuntimeError)
        assert "event loop" in str(error)


async def test_who_waits_in_another_loop_for_a_start_is_told(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    stream = hand.statuses()
    waiting = threading.Event()

    async def read() -> object:
        asyncio.get_running_loop().call_soon(waiting.set)
        return await anext(stream)

    other = asyncio.create_task(in_a_thread(lambda: asyncio.run(read())))
    await asyncio.to_thread(waiting.wait)
    async with hand:
        async with asyncio.timeout(5):
            error = await other
        assert isinstance(error, RuntimeError)
        await anext(hand.statuses())


def test_without_an_asyncio_loop_a_start_says_what_is_needed() -> None:
    """As under trio, which drives coroutines itself."""
    hand = RobotiqHand("127.0.0.1:9")
    with pytest.raises(RuntimeError, match="trio is not supported"):
        hand.start().send(None)
    with pytest.raises(NotStartedError):
        hand.command(position=3)
    assert hand.state is State.DISCONNECTED


# -- a loop that is closed under a hand ---------------------------------------------------------------------


@pytest.fixture
def address() -> Iterator[str]:
    """A simulated gripper whose server has a loop and a thread of its own."""
    ready: dict[str, Any] = {}
    listens = threading.Event()

    async def serve() -> None:
        ready["loop"], ready["end"] = asyncio.get_running_loop(), asyncio.Event()
        async with SimulatorServer(SimulatedGripper(speedup=20)) as server:
            ready["address"] = server.address
            listens.set()
            await ready["end"].wait()

    thread = threading.Thread(target=lambda: asyncio.run(serve()))
    thread.start()
    listens.wait()
    yield ready["address"]
    ready["loop"].call_soon_threadsafe(ready["end"].set)
    thread.join()


def abandoned(address: str) -> RobotiqHand:
    """A hand whose loop has been closed while it ran."""
    hand = RobotiqHand(address)
    loop = asyncio.new_event_loop()
    loop.run_until_complete(hand.start(activate=False))
    assert hand.state is State.RESET
    loop.close()
    return hand


@pytest.fixture(params=["tcp", "sim"])
def place(request: pytest.FixtureRequest, address: str) -> str:
    return address if request.param == "tcp" else "sim://"


OPEN_IN_A_CLOSED_LOOP = [
    pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


class TestClosedLoop:
    pytestmark = OPEN_IN_A_CLOSED_LOOP

    @pytest.fixture(autouse=True)
    def nothing_kept(self) -> Iterator[None]:
        """Collect what was left open in that loop: Python warns of it then."""
        yield
        gc.collect()

    def test_stop_ends(self, place: str) -> None:
        """It waited for ever, and swallowed its own cancellation."""
        hand = abandoned(place)

        async def stop() -> None:
            async with asyncio.timeout(3):
                await hand.stop()

        asyncio.run(stop())
        assert hand.state is State.SHUTDOWN

    @pytest.mark.parametrize("stop_first", [False, True], ids=["", "stopped"])
    def test_start_begins_anew(self, place: str, stop_first: bool) -> None:
        """It refused for ever."""
        hand = abandoned(place)

        async def again() -> None:
            if stop_first:
                await hand.stop()
            async with asyncio.timeout(10):
                await hand.start(activate=False)
                assert hand.state is State.RESET
                await anext(hand.statuses())
                await hand.stop()

        asyncio.run(again())
        assert hand.state is State.SHUTDOWN

    def test_what_is_left_of_the_first_start_leaves_the_second_alone(self, address: str) -> None:
        """The task of the closed loop is ended by the garbage collector, whenever that comes."""
        hand = abandoned(address)

        async def again() -> None:
            await hand.start(activate=False)
            gc.collect()
            assert hand.state is State.RESET
            await anext(hand.statuses())
            await hand.stop()

        asyncio.run(again())

    def test_a_sequence_of_the_first_start_does_not_go_on_in_the_second(self, address: str) -> None:
        """It activated a gripper that the second start was to leave as it is."""
        hand = RobotiqHand(address, poll_interval=0.1)
        loop = asyncio.new_event_loop()

        async def asked() -> asyncio.Task[None]:
            await hand.start(activate=False)
            await anext(hand.statuses())  # nothing is read, and so nothing written, before the next tick
            return asyncio.create_task(hand.activate())

        asking = loop.run_until_complete(asked())
        loop.run_until_complete(asyncio.sleep(0))
        assert hand.state is State.DO_ACTIVATION
        loop.close()
        del asking

        async def again() -> None:
            await hand.start(activate=False)
            for _ in range(5):
                assert not (await anext(hand.statuses())).activation_echo
            assert hand.state is State.RESET
            await hand.stop()

        asyncio.run(again())

    def test_every_other_call_says_so(self, place: str) -> None:
        hand = abandoned(place)
        for name, call in CALLS.items():
            if name != "stop":
                with pytest.raises(NotStartedError, match="closed"):
                    asyncio.run(call(hand))
        with pytest.raises(NotStartedError, match="closed"):
            hand.command(position=3)
        with pytest.raises(NotStartedError, match="closed"):
            hand.is_moving  # noqa: B018
        asyncio.run(hand.stop())

    def test_its_streams_end(self, address: str) -> None:
        hand = RobotiqHand(address)
        stream = hand.statuses()
        loop = asyncio.new_event_loop()
        loop.run_until_complete(hand.start(activate=False))
        waiting = loop.create_task(anext(stream))
        loop.run_until_complete(asyncio.sleep(0))
        loop.close()

        async def end() -> None:
            await hand.stop()
            async with asyncio.timeout(2):
                async for _ in stream:
                    pass

        asyncio.run(end())
        del waiting

    def test_another_hand_takes_the_address_over(self, address: str) -> None:
        left = abandoned(address)

        async def other() -> None:
            async with asyncio.timeout(5):
                another = RobotiqHand(address)
                await another.start(activate=False)
                await another.stop()

        asyncio.run(other())
        asyncio.run(left.stop())
