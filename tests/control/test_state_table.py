"""The table of states and triggers: every cell of it, and every refusal."""

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
from robotiq_async.values.enums import Fault, State
from robotiq_async.values.errors import (
    ConnectionLostError,
    GripperFaultError,
    InvalidStateError,
    NotActivatedError,
    NotStartedError,
    RobotiqError,
)
from robotiq_async.values.trigger import Trigger
from tests.control.walks import Recorded, path_to
from tests.register_words import status_of

SEEN = [trigger for trigger in Trigger if trigger.is_seen]
STOPPABLE = [state for state in State if state not in (State.DO_SHUTDOWN, State.SHUTDOWN)]
CONNECTED = [state for state in STOPPABLE if state is not State.DISCONNECTED]
ABOUT_TO_SEND = [state for state in State if state.name.startswith("DO_")]
PAIRS = list(itertools.product(State, Trigger))


def test_every_state_has_an_entry_for_every_trigger() -> None:
    assert set(TABLE) == set(State)
    for row in TABLE.values():
        assert set(row) == set(Trigger)


def test_every_trigger_leads_somewhere() -> None:
    leading = {trigger for row in TABLE.values() for trigger, to in row.items() if isinstance(to, State)}
    assert leading == set(Trigger)


@pytest.mark.parametrize("state", State)
def test_every_state_can_be_reached(state: State) -> None:
    assert path_to(state) is not None


@pytest.mark.parametrize("state", State)
def test_from_every_state_the_hand_can_be_shut_down(state: State) -> None:
    assert path_to(State.SHUTDOWN, state) is not None


@pytest.mark.parametrize("state", STOPPABLE)
def test_every_state_but_the_last_two_can_be_stopped(state: State) -> None:
    assert TABLE[state][Trigger.ASK_STOP] is State.DO_SHUTDOWN


@pytest.mark.parametrize("state", CONNECTED)
def test_a_connected_hand_that_loses_its_link_is_disconnected(state: State) -> None:
    assert TABLE[state][Trigger.LINK_LOST] is State.DISCONNECTED


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


@pytest.mark.parametrize("state", [*ABOUT_TO_SEND, State.SHUTDOWN])
def test_what_is_seen_before_a_request_was_acknowledged_changes_nothing(state: State) -> None:
    assert {TABLE[state][trigger] for trigger in SEEN} == {Verdict.IGNORED}


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


@pytest.mark.parametrize(("state", "trigger"), PAIRS)
def test_a_pair_leads_on_is_ignored_or_is_refused(state: State, trigger: Trigger) -> None:
    recorded = Recorded(state)
    target = TABLE[state][trigger]
    if isinstance(target, State):
        assert recorded.machine.fire(trigger) is True
        assert recorded.machine.state is target
        assert recorded.changes == ([(state, target, trigger)] if target is not state else [])
        return
    if target is Verdict.IGNORED:
        assert recorded.machine.fire(trigger) is False
    else:
        with pytest.raises(RobotiqError):
            recorded.machine.fire(trigger)
    assert recorded.machine.state is state
    assert not recorded.changes


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


@pytest.mark.parametrize(("state", "trigger"), ANSWERS)
def test_what_is_asked_goes_is_nothing_to_do_or_is_refused_with_the_error_that_says_why(
    state: State, trigger: Trigger
) -> None:
    recorded, answer = Recorded(state), ANSWERS[state, trigger]
    machine, status = recorded.machine, status_of(0x31, fault=0x0E)
    if answer in ERRORS:
        with pytest.raises(RobotiqError) as caught:
            machine.fire(trigger, status)
        assert type(caught.value) is ERRORS[answer]
        if isinstance(caught.value, GripperFaultError):
            assert caught.value.fault is status.fault
        if isinstance(caught.value, InvalidStateError):
            assert caught.value.state is state
            would_do = {each for each in State if ANSWERS[each, trigger] not in ERRORS}
            assert caught.value.allowed == would_do
    else:
        assert machine.fire(trigger, status) is (answer == "goes")
    if answer != "goes":
        assert machine.state is state
        assert not recorded.changes


@pytest.mark.parametrize(("state", "trigger"), PAIRS)
def test_a_verdict_is_named_after_the_error_it_means(state: State, trigger: Trigger) -> None:
    verdict = TABLE[state][trigger]
    if isinstance(verdict, Verdict) and verdict is not Verdict.IGNORED:
        assert type(refusal(trigger, state)).__name__ == verdict.value


def test_a_fault_that_nobody_has_seen_is_refused_all_the_same() -> None:
    error = refusal(Trigger.ASK_COMMAND, State.FAULT)
    assert isinstance(error, GripperFaultError)
    assert error.fault is Fault.NONE


@pytest.mark.parametrize("trigger", Trigger)
def test_a_refusal_names_what_was_asked_the_state_and_the_states_that_would_do(trigger: Trigger) -> None:
    if TABLE[State.WF_ATR][trigger] is not Verdict.NOT_NOW:
        return
    message = str(refusal(trigger, State.WF_ATR))
    assert trigger.value in message
    assert "WF_ATR" in message
    for state in states_allowing(trigger):
        assert state.name in message
