"""Statuses, transitions and requests: for any number of readers, in their order, to the end."""

from __future__ import annotations

import asyncio
import gc
import itertools
import weakref
from typing import TypeVar

import pytest

from robotiq_async import ConnectionLostError, Fault, State, Stream
from robotiq_async.hands import Hand
from tests.contract.bench import A, Bench, at_rest, contract

T = TypeVar("T")


async def all_of(stream: Stream[T]) -> list[T]:
    return [each async for each in stream]


@contract
@pytest.mark.parametrize("lost_after", [None, 0.2])
async def test_statuses_opened_before_the_start_end_after_the_stop(
    here: Bench, lost_after: float | None
) -> None:
    hand = here.make()
    stream = hand.statuses(100_000, lost_after=lost_after)
    collecting = asyncio.create_task(all_of(stream))
    await asyncio.sleep(0)
    async with hand:
        await hand.move(250, speed=0)  # longer than the limit
    sequences = [status.sequence for status in await collecting]
    assert len(sequences) > 20
    assert sequences == list(range(sequences[0], sequences[0] + len(sequences))), "none twice, none lost"
    assert stream.missed == 0
    with pytest.raises(StopAsyncIteration):
        await anext(stream)


@contract
async def test_a_slow_reader_costs_only_itself(here: Bench, hand: Hand) -> None:
    slow, few, fast = hand.statuses(), hand.statuses(buffer=5), hand.statuses()
    first = latest = await anext(slow)
    for _ in range(20):
        latest = await anext(fast)
    while latest.sequence <= first.sequence + 10:
        latest = await anext(fast)
    assert (await anext(slow)).sequence == latest.sequence
    assert slow.missed == latest.sequence - first.sequence - 1
    assert [status.sequence for status in few.drain()] == list(
        range(latest.sequence - 4, latest.sequence + 1)
    )
    assert few.take_nowait() is None
    assert fast.missed == 0


@contract
async def test_a_second_reader_of_one_stream_is_refused(here: Bench, hand: Hand) -> None:
    stream = hand.transitions()
    first = asyncio.create_task(anext(stream))
    await asyncio.sleep(0)
    with pytest.raises(RuntimeError, match="one reader"):
        await anext(stream)
    await hand.set_position(20)
    assert (await first).target is State.RUNNING_CC


@contract
async def test_a_cancelled_wait_loses_nothing(here: Bench, hand: Hand) -> None:
    stream = hand.transitions()
    waiting = asyncio.create_task(anext(stream))
    await asyncio.sleep(0)
    waiting.cancel()
    await asyncio.wait({waiting})
    await hand.set_position(20)
    assert [(await anext(stream)).target for _ in range(2)] == [State.RUNNING_CC, State.RUNNING_IDLE]


@contract
async def test_a_closed_stream_ends_and_a_dropped_one_is_forgotten(here: Bench, hand: Hand) -> None:
    stream = hand.statuses()
    await anext(stream)
    await stream.aclose()
    await stream.aclose()
    with pytest.raises(StopAsyncIteration):
        await anext(stream)
    waited_for = hand.transitions()
    waiting = asyncio.create_task(anext(waited_for, None))
    await asyncio.sleep(0)
    await waited_for.aclose()
    assert await waiting is None
    dropped = [
        weakref.ref(opened())
        for opened in (hand.statuses, hand.transitions, hand.requests, hand.grip_events)
        for _ in range(100)
    ]
    gc.collect()
    assert not any(each() for each in dropped)


@contract
async def test_transitions_lose_nothing(here: Bench) -> None:
    hand = here.make()
    for first in (State.DISCONNECTED, State.SHUTDOWN):
        stream = hand.transitions()
        collecting = asyncio.create_task(all_of(stream))
        async with hand:
            for _ in range(5):
                await hand.set_position(20)
            await hand.reset()
            await hand.activate()
        seen = await collecting
        assert seen[0].source is first
        assert seen[-1].target is State.SHUTDOWN
        assert all(before.target is after.source for before, after in itertools.pairwise(seen))
        assert all(each.source is not each.target for each in seen)
        targets = [each.target for each in seen]
        assert targets.count(State.RUNNING_CC) >= 5
        for name in ("DO_RESET", "WF_RESET", "RESET", "DO_ACTIVATION", "WF_ACTIVATION"):
            assert targets.count(State[name]) == 1


@contract
async def test_a_transition_finds_the_status_that_made_it(here: Bench, hand: Hand) -> None:
    stream = hand.transitions()
    here.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.5)
    async for transition in stream:
        if transition.target is State.FAULT:
            break
    assert hand.state is State.FAULT
    assert hand.status.fault is Fault.COMMUNICATION_NOT_READY


@contract
async def test_streams_wait_out_a_lost_link(here: Bench, hand: Hand) -> None:
    transitions, stream = hand.transitions(), hand.statuses(buffer=10_000)
    await here.unplug(hand)
    await here.plug(hand)
    assert [(await anext(transitions)).target for _ in range(2)] == [
        State.DISCONNECTED,
        State.RUNNING_IDLE,
    ]
    last = -1
    for _ in range(50):
        sequence = (await anext(stream)).sequence
        assert sequence > last
        last = sequence


@contract
async def test_requests(here: Bench) -> None:
    hand = here.make()
    stream, newest = hand.requests(), hand.requests(buffer=1)
    collecting = asyncio.create_task(all_of(stream))
    async with hand:
        await hand.set_position(20, A)
        await hand.set_speed(9)
        await at_rest(hand)
        assert newest.missed == 1
    requests = await collecting
    assert all(request.acknowledged for request in requests)
    assert requests[0].request.position(A) == 20
    assert requests[1].request.axes[1].speed == 9
    assert [each.request.registers for each in requests] == [
        write.registers for write in list(here.gripper.writes)[-len(requests) :]
    ]
    assert not requests[-1].request.go, "the stop is the last one"


@contract
async def test_a_request_that_another_client_wrote_is_not_ours(here: Bench, hand: Hand) -> None:
    stream = hand.requests()
    here.gripper.write(0, [0x0900, 0, 0, 0x0AFF, 0, 0, 0, 0])
    await asyncio.sleep(0.5)
    assert stream.take_nowait() is None


@contract
async def test_a_reader_that_asks_for_it_hears_of_a_lost_link_and_may_read_on(
    here: Bench, hand: Hand
) -> None:
    loop, stream, patient = asyncio.get_running_loop(), hand.statuses(lost_after=0.3), hand.statuses()
    for _ in range(100):
        await anext(stream)
    await here.unplug(hand)
    while stream.take_nowait() is not None:
        pass
    for earliest in (0.0, 0.29):
        began = loop.time()
        with pytest.raises(ConnectionLostError, match=r"no status for 0\.3 s.*DISCONNECTED|0\.3 s: .*down"):
            await anext(stream)
        assert earliest <= loop.time() - began <= 0.31
    with pytest.raises(ConnectionLostError):
        await anext(hand.statuses(lost_after=0.3))
    await here.plug(hand)
    assert (await anext(stream)).sequence <= hand.status.sequence
    patient.take_nowait()
    await anext(patient)


@contract
async def test_a_reader_that_waits_for_the_start_waits_without_a_limit(here: Bench) -> None:
    hand = here.make()
    stream = hand.statuses(lost_after=0.05)
    waiting = asyncio.create_task(anext(stream))
    await asyncio.sleep(0.2)
    assert not waiting.done()
    async with hand:
        assert (await waiting).sequence >= 0
