"""Requests to an agent, and their answers."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field
from typing import Any, Final

from ...values import ProtocolError
from ..errors import AgentError, ControlLostError
from .names import VERSION, other_version
from .values import Fields, ReadStatus, error_fields, label_of, read_error

_MOST_BYTES: Final = 64 * 1024
_INTEGERS: Final = ("epoch", "lease", "number", "after")


@dataclass(frozen=True, slots=True)
class AgentCall:
    """One request.

    Attributes:
        to: base key of the addressed gripper. The receiver compares it: zenoh may deliver under a wrong key.
        client: identifies the client: 1..64 printable characters of ASCII; see
            :class:`~robotiq_async.fleet.control.lease.Holder`.
        epoch: the run of the agent that is addressed; 0 for any.
        lease: number of the lease that the request is made under.
        number: rises with each request of a client; identifies repetitions and requests that were overtaken.
        seen: newest stamp of the agent that the client had received when it made the request.
        arguments: by name.
        after: number of the preceding command if that is still unanswered, else 0. If that command was lost,
            the agent refuses this one, which must not take its place.
    """

    to: str
    client: str
    epoch: int = 0
    lease: int = 0
    number: int = 0
    seen: float = 0.0
    arguments: Fields = field(default_factory=dict)
    after: int = 0

    def pack(self) -> bytes:
        return _pack(self)

    @property
    def label(self) -> str:
        """The client for people, as it calls itself."""
        return label_of(self.arguments.get("label", "unknown client"))


def unpack_call(data: bytes) -> AgentCall:
    """Parse a request: ProtocolError if it is not a request, AgentError if it has another version."""
    fields = _object("a request", data)
    try:
        call = AgentCall(
            **{name: fields[name] for name in AgentCall.__slots__ if name in fields or name != "after"}
        )
    except KeyError as error:
        raise ProtocolError(f"not a request: {data[:200]!r}") from error
    if not _is_well_formed(call):
        raise ProtocolError(f"not a request: {data[:200]!r}")
    return call


def _is_well_formed(call: AgentCall) -> bool:
    # Any program on the network may have written the fields, so each type is checked.
    values = {name: getattr(call, name) for name in call.__slots__}
    return (
        isinstance(values["to"], str)
        and isinstance(values["client"], str)
        and 0 < len(values["client"]) <= 64
        # Plain text: it is compared as bytes, and half a character (a lone surrogate) has no bytes.
        and values["client"].isascii()
        and values["client"].isprintable()
        and all(type(values[name]) is int and values[name] >= 0 for name in _INTEGERS)
        and type(values["seen"]) in (int, float)
        # Not isfinite(): an int may be too long for it.
        and abs(values["seen"]) <= sys.float_info.max
        and isinstance(values["arguments"], dict)
    )


@dataclass(frozen=True, slots=True)
class AgentAnswer:
    """The answer to a request.

    Attributes:
        to: base key of the gripper that answers.
        number: of the request.
        epoch: of the agent.
        value: the result of the request.
        error: the error of the request; None if it was carried out.
        begun: True if it was carried out, also if it has ended in an error; False if it was not begun, and
            never will be; None if that is unknown.
    """

    to: str
    number: int
    epoch: int
    value: Any = None
    error: Fields | None = None
    begun: bool | None = True

    def pack(self) -> bytes:
        return _pack(self)

    def outcome(self, read_status: ReadStatus) -> Any:  # noqa: ANN401  # each request has another result
        """Return the result of the request, or raise its error."""
        if self.error is not None:
            raise read_error(self.error, read_status)
        return self.value


def unpack_answer(data: bytes) -> AgentAnswer:
    """Parse an answer: ProtocolError if it is not an answer, AgentError if it has another version."""
    fields = _object("an answer", data)
    try:
        begun = fields.get("begun")
        if begun is not None and not isinstance(begun, bool):
            raise TypeError("begun")
        return AgentAnswer(
            **{name: fields[name] for name in AgentAnswer.__slots__ if name != "begun"}, begun=begun
        )
    except (KeyError, TypeError) as error:
        raise ProtocolError(f"not an answer: {data[:200]!r}") from error


def outcome(begun: bool | None, what: str = "it") -> str:
    """The only words that say whether a request was carried out; None: not known."""
    words = {False: "nothing was done", None: f"{what} may have been carried out", True: f"{what} had begun"}
    return f"; {words[begun]}"


def failure(call: AgentCall, epoch: int, error: Exception, begun: bool | None) -> AgentAnswer:
    """The answer with an error, and with the only statement whether the request was carried out."""
    fields = error_fields(error)
    if isinstance(error, AgentError | ControlLostError):
        fields["message"] += outcome(begun)
    return AgentAnswer(call.to, call.number, epoch, error=fields, begun=begun)


def _pack(message: AgentCall | AgentAnswer) -> bytes:
    fields = {name: getattr(message, name) for name in message.__slots__}
    if not fields.get("after", True):
        del fields["after"]
    return json.dumps({"version": VERSION, **fields}).encode()


def _object(what: str, data: bytes) -> Fields:
    try:
        fields = json.loads(data) if len(data) <= _MOST_BYTES else None
    except (ValueError, RecursionError) as error:
        raise ProtocolError(f"not {what}: {data[:200]!r}") from error
    if not isinstance(fields, dict):
        raise ProtocolError(f"not {what}: {data[:200]!r}")
    if fields.get("version") != VERSION:
        raise AgentError(other_version(what, fields.get("version")))
    return fields
