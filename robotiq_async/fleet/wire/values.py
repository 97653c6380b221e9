"""Values as JSON on the network: the fields of ``as_dict()``, less those that the receiver works out.

Enumerations are names, but a fault is its code, because a gripper may report one that has no name. A status
or a request is its registers and its model.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

from ... import values
from ...hands import Statistics
from ...runtime import printable
from ...values import (
    ConnectFailedError,
    Fault,
    Finger,
    GripperFaultError,
    Inhibit,
    InvalidStateError,
    MotionInhibitedError,
    MoveResult,
    MoveTimeoutError,
    ObjectStatus,
    ProtocolError,
    Request,
    RobotiqError,
    RobotiqStatus,
    SentRequest,
    State,
    Transition,
    Trigger,
    model_of,
)
from ..errors import AgentError, ControlLostError, NotAllowedError

Fields = dict[str, Any]
Clock = Callable[[float], float]  # converts a time of the agent to a time of this process

_KINDS: Final[dict[str, type[Exception]]] = {
    each.__name__: each
    for each in (*vars(values).values(), AgentError, ControlLostError, NotAllowedError, TypeError, ValueError)
    if isinstance(each, type) and issubclass(each, RobotiqError | TypeError | ValueError)
}
_PLAIN: Final = ("address", "reason", "who", "since")  # attributes of errors that JSON has as they are


@contextmanager
def reading(what: str) -> Iterator[None]:
    """Report malformed data from an agent, or from another program, as ProtocolError."""
    try:
        yield
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        raise ProtocolError(f"the agent sent {what} that cannot be read: {error!r:.200}") from error


def words(text: object) -> str:
    """Text from the network, without control characters, fit to be shown."""
    if not isinstance(text, str):
        raise TypeError(f"words must be a string, got {text!r}")
    return printable(text)


# -- statuses ----------------------------------------------------------------------------------------------


def status_fields(status: RobotiqStatus) -> Fields:
    return {
        "registers": status.registers,
        "timestamp": status.timestamp,
        "sequence": status.sequence,
        "model": status.model.name,
        "has_current": status.has_current,
    }


def read_status(fields: Mapping[str, Any], clock: Clock) -> RobotiqStatus:
    return RobotiqStatus.from_registers(
        fields["registers"],
        timestamp=clock(fields["timestamp"]),
        sequence=fields["sequence"],
        model=model_of(fields.get("model")),
        has_current=fields.get("has_current", True),
    )


# -- errors ------------------------------------------------------------------------------------------------


def error_fields(error: Exception) -> Fields:
    """Encode an error: kind, attributes, and the message without the name of the agent's hand."""
    fields: Fields = {
        "kind": type(error).__name__,
        "message": error.message if isinstance(error, RobotiqError) else str(error),
    }
    state: State | None = getattr(error, "state", None)
    fault: Fault | None = getattr(error, "fault", None)
    status: RobotiqStatus | None = getattr(error, "status", None)
    if state is not None:
        allowed = getattr(error, "allowed", frozenset[State]())
        fields |= {"state": state.name, "allowed": sorted(each.name for each in allowed)}
    if fault is not None:
        fields["fault"] = fault.value
    if status is not None:
        fields["status"] = status_fields(status)
    for name in _PLAIN:
        if hasattr(error, name):
            fields[name] = getattr(error, name)
    if isinstance(error, RobotiqError) and error.advice:
        fields["advice"] = error.advice
    return fields


def read_error(fields: Fields, clock: Clock) -> Exception:
    """Decode an error. An unknown kind becomes AgentError, malformed data ProtocolError."""
    try:
        with reading("an error"):
            return _error(fields, clock)
    except ProtocolError as unreadable:
        return unreadable


def inhibit_fields(inhibit: Inhibit | None) -> Fields | None:
    return None if inhibit is None else inhibit.as_dict()


def read_inhibit(fields: Mapping[str, Any] | None) -> Inhibit | None:
    """Decode an inhibit, or the lack of one."""
    if fields is None:
        return None
    return Inhibit(words(fields["reason"]), words(fields["who"]), float(fields["since"]))


def _error(fields: Fields, clock: Clock) -> Exception:
    kind, message = _KINDS.get(fields["kind"]), words(fields["message"])
    if kind is None:
        return AgentError(f"{words(fields['kind'])}: {message}")
    error: Exception = kind.__new__(kind)
    error.args = (message,)
    known: dict[str, object] = {}
    if issubclass(kind, InvalidStateError):
        known["state"] = State[fields["state"]]
        known["allowed"] = frozenset(State[name] for name in fields["allowed"])
    if issubclass(kind, GripperFaultError):
        value = fields["fault"]
        known["fault"] = Fault(tuple(value) if isinstance(value, list) else value)  # type: ignore[arg-type]
    if issubclass(kind, MoveTimeoutError):
        known["status"] = read_status(fields["status"], clock)
    if issubclass(kind, ConnectFailedError):
        known["address"] = words(fields["address"])
    if issubclass(kind, ControlLostError):
        known["reason"] = words(fields["reason"])
    if issubclass(kind, MotionInhibitedError):
        known |= {name: words(fields[name]) for name in ("reason", "who")} | {"since": float(fields["since"])}
    if issubclass(kind, RobotiqError) and "advice" in fields:
        known["advice"] = words(fields["advice"])
    vars(error).update(known)
    return error


# -- results -----------------------------------------------------------------------------------------------


def result_fields(result: MoveResult | None) -> Fields | None:
    return None if result is None else {**result.as_dict(), "status": status_fields(result.status)}


def read_result(fields: Mapping[str, Any], clock: Clock) -> MoveResult:
    axes = {axis: fields[str(axis.name)] for axis in Finger.ALL if axis.name in fields}
    return MoveResult(
        outcomes={axis: ObjectStatus[end["outcome"]] for axis, end in axes.items()},
        positions={axis: int(end["position"]) for axis, end in axes.items()},
        contacts=Finger(sum(Finger[name] for name in fields["contacts"])),
        reached=Finger(sum(axis for axis, end in axes.items() if end["reached"])),
        duration=float(fields["duration"]),
        peak_current_ma={
            axis: int(end["peak_current_ma"]) if "peak_current_ma" in end else None
            for axis, end in axes.items()
        },
        status=read_status(fields["status"], clock),
    )


# -- events ------------------------------------------------------------------------------------------------


def transition_fields(transition: Transition) -> Fields:
    return {"kind": "transition", **transition.as_dict()}


def read_transition(fields: Mapping[str, Any], clock: Clock) -> Transition:
    return Transition(
        source=State[fields["source"]],
        target=State[fields["target"]],
        trigger=Trigger[fields["trigger"]],
        timestamp=clock(fields["timestamp"]),
    )


def request_fields(sent: SentRequest) -> Fields:
    return {
        "kind": "request",
        "registers": sent.request.registers,
        "model": sent.request.model.name,
        "timestamp": sent.timestamp,
        "acknowledged": sent.acknowledged,
    }


def read_request(fields: Mapping[str, Any], clock: Clock) -> SentRequest:
    return SentRequest(
        request=Request.from_registers(fields["registers"], model_of(fields.get("model"))),
        timestamp=clock(fields["timestamp"]),
        acknowledged=bool(fields["acknowledged"]),
    )


def read_statistics(fields: Mapping[str, Any]) -> Statistics:
    # An older agent lacks the figures that have a default; those of a newer one that are unknown here are
    # ignored.
    figures = dataclasses.fields(Statistics)
    told = [each.name for each in figures if each.name in fields or each.default is dataclasses.MISSING]
    return Statistics(**{name: fields[name] for name in told})
