"""StatusMessage: the status of a gripper for its readers, 60 bytes, 200 times a second.

docs/fleet-protocol.md has the layout. A state and a model are their index in ``State`` and in ``MODELS``.
"""

from __future__ import annotations

import struct
from math import isfinite
from typing import Final, NamedTuple

from ...values import MODELS, ProtocolError, RobotiqStatus, State
from ..errors import AgentError
from .names import VERSION, other_version

_LAYOUT: Final = struct.Struct("<BBBBIIIQQdf8H")
SIZE: Final = _LAYOUT.size
_STATES: Final = tuple(State)
_MODEL_ORDER: Final = tuple(MODELS.values())
_PLACES: Final = {state: place for place, state in enumerate(_STATES)}
_READ_BIT, _MOVES_BIT, _HELD_BIT, _NO_CURRENT_BIT = 1, 2, 4, 8
_NO_REGISTERS: Final[tuple[int, ...]] = (0,) * 8


class StatusMessage(NamedTuple):
    """The condition of a gripper at one moment.

    Attributes:
        mark: identifies the gripper (see :attr:`~robotiq_async.fleet.wire.names.GripperName.mark`).
        epoch: random, new with each start of the agent.
        stamp: the agent's time at which this was sent, in seconds.
        state: of the agent's hand.
        lease: number of the lease.
        is_held: whether a client holds the lease.
        events: number of the newest event; a client that has received fewer has missed some.
        is_moving: whether an axis moves, or will move by a command that has no effect yet.
        status: the newest, at the agent's time; None if none has been read yet.
    """

    mark: int
    epoch: int
    stamp: float
    state: State
    lease: int
    is_held: bool
    events: int
    is_moving: bool
    status: RobotiqStatus | None

    def pack(self) -> bytes:
        mark, epoch, stamp, state, lease, is_held, events, is_moving, status = self
        flags = _MOVES_BIT * is_moving | _HELD_BIT * is_held
        model, sequence, age, registers = 0, 0, 0.0, _NO_REGISTERS
        if status is not None:
            flags |= _READ_BIT | _NO_CURRENT_BIT * (not status.has_current)
            model, registers = _MODEL_ORDER.index(status.model), status.registers
            sequence, age = status.sequence, stamp - status.timestamp
        return _LAYOUT.pack(
            *(VERSION, _PLACES[state], flags, model),
            *(mark, lease, events, epoch, sequence, stamp, age, *registers),
        )


def unpack(data: bytes) -> StatusMessage:
    """Parse a status message.

    Raises:
        ProtocolError: not a status message.
        AgentError: one of another version.
    """
    if len(data) != SIZE:
        raise ProtocolError(f"not a status: {data[:8].hex()} ({len(data)} bytes)")
    if data[0] != VERSION:
        raise AgentError(other_version("a status", data[0]))
    _, place, flags, model, mark, lease, events, epoch, sequence, stamp, age, *registers = _LAYOUT.unpack(
        data
    )
    if place >= len(_STATES):
        raise ProtocolError(f"a status in a state that does not exist: {place}")
    if model >= len(_MODEL_ORDER):
        raise ProtocolError(f"a status of a model that does not exist: {model}")
    if not (isfinite(stamp) and isfinite(age)):
        # The client returns the newest stamp with every request and ignores older ones: an infinite stamp
        # would block all that follow.
        raise ProtocolError(f"a status with an impossible time: {stamp}, {age} s old")
    status = None
    if flags & _READ_BIT:
        has_current = not flags & _NO_CURRENT_BIT
        status = RobotiqStatus(
            tuple(registers), stamp - age, sequence, _MODEL_ORDER[model], has_current=has_current
        )
    return StatusMessage(
        mark=mark,
        epoch=epoch,
        stamp=stamp,
        state=_STATES[place],
        lease=lease,
        is_held=bool(flags & _HELD_BIT),
        events=events,
        is_moving=bool(flags & _MOVES_BIT),
        status=status,
    )
