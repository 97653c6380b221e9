"""The tree of errors and what each of them carries."""

from __future__ import annotations

import copy
import pickle

import pytest

from robotiq_async.values import errors
from robotiq_async.values.enums import Fault, State

TREE = {
    "RobotiqError": "Exception",
    "RobotiqStateError": "RobotiqError",
    "NotStartedError": "RobotiqStateError",
    "InvalidStateError": "RobotiqStateError",
    "NotActivatedError": "RobotiqStateError",
    "GripperFaultError": "RobotiqStateError",
    "ActivationTimeoutError": "RobotiqStateError TimeoutError",
    "StateTimeoutError": "RobotiqStateError TimeoutError",
    "MoveTimeoutError": "RobotiqStateError TimeoutError",
    "MoveSupersededError": "RobotiqStateError",
    "MotionInhibitedError": "RobotiqStateError",
    "RobotiqConnectionError": "RobotiqError ConnectionError",
    "ConnectFailedError": "RobotiqConnectionError",
    "ConnectionLostError": "RobotiqConnectionError",
    "ResponseTimeoutError": "RobotiqConnectionError TimeoutError",
    "ProtocolError": "RobotiqConnectionError",
    # Those that a user may distinguish from other time-outs.
    "WrongModelError": "ProtocolError",
}
"""The contract's tree, and what has been added: each error with its bases."""


def test_the_tree_is_that_of_the_contract() -> None:
    kinds = {each for each in vars(errors).values() if isinstance(each, type)}
    found = {kind for kind in kinds if issubclass(kind, BaseException)}
    assert {kind.__name__: " ".join(base.__name__ for base in kind.__bases__) for kind in found} == TREE
    assert errors.__doc__ is not None
    assert [name for name in TREE if name not in errors.__doc__] == [], "it draws the tree"


def test_advice_is_told_and_kept_apart_from_the_message() -> None:
    error = errors.NotActivatedError("not activated", advice="call activate()")
    error.hand = "left"
    for each in (error, copy.copy(error), pickle.loads(pickle.dumps(error))):
        assert (each.message, each.advice) == ("not activated", "call activate()")
        assert str(each) == "left: not activated: call activate()"
        assert repr(each) == "NotActivatedError('left: not activated: call activate()')"
    assert errors.NotActivatedError("not activated").advice == ""


@pytest.mark.parametrize("kind", [errors.StateTimeoutError, errors.ResponseTimeoutError])
def test_an_error_of_python_with_two_bases_has_advice_too(kind: type[errors.RobotiqError]) -> None:
    error = pickle.loads(pickle.dumps(kind("late", advice="call stop()")))
    assert (type(error), error.message, str(error)) == (kind, "late", "late: call stop()")


def test_a_refusal_tells_the_state_and_the_states_that_would_do() -> None:
    error = errors.InvalidStateError("not now", State.RESET, [State.FAULT, State.FAULT])
    assert str(error) == "not now"
    assert error.state is State.RESET
    assert error.allowed == frozenset({State.FAULT})


def test_a_fault_error_tells_code_severity_and_description() -> None:
    error = errors.GripperFaultError(Fault.SCISSOR_BLOCKED)
    assert error.fault is Fault.SCISSOR_BLOCKED
    assert "0x0E" in str(error)
    assert "major" in str(error)
    assert Fault.SCISSOR_BLOCKED.description in str(error)
    assert "0x0C" in str(errors.GripperFaultError(Fault(0x0C)))
    assert str(errors.GripperFaultError(Fault.ACTIVATION_FAULT, "as said")) == "as said"


def test_a_failed_connection_tells_address_and_reason() -> None:
    error = errors.ConnectFailedError("tcp://192.168.1.11:502", "refused")
    assert error.address == "tcp://192.168.1.11:502"
    assert "tcp://192.168.1.11:502" in str(error)
    assert "refused" in str(error)
