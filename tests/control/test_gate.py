"""No image activates or releases by accident, whatever was requested and whatever the gripper reports."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async import Finger, RobotiqError, State
from robotiq_async.control.controller import Controller
from robotiq_async.control.gate import gate
from robotiq_async.control.pending import changes
from robotiq_async.control.state_machine import StateMachine
from robotiq_async.control.waiters import Move
from robotiq_async.values.enums import StopLevel
from robotiq_async.values.model import MODELS, Model
from robotiq_async.values.request import Request
from robotiq_async.values.status import RobotiqStatus
from tests.control.scan import POLL_S, Outcome, first_request
from tests.register_words import status_of

ACTIVE, RESET = status_of(0x39), status_of(0x00)


@pytest.mark.parametrize("activate", [False, True])
@pytest.mark.parametrize("release", [False, True])
@pytest.mark.parametrize("status", [ACTIVE, RESET], ids=["active", "reset"])
def test_an_image_has_ract_if_the_gripper_shows_it_and_ratr_never(
    activate: bool, release: bool, status: RobotiqStatus
) -> None:
    image = gate(Request(activate=activate, release=release, go=True), status)
    assert image == Request(activate=activate and status is ACTIVE, go=True)


def test_an_activation_raises_ract_and_a_release_ratr() -> None:
    image = Request(activate=True, release=True)
    assert gate(image, RESET, activates=True) == Request(activate=True)
    assert gate(image, ACTIVE, releases=True) == image
    assert gate(Request(), ACTIVE, activates=True, releases=True) == Request(), "it adds nothing"


CALLS: dict[str, Callable[[Controller, int], object]] = {
    "command": lambda hand, value: hand.command(changes(Finger.A, value, value, value), Outcome()),
    "move": lambda hand, value: hand.move(Move(value, Finger.A, 0.0, Outcome()), value, None),
    "hold": lambda hand, _: hand.hold(Finger.A, Outcome()),
    "halt": lambda hand, _: hand.halt(Outcome()),
    "activate": lambda hand, _: hand.activate(),
    "reset": lambda hand, _: hand.reset(),
    "release": lambda hand, _: hand.release(),
    "lost": lambda hand, _: hand.lost(None),
    "refuse requests": lambda hand, _: hand.refuse_requests(),
    "stop fingers": lambda hand, value: hand.stop_fingers(
        StopLevel.KEEP if value > 127 else StopLevel.SHUTDOWN
    ),
}
words = st.integers(0, 0xFFFF)
# Mostly of a gripper that is active, reset, in a fault or activating: random words seldom are.
first = st.sampled_from([0x3900, 0x31FF, 0x39AA, 0x0000, 0x1100, 0x3100, 0x0100]) | words
statuses = st.tuples(first, st.sampled_from([0, 0x0500, 0x0900, 0x0E00, 0x0F00]) | words, words, words)
steps = st.tuples(st.sampled_from([*CALLS, "", "", ""]), st.integers(0, 255), statuses, st.booleans())


@given(st.sampled_from([*MODELS.values()]), st.floats(0, 0.01), st.booleans(), st.lists(steps, max_size=25))
def test_whatever_is_asked_and_shown_ract_rises_and_ratr_is_set_only_where_it_was_asked_for(
    model: Model, spacing: float, activates: bool, life: list[tuple[str, int, tuple[int, ...], bool]]
) -> None:
    machine = StateMachine()
    hand = Controller(machine, first_request(model=model), spacing)
    hand.activates = activates
    for number, (call, value, registers, is_answered) in enumerate(life):
        now = 100 + number * POLL_S
        hand.see(RobotiqStatus((*registers, 0, 0, 0, 0), now, number, model), now)
        if call:
            with contextlib.suppress(RobotiqError):
                CALLS[call](hand, value)
        state, status = machine.state, hand.status
        assert status is not None
        image = hand.decide(now)
        if image is None:
            continue
        assert not image.activate or status.activation_echo or state is State.DO_ACTIVATION
        assert not image.release or state is State.DO_ATR
        if is_answered:
            hand.acknowledged(now)
        else:
            hand.lost(None)
