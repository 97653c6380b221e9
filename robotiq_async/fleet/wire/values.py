"""Text and errors on the network. The other values encode themselves: ``as_dict()``, ``as_raw()``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

from ...runtime import printable
from ...values import Fault, ProtocolError, RobotiqError, RobotiqStatus, State
from ..errors import AgentError, NotAllStoppedError

LABEL_MAX: Final = 200  # characters of a label that are shown
Fields = dict[str, Any]
ReadStatus = Callable[[Mapping[str, Any]], RobotiqStatus]
"""Reads a status that an answer has."""


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


def label_of(text: object) -> str:
    """The name that a client gives itself, or its words, cut to the length that is shown."""
    return printable(str(text))[:LABEL_MAX]


# -- errors ------------------------------------------------------------------------------------------------


def _kinds(kind: type[RobotiqError]) -> Iterator[type[RobotiqError]]:
    if kind.__module__ in (RobotiqError.__module__, AgentError.__module__) and kind is not NotAllStoppedError:
        yield kind
    for each in kind.__subclasses__():
        yield from _kinds(each)


_ERROR_KINDS: Final[Mapping[str, type[Exception]]] = {
    **{each.__name__: each for each in _kinds(RobotiqError)},
    "TypeError": TypeError,
    "ValueError": ValueError,
}
_ATTRIBUTES: Final = {
    "InvalidStateError": ("state", "allowed"),
    "GripperFaultError": ("fault",),
    "MoveTimeoutError": ("status",),
    "ConnectFailedError": ("address",),
    "ControlLostError": ("reason",),
    "MotionInhibitedError": ("reason", "who", "since"),
}
"""The attributes of each kind of error, in addition to its message."""
_WRITTEN: Final[Mapping[str, Callable[[Any], object]]] = {
    "state": lambda state: state.name,
    "allowed": lambda states: sorted(each.name for each in states),
    "fault": lambda fault: fault.value,  # a gripper may report one that has no name
    "status": lambda status: status.as_raw(),
}
_READERS: Final[Mapping[str, Callable[[Any], object]]] = {
    "state": lambda name: State[name],
    "allowed": lambda names: frozenset(State[name] for name in names),
    "fault": lambda code: Fault(tuple(code) if isinstance(code, list) else code),  # type: ignore[arg-type]
    "since": float,
}


def error_fields(error: Exception) -> Fields:
    """Encode an error: kind, attributes, and the message without the name of the agent's hand."""
    kind = type(error).__name__
    fields: Fields = {
        "kind": kind,
        "message": error.message if isinstance(error, RobotiqError) else str(error),
    }
    for name in _ATTRIBUTES.get(kind, ()):
        value = getattr(error, name)
        fields[name] = _WRITTEN[name](value) if name in _WRITTEN else value
    if isinstance(error, RobotiqError) and error.advice:
        fields["advice"] = error.advice
    return fields


def read_error(fields: Fields, read_status: ReadStatus) -> Exception:
    """Decode an error. An unknown kind becomes AgentError, malformed data ProtocolError."""
    try:
        with reading("an error"):
            return _error(fields, read_status)
    except ProtocolError as unreadable:
        return unreadable


def _error(fields: Fields, read_status: ReadStatus) -> Exception:
    kind, message = _ERROR_KINDS.get(fields["kind"]), words(fields["message"])
    if kind is None:
        return AgentError(f"{words(fields['kind'])}: {message}")
    error: Exception = kind.__new__(kind)
    error.args = (message,)
    names = [*_ATTRIBUTES.get(fields["kind"], ())]
    if issubclass(kind, RobotiqError) and "advice" in fields:
        names.append("advice")
    read = {**_READERS, "status": read_status}
    vars(error).update({name: read.get(name, words)(fields[name]) for name in names})
    return error
