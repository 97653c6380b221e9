"""Messages from the threads of zenoh, and to them."""

from __future__ import annotations

import asyncio
import json
import threading
import time
from functools import partial

import pytest

from robotiq_async.fleet.network.bus import MessageKind
from robotiq_async.fleet.network.mailbox import (
    GATHER_S,
    MOST,
    MOST_REPLIES,
    TURN_S,
    Mailbox,
    ReplySender,
)
from tests.patience import patience
from tests.virtual import virtual

PATIENCE_S = 10.0


# -- mailbox -----------------------------------------------------------------------------------------------


class Postman:
    """Brings deliveries, and knows when each was made."""

    def __init__(self) -> None:
        self.loop = asyncio.get_running_loop()
        self.mailbox = Mailbox()
        self.late: list[float] = []
        self.opened: list[int] = []

    def bring(self, number: int, kind: MessageKind = MessageKind.TELEMETRY) -> None:
        self.mailbox.put(partial(self._open, number, self.loop.time()), kind)

    def _open(self, number: int, brought_at: float) -> None:
        self.opened.append(number)
        self.late.append(self.loop.time() - brought_at)

    async def bring_many(self, every: float) -> None:
        for number in range(20):
            self.bring(number)
            await asyncio.sleep(every)


@virtual
async def test_the_news_of_one_hand_do_not_wait() -> None:
    postman = Postman()
    await postman.bring_many(every=0.005)
    assert max(postman.late) == 0.0


@virtual
async def test_the_news_of_many_are_gathered() -> None:
    postman = Postman()
    await postman.bring_many(every=0.0001)
    await asyncio.sleep(2 * GATHER_S)
    assert postman.opened == list(range(20))
    assert sum(late > 0.0 for late in postman.late) > 10
    assert max(postman.late) <= GATHER_S * 1.001


@virtual
async def test_urgent_messages_do_not_wait_and_do_not_overtake() -> None:
    postman = Postman()
    await postman.bring_many(every=0.0001)
    await asyncio.sleep(2 * GATHER_S)
    for number in (20, 21):  # the second finds the mailbox opened a moment ago
        postman.bring(number)
        await asyncio.sleep(0.0001)
    postman.bring(22)
    postman.bring(23, MessageKind.REQUEST)
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert postman.opened[-2:] == [22, 23]
    assert postman.late[-1] == 0.0
    postman.bring(24)  # it is gathered from that opening on
    await asyncio.sleep(2 * GATHER_S)
    assert postman.opened == list(range(25))
    assert postman.late[-1] == pytest.approx(GATHER_S)


@virtual
async def test_a_letter_that_fails_keeps_no_other(caplog: pytest.LogCaptureFixture) -> None:
    postman = Postman()
    postman.mailbox.put(partial(json.loads, "?"), MessageKind.TELEMETRY)
    postman.bring(1)
    await asyncio.sleep(0.01)
    assert postman.opened == [1]
    assert "handling a fleet message failed" in caplog.text


async def test_letters_of_another_thread() -> None:
    postman, there = Postman(), asyncio.Event()

    def work() -> None:
        for number in range(1000):
            postman.bring(number)
        postman.mailbox.put(there.set, MessageKind.ANSWER)

    thread = threading.Thread(target=work)
    thread.start()
    async with asyncio.timeout(patience(PATIENCE_S)):
        await there.wait()
    thread.join()
    assert postman.opened == list(range(1000))


def test_a_closed_loop_gets_no_messages() -> None:
    async def make() -> Mailbox:
        return Mailbox()

    asyncio.run(make()).put(lambda: None, MessageKind.TELEMETRY)


@virtual
async def test_a_halt_comes_before_a_flood() -> None:
    """A reader that flooded the agent kept the halts of others waiting for seconds."""
    postman = Postman()
    for number in range(1000):
        postman.bring(number, MessageKind.REQUEST)
    postman.bring(-1, MessageKind.HALT)
    await asyncio.sleep(0.1)
    assert postman.opened == [-1, *range(1000)]


@virtual
async def test_excess_messages_are_dropped_but_answers_are_not(caplog: pytest.LogCaptureFixture) -> None:
    postman = Postman()
    for number in range(MOST + 10):
        postman.bring(number, MessageKind.REQUEST)
    postman.bring(-1, MessageKind.ANSWER)
    await asyncio.sleep(0.1)
    assert postman.opened == [*range(MOST), -1]
    assert caplog.text.count("a fleet message was dropped: queue full") == 1


async def test_a_flood_leaves_the_loop_its_turns() -> None:
    mailbox, turns, left = Mailbox(), 0, 50
    done = asyncio.Event()

    def slow() -> None:
        nonlocal left
        until = time.perf_counter() + TURN_S
        while time.perf_counter() < until:
            pass
        left -= 1
        if not left:
            done.set()

    def count() -> None:
        nonlocal turns
        turns += 1
        if not done.is_set():
            asyncio.get_running_loop().call_soon(count)

    for _ in range(left):
        mailbox.put(slow, MessageKind.REQUEST)
    count()
    await done.wait()
    assert turns >= 50


# -- reply sender ------------------------------------------------------------------------------------------


def test_answers_go_out_in_their_order_and_then_it_ends() -> None:
    reply_sender, sent = ReplySender(), list[int]()
    for number in range(100):
        reply_sender.put(lambda number=number: sent.append(number), lambda: sent.append(-1))  # type: ignore[misc]
    reply_sender.close()
    reply_sender.join(patience(PATIENCE_S))
    assert sent == list(range(100))


def test_a_client_that_does_not_read_delays_no_other_and_excess_replies_are_dropped() -> None:
    """A dropped question is reported to its client, as slow as an answer: it held up the loop."""
    reply_sender, read = ReplySender(), threading.Event()
    sent, dropped_in = list[int](), set[threading.Thread]()
    reply_sender.put(lambda: (read.wait(patience(PATIENCE_S)), None)[1], lambda: None)
    for number in range(2 * MOST_REPLIES):
        reply_sender.put(
            lambda number=number: sent.append(number),  # type: ignore[misc]
            lambda: dropped_in.add(threading.current_thread()),
        )
    assert not sent
    read.set()
    reply_sender.close()
    reply_sender.join(patience(PATIENCE_S))
    assert MOST_REPLIES - 1 <= len(sent) <= MOST_REPLIES
    assert dropped_in
    assert threading.current_thread() not in dropped_in


def test_the_first_reply_goes_out_at_once_and_those_of_a_pause_together() -> None:
    """Each time that the thread woke, the loop waited for the interpreter."""
    pause, first, times = patience(1.0), threading.Event(), list[float]()
    reply_sender = ReplySender(pause)
    began = time.monotonic()
    reply_sender.put(first.set, lambda: None)
    assert first.wait(pause / 2)
    for _ in range(10):
        reply_sender.put(lambda: times.append(time.monotonic()), lambda: None)
    reply_sender.close()
    reply_sender.join(patience(PATIENCE_S))
    assert len(times) == 10
    assert min(times) >= began + pause


def test_an_unused_sender_ends_at_once() -> None:
    reply_sender = ReplySender()
    reply_sender.close()
    reply_sender.join(patience(PATIENCE_S))
