"""A hand belongs to one event loop; a call from anywhere else asks for nothing."""

from __future__ import annotations

import asyncio
import gc
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from robotiq_async import NotStartedError, RobotiqStatus, State, Stream
from robotiq_async.hand import Hand
from tests.contract.bench import LOCAL, REMOTE, A, Bench, bench, contract
from tests.virtual import VirtualLoop

CALLS: dict[str, Callable[[Any], Any]] = {
    "move": lambda hand: hand.move(3),
    "open": lambda hand: hand.open(),
    "close": lambda hand: hand.close(),
    "grasp": lambda hand: hand.grasp(),
    "set_position": lambda hand: hand.set_position(3),
    "set_speed": lambda hand: hand.set_speed(3),
    "set_force": lambda hand: hand.set_force(3),
    "hold": lambda hand: hand.hold(),
    "halt": lambda hand: hand.halt(),
    "activate": lambda hand: hand.activate(),
    "reset": lambda hand: hand.reset(),
    "atr": lambda hand: hand.atr(),
    "recover": lambda hand: hand.recover(),
    "wait_for_state": lambda hand: hand.wait_for_state(State.FAULT),
    "stop": lambda hand: hand.stop(),
    "command": lambda hand: hand.command(position=3),
    "statuses": lambda hand: hand.statuses(),
    "transitions": lambda hand: hand.transitions(),
    "requests": lambda hand: hand.requests(),
    "grip_events": lambda hand: hand.grip_events(),
}


async def called(call: Callable[[Any], Any], hand: Hand) -> None:
    outcome = call(hand)
    if asyncio.iscoroutine(outcome):
        await outcome


def elsewhere(call: Callable[[Any], Any], hand: Hand) -> BaseException | None:
    """What a call raises in the event loop of another thread."""
    raised: list[BaseException] = []

    def work() -> None:
        try:
            asyncio.run(called(call, hand))
        except BaseException as error:  # noqa: BLE001  # whatever it is
            raised.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    return raised[0] if raised else None


@contract
@pytest.mark.parametrize("name", CALLS)
async def test_another_loop(where: str, name: str) -> None:
    async with bench(where) as here, here.make() as hand:
        writes = here.writes
        error = elsewhere(CALLS[name], hand)
        assert isinstance(error, RuntimeError)
        assert "outside of the event loop" in str(error)
        await asyncio.sleep(0.1)
        assert here.writes == writes
        assert hand.state is State.RUNNING_IDLE
        await hand.move(30, A)


@contract
async def test_starting_it_in_another_loop_is_refused_while_it_runs(where: str) -> None:
    async with bench(where) as here, here.make() as hand:
        assert elsewhere(lambda hand: hand.start(), hand) is not None
        assert hand.state is State.RUNNING_IDLE
        await hand.move(30, A)


@contract
async def test_reading_from_another_thread(where: str) -> None:
    async with bench(where) as here, here.make() as hand:
        seen: list[object] = []

        def read() -> None:
            seen.extend((hand.state, hand.is_moving, hand.is_activated, hand.is_reset))
            seen.append(hand.status.sequence)
            seen.append(hand.statistics.polls)

        thread = threading.Thread(target=read)
        thread.start()
        thread.join()
        assert seen[:4] == [State.RUNNING_IDLE, False, True, False]
        assert len(seen) == 6


@pytest.fixture
def nothing_kept() -> Iterator[None]:
    """Collect what was left open in a closed loop: Python warns of it then."""
    yield
    gc.collect()


@pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.usefixtures("nothing_kept")
@pytest.mark.parametrize("where", [LOCAL, REMOTE])
def test_a_loop_that_was_closed_under_it(where: str) -> None:
    loop = VirtualLoop()
    context = bench(where)

    async def begin() -> tuple[Bench, Hand, Stream[RobotiqStatus]]:
        here = await context.__aenter__()
        hand = here.make()
        await hand.start()
        return here, hand, hand.statuses()

    here, hand, stream = loop.run_until_complete(begin())
    loop.close()
    with pytest.raises(NotStartedError, match="closed"):
        hand.command(position=3)

    async def go_on() -> None:
        async with asyncio.timeout(3):
            await hand.stop()
            assert hand.state is State.SHUTDOWN
            assert [status async for status in stream][1:] == []
            if here.lab is not None:
                await here.lab.local.stop()

    asyncio.run(go_on())
