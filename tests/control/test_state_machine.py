"""The machine that follows the table: what it tells, the sequence it runs, and whole lives as stories."""

from __future__ import annotations

import logging

import pytest

from robotiq_async.control.sequences import Sequence
from robotiq_async.control.state_machine import TABLE, StateMachine
from robotiq_async.values.enums import Fault, State, Trigger
from robotiq_async.values.errors import GripperFaultError, InvalidStateError
from robotiq_async.values.request import Request
from robotiq_async.values.status import RobotiqStatus
from tests.control.walks import Change, Recorded
from tests.register_words import status_of


def test_after_a_refusal_the_machine_goes_on_as_if_nothing_had_been_asked() -> None:
    machine = StateMachine()
    machine.fire(Trigger.SEEN_READY)
    with pytest.raises(InvalidStateError):
        machine.fire(Trigger.ASK_RELEASE)
    assert machine.fire(Trigger.ASK_COMMAND)
    assert machine.state is State.RUNNING_CC


def test_the_new_state_is_in_place_when_the_change_is_told() -> None:
    seen: list[State] = []
    machine = StateMachine(lambda *_: seen.append(machine.state))
    machine.fire(Trigger.SEEN_RESET)
    assert seen == [State.RESET]


def test_a_machine_begins_disconnected_and_with_no_sequence() -> None:
    assert StateMachine().state is State.DISCONNECTED
    assert StateMachine().sequence is None


@pytest.mark.parametrize("state", State)
def test_what_was_about_to_be_sent_has_been_delivered_and_nothing_else_has(state: State) -> None:
    recorded = Recorded(state)
    recorded.machine.delivered()
    expected = TABLE[state][Trigger.DELIVERED]
    assert recorded.machine.state is (expected if isinstance(expected, State) else state)


def test_commands_coming_and_going_are_for_the_curious_and_other_changes_for_everybody(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with caplog.at_level(logging.DEBUG, logger="robotiq_async"):
        machine = StateMachine()
        for trigger in (Trigger.SEEN_READY, Trigger.ASK_COMMAND, Trigger.DELIVERED, Trigger.SEEN_FAULT):
            machine.fire(trigger)
    assert [(record.levelname, record.getMessage()) for record in caplog.records] == [
        ("INFO", "DISCONNECTED -> RUNNING_IDLE (gripper is active)"),
        ("DEBUG", "RUNNING_IDLE -> RUNNING_CC (a command)"),
        ("DEBUG", "RUNNING_CC -> RUNNING_IDLE (request acknowledged)"),
        ("INFO", "RUNNING_IDLE -> FAULT (gripper reports a fault)"),
    ]


# -- the sequence under way --------------------------------------------------------------------------------

READY, RESET = status_of(0x31), status_of(0x00)
FAULT = status_of(0x31, fault=0x0E)
IMAGE = Request(activate=True)


def one_write(seen: list[RobotiqStatus]) -> Sequence:
    """Writes once, and ends with the next status."""
    seen.append((yield None))
    seen.append((yield IMAGE))


def test_a_sequence_is_handed_statuses_and_says_what_to_write() -> None:
    seen: list[RobotiqStatus] = []
    machine = Recorded(State.DO_ACTIVATION).machine
    machine.begin(one_write(seen))
    assert machine.sequence is not None
    assert not seen, "it is asked for; what the gripper shows decides whether it begins"
    assert machine.advance(RESET) is IMAGE
    assert seen == [RESET]
    assert machine.state is State.DO_ACTIVATION


def test_at_the_end_of_a_sequence_the_state_follows_what_the_status_shows() -> None:
    recorded = Recorded(State.DO_ACTIVATION)
    machine = recorded.machine
    machine.begin(one_write([]))
    machine.advance(RESET)
    machine.delivered()
    assert machine.advance(READY) is None
    assert machine.sequence is None
    assert recorded.changes == [
        (State.DO_ACTIVATION, State.WF_ACTIVATION, Trigger.DELIVERED),
        (State.WF_ACTIVATION, State.RUNNING_IDLE, Trigger.SEEN_READY),
    ]


def test_a_sequence_with_nothing_to_begin_leads_to_where_the_gripper_is() -> None:
    def nothing() -> Sequence:
        yield None

    machine = Recorded(State.DO_ACTIVATION).machine
    machine.begin(nothing())
    assert machine.advance(READY) is None
    assert machine.sequence is None
    assert machine.state is State.RUNNING_IDLE


def test_a_sequence_that_fails_is_said_in_the_log_and_leads_to_where_the_gripper_is(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def failing() -> Sequence:
        status = yield None
        raise GripperFaultError(status.fault)

    machine = Recorded(State.WF_ACTIVATION).machine
    machine.begin(failing())
    assert machine.advance(FAULT) is None
    assert machine.sequence is None
    assert machine.state is State.FAULT
    (record,) = [each for each in caplog.records if each.levelname == "WARNING"]
    assert record.getMessage() == str(GripperFaultError(Fault(0x0E)))


def test_a_bug_in_a_sequence_is_not_taken_for_its_end() -> None:
    def broken() -> Sequence:
        yield None
        raise ZeroDivisionError

    machine = Recorded(State.DO_RESET).machine
    machine.begin(broken())
    with pytest.raises(ZeroDivisionError):
        machine.advance(READY)


def test_a_sequence_takes_the_place_of_the_one_under_way() -> None:
    first: list[RobotiqStatus] = []
    second: list[RobotiqStatus] = []
    machine = Recorded(State.DO_ACTIVATION).machine
    machine.begin(one_write(first))
    machine.begin(one_write(second))
    machine.advance(RESET)
    assert (first, second) == ([], [RESET])


def test_a_sequence_that_is_dropped_is_over_and_changes_no_state() -> None:
    recorded = Recorded(State.WF_RESET)
    recorded.machine.begin(one_write([]))
    recorded.machine.drop_sequence()
    assert recorded.machine.sequence is None
    assert recorded.machine.state is State.WF_RESET
    assert not recorded.changes


# -- stories -----------------------------------------------------------------------------------------------

Story = list[tuple[Trigger, State]]

STORIES: dict[str, Story] = {
    "a whole life": [
        (Trigger.ASK_START, State.DISCONNECTED),
        (Trigger.ACTIVATES, State.DO_ACTIVATION),
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
    changes: list[Change] = []
    machine = StateMachine(lambda *change: changes.append(change))
    expected = []
    for trigger, target in STORIES[name]:
        if target is not machine.state:
            expected.append((machine.state, target, trigger))
        machine.fire(trigger)
        assert machine.state is target
    assert changes == expected
