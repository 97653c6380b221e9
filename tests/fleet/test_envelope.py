"""Requests and answers; a stranger may have written them."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.fleet.wire.envelope import Answer, Call, failure, unpack_answer, unpack_call
from robotiq_async.values.errors import AgentError, ProtocolError

JSON: st.SearchStrategy[Any] = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**70), 2**70) | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
PLAIN: st.SearchStrategy[Any] = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**53), 2**53)
    | st.floats(allow_nan=False)
    | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
CALLS = st.builds(
    Call,
    to=st.text(max_size=30),
    client=st.text(min_size=1, max_size=64),
    epoch=st.integers(0, 2**53),
    lease=st.integers(0, 2**32),
    number=st.integers(0, 2**53),
    seen=st.floats(allow_nan=False, allow_infinity=False),
    arguments=st.dictionaries(st.text(max_size=8), PLAIN, max_size=4),
)
FIELDS = ["version", "to", "client", "epoch", "lease", "number", "seen", "arguments"]


@given(CALLS)
def test_a_request(call: Call) -> None:
    assert unpack_call(call.pack()) == call


@given(st.builds(Answer, to=st.text(), number=st.integers(0), epoch=st.integers(0, 2**53), value=PLAIN))
def test_an_answer(answer: Answer) -> None:
    read = unpack_answer(answer.pack())
    assert read == answer
    assert read.outcome(lambda stamp: stamp) == answer.value


def test_the_answer_to_what_failed() -> None:
    answer = unpack_answer(failure(Call("a", "me", number=7), 5, AgentError("no")).pack())
    assert (answer.to, answer.number, answer.epoch) == ("a", 7, 5)
    with pytest.raises(AgentError, match="no"):
        answer.outcome(lambda stamp: stamp)


@given(CALLS, st.sampled_from(FIELDS), JSON)
def test_a_request_with_something_else_in_a_field(call: Call, name: str, value: Any) -> None:
    fields = json.loads(call.pack()) | {name: value}
    refused_or_well_formed(json.dumps(fields).encode())


@given(CALLS, st.sampled_from(FIELDS))
def test_a_request_without_a_field(call: Call, name: str) -> None:
    fields = json.loads(call.pack())
    del fields[name]
    with pytest.raises((ProtocolError, AgentError)):
        unpack_call(json.dumps(fields).encode())


@given(
    st.binary(max_size=300)
    | st.text(max_size=300).map(str.encode)
    | JSON.map(lambda each: json.dumps(each).encode())
)
def test_garbage(data: bytes) -> None:
    refused_or_well_formed(data)
    try:
        answer = unpack_answer(data)
    except (ProtocolError, AgentError):
        return
    assert isinstance(answer, Answer)


@given(
    st.dictionaries(st.sampled_from(["kind", "message", "state", "allowed", "fault", "status"]), JSON) | JSON
)
def test_an_answer_with_an_error_that_is_none(error: Any) -> None:
    answer = unpack_answer(
        json.dumps({"version": 1, "to": "a", "number": 1, "epoch": 1, "value": 3, "error": error}).encode()
    )
    if error is None:
        assert answer.outcome(lambda stamp: stamp) == 3
    else:
        with pytest.raises((ProtocolError, AgentError)):
            answer.outcome(lambda stamp: stamp)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"{}",
        b"[" * 60_000,
        b'{"version": 1, "to": ' + b"[" * 30_000 + b"]" * 30_000 + b"}",
        b'{"version": 1, "number": ' + b"9" * 5000 + b"}",
        b"{" + b" " * 70_000 + b"}",
        b"\xff\xfe\x00",
        b"null",
        b"NaN",
        b'"text"',
    ],
    ids=lambda data: repr(data[:20]),
)
def test_what_is_huge_deep_or_nothing(data: bytes) -> None:
    for unpack in (unpack_call, unpack_answer):
        with pytest.raises((ProtocolError, AgentError)):
            unpack(data)


@pytest.mark.parametrize("seen", ["1" + "0" * 400, "1e999", "-1e999", "NaN", "true", '"1"', "null"])
def test_a_time_that_is_none(seen: str) -> None:
    text = Call("a", "me", seen=0.125).pack().decode().replace("0.125", seen)
    with pytest.raises(ProtocolError):
        unpack_call(text.encode())


@pytest.mark.parametrize("version", [0, 2, "1", None, 1.5, [1]])
def test_another_version_says_what_to_do(version: object) -> None:
    data = json.dumps(json.loads(Call("a", "me").pack()) | {"version": version}).encode()
    for unpack in (unpack_call, unpack_answer):
        with pytest.raises(AgentError, match="update the older side"):
            unpack(data)


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
