"""Answers go out from a thread of their own: where nobody reads, only that one waits."""

from __future__ import annotations

import threading

from robotiq_async.fleet.network.mailbox import MOST_REPLIES, ReplySender

PATIENCE_S = 10.0


def test_answers_go_out_in_their_order_and_then_it_ends() -> None:
    reply_sender, sent = ReplySender(), list[int]()
    for number in range(100):
        reply_sender.put(lambda number=number: sent.append(number), lambda: sent.append(-1))  # type: ignore[misc]
    reply_sender.close()
    reply_sender.join(PATIENCE_S)
    assert sent == list(range(100))


def test_whoever_does_not_read_holds_up_nobody_and_too_much_is_dropped_in_the_thread() -> None:
    """Dropping a question says so to whoever asked, and takes as long as an answer: it held up the loop."""
    reply_sender, read = ReplySender(), threading.Event()
    sent, dropped_in = list[int](), set[threading.Thread]()
    reply_sender.put(lambda: (read.wait(PATIENCE_S), None)[1], lambda: None)
    for number in range(2 * MOST_REPLIES):
        reply_sender.put(
            lambda number=number: sent.append(number),  # type: ignore[misc]
            lambda: dropped_in.add(threading.current_thread()),
        )
    assert not sent
    read.set()
    reply_sender.close()
    reply_sender.join(PATIENCE_S)
    assert MOST_REPLIES - 1 <= len(sent) <= MOST_REPLIES
    assert dropped_in
    assert threading.current_thread() not in dropped_in


def test_one_that_was_never_used_ends_at_once() -> None:
    reply_sender = ReplySender()
    reply_sender.close()
    reply_sender.join(PATIENCE_S)
