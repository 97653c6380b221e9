"""The status on its way to readers."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async import State
from robotiq_async.fleet.wire.status_message import SIZE, StatusMessage, unpack
from robotiq_async.values.errors import ProtocolError
from robotiq_async.values.model import MODELS

U32, U64 = st.integers(0, 2**32 - 1), st.integers(0, 2**64 - 1)
TIME = st.floats(allow_nan=False, allow_infinity=False, width=64)
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
    sequence=U64,
    age=st.floats(allow_nan=False, allow_infinity=False, width=32),
    registers=st.none() | st.tuples(*[st.integers(0, 65535)] * 8),
    model=st.sampled_from([*MODELS.values()]),
)


@given(MESSAGES)
def test_what_is_packed_is_unpacked(message: StatusMessage) -> None:
    data = message.pack()
    assert len(data) == SIZE == 60
    assert unpack(data) == message


@given(st.binary(max_size=200))
def test_anything_else_is_refused(data: bytes) -> None:
    if not is_one(data):
        with pytest.raises(ProtocolError):
            unpack(data)
    else:
        assert isinstance(unpack(data), StatusMessage)


@given(st.binary(min_size=SIZE, max_size=SIZE))
def test_any_bytes_of_the_right_size_are_a_message_or_refused(data: bytes) -> None:
    for version in (b"\x01", b"\x00", b"\x02"):
        try:
            message = unpack(version + data[1:])
        except ProtocolError:
            assert not is_one(version + data[1:])
        else:
            assert isinstance(message.state, State)


def is_one(data: bytes) -> bool:
    if len(data) != SIZE or data[0] != 1 or data[1] >= len(State) or data[3] >= len(MODELS):
        return False
    return all(map(math.isfinite, struct.unpack("<df", data[32:44])))


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
def test_a_time_that_is_none_is_refused(value: float) -> None:
    """Nothing would be newer than it ever after."""
    message = StatusMessage(1, 2, 3.0, State.RUNNING_IDLE, 4, False, 5, False, 6, 0.5, None)
    assert unpack(message.pack()) == message
    for other in (message._replace(stamp=value), message._replace(age=value)):
        with pytest.raises(ProtocolError, match="no time"):
            unpack(other.pack())


@given(MESSAGES, st.integers(0, SIZE - 1))
def test_a_piece_is_refused(message: StatusMessage, size: int) -> None:
    with pytest.raises(ProtocolError):
        unpack(message.pack()[:size])
    with pytest.raises(ProtocolError):
        unpack(message.pack() + b"\x00")


def test_the_places_of_the_states_do_not_change() -> None:
    # Agents and clients of different versions talk to each other: a new state goes to the end.
    assert [state.name for state in State] == [
        "DISCONNECTED",
        "DO_ACTIVATION",
        "WF_ACTIVATION",
        "RUNNING_IDLE",
        "RUNNING_CC",
        "FAULT",
        "DO_ATR",
        "WF_ATR",
        "ATR_DONE",
        "DO_RESET",
        "WF_RESET",
        "RESET",
        "DO_SHUTDOWN",
        "SHUTDOWN",
    ]
