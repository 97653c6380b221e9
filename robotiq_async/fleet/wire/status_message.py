"""The status of a gripper on its way to readers: 60 bytes, two hundred times a second.

| bytes | what |
|--|--|
| B | version of the layout |
| B | state, by its place in ``State`` |
| B | flags: 1 a status was read, 2 the axes move, 4 somebody holds the lease |
| B | model of the gripper, by its place in ``MODELS``: 0 is the 3-Finger |
| I | which gripper: the CRC-32 of its base key |
| I | number of the lease |
| I | number of the newest event |
| Q | epoch: random, anew with each start of the agent |
| Q | sequence of the status |
| d | the agent's time at which this was sent, in seconds |
| f | age of the status when it was sent, in seconds |
| 8H | the eight status registers |
"""

from __future__ import annotations

import struct
from math import isfinite
from typing import Final, NamedTuple

from ...values.enums import State
from ...values.errors import ProtocolError
from ...values.model import MODELS, THREE_FINGER, Model
from ...values.registers import Registers

_LAYOUT: Final = struct.Struct("<BBBBIIIQQdf8H")
VERSION: Final = 1
SIZE: Final = _LAYOUT.size
_STATES: Final = tuple(State)
_MODELS: Final = tuple(MODELS.values())
_PLACES: Final = {state: place for place, state in enumerate(_STATES)}
_READ, _MOVES, _HELD = 1, 2, 4
_NO_REGISTERS: Final = (0,) * 8


class StatusMessage(NamedTuple):
    """What an agent says about a gripper in one moment.

    Attributes:
        mark: which gripper it is about (see :attr:`~robotiq_async.fleet.wire.names.GripperName.mark`).
        epoch: random, anew with each start of the agent.
        stamp: the agent's time at which this was sent, in seconds.
        state: of the agent's hand.
        lease: number of the lease.
        is_held: whether somebody holds it.
        events: number of the newest event; whoever knows of fewer has missed some.
        is_moving: whether an axis moves, or will because of a command that does not act yet.
        sequence: of the status, as the agent's hand counts; meaningless without registers.
        age: seconds from the gripper's reply to ``stamp``.
        registers: the status; None if none has been read yet.
        model: of the gripper.
    """

    mark: int
    epoch: int
    stamp: float
    state: State
    lease: int
    is_held: bool
    events: int
    is_moving: bool
    sequence: int
    age: float
    registers: Registers | None
    model: Model = THREE_FINGER

    def pack(self) -> bytes:
        """The message as bytes."""
        mark, epoch, stamp, state, lease, is_held, events, is_moving, sequence, age, registers, model = self
        flags = _READ * (registers is not None) | _MOVES * is_moving | _HELD * is_held
        return _LAYOUT.pack(
            VERSION,
            _PLACES[state],
            flags,
            _MODELS.index(model),
            mark,
            lease,
            events,
            epoch,
            sequence,
            stamp,
            age,
            *(registers or _NO_REGISTERS),
        )


def unpack(data: bytes) -> StatusMessage:
    """The message in bytes.

    Raises:
        ProtocolError: not such a message, or one of another version.
    """
    if len(data) != SIZE or data[0] != VERSION:
        raise ProtocolError(f"not a status of version {VERSION}: {data[:8].hex()} ({len(data)} bytes)")
    _, place, flags, model, mark, lease, events, epoch, sequence, stamp, age, *registers = _LAYOUT.unpack(
        data
    )
    if place >= len(_STATES):
        raise ProtocolError(f"a status in a state that does not exist: {place}")
    if model >= len(_MODELS):
        raise ProtocolError(f"a status of a model that does not exist: {model}")
    if not (isfinite(stamp) and isfinite(age)):
        # What has been heard is told back with every request, and no older one counts after it.
        raise ProtocolError(f"a status at no time: {stamp}, {age} s old")
    return StatusMessage(
        mark=mark,
        epoch=epoch,
        stamp=stamp,
        state=_STATES[place],
        lease=lease,
        is_held=bool(flags & _HELD),
        events=events,
        is_moving=bool(flags & _MOVES),
        sequence=sequence,
        age=age,
        registers=tuple(registers) if flags & _READ else None,
        model=_MODELS[model],
    )
