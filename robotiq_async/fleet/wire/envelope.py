"""A request to an agent, and its answer."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field
from typing import Any, Final

from ...values.errors import AgentError, ProtocolError
from .values import Clock, Fields, error_fields, read_error

VERSION: Final = 1
_LONGEST: Final = 64 * 1024
_INTEGERS: Final = ("epoch", "lease", "number", "after")


@dataclass(frozen=True, slots=True)
class Call:
    """One request.

    Attributes:
        to: base key of the gripper it is meant for; it is compared, for a key may be wrong.
        client: who asks; see :class:`~robotiq_async.fleet.control.lease.Holder`.
        epoch: the run of the agent it is meant for; 0 for whichever there is.
        lease: number of the lease it is made under.
        number: rises with each request of a client; tells a repetition, and what was overtaken.
        seen: newest stamp of the agent that the client had heard when it asked.
        arguments: by name.
        after: number of the command before this one if that is not answered yet, so that this one does not
            take its place when it got lost; else 0.
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
        """The request as bytes."""
        return _pack(self)


def unpack_call(data: bytes) -> Call:
    """The request in bytes.

    Raises:
        ProtocolError: none, or one of another version.
    """
    fields = _object("a request", data)
    try:
        call = Call(**{name: fields[name] for name in Call.__slots__ if name in fields or name != "after"})
    except KeyError as error:
        raise ProtocolError(f"not a request: {data[:200]!r}") from error
    if not _is_well_formed(call):
        raise ProtocolError(f"not a request: {data[:200]!r}")
    return call


def _is_well_formed(call: Call) -> bool:
    """Whether every field is of its type: a stranger may have written them."""
    values = {name: getattr(call, name) for name in call.__slots__}
    return (
        isinstance(values["to"], str)
        and isinstance(values["client"], str)
        and 0 < len(values["client"]) <= 64
        and all(type(values[name]) is int and values[name] >= 0 for name in _INTEGERS)
        and type(values["seen"]) in (int, float)
        # Not isfinite(): an int may be too long for it.
        and abs(values["seen"]) <= sys.float_info.max
        and isinstance(values["arguments"], dict)
    )


@dataclass(frozen=True, slots=True)
class Answer:
    """What became of a request.

    Attributes:
        to: base key of the gripper that answers.
        number: of the request.
        epoch: of the agent.
        value: what it returned.
        error: what it raised; None if it was carried out.
    """

    to: str
    number: int
    epoch: int
    value: Any = None
    error: Fields | None = None

    def pack(self) -> bytes:
        """The answer as bytes."""
        return _pack(self)

    def outcome(self, clock: Clock) -> Any:  # noqa: ANN401  # what each request returns
        """What the request returned.

        Raises:
            RobotiqError, TypeError, ValueError: what it raised.
        """
        if self.error is not None:
            raise read_error(self.error, clock)
        return self.value


def unpack_answer(data: bytes) -> Answer:
    """The answer in bytes.

    Raises:
        ProtocolError: none, or one of another version.
    """
    fields = _object("an answer", data)
    try:
        return Answer(**{name: fields[name] for name in Answer.__slots__})
    except (KeyError, TypeError) as error:
        raise ProtocolError(f"not an answer: {data[:200]!r}") from error


def failure(call: Call, epoch: int, error: Exception) -> Answer:
    """The answer to a request that failed."""
    return Answer(call.to, call.number, epoch, error=error_fields(error))


def _pack(message: Call | Answer) -> bytes:
    fields = {name: getattr(message, name) for name in message.__slots__}
    if not fields.get("after", True):
        del fields["after"]
    return json.dumps({"version": VERSION, **fields}).encode()


def _object(what: str, data: bytes) -> Fields:
    try:
        fields = json.loads(data) if len(data) <= _LONGEST else None
    except (ValueError, RecursionError) as error:
        raise ProtocolError(f"not {what}: {data[:200]!r}") from error
    if not isinstance(fields, dict):
        raise ProtocolError(f"not {what}: {data[:200]!r}")
    if fields.get("version") != VERSION:
        raise AgentError(
            f"{what} of version {fields.get('version')!r} of the protocol; here it is {VERSION}: "
            "update the older side"
        )
    return fields
