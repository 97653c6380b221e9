"""RobotiqStatus: one reading of the gripper's eight status registers."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from . import registers as reg
from .checks import check_flag, check_int, check_seconds
from .enums import CONTROLLER_FAULTS, Fault, Finger, Initialization, Mode, ObjectStatus
from .model import THREE_FINGER, TOLERANCE, Model, index_of, model_of
from .object_byte import object_byte_of
from .stroke import Stroke

NO_REQUEST: Final = "NO_REQUEST"
"""The :meth:`RobotiqStatus.axis_state` of an axis with a gDT of 0 that does not mean motion."""

_set = object.__setattr__
_OBJECT_STATUSES = tuple(ObjectStatus)
_STATES = tuple(what.name for what in _OBJECT_STATUSES)
_STATES_WITHOUT_REQUEST = (NO_REQUEST, *_STATES[1:])


@dataclass(frozen=True, slots=True)
class Part:
    """A part that fingers hold, as the gripper reports it. Immutable; can be compared, hashed and pickled.

    Attributes:
        holds: the fingers that hold it.
        width_mm: the opening of a jaw around it, in millimetres: nominal, unless the hand has measured
            points. None for a 3-Finger, whose fingers have no single width between them.
    """

    holds: Finger
    width_mm: float | None


class RobotiqStatus:
    """One status reading. Immutable and hashable; decoded on access.

    Two statuses are equal when their registers, timestamp, sequence and model are.

    Attributes:
        registers: the eight registers as they came.
        timestamp: monotonic seconds at which the reply was taken in. The gripper gave it at most one exchange
            earlier. If the event loop was held up meanwhile, the reply waited, and is older by that time.
        sequence: counts every poll of a hand, from 0.
        model: of the gripper.
        stroke: openings by position; by default the model's.
        has_current: whether the link carries the motor currents.
    """

    __slots__ = ("_has_current", "_model", "_registers", "_sequence", "_stroke", "_timestamp")
    _registers: reg.Registers
    _timestamp: float
    _sequence: int
    _model: Model
    _stroke: Stroke
    _has_current: bool

    # The hand makes one of these 200 times a second: it keeps the registers and nothing else.
    def __init__(
        self,
        registers: reg.Registers,
        timestamp: float = 0.0,
        sequence: int = 0,
        model: Model = THREE_FINGER,
        stroke: Stroke | None = None,
        has_current: bool = True,
    ) -> None:
        if hasattr(self, "_sequence"):
            raise AttributeError("RobotiqStatus is immutable: it is made once")
        _set(self, "_registers", registers)
        _set(self, "_timestamp", timestamp)
        _set(self, "_sequence", sequence)
        _set(self, "_model", model)
        _set(self, "_stroke", model.stroke if stroke is None else stroke)
        _set(self, "_has_current", has_current)

    @classmethod
    def from_registers(
        cls,
        registers: Sequence[int],
        *,
        timestamp: float = 0.0,
        sequence: int = 0,
        model: Model = THREE_FINGER,
        stroke: Stroke | None = None,
        has_current: bool = True,
    ) -> RobotiqStatus:
        """A status from eight registers.

        Raises:
            TypeError: a register or the sequence is not an int, the timestamp not a number, or has_current
                not a bool.
            ValueError: not eight registers, or one outside 0..65535; a timestamp that is not finite, or a
                sequence below 0.
        """
        at = check_seconds("timestamp", timestamp, -sys.float_info.max, sys.float_info.max)
        number = check_int("sequence", sequence, 0, sys.maxsize)
        return cls(
            reg.check_registers(registers),
            at,
            number,
            model,
            stroke,
            check_flag("has_current", has_current),
        )

    @property
    def registers(self) -> reg.Registers:
        """The eight registers as they came."""
        return self._registers

    @property
    def timestamp(self) -> float:
        """Monotonic seconds (``time.monotonic()``) at which the reply arrived."""
        return self._timestamp

    @property
    def sequence(self) -> int:
        """Counts every poll of the hand since its first start."""
        return self._sequence

    @property
    def model(self) -> Model:
        """The model of the gripper."""
        return self._model

    @property
    def stroke(self) -> Stroke:
        """The openings by position: of the gripper's model, or from points measured on it."""
        return self._stroke

    @property
    def has_current(self) -> bool:
        """Whether the link carries the motor currents. A URCap's text port without COU does not."""
        return self._has_current

    # One axis. Each takes one Finger member; several, or one that the model lacks, is a ValueError.

    def finger_status(self, finger: Finger | int) -> ObjectStatus:
        """The object status of an axis (gDT) as reported: moving, stopped by a contact, or at position.

        The gripper also reports IN_MOTION for an axis that has received no request: see :meth:`axis_state`.

        Raises:
            TypeError: not a Finger or an int.
            ValueError: not exactly one axis.
        """
        model = self._model
        return _OBJECT_STATUSES[model.object_status[index_of(model, finger)].read(self._registers)]

    def axis_state(self, finger: Finger | int) -> str:
        """The state of an axis in one word, for people and files: the name of its :meth:`finger_status`.

        ``NO_REQUEST`` where that means nothing: gDT = 0 while no position request is in force (gGTO = 0, or
        gIMC other than 3). So IN_MOTION are the axes in :attr:`moving`, and no others. During an
        activation and a release axes move without a report.

        Raises:
            TypeError, ValueError: as :meth:`finger_status`.
        """
        return self._states[self.finger_status(finger)]

    def position(self, finger: Finger | int) -> int:
        """Position in counts, 0..255 (gPO). Open reads 6-7 on a 3-Finger, closed 240 or more."""
        return reg.gPO[index_of(self._model, finger)].read(self._registers)

    def opening_mm(self, finger: Finger | int) -> float:
        """The opening at a finger, in millimetres: nominal, unless the hand was made with measured points.

        Of a jaw this is the width between its fingertips. See :class:`Units` for its meaning on a 3-Finger.

        Raises:
            TypeError: not a Finger or an int.
            ValueError: not exactly one finger. The scissor has no opening.
        """
        return self._stroke.openings[self._finger_position(finger)]

    def open_fraction(self, finger: Finger | int) -> float:
        """The share of a finger's travel that is open, linear in counts: 1 (open) .. 0 (closed).

        Raises:
            TypeError, ValueError: as :meth:`opening_mm`.
        """
        return self._stroke.fractions[self._finger_position(finger)]

    def has_reached(self, finger: Finger | int, request: int) -> bool:
        """Whether an axis is within 2 counts of a request, or at the end of its stroke for one beyond it.

        The end comes from the model, or from the points that were measured on this gripper.

        Raises:
            TypeError, ValueError: as :meth:`position`.
        """
        position, own = self.position(finger), self._stroke
        if self._model.has_reached(request, position):
            return True
        if not own.points or finger == Finger.SCISSOR:
            return False
        return (request <= own.open_reading and position <= own.open_reading + TOLERANCE) or (
            request >= own.closed_reading and position >= own.closed_reading - TOLERANCE
        )

    def _finger_position(self, finger: Finger | int) -> int:
        position = self.position(finger)
        if finger == Finger.SCISSOR:
            raise ValueError(
                f"finger must be A, B or C, for the scissor has no opening, got {Finger.SCISSOR}"
            )
        return position

    def requested_position(self, finger: Finger | int) -> int:
        """Echo of the position request, 0..255 (gPR)."""
        return reg.gPR[index_of(self._model, finger)].read(self._registers)

    def current(self, finger: Finger | int) -> int | None:
        """Motor current in counts, 0..255 (gCU); None where the link does not carry it."""
        index = index_of(self._model, finger)
        return reg.gCU[index].read(self._registers) if self._has_current else None

    def current_ma(self, finger: Finger | int) -> int | None:
        """Motor current in milliampere, 10 a count; None where the link does not carry it."""
        counts = self.current(finger)
        return None if counts is None else counts * reg.MILLIAMPERE_PER_COUNT

    # The whole hand.

    @property
    def fault(self) -> Fault:
        """The fault code (gFLT), as the model means it; an unassigned code keeps its number."""
        return self._model.faults[reg.gFLT.read(self._registers)]

    @property
    def controller_fault(self) -> int:
        """The fault code of the controller before a 2F or a Hand-E (kFLT), 0..15; 0 for none.

        Only the retired Universal Controller has such a code; behind another link, and on a 3-Finger, it is
        0.
        """
        return 0 if self._model.has_modes else reg.kFLT.read(self._registers)

    @property
    def controller_fault_text(self) -> str:
        """The fault of the controller for people; empty without a fault."""
        code = self.controller_fault
        what = CONTROLLER_FAULTS.get(code, "a fault that no manual names")
        return f"its controller reports: {what} (kFLT 0x{code:02X})" if code else ""

    @property
    def activation_echo(self) -> bool:
        """Echo of the activation bit (gACT); true while the activation still runs."""
        return bool(reg.gACT.read(self._registers))

    @property
    def go_echo(self) -> bool:
        """Echo of the go bit (gGTO)."""
        return bool(self._registers[0] & 0x0800)  # by hand, as the echo

    @property
    def echo(self) -> reg.Echo:
        """The echo of the request in force: gACT, gGTO, and the position of each axis."""
        # By hand for speed: this runs at every poll.
        word = self._registers
        first = word[0]
        if len(self._model.axes) == 1:
            return bool(first & 0x0100), bool(first & 0x0800), word[1] & 0xFF
        return (
            bool(first & 0x0100),
            bool(first & 0x0800),
            word[1] & 0xFF,
            word[3] >> 8,
            word[4] & 0xFF,
            word[6] >> 8,
        )

    @property
    def mode(self) -> Mode:
        """Echo of the mode (gMOD); BASIC on a model without modes."""
        return Mode(reg.gMOD.read(self._registers))

    @property
    def initialization(self) -> Initialization:
        """Progress of the activation or mode change (gIMC)."""
        return Initialization(reg.gIMC.read(self._registers))

    @property
    def motion(self) -> int:
        """The motion summary of the three fingers, 0..3, as the gripper gives it (gSTA).

        Raises:
            ValueError: the model has one axis, and no summary.
        """
        if len(self._model.axes) == 1:
            raise ValueError(f"a {self._model.title} has no motion summary: use finger_status()")
        return reg.gSTA.read(self._registers)

    @property
    def is_activated(self) -> bool:
        """Whether activation and mode change are complete (gIMC = 3)."""
        return self.initialization is Initialization.COMPLETE

    @property
    def is_reset(self) -> bool:
        """Whether gIMC = 0: reset, or in automatic release (see the fault)."""
        return self.initialization is Initialization.RESET

    @property
    def is_moving(self) -> bool:
        """Whether an axis moves: gGTO = 1, gIMC = 3 and a gDT of 0.

        gSTA = 0 or gDT = 0 alone do not mean motion: a gripper that is ready and has received no request
        reads 0 in both.
        """
        return bool(self.moving)

    @property
    def moving(self) -> Finger:
        """The axes that move; may be empty."""
        byte = object_byte_of(self._model)
        shown = self._registers[0] >> byte.shift & 0xFF
        return byte.moving[shown] if self._is_under_request else Finger(0)

    @property
    def _is_under_request(self) -> bool:
        return self.go_echo and self.is_activated

    @property
    def _states(self) -> tuple[str, ...]:
        """The :meth:`axis_state` for each gDT."""
        return _STATES if self._is_under_request else _STATES_WITHOUT_REQUEST

    @property
    def contacts(self) -> Finger:
        """The axes stopped by a contact; may be empty."""
        byte = object_byte_of(self._model)
        return byte.contacts[self._registers[0] >> byte.shift & 0xFF]

    @property
    def part(self) -> Part | None:
        """The part that is held, with its width; None if the gripper reports none.

        A finger holds a part if it reports a contact while closing, under a request in force, and without a
        serious fault. It may never report one for a thin part. A contact latches: it stays when the part has
        been taken out, until a request moves the finger.
        """
        byte = object_byte_of(self._model)
        holding = byte.holding[self._registers[0] >> byte.shift & 0xFF]
        if not holding or not self._is_under_request or self.fault.is_serious:
            return None
        jaw = len(self._model.axes) == 1
        return Part(holding, self.opening_mm(holding) if jaw else None)

    def as_dict(self) -> dict[str, Any]:
        """The status in types for JSON and pandas, by attribute name.

        Enumerations become their names, masks become lists of axis names. Values of one axis are below its
        name (``A``, ``B``, ``C``, ``SCISSOR``), and ``fault_code`` is the number of the fault.
        ``current_ma`` is left out where the link does not carry it. :meth:`from_registers` rebuilds the
        status from the first three, the model, and whether there is a current.
        """
        # A recorder calls this at every poll: read registers and not the many properties.
        words, fault, states, model = self._registers, self.fault, self._states, self._model
        scale, byte = reg.MILLIAMPERE_PER_COUNT, object_byte_of(model)
        axes: dict[str, dict[str, Any]] = {
            name: {
                "position": reg.gPO[n].read(words),
                "requested_position": reg.gPR[n].read(words),
                **({"current_ma": reg.gCU[n].read(words) * scale} if self._has_current else {}),
                "axis_state": states[model.object_status[n].read(words)],
            }
            for n, name in enumerate(model.names)
        }
        for name in model.names[:3]:  # without the scissor
            position = axes[name]["position"]
            axes[name]["opening_mm"] = self._stroke.openings[position]
            axes[name]["open_fraction"] = self._stroke.fractions[position]
        return {
            "registers": list(words),
            "timestamp": self._timestamp,
            "sequence": self._sequence,
            "fault": fault.name,
            "fault_code": int(fault),
            "controller_fault": self.controller_fault,
            "is_activated": self.is_activated,
            "is_reset": self.is_reset,
            "is_moving": self.is_moving,
            "initialization": self.initialization.name,
            "mode": self.mode.name,
            "activation_echo": self.activation_echo,
            "go_echo": self.go_echo,
            "contacts": list(byte.contact_names[words[0] >> byte.shift & 0xFF]),
            **axes,
        }

    def as_raw(self) -> dict[str, Any]:
        """The fewest figures that :meth:`from_raw` needs, in types that JSON accepts."""
        return {
            "registers": self._registers,
            "timestamp": self._timestamp,
            "sequence": self._sequence,
            "model": self._model.name,
            "has_current": self._has_current,
        }

    @classmethod
    def from_raw(cls, fields: Mapping[str, Any]) -> RobotiqStatus:
        """The status with this :meth:`as_raw`, with nominal openings.

        Raises:
            KeyError: a figure is missing.
            TypeError, ValueError: as :meth:`from_registers`, or no such model.
        """
        return cls.from_registers(
            fields["registers"],
            timestamp=fields["timestamp"],
            sequence=fields["sequence"],
            model=model_of(fields.get("model")),
            has_current=fields.get("has_current", True),
        )

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, RobotiqStatus):
            return NotImplemented
        return self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def __reduce__(self) -> tuple[object, ...]:
        *key, has_current = self._key()
        own = None if self._stroke == self._model.stroke else self._stroke
        return RobotiqStatus, (*key, own, has_current)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"RobotiqStatus is immutable: cannot set {name!r}")

    def __repr__(self) -> str:
        axes = ", ".join(
            f"{axis.name}={self.position(axis)}->{self.requested_position(axis)} "
            f"{self.axis_state(axis)}{milliampere(self.current_ma(axis))}"
            for axis in self._model.axes
        )
        controller = f"kFLT=0x{self.controller_fault:02X} " if self.controller_fault else ""
        return (
            f"<RobotiqStatus #{self._sequence} {self.initialization.name} go={int(self.go_echo)} "
            f"fault={self.fault.name} {controller}{axes}>"
        )

    def _key(self) -> tuple[reg.Registers, float, int, Model, bool]:
        return self._registers, self._timestamp, self._sequence, self._model, self._has_current


def milliampere(current: int | None) -> str:
    """A current as the end of a text; empty if it is not known."""
    return "" if current is None else f" {current}mA"
