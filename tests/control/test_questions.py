"""Queries change nothing: a hand that answers all of them decides as one that answers none."""

from __future__ import annotations

import contextlib

from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.control.controller import Controller
from robotiq_async.control.ledger import Ledger
from robotiq_async.control.rest import LAG_READS, LAG_S
from robotiq_async.control.state_machine import StateMachine
from robotiq_async.values.enums import NO_AXES, Finger
from robotiq_async.values.errors import RobotiqError
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.status import RobotiqStatus
from tests.control.histories import image, shows
from tests.control.scan import POLL_S, first_request
from tests.control.test_gate import CALLS, steps


def answers(hand: Controller, now: float) -> list[object]:
    """The answers to all queries of a hand."""
    return [
        hand.is_moving,
        hand.evidence.is_undecided,
        hand.has_request,
        hand.has_open_stop,
        hand.is_busy,
        hand.next_write(now),
    ]


class Hand:
    """A hand, with or without queries, and all that it does."""

    def __init__(self, *, is_asked: bool, activates: bool) -> None:
        self.machine = StateMachine()
        self.controller = Controller(self.machine, first_request(), 0.01)
        self.controller.activates = activates
        self.is_asked = is_asked
        self.done: list[object] = []

    def ask(self, now: float) -> None:
        if self.is_asked:
            assert answers(self.controller, now) == answers(self.controller, now)

    def live(self, call: str, value: int, status: RobotiqStatus, *, is_answered: bool) -> None:
        hand, now = self.controller, status.timestamp
        hand.see(status, now)
        self.ask(now)
        if call:
            with contextlib.suppress(RobotiqError):
                CALLS[call](hand, value)
            self.ask(now)
        written = hand.decide(now)
        self.ask(now)
        if written is not None:
            hand.acknowledged(now) if is_answered else hand.lost(None)
            self.ask(now)
        self.done += [written, self.machine.state, hand.is_moving]


@given(st.booleans(), st.lists(steps, max_size=25))
def test_a_hand_that_is_asked_everything_does_what_one_does_that_is_asked_nothing(
    activates: bool, life: list[tuple[str, int, tuple[int, ...], bool]]
) -> None:
    hands = [Hand(is_asked=is_asked, activates=activates) for is_asked in (False, True)]
    for number, (call, value, registers, is_answered) in enumerate(life):
        status = RobotiqStatus((*registers, 0, 0, 0, 0), 100 + number * POLL_S, number, THREE_FINGER)
        for hand in hands:
            hand.live(call, value, status, is_answered=is_answered)
    assert hands[0].done == hands[1].done


def known_to_rest(*, is_asked: bool) -> Finger:
    """The axes that are known to rest just after a fault, in which a request of theirs was echoed."""
    ledger, at = Ledger(first_request()), 1.0
    ledger.update(shows(100, at), at)
    ledger.adopt(shows(100, at))
    ledger.write(image(200), Finger.ALL, at)
    ledger.acknowledge(at)
    for _ in range(2 * LAG_READS):
        at += LAG_S / LAG_READS
        ledger.update(shows(200, at), at)
        if is_asked:
            for _ in range(2):
                ledger.requests.may_move(shows(200, at), ledger.now)
    ledger.update(status := shows(150, at), at)
    ledger.update_rest(status)
    ledger.update_rest(status)
    return Finger.ABC & ~ledger.requests.unrested


def test_whether_an_axis_rests_does_not_depend_on_who_has_asked() -> None:
    assert known_to_rest(is_asked=True) == known_to_rest(is_asked=False)
    assert known_to_rest(is_asked=False) == NO_AXES
