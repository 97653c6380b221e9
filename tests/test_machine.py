"""The table of states: exhaustively, and as stories."""

from __future__ import annotations

import itertools
import logging
from collections import deque

import pytest

from robotiq_async.control.state_machine import (
    RUNNING,
    SEQUENCES,
    TRANSITIONS,
    Machine,
    Trigger,
    look,
    refusal,
    states_allowing,
)
from robotiq_async.enums import State
from robotiq_async.errors import InvalidStateError
from tests.words import status_of

SIGHTS = [trigger for trigger in Trigger if trigger.name.startswith("SEEN_")]
STOPPABLE = [state for state in State if state not in (State.DO_SHUTDOWN, State.SHUTDOWN)]
CONNECTED = [state for state in STOPPABLE if state is not State.DISCONNECTED]


def path_to(target: State, start: State = State.DISCONNECTED) -> list[Trigger] | None:
    """The shortest way through the table, or None."""
    ways: dict[State, list[Trigger]] = {start: []}
    queue = deque([start])
    while queue:
        state = queue.popleft()
        for trigger, following in TRANSITIONS[state].items():
            if following not in ways:
                ways[following] = [*ways[state], trigger]
                queue.append(following)
    return ways.get(target)


class Recorded:
    """A machine that has walked to a state, and the changes it has told since."""

    def __init__(self, state: State) -> None:
        self.changes: list[tuple[State, State, Trigger]] = []
        self.machine = Machine(lambda *change: self.changes.append(change))
        path = path_to(state)
        assert path is not None, f"{state} is out of reach"
        for trigger in path:
            self.machine.happen(trigger)
        assert self.machine.state is state
        self.changes.clear()


# -- the table ---------------------------------------------------------------------------------------------


def test_every_state_has_a_row() -> None:
    assert set(TRANSITIONS) == set(State)


def test_every_trigger_is_used() -> None:
    assert {trigger for row in TRANSITIONS.values() for trigger in row} == set(Trigger)


@pytest.mark.parametrize("state", State)
def test_every_state_can_be_reached(state: State) -> None:
    assert path_to(state) is not None


@pytest.mark.parametrize("state", State)
def test_from_every_state_the_hand_can_be_shut_down(state: State) -> None:
    assert path_to(State.SHUTDOWN, state) is not None


@pytest.mark.parametrize("state", STOPPABLE)
def test_every_state_but_the_last_two_can_be_stopped(state: State) -> None:
    assert TRANSITIONS[state][Trigger.ASK_STOP] is State.DO_SHUTDOWN


@pytest.mark.parametrize("state", CONNECTED)
def test_a_connected_hand_that_loses_its_link_is_disconnected(state: State) -> None:
    assert TRANSITIONS[state][Trigger.LINK_LOST] is State.DISCONNECTED


def test_the_states_that_take_an_activation_a_command_a_release_are_those_of_the_contract() -> None:
    assert states_allowing(Trigger.ASK_ACTIVATE) == {State.DISCONNECTED, State.RESET}
    assert states_allowing(Trigger.ASK_COMMAND) == RUNNING == {State.RUNNING_IDLE, State.RUNNING_CC}
    assert states_allowing(Trigger.ASK_RELEASE) == {State.FAULT}
    assert states_allowing(Trigger.ASK_START) == {State.DISCONNECTED, State.SHUTDOWN}


def test_an_emergency_is_heard_in_every_state_of_a_hand_that_has_its_link() -> None:
    connected = states_allowing(Trigger.ASK_STOP) - {State.DISCONNECTED}
    assert states_allowing(Trigger.ASK_HALT) == states_allowing(Trigger.ASK_RESET) == connected
    for state in SEQUENCES:
        assert TRANSITIONS[state][Trigger.ASK_HALT] is State.DO_RESET


def test_a_sight_is_what_its_name_says() -> None:
    assert [trigger for trigger in Trigger if trigger.is_sight] == SIGHTS
    assert len(SIGHTS) == 5


@pytest.mark.parametrize(
    "state", [state for state in State if state.name.startswith("DO_") or state is State.SHUTDOWN]
)
def test_what_is_seen_before_a_request_was_acknowledged_changes_nothing(state: State) -> None:
    assert not set(SIGHTS) & set(TRANSITIONS[state])


def test_no_sight_leads_to_a_state_that_sends_something() -> None:
    for row in TRANSITIONS.values():
        for trigger in set(SIGHTS) & set(row):
            assert not row[trigger].name.startswith("DO_")


def test_a_reset_is_over_only_when_the_gripper_is_reset() -> None:
    assert set(SIGHTS) & set(TRANSITIONS[State.WF_RESET]) == {Trigger.SEEN_RESET}


# -- every pair of a state and a trigger -------------------------------------------------------------------


@pytest.mark.parametrize(("state", "trigger"), list(itertools.product(State, Trigger)))
def test_a_pair_is_in_the_table_or_ignored_or_refused(state: State, trigger: Trigger) -> None:
    recorded = Recorded(state)
    target = TRANSITIONS[state].get(trigger)
    if target is not None:
        assert recorded.machine.happen(trigger) is target
        assert recorded.machine.state is target
        assert recorded.changes == ([(state, target, trigger)] if target is not state else [])
    elif trigger in SIGHTS:
        assert recorded.machine.happen(trigger) is state
        assert recorded.machine.state is state
        assert not recorded.changes
    else:
        with pytest.raises(InvalidStateError) as caught:
            recorded.machine.happen(trigger)
        assert recorded.machine.state is state
        assert not recorded.changes
        assert caught.value.state is state
        assert caught.value.allowed == {each for each in State if trigger in TRANSITIONS[each]}
        assert state not in caught.value.allowed


@pytest.mark.parametrize("trigger", Trigger)
def test_a_refusal_names_what_was_asked_the_state_and_the_states_that_would_do(trigger: Trigger) -> None:
    message = str(refusal(trigger, State.WF_ATR))
    assert trigger.value in message
    assert "WF_ATR" in message
    for state in states_allowing(trigger):
        assert state.name in message


def test_after_a_refusal_the_machine_goes_on_as_if_nothing_had_been_asked() -> None:
    machine = Machine()
    machine.happen(Trigger.SEEN_READY)
    with pytest.raises(InvalidStateError):
        machine.happen(Trigger.ASK_RELEASE)
    assert machine.happen(Trigger.ASK_COMMAND) is State.RUNNING_CC


def test_the_new_state_is_in_place_when_the_change_is_told() -> None:
    seen: list[State] = []
    machine = Machine(lambda *_: seen.append(machine.state))
    machine.happen(Trigger.SEEN_RESET)
    assert seen == [State.RESET]


def test_a_machine_begins_disconnected() -> None:
    assert Machine().state is State.DISCONNECTED


def test_commands_coming_and_going_are_for_the_curious_and_other_changes_for_everybody(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with caplog.at_level(logging.DEBUG, logger="robotiq_async"):
        machine = Machine()
        for trigger in (Trigger.SEEN_READY, Trigger.ASK_COMMAND, Trigger.DELIVERED, Trigger.SEEN_FAULT):
            machine.happen(trigger)
    assert [(record.levelname, record.getMessage()) for record in caplog.records] == [
        ("INFO", "DISCONNECTED -> RUNNING_IDLE (gripper is active)"),
        ("DEBUG", "RUNNING_IDLE -> RUNNING_CC (a command)"),
        ("DEBUG", "RUNNING_CC -> RUNNING_IDLE (request acknowledged)"),
        ("INFO", "RUNNING_IDLE -> FAULT (gripper reports a fault)"),
    ]


# -- stories -----------------------------------------------------------------------------------------------

Story = list[tuple[Trigger, State]]

STORIES: dict[str, Story] = {
    "a whole life": [
        (Trigger.ASK_START, State.DISCONNECTED),
        (Trigger.ASK_ACTIVATE, State.DO_ACTIVATION),
        (Trigger.SEEN_RESET, State.DO_ACTIVATION),
        (Trigger.DELIVERED, State.WF_ACTIVATION),
        (Trigger.SEEN_BUSY, State.WF_ACTIVATION),
        (Trigger.SEEN_READY, State.RUNNING_IDLE),
        (Trigger.ASK_COMMAND, State.RUNNING_CC),
        (Trigger.SEEN_READY, State.RUNNING_CC),
        (Trigger.ASK_COMMAND, State.RUNNING_CC),
        (Trigger.DELIVERED, State.RUNNING_IDLE),
        (Trigger.ASK_HALT, State.RUNNING_CC),
        (Trigger.DELIVERED, State.RUNNING_IDLE),
        (Trigger.SEEN_FAULT, State.FAULT),
        (Trigger.ASK_RELEASE, State.DO_ATR),
        (Trigger.SEEN_FAULT, State.DO_ATR),
        (Trigger.DELIVERED, State.WF_ATR),
        (Trigger.SEEN_FAULT, State.WF_ATR),
        (Trigger.SEEN_RELEASED, State.ATR_DONE),
        (Trigger.ASK_RESET, State.DO_RESET),
        (Trigger.SEEN_RELEASED, State.DO_RESET),
        (Trigger.DELIVERED, State.WF_RESET),
        (Trigger.SEEN_RELEASED, State.WF_RESET),
        (Trigger.SEEN_RESET, State.RESET),
        (Trigger.ASK_ACTIVATE, State.DO_ACTIVATION),
        (Trigger.DELIVERED, State.WF_ACTIVATION),
        (Trigger.SEEN_READY, State.RUNNING_IDLE),
        (Trigger.ASK_STOP, State.DO_SHUTDOWN),
        (Trigger.SEEN_READY, State.DO_SHUTDOWN),
        (Trigger.STOPPED, State.SHUTDOWN),
        (Trigger.ASK_START, State.DISCONNECTED),
        (Trigger.SEEN_READY, State.RUNNING_IDLE),
    ],
    "an active gripper is adopted and a lost link is opened again": [
        (Trigger.ASK_START, State.DISCONNECTED),
        (Trigger.SEEN_READY, State.RUNNING_IDLE),
        (Trigger.LINK_LOST, State.DISCONNECTED),
        (Trigger.LINK_LOST, State.DISCONNECTED),
        (Trigger.SEEN_READY, State.RUNNING_IDLE),
        (Trigger.LINK_LOST, State.DISCONNECTED),
        (Trigger.SEEN_RESET, State.RESET),
    ],
    "a minor fault clears by itself": [
        (Trigger.SEEN_READY, State.RUNNING_IDLE),
        (Trigger.SEEN_FAULT, State.FAULT),
        (Trigger.SEEN_FAULT, State.FAULT),
        (Trigger.SEEN_READY, State.RUNNING_IDLE),
    ],
    "a failed activation is reset": [
        (Trigger.SEEN_RESET, State.RESET),
        (Trigger.ASK_ACTIVATE, State.DO_ACTIVATION),
        (Trigger.DELIVERED, State.WF_ACTIVATION),
        (Trigger.SEEN_FAULT, State.FAULT),
        (Trigger.ASK_RESET, State.DO_RESET),
        (Trigger.DELIVERED, State.WF_RESET),
        (Trigger.SEEN_FAULT, State.WF_RESET),
        (Trigger.SEEN_RESET, State.RESET),
    ],
    "the power goes during a release": [
        (Trigger.SEEN_FAULT, State.FAULT),
        (Trigger.ASK_RELEASE, State.DO_ATR),
        (Trigger.DELIVERED, State.WF_ATR),
        (Trigger.SEEN_RESET, State.RESET),
    ],
    "the link goes in the middle of a shutdown": [
        (Trigger.SEEN_READY, State.RUNNING_IDLE),
        (Trigger.ASK_STOP, State.DO_SHUTDOWN),
        (Trigger.LINK_LOST, State.DO_SHUTDOWN),
        (Trigger.STOPPED, State.SHUTDOWN),
    ],
    "a hand that never found its gripper": [
        (Trigger.ASK_START, State.DISCONNECTED),
        (Trigger.ASK_STOP, State.DO_SHUTDOWN),
        (Trigger.STOPPED, State.SHUTDOWN),
    ],
}


@pytest.mark.parametrize("name", STORIES)
def test_a_story_goes_as_it_is_told(name: str) -> None:
    changes: list[tuple[State, State, Trigger]] = []
    machine = Machine(lambda *change: changes.append(change))
    expected = []
    for trigger, target in STORIES[name]:
        if target is not machine.state:
            expected.append((machine.state, target, trigger))
        assert machine.happen(trigger) is target
    assert changes == expected


# -- what a status shows -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("byte_0", "byte_1", "fault", "sight"),
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
def test_a_status_shows(byte_0: int, byte_1: int, fault: int, sight: Trigger) -> None:
    assert look(status_of(byte_0, byte_1, fault)) is sight


@pytest.mark.parametrize("code", range(1, 16))
def test_no_fault_that_matters_is_taken_for_a_reset(code: int) -> None:
    status = status_of(0x00, fault=code)
    assert (look(status) is Trigger.SEEN_RESET) == (code in (0x05, 0x06, 0x07))
