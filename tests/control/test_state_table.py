"""The table of states and triggers: every cell of it, every refusal, and the trigger that a status gives."""

from __future__ import annotations

import itertools

import pytest

from robotiq_async.control.state_machine import (
    RUNNING,
    SEQUENCES,
    TABLE,
    Verdict,
    refusal,
    states_allowing,
)
from robotiq_async.control.triggers import classify
from robotiq_async.values.enums import Fault, State, Trigger
from robotiq_async.values.errors import (
    ConnectionLostError,
    GripperFaultError,
    InvalidStateError,
    NotActivatedError,
    NotStartedError,
    RobotiqError,
)
from tests.control.walks import Recorded, path_to
from tests.register_words import status_of

SEEN = [trigger for trigger in Trigger if trigger.is_seen]
CONNECTED = [*set(State) - {State.DISCONNECTED, State.DO_SHUTDOWN, State.SHUTDOWN}]
ABOUT_TO_SEND = [state for state in State if state.name.startswith("DO_")]
PAIRS = list(itertools.product(State, Trigger))


def test_every_state_has_an_entry_for_every_trigger() -> None:
    assert set(TABLE) == set(State)
    for row in TABLE.values():
        assert set(row) == set(Trigger)


def test_every_trigger_leads_somewhere() -> None:
    leading = {trigger for row in TABLE.values() for trigger, to in row.items() if isinstance(to, State)}
    assert leading == set(Trigger)


def test_every_state_can_be_reached_and_shut_down() -> None:
    for state in State:
        assert path_to(state) is not None, state
        assert path_to(State.SHUTDOWN, state) is not None, state


def test_every_state_but_the_last_two_can_be_stopped() -> None:
    assert {TABLE[state][Trigger.ASK_STOP] for state in (State.DISCONNECTED, *CONNECTED)} == {
        State.DO_SHUTDOWN
    }


def test_a_connected_hand_that_loses_its_link_is_disconnected() -> None:
    assert {TABLE[state][Trigger.LINK_LOST] for state in CONNECTED} == {State.DISCONNECTED}


def test_the_states_that_take_a_command_a_release_a_start_are_those_of_the_contract() -> None:
    assert states_allowing(Trigger.ASK_COMMAND) == RUNNING == {State.RUNNING_IDLE, State.RUNNING_CC}
    assert states_allowing(Trigger.ASK_RELEASE) == {State.FAULT}
    assert states_allowing(Trigger.ASK_START) == {State.DISCONNECTED, State.SHUTDOWN}


def test_an_activation_begins_in_reset_or_where_a_gripper_is_found_reset() -> None:
    beginning = {(state, trigger) for state, trigger in PAIRS if TABLE[state][trigger] is State.DO_ACTIVATION}
    assert beginning == {
        (State.RESET, Trigger.ASK_ACTIVATE),
        (State.DISCONNECTED, Trigger.ACTIVATES),
    }
    assert states_allowing(Trigger.ACTIVATES) == {State.DISCONNECTED}


def test_an_emergency_is_heard_in_every_state_of_a_hand_that_has_its_link() -> None:
    assert states_allowing(Trigger.ASK_HALT) == states_allowing(Trigger.ASK_RESET) == set(CONNECTED)
    for state in SEQUENCES - {State.DO_RESET}:
        assert TABLE[state][Trigger.ASK_HALT] is TABLE[state][Trigger.ASK_RESET] is State.DO_RESET
    # The request that ends every sequence is about to be sent already.
    assert TABLE[State.DO_RESET][Trigger.ASK_HALT] is Verdict.IGNORED
    assert TABLE[State.DO_RESET][Trigger.ASK_RESET] is Verdict.IGNORED


def test_what_is_seen_before_a_request_was_acknowledged_changes_nothing() -> None:
    for state in (*ABOUT_TO_SEND, State.SHUTDOWN):
        assert {TABLE[state][trigger] for trigger in SEEN} == {Verdict.IGNORED}, state


def test_nothing_that_is_seen_leads_to_a_state_that_sends_something() -> None:
    for state, trigger in itertools.product(State, SEEN):
        assert TABLE[state][trigger] not in ABOUT_TO_SEND


def test_a_reset_is_over_only_when_the_gripper_is_reset() -> None:
    row = TABLE[State.WF_RESET]
    assert [trigger for trigger in SEEN if isinstance(row[trigger], State)] == [Trigger.SEEN_RESET]


def test_what_the_gripper_does_is_never_refused() -> None:
    for state, trigger in itertools.product(State, SEEN):
        entry = TABLE[state][trigger]
        assert isinstance(entry, State) or entry is Verdict.IGNORED


# -- every pair of a state and a trigger -------------------------------------------------------------------


def test_a_pair_leads_on_is_ignored_or_is_refused() -> None:
    for state, trigger in PAIRS:
        recorded, target = Recorded(state), TABLE[state][trigger]
        if target is Verdict.IGNORED or isinstance(target, State):
            assert recorded.machine.fire(trigger) is (target is not Verdict.IGNORED), (state, trigger)
        else:
            with pytest.raises(RobotiqError):
                recorded.machine.fire(trigger)
        to = target if isinstance(target, State) else state
        assert recorded.machine.state is to, (state, trigger)
        assert recorded.changes == ([(state, to, trigger)] if to is not state else []), (state, trigger)


# -- every refusal -----------------------------------------------------------------------------------------

ASKED = (
    Trigger.ASK_START,
    Trigger.ASK_ACTIVATE,
    Trigger.ASK_COMMAND,
    Trigger.ASK_HOLD,
    Trigger.ASK_HALT,
    Trigger.ASK_RELEASE,
    Trigger.ASK_RESET,
    Trigger.ASK_STOP,
)
ERRORS: dict[str, type[RobotiqError]] = {
    "lost": ConnectionLostError,
    "off": NotStartedError,
    "reset": NotActivatedError,
    "fault": GripperFaultError,
    "not now": InvalidStateError,
}
CONTRACT = """
                start()  activate()  command  hold()   halt()   atr()    reset()  stop()
DISCONNECTED  | goes   | lost      | lost   | lost   | lost   | lost   | lost   | goes
DO_ACTIVATION | not now| nothing   | not now| nothing| goes   | not now| goes   | goes
WF_ACTIVATION | not now| nothing   | not now| nothing| goes   | not now| goes   | goes
RUNNING_IDLE  | not now| nothing   | goes   | goes   | goes   | not now| goes   | goes
RUNNING_CC    | not now| nothing   | goes   | goes   | goes   | not now| goes   | goes
FAULT         | not now| fault     | fault  | goes   | goes   | goes   | goes   | goes
DO_ATR        | not now| not now   | not now| nothing| goes   | not now| goes   | goes
WF_ATR        | not now| not now   | not now| nothing| goes   | not now| goes   | goes
ATR_DONE      | not now| fault     | fault  | nothing| nothing| not now| goes   | goes
DO_RESET      | not now| not now   | not now| nothing| nothing| not now| nothing| goes
WF_RESET      | not now| not now   | not now| nothing| goes   | not now| goes   | goes
RESET         | not now| goes      | reset  | nothing| nothing| not now| goes   | goes
DO_SHUTDOWN   | not now| off       | off    | off    | off    | off    | off    | nothing
SHUTDOWN      | goes   | off       | off    | off    | off    | off    | off    | nothing
"""
"""What becomes of what is asked: "goes" to a state or stays, "nothing" to do, or the error."""


def contract() -> dict[tuple[State, Trigger], str]:
    cells = {}
    for line in CONTRACT.strip().splitlines()[1:]:
        name, *words = (word.strip() for word in line.split("|"))
        for trigger, word in zip(ASKED, words, strict=True):
            cells[State[name], trigger] = word
    return cells


ANSWERS = contract()


def test_the_contract_has_every_state_and_everything_that_can_be_asked() -> None:
    assert set(ANSWERS) == set(itertools.product(State, ASKED))
    assert set(ASKED) == {trigger for trigger in Trigger if trigger.name.startswith("ASK_")}


@pytest.mark.parametrize("state", State)
def test_what_is_asked_goes_is_nothing_to_do_or_is_refused_with_the_error_that_says_why(state: State) -> None:
    status = status_of(0x31, fault=0x0E)
    for trigger in ASKED:
        recorded, answer = Recorded(state), ANSWERS[state, trigger]
        machine = recorded.machine
        if answer in ERRORS:
            with pytest.raises(RobotiqError) as caught:
                machine.fire(trigger, status)
            assert type(caught.value) is ERRORS[answer], trigger
            if isinstance(caught.value, GripperFaultError):
                assert caught.value.fault is status.fault
            if isinstance(caught.value, InvalidStateError):
                assert caught.value.state is state
                would_do = {each for each in State if ANSWERS[each, trigger] not in ERRORS}
                assert caught.value.allowed == would_do, trigger
        else:
            assert machine.fire(trigger, status) is (answer == "goes"), trigger
        if answer != "goes":
            assert machine.state is state
            assert not recorded.changes


def test_a_verdict_is_named_after_the_error_it_means() -> None:
    for state, trigger in PAIRS:
        verdict = TABLE[state][trigger]
        if isinstance(verdict, Verdict) and verdict is not Verdict.IGNORED:
            assert type(refusal(trigger, state)).__name__ == verdict.value, (state, trigger)


def test_a_fault_that_nobody_has_seen_is_refused_all_the_same() -> None:
    error = refusal(Trigger.ASK_COMMAND, State.FAULT)
    assert isinstance(error, GripperFaultError)
    assert error.fault is Fault.NONE


def test_a_refusal_names_what_was_asked_the_state_and_the_states_that_would_do() -> None:
    for trigger in Trigger:
        if TABLE[State.WF_ATR][trigger] is Verdict.NOT_NOW:
            message = str(refusal(trigger, State.WF_ATR))
            assert trigger.value in message
            assert "WF_ATR" in message
            assert [state for state in states_allowing(trigger) if state.name not in message] == []


# -- what a status shows -----------------------------------------------------------------------------------


def test_what_a_status_shows_is_one_of_five_conditions() -> None:
    seen = [trigger for trigger in Trigger if trigger.is_seen]
    assert seen == [trigger for trigger in Trigger if trigger.name.startswith("SEEN_")]
    assert len(seen) == 5


@pytest.mark.parametrize(
    ("byte_0", "byte_1", "fault", "condition"),
    [
        (0x00, 0x00, 0x00, Trigger.SEEN_RESET),
        (0x01, 0x00, 0x00, Trigger.SEEN_BUSY),  # rACT taken over, not begun yet
        (0x11, 0x00, 0x00, Trigger.SEEN_BUSY),  # activating
        (0x21, 0x00, 0x00, Trigger.SEEN_BUSY),  # changing mode
        (0x30, 0x00, 0x00, Trigger.SEEN_BUSY),  # rACT cleared, not reset yet
        (0x31, 0x00, 0x00, Trigger.SEEN_READY),
        (0x39, 0xC0, 0x00, Trigger.SEEN_READY),  # closing
        (0xB9, 0xEA, 0x00, Trigger.SEEN_READY),  # object held
        (0xF9, 0xFF, 0x00, Trigger.SEEN_READY),  # position reached
        # Priority codes are no faults.
        (0x11, 0x00, 0x05, Trigger.SEEN_BUSY),
        (0x21, 0x00, 0x06, Trigger.SEEN_BUSY),
        (0x00, 0x00, 0x07, Trigger.SEEN_RESET),
        (0x31, 0x00, 0x07, Trigger.SEEN_READY),
        # Minor and major ones are, whatever else the status shows.
        (0x00, 0x00, 0x09, Trigger.SEEN_FAULT),
        (0x39, 0x00, 0x0A, Trigger.SEEN_FAULT),
        (0x11, 0x00, 0x0D, Trigger.SEEN_FAULT),
        (0x39, 0x00, 0x0E, Trigger.SEEN_FAULT),
        (0x31, 0x00, 0x0C, Trigger.SEEN_FAULT),  # unassigned
        # gIMC = 0 with a fault is an automatic release and not a reset.
        (0x01, 0x00, 0x0B, Trigger.SEEN_FAULT),
        (0x09, 0x00, 0x0B, Trigger.SEEN_FAULT),
        (0x00, 0x00, 0x0B, Trigger.SEEN_FAULT),
        (0x01, 0x00, 0x0F, Trigger.SEEN_RELEASED),
        (0x00, 0x00, 0x0F, Trigger.SEEN_RELEASED),
        (0x31, 0x00, 0xF0, Trigger.SEEN_READY),  # the high nibble is no fault code
    ],
)
def test_a_status_shows(byte_0: int, byte_1: int, fault: int, condition: Trigger) -> None:
    assert classify(status_of(byte_0, byte_1, fault)) is condition


@pytest.mark.parametrize("code", range(1, 16))
def test_no_fault_that_matters_is_taken_for_a_reset(code: int) -> None:
    status = status_of(0x00, fault=code)
    assert (classify(status) is Trigger.SEEN_RESET) == (code in (0x05, 0x06, 0x07))
