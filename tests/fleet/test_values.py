"""Errors, results, events and figures on their way as JSON."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async import (
    Fault,
    Finger,
    MoveResult,
    ObjectStatus,
    RobotiqStatus,
    SentRequest,
    State,
    Transition,
)
from robotiq_async.fleet.wire import values
from robotiq_async.values import errors
from robotiq_async.values.errors import (
    AgentError,
    ConnectFailedError,
    ControlLostError,
    GripperFaultError,
    InvalidStateError,
    MoveTimeoutError,
    ProtocolError,
    RobotiqError,
)
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.statistics import Statistics
from robotiq_async.values.trigger import Trigger

KINDS = sorted(
    (kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, RobotiqError)),
    key=lambda kind: kind.__name__,
)
STATUS = RobotiqStatus.from_registers(range(8), timestamp=100.25, sequence=7)
LATER = RobotiqStatus.from_registers(range(8), timestamp=105.25, sequence=7)
GARBAGE: st.SearchStrategy[Any] = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=5,
)


def five_later(stamp: float) -> float:
    return stamp + 5.0


def carried(fields: Any) -> Any:
    return json.loads(json.dumps(fields))


def an(kind: type[RobotiqError]) -> RobotiqError:
    """An error of a kind."""
    if kind is InvalidStateError:
        return InvalidStateError("not now", State.RESET, {State.FAULT, State.RUNNING_IDLE})
    if kind is GripperFaultError:
        return GripperFaultError(Fault(0x0C))
    if issubclass(kind, MoveTimeoutError):
        return kind("slow", STATUS)
    if kind is ConnectFailedError:
        return ConnectFailedError("tcp://10.0.0.1:502", "refused")
    if kind is ControlLostError:
        return ControlLostError("gone", "taken")
    return kind("why")


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind is not errors.NotAllStoppedError])
def test_errors(kind: type[RobotiqError]) -> None:
    error = an(kind)
    read = values.read_error(carried(values.error_fields(error)), five_later)
    assert type(read) is kind
    assert str(read) == str(error)
    assert vars(read) == vars(error) | ({"status": LATER} if issubclass(kind, MoveTimeoutError) else {})


def test_the_name_of_the_agents_hand_stays_with_the_agent() -> None:
    error = GripperFaultError(Fault.SCISSOR_BLOCKED)
    error.hand = "left"
    again = values.read_error(carried(values.error_fields(error)), five_later)
    assert isinstance(again, GripperFaultError)
    assert (str(again), again.hand) == (error.message, "")


@pytest.mark.parametrize("kind", [TypeError, ValueError])
def test_bad_arguments(kind: type[Exception]) -> None:
    read = values.read_error(carried(values.error_fields(kind("value must be an int"))), five_later)
    assert type(read) is kind
    assert str(read) == "value must be an int"


@pytest.mark.parametrize(
    "name", ["ZeroDivisionError", "SystemExit", "Any", "annotations", "NotAllStoppedError"]
)
def test_errors_of_another_kind(name: str) -> None:
    read = values.read_error({"kind": name, "message": "m"}, five_later)
    assert type(read) is AgentError
    assert str(read) == f"{name}: m"


@pytest.mark.parametrize(
    "kind", [InvalidStateError, GripperFaultError, MoveTimeoutError, ConnectFailedError, ControlLostError]
)
def test_an_error_without_what_its_kind_knows(kind: type[RobotiqError]) -> None:
    assert type(values.read_error({"kind": kind.__name__, "message": "m"}, five_later)) is ProtocolError


@given(
    st.sampled_from([kind.__name__ for kind in KINDS]),
    st.dictionaries(st.sampled_from(["state", "allowed", "fault", "status", "address", "reason"]), GARBAGE),
)
def test_an_error_made_of_garbage(kind: str, rest: dict[str, Any]) -> None:
    assert isinstance(values.read_error({"kind": kind, "message": 3, **rest}, five_later), RobotiqError)


@given(
    st.dictionaries(
        st.sampled_from([Finger.A, Finger.B, Finger.C, Finger.SCISSOR]),
        st.tuples(st.sampled_from(ObjectStatus), st.integers(0, 255), st.integers(0, 2550)),
        min_size=1,
    ),
    st.floats(0, 1000),
)
def test_results(axes: dict[Finger, tuple[ObjectStatus, int, int]], duration: float) -> None:
    def result(status: RobotiqStatus) -> MoveResult:
        return MoveResult(
            outcomes={axis: how for axis, (how, _, _) in axes.items()},
            positions={axis: at for axis, (_, at, _) in axes.items()},
            contacts=Finger(sum(axis for axis, (how, _, _) in axes.items() if how.is_contact)),
            duration=duration,
            peak_current_ma={axis: peak for axis, (_, _, peak) in axes.items()},
            status=status,
        )

    fields = values.result_fields(result(STATUS))
    assert fields is not None
    assert values.read_result(carried(fields), five_later) == result(LATER)
    assert values.result_fields(None) is None


@given(st.sampled_from(State), st.sampled_from(State), st.sampled_from(Trigger))
def test_transitions(source: State, target: State, trigger: Trigger) -> None:
    fields = carried(values.transition_fields(Transition(source, target, trigger, 100.25)))
    assert fields["kind"] == "transition"
    assert values.read_transition(fields, five_later) == Transition(source, target, trigger, 105.25)


@pytest.mark.parametrize("acknowledged", [True, False])
def test_requests(acknowledged: bool) -> None:
    request = Request(activate=True, go=True, axes=(AxisRequest(1, 2, 3),) * 4)
    fields = carried(values.request_fields(SentRequest(request, 100.25, acknowledged)))
    assert fields["kind"] == "request"
    assert values.read_request(fields, five_later) == SentRequest(request, 105.25, acknowledged)


def test_statistics() -> None:
    figures = Statistics(1, 2, 3, 0.4, 0.5, 0.6, 0.7, 0.8, 9, 10, "timerfd", 11, {"reached": 12})
    fields = carried(figures.as_dict())
    assert values.read_statistics(fields) == figures
    assert values.read_statistics(fields | {"of another version": 3}) == figures


READERS: dict[str, Any] = {
    "result": values.read_result,
    "transition": values.read_transition,
    "request": values.read_request,
    "status": values.read_status,
    "statistics": lambda fields, _: values.read_statistics(fields),
}


@pytest.mark.parametrize("what", READERS)
@given(fields=GARBAGE)
def test_garbage_is_a_protocol_error(what: str, fields: Any) -> None:
    def attempt() -> None:
        with values.reading("something"):
            READERS[what](fields, five_later)

    with pytest.raises(ProtocolError, match="the agent sent something that cannot be read"):
        attempt()
