"""The state machine: each cell of its table, each refusal, and the conditions in a status."""

from __future__ import annotations

import itertools
import logging

import pytest

from robotiq_async.control.evidence import classify
from robotiq_async.control.state_machine import StateMachine
from robotiq_async.values.enums import Fault, State, Trigger
from robotiq_async.values.errors import (
    ConnectionLostError,
    GripperFaultError,
    InvalidStateError,
    NotActivatedError,
    NotStartedError,
    RobotiqError,
)
from robotiq_async.values.states import RUNNING, SEQUENCES, TABLE, Verdict, refusal, states_allowing
from tests.register_words import status_of


class Recorded:
    """A machine in a state, and the changes it has reported since."""

    def __init__(self, state: State) -> None:
        self.changes: list[tuple[State, State, Trigger]] = []
        self.machine = StateMachine()
        self.machine.begin(lambda *change: self.changes.append(change))
        self.machine.show(state, Trigger.ASK_START)
        assert self.machine.state is state
        self.changes.clear()


# -- every state and trigger -------------------------------------------------------------------------------

GOES = {
    Trigger.ASK_START: State.DISCONNECTED,
    Trigger.ASK_ACTIVATE: State.DO_ACTIVATION,
    Trigger.ASK_COMMAND: State.RUNNING_CC,
    Trigger.ASK_HOLD: State.RUNNING_CC,
    Trigger.ASK_HALT: State.RUNNING_CC,
    Trigger.ASK_RELEASE: State.DO_ATR,
    Trigger.ASK_RESET: State.DO_RESET,
    Trigger.ASK_STOP: State.DO_SHUTDOWN,
    Trigger.HALT_RESETS: State.DO_RESET,
}
ASKED = """
                start()  activate()  command  hold()   halt()   atr()    reset()  stop()   halt(), by a reset
DISCONNECTED  | goes   | lost      | lost   | lost   | lost   | lost   | lost   | goes   | lost
DO_ACTIVATION | not now| nothing   | not now| nothing| resets | not now| goes   | goes   | goes
WF_ACTIVATION | not now| nothing   | not now| nothing| resets | not now| goes   | goes   | goes
RUNNING_IDLE  | not now| nothing   | goes   | goes   | goes   | not now| goes   | goes   | goes
RUNNING_CC    | not now| nothing   | goes   | goes   | goes   | not now| goes   | goes   | goes
FAULT         | not now| fault     | fault  | stays  | stays  | goes   | goes   | goes   | goes
DO_ATR        | not now| not now   | not now| nothing| resets | not now| goes   | goes   | goes
WF_ATR        | not now| not now   | not now| nothing| resets | not now| goes   | goes   | goes
ATR_DONE      | not now| fault     | fault  | nothing| nothing| not now| goes   | goes   | goes
DO_RESET      | not now| not now   | not now| nothing| nothing| not now| nothing| goes   | nothing
WF_RESET      | not now| not now   | not now| nothing| resets | not now| goes   | goes   | goes
RESET         | not now| goes      | reset  | nothing| nothing| not now| goes   | goes   | goes
DO_SHUTDOWN   | not now| off       | off    | off    | off    | off    | off    | nothing| off
SHUTDOWN      | goes   | off       | off    | off    | off    | off    | off    | nothing| off
"""
"""The fate of each request: the next state, "nothing" to do, or the error."""
LEADS = {
    Trigger.SEEN_READY: State.RUNNING_IDLE,
    Trigger.SEEN_BUSY: State.WF_ACTIVATION,
    Trigger.SEEN_RESET: State.RESET,
    Trigger.SEEN_STRANDED: State.RESET,
    Trigger.SEEN_FAULT: State.FAULT,
    Trigger.SEEN_RELEASED: State.ATR_DONE,
}
HAPPENS = """
                active   busy     reset    stranded fault    released  acknowledged    link lost      stopped
DISCONNECTED  | leads  | leads  | leads  | leads  | leads  | leads   | not now       | stays        | not now
DO_ACTIVATION | nothing| nothing| nothing| nothing| nothing| nothing | WF_ACTIVATION | DISCONNECTED | not now
WF_ACTIVATION | leads  | leads  | leads  | leads  | leads  | leads   | not now       | DISCONNECTED | not now
RUNNING_IDLE  | leads  | leads  | leads  | leads  | leads  | leads   | not now       | DISCONNECTED | not now
RUNNING_CC    | stays  | leads  | leads  | leads  | leads  | leads   | RUNNING_IDLE  | DISCONNECTED | not now
FAULT         | leads  | leads  | leads  | leads  | leads  | leads   | not now       | DISCONNECTED | not now
DO_ATR        | nothing| nothing| nothing| nothing| nothing| nothing | WF_ATR        | DISCONNECTED | not now
WF_ATR        | leads  | leads  | leads  | leads  | leads  | leads   | not now       | DISCONNECTED | not now
ATR_DONE      | leads  | leads  | leads  | leads  | leads  | leads   | not now       | DISCONNECTED | not now
DO_RESET      | nothing| nothing| nothing| nothing| nothing| nothing | WF_RESET      | DISCONNECTED | not now
WF_RESET      | nothing| nothing| leads  | nothing| nothing| nothing | not now       | DISCONNECTED | not now
RESET         | leads  | leads  | leads  | leads  | leads  | leads   | not now       | DISCONNECTED | not now
DO_SHUTDOWN   | nothing| nothing| nothing| nothing| nothing| nothing | not now       | nothing      | SHUTDOWN
SHUTDOWN      | nothing| nothing| nothing| nothing| nothing| nothing | not now       | nothing      | nothing
"""
"""A condition in a status never leads to a state that sends something, and none before an acknowledgement."""
HAPPENING = (*LEADS, Trigger.DELIVERED, Trigger.LINK_LOST, Trigger.STOPPED)
ERRORS: dict[str, type[RobotiqError]] = {
    "lost": ConnectionLostError,
    "off": NotStartedError,
    "reset": NotActivatedError,
    "fault": GripperFaultError,
    "not now": InvalidStateError,
}


def contract() -> dict[tuple[State, Trigger], State | str]:
    """The next state for every state and trigger, "nothing", or a key of the errors."""
    cells: dict[tuple[State, Trigger], State | str] = {}
    for table, triggers in ((ASKED, tuple(GOES)), (HAPPENS, HAPPENING)):
        for line in table.strip().splitlines()[1:]:
            name, *words = (word.strip() for word in line.split("|"))
            state = State[name]
            for trigger, word in zip(triggers, words, strict=True):
                where = {"stays": state, "resets": State.DO_RESET} | State.__members__
                target = (GOES | LEADS).get(trigger) if word in ("goes", "leads") else where.get(word)
                cells[state, trigger] = target or word
    activates = dict.fromkeys(itertools.product(State, [Trigger.ACTIVATES]), "not now")
    return cells | activates | {(State.DISCONNECTED, Trigger.ACTIVATES): State.DO_ACTIVATION}


ANSWERS = contract()
PAIRS = list(itertools.product(State, Trigger))


def test_the_contract_has_every_state_and_trigger() -> None:
    assert set(ANSWERS) == set(PAIRS)
    assert [trigger for trigger in Trigger if trigger.is_seen] == list(LEADS)


def test_the_table_is_that_of_the_contract() -> None:
    table = {(state, trigger): TABLE[state][trigger] for state, trigger in PAIRS}
    words: dict[State | Verdict, State | str] = {
        Verdict.IGNORED: "nothing",
        Verdict.LINK_DOWN: "lost",
        Verdict.NOT_STARTED: "off",
        Verdict.NOT_ACTIVATED: "reset",
        Verdict.IN_FAULT: "fault",
        Verdict.NOT_NOW: "not now",
    }
    assert {pair: words.get(cell, cell) for pair, cell in table.items()} == ANSWERS


@pytest.mark.parametrize("state", State)
def test_what_is_asked_is_something_or_nothing_to_do_or_refused_with_the_error_that_says_why(
    state: State,
) -> None:
    status = status_of(0x31, fault=0x0E)
    for trigger in Trigger:
        recorded, answer = Recorded(state), ANSWERS[state, trigger]
        machine = recorded.machine
        if isinstance(answer, State) or answer == "nothing":
            assert machine.ask(trigger, status) is (answer != "nothing"), trigger
        else:
            with pytest.raises(RobotiqError) as caught:
                machine.ask(trigger, status)
            assert type(caught.value) is ERRORS[answer], trigger
            if isinstance(caught.value, GripperFaultError):
                assert caught.value.fault is status.fault
            if isinstance(caught.value, InvalidStateError):
                assert caught.value.state is state
                assert caught.value.allowed == states_allowing(trigger), trigger
        assert machine.state is state, "a question changes nothing"
        assert not recorded.changes, trigger


def test_the_states_that_allow_something_are_those_of_the_contract() -> None:
    for trigger in Trigger:
        allowed = {state for state in State if ANSWERS[state, trigger] not in ERRORS}
        assert states_allowing(trigger) == allowed, trigger
    assert states_allowing(Trigger.ASK_COMMAND) == RUNNING
    ended_by_a_reset = {state for state in State if ANSWERS[state, Trigger.ASK_HALT] is State.DO_RESET}
    assert ended_by_a_reset | {State.DO_RESET} == SEQUENCES


def test_a_verdict_is_named_after_the_error_it_means() -> None:
    for state, trigger in PAIRS:
        verdict = TABLE[state][trigger]
        if isinstance(verdict, Verdict) and verdict is not Verdict.IGNORED:
            assert type(refusal(trigger, state)).__name__ == verdict.value, (state, trigger)


def test_a_refusal_in_fault_needs_no_status() -> None:
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


# -- the machine -------------------------------------------------------------------------------------------


def test_a_machine_begins_disconnected_and_tells_a_change_when_it_has_happened() -> None:
    seen: list[State] = []
    machine = StateMachine()
    machine.begin(lambda *_: seen.append(machine.state))
    assert machine.state is State.DISCONNECTED
    machine.show(State.RESET, Trigger.SEEN_RESET)
    machine.show(State.RESET, Trigger.SEEN_RESET)
    assert seen == [State.RESET]


def test_commands_are_logged_for_debugging_and_other_changes_as_info(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with caplog.at_level(logging.DEBUG, logger="robotiq_async"):
        machine = StateMachine()
        machine.show(State.RUNNING_IDLE, Trigger.SEEN_READY)
        machine.show(State.RUNNING_CC, Trigger.ASK_COMMAND)
        machine.show(State.RUNNING_IDLE, Trigger.DELIVERED)
        machine.show(State.FAULT, Trigger.SEEN_FAULT)
    assert [(record.levelname, record.getMessage()) for record in caplog.records] == [
        ("INFO", "DISCONNECTED -> RUNNING_IDLE (gripper is active)"),
        ("DEBUG", "RUNNING_IDLE -> RUNNING_CC (a command)"),
        ("DEBUG", "RUNNING_CC -> RUNNING_IDLE (request acknowledged)"),
        ("INFO", "RUNNING_IDLE -> FAULT (gripper reports a fault)"),
    ]


# -- conditions in a status --------------------------------------------------------------------------------


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
        # Minor and major ones are, whatever else the status has.
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
