"""Messages on the network, in either direction; strangers may have written them."""

from __future__ import annotations

import contextlib
import json
import math
import struct
import sys
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from robotiq_async import (
    Fault,
    Finger,
    Inhibit,
    MotionInhibitedError,
    MoveResult,
    ObjectStatus,
    RobotiqStatus,
    SentRequest,
    State,
    Transition,
)
from robotiq_async.fleet.errors import AgentError, ControlLostError, NotAllowedError
from robotiq_async.fleet.wire import values
from robotiq_async.fleet.wire.envelope import AgentAnswer, AgentCall, failure, unpack_answer, unpack_call
from robotiq_async.fleet.wire.status_message import SIZE, StatusMessage, unpack
from robotiq_async.hands.statistics import Statistics
from robotiq_async.values import errors
from robotiq_async.values.enums import Trigger
from robotiq_async.values.errors import (
    ConnectFailedError,
    GripperFaultError,
    InvalidStateError,
    MoveTimeoutError,
    NotActivatedError,
    ProtocolError,
    RobotiqError,
)
from robotiq_async.values.model import MODELS
from robotiq_async.values.request import AxisRequest, Request
from tests.strategies import ANY


def trees(numbers: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Anything that JSON holds, with such numbers."""
    words = st.text(ANY, max_size=8)
    return st.recursive(
        st.none() | st.booleans() | numbers | words,
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(words, inner, max_size=3),
        max_leaves=6,
    )


GARBAGE = trees(st.integers() | st.floats())
PLAIN = trees(st.integers(-(2**53), 2**53) | st.floats(allow_nan=False))
CALLS = st.builds(
    AgentCall,
    to=st.text(ANY, max_size=30),
    client=st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=64),
    epoch=st.integers(0, 2**53),
    lease=st.integers(0, 2**32),
    number=st.integers(0, 2**53),
    seen=st.floats(allow_nan=False, allow_infinity=False),
    arguments=st.dictionaries(st.text(ANY, max_size=8), PLAIN, max_size=4),
)
CALL = AgentCall("a", "me", 5, 6, 7, 8.5, {"speed": 9})
FIELDS = ["version", "to", "client", "epoch", "lease", "number", "seen", "arguments"]
ODD: list[Any] = [
    *(None, True, -1, 0, 7, 10**400, 1.5, math.nan, math.inf, "", "x", "é" * 70),
    *([], [3], [None] * 8, {}, {"a": []}, {"kind": {}}),
]
"""In place of whatever should be there."""
KINDS = [
    kind
    for kind in (*vars(errors).values(), AgentError, ControlLostError, NotAllowedError)
    if isinstance(kind, type) and issubclass(kind, RobotiqError)
]
STATUS = RobotiqStatus.from_registers(range(8), timestamp=100.25, sequence=7)
LATER = RobotiqStatus.from_registers(range(8), timestamp=105.25, sequence=7)


def five_later(fields: Any) -> RobotiqStatus:
    return RobotiqStatus.from_raw(fields | {"timestamp": fields["timestamp"] + 5.0})


FIGURES = Statistics(1, 2, 3, 0.4, 0.5, 0.6, 0.7, 0.8, 9, 10, "timerfd", 11, {"reached": 12})
READERS: dict[str, Any] = {
    "result": lambda fields: MoveResult.from_dict(fields, five_later(fields["status"])),
    "transition": Transition.from_dict,
    "request": SentRequest.from_raw,
    "status": five_later,
    "statistics": Statistics.from_dict,
    "inhibit": Inhibit.from_dict,
}
FEW = settings(max_examples=settings().max_examples // 4)
"""To make an example takes many times as long as to read it."""
U32, U64 = st.integers(0, 2**32 - 1), st.integers(0, 2**64 - 1)
TIME = st.floats(-1e6, 1e6)
MESSAGES = st.builds(
    StatusMessage,
    mark=U32,
    epoch=U64,
    stamp=TIME,
    state=st.sampled_from(State),
    lease=U32,
    is_held=st.booleans(),
    events=U32,
    is_moving=st.booleans(),
    status=st.none()
    | st.builds(
        RobotiqStatus,
        st.tuples(*[st.integers(0, 65535)] * 8),
        st.floats(-1e6, 1e6),
        U64,
        st.sampled_from([*MODELS.values()]),
        has_current=st.booleans(),
    ),
)


# -- envelope ----------------------------------------------------------------------------------------------


@FEW
@given(CALLS)
@example(replace(CALL, seen=sys.float_info.max))
def test_a_request(call: AgentCall) -> None:
    assert unpack_call(call.pack()) == call


@FEW
@given(
    st.builds(AgentAnswer, to=st.text(ANY), number=st.integers(0), epoch=st.integers(0, 2**53), value=PLAIN)
)
def test_an_answer(answer: AgentAnswer) -> None:
    read = unpack_answer(answer.pack())
    assert read == answer
    assert read.outcome(RobotiqStatus.from_raw) == answer.value


def test_the_answer_to_what_failed() -> None:
    answer = unpack_answer(failure(AgentCall("a", "me", number=7), 5, AgentError("no"), begun=False).pack())
    assert (answer.to, answer.number, answer.epoch) == ("a", 7, 5)
    with pytest.raises(AgentError, match="no"):
        answer.outcome(RobotiqStatus.from_raw)


@pytest.mark.parametrize("name", FIELDS)
def test_a_request_with_something_else_in_a_field(name: str) -> None:
    for value in ODD:
        fields = json.loads(CALL.pack()) | {name: value}
        refused_or_well_formed(json.dumps(fields).encode())


@pytest.mark.parametrize("name", FIELDS)
def test_a_request_without_a_field(name: str) -> None:
    fields = json.loads(CALL.pack())
    del fields[name]
    with pytest.raises((ProtocolError, AgentError)):
        unpack_call(json.dumps(fields).encode())


@FEW
@given(
    st.binary(max_size=300)
    | st.text(ANY, max_size=300).map(str.encode)
    | GARBAGE.map(lambda each: json.dumps(each).encode())
)
def test_garbage(data: bytes) -> None:
    refused_or_well_formed(data)
    try:
        answer = unpack_answer(data)
    except (ProtocolError, AgentError):
        return
    assert isinstance(answer, AgentAnswer)


def answered(error: Any) -> AgentAnswer:
    fields = {"version": 2, "to": "a", "number": 1, "epoch": 1, "value": 3, "error": error}
    return unpack_answer(json.dumps(fields).encode())


@pytest.mark.parametrize("error", [*ODD[1:], {"kind": "AgentError"}, {"message": "m"}], ids=repr)
def test_an_answer_with_a_malformed_error(error: Any) -> None:
    with pytest.raises((ProtocolError, AgentError)):
        answered(error).outcome(RobotiqStatus.from_raw)
    assert answered(None).outcome(RobotiqStatus.from_raw) == 3


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"{}",
        b"[" * 60_000,
        b'{"version": 2, "to": ' + b"[" * 30_000 + b"]" * 30_000 + b"}",
        b'{"version": 2, "number": ' + b"9" * 5000 + b"}",
        b"{" + b" " * 70_000 + b"}",
        b"\xff\xfe\x00",
        b"null",
        b"NaN",
        b'"text"',
    ],
    ids=lambda data: repr(data[:20]),
)
def test_huge_deep_or_empty_messages_are_refused(data: bytes) -> None:
    for read in (unpack_call, unpack_answer):
        with pytest.raises((ProtocolError, AgentError)):
            read(data)


@pytest.mark.parametrize("seen", ["1" + "0" * 400, "1e999", "-1e999", "NaN", "true", '"1"', "null"])
def test_a_malformed_time_is_refused(seen: str) -> None:
    text = AgentCall("a", "me", seen=0.125).pack().decode().replace("0.125", seen)
    with pytest.raises(ProtocolError):
        unpack_call(text.encode())


@pytest.mark.parametrize("version", [0, 1, "2", None, 2.5, [2]])
def test_another_version_says_what_to_do(version: object) -> None:
    data = json.dumps(json.loads(AgentCall("a", "me").pack()) | {"version": version}).encode()
    for read in (unpack_call, unpack_answer):
        with pytest.raises(AgentError, match="update the older side"):
            read(data)


def refused_or_well_formed(data: bytes) -> None:
    try:
        call = unpack_call(data)
    except (ProtocolError, AgentError):
        return
    assert isinstance(call.to, str)
    assert 0 < len(call.client) <= 64
    assert all(type(each) is int and each >= 0 for each in (call.epoch, call.lease, call.number))
    assert abs(call.seen) < float("inf")
    assert isinstance(call.arguments, dict)


# -- values ------------------------------------------------------------------------------------------------


def carried(fields: Any) -> Any:
    return json.loads(json.dumps(fields))


def an(kind: type[Exception]) -> Exception:
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
    if kind is MotionInhibitedError:
        return MotionInhibitedError(Inhibit("HALT was pressed", "the page", 5.5))
    return kind("why")


@pytest.mark.parametrize("kind", [*KINDS, TypeError, ValueError])
def test_errors(kind: type[Exception]) -> None:
    error = an(kind)
    read = values.read_error(carried(values.error_fields(error)), five_later)
    assert type(read) is kind
    assert str(read) == str(error)
    assert vars(read) == vars(error) | ({"status": LATER} if issubclass(kind, MoveTimeoutError) else {})


def test_the_advice_of_an_error_is_carried() -> None:
    error = NotActivatedError("not activated", advice="call activate()")
    again = values.read_error(carried(values.error_fields(error)), five_later)
    assert isinstance(again, NotActivatedError)
    assert (again.message, again.advice) == ("not activated", "call activate()")
    garbage = values.error_fields(error) | {"advice": 7}
    assert isinstance(values.read_error(carried(garbage), five_later), ProtocolError)


def test_the_name_of_the_agents_hand_stays_with_the_agent() -> None:
    error = GripperFaultError(Fault.SCISSOR_BLOCKED)
    error.hand = "left"
    again = values.read_error(carried(values.error_fields(error)), five_later)
    assert isinstance(again, GripperFaultError)
    assert (str(again), again.hand) == (error.message, "")


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


@pytest.mark.parametrize("kind", [*KINDS, TypeError])
def test_an_error_with_something_else_in_a_field(kind: type[Exception]) -> None:
    """It is an error in any case, and one that can be shown."""
    fields = values.error_fields(an(kind)) | {"advice": "wait"}
    for name in fields:
        for value in ODD:
            error = values.read_error(carried(fields | {name: value}), five_later)
            assert type(error) in (kind, AgentError, ProtocolError), (name, value)
            assert isinstance(str(error), str)


@FEW
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
            reached=Finger(sum(axis for axis, (how, _, _) in axes.items() if not how.is_contact)),
            duration=duration,
            peak_current_ma={axis: peak for axis, (_, _, peak) in axes.items()},
            status=status,
        )

    fields = carried(result(STATUS).as_dict() | {"status": STATUS.as_raw()})
    assert MoveResult.from_dict(fields, five_later(fields["status"])) == result(LATER)


@FEW
@given(st.sampled_from(State), st.sampled_from(State), st.sampled_from(Trigger))
def test_transitions(source: State, target: State, trigger: Trigger) -> None:
    transition = Transition(source, target, trigger, 100.25)
    assert Transition.from_dict(carried(transition.as_dict())) == transition


@pytest.mark.parametrize("acknowledged", [True, False])
def test_requests(acknowledged: bool) -> None:
    request = Request(activate=True, go=True, axes=(AxisRequest(1, 2, 3),) * 4)
    sent = SentRequest(request, 100.25, acknowledged)
    assert SentRequest.from_raw(carried(sent.as_raw())) == sent


def test_statistics() -> None:
    fields = carried(FIGURES.as_dict())
    assert Statistics.from_dict(fields) == FIGURES
    assert Statistics.from_dict(fields | {"of another version": 3}) == FIGURES


def read(what: str, fields: Any) -> Any:
    with values.reading("something"):
        return READERS[what](fields)


@pytest.mark.parametrize("what", READERS)
@FEW
@given(fields=GARBAGE)
def test_garbage_is_a_protocol_error(what: str, fields: Any) -> None:
    with pytest.raises(ProtocolError, match="the agent sent something that cannot be read"):
        read(what, fields)


@pytest.mark.parametrize("what", READERS)
def test_values_with_something_else_in_a_field(what: str) -> None:
    """It is read, or reported as what it is."""
    result = MoveResult(
        outcomes={Finger.A: ObjectStatus.AT_POSITION},
        positions={Finger.A: 9},
        contacts=Finger(0),
        reached=Finger.A,
        duration=1.0,
        peak_current_ma={Finger.A: 100},
        status=STATUS,
    )
    fields: Any = {
        "result": result.as_dict() | {"status": STATUS.as_raw()},
        "transition": Transition(State.RESET, State.RESET, Trigger.ASK_STOP, 1.0).as_dict(),
        "request": SentRequest(Request(), 100.25, True).as_raw(),
        "status": STATUS.as_raw(),
        "statistics": FIGURES.as_dict(),
        "inhibit": Inhibit("the guard is open", "", 5.5).as_dict(),
    }[what]
    read(what, carried(fields))
    for name in fields:
        for value in ODD:
            with contextlib.suppress(ProtocolError):
                read(what, carried(fields | {name: value}))


# -- status message ----------------------------------------------------------------------------------------


@FEW
@given(MESSAGES)
def test_packing_and_unpacking_keep_a_message(message: StatusMessage) -> None:
    data = message.pack()
    assert len(data) == SIZE == 60
    read = unpack(data)
    assert read._replace(status=None) == message._replace(status=None)
    assert (read.status is None) == (message.status is None)
    if read.status is not None and message.status is not None:
        # The age has 24 bits.
        age, told = message.stamp - message.status.timestamp, read.stamp - read.status.timestamp
        assert told == pytest.approx(age, rel=1e-6, abs=1e-9)
        at = {"timestamp": 0.0}
        assert read.status.as_raw() | at == message.status.as_raw() | at


def test_any_byte_in_any_place_gives_a_message_or_is_refused() -> None:
    message = StatusMessage(1, 2, 3.0, State.RUNNING_IDLE, 4, False, 5, False, None).pack()
    for place in range(SIZE):
        for value in range(256):
            data = message[:place] + bytes([value]) + message[place + 1 :]
            try:
                found = unpack(data)
            except (ProtocolError, AgentError):
                assert not is_one(data)
            else:
                assert isinstance(found.state, State)
                assert is_one(data)


def is_one(data: bytes) -> bool:
    if len(data) != SIZE or data[0] != 2 or data[1] >= len(State) or data[3] >= len(MODELS):
        return False
    return all(map(math.isfinite, struct.unpack("<df", data[32:44])))


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
def test_a_time_that_is_none_is_refused(value: float) -> None:
    """Nothing would be newer than it ever after."""
    message = StatusMessage(1, 2, 3.0, State.RUNNING_IDLE, 4, False, 5, False, None)
    assert unpack(message.pack()) == message
    for other in (message._replace(stamp=value), message._replace(status=RobotiqStatus((0,) * 8, value))):
        with pytest.raises(ProtocolError, match="impossible time"):
            unpack(other.pack())


@FEW
@given(MESSAGES, st.integers(0, SIZE - 1))
def test_a_piece_is_refused(message: StatusMessage, size: int) -> None:
    with pytest.raises(ProtocolError):
        unpack(message.pack()[:size])
    with pytest.raises(ProtocolError):
        unpack(message.pack() + b"\x00")


def test_the_places_of_the_states_do_not_change() -> None:
    # Agents and clients of different versions talk to each other: a new state goes to the end.
    assert [state.name for state in State] == [
        *("DISCONNECTED", "DO_ACTIVATION", "WF_ACTIVATION", "RUNNING_IDLE", "RUNNING_CC", "FAULT", "DO_ATR"),
        *("WF_ATR", "ATR_DONE", "DO_RESET", "WF_RESET", "RESET", "DO_SHUTDOWN", "SHUTDOWN"),
    ]
