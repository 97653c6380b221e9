"""Enumerations and constants: axes, modes, object states, faults; states, triggers and stops of the hand."""

from __future__ import annotations

import operator
from collections.abc import Callable
from enum import Enum, IntEnum, IntFlag
from typing import ClassVar, Final, Self


class Finger(IntFlag):
    """The axes of a gripper, and masks of them.

    ``A`` is the single finger that closes between ``B`` and ``C``; ``SCISSOR`` spreads ``B`` and ``C``. A 2F
    or a Hand-E has ``A`` alone, also called ``JAW``.
    """

    A = 1
    JAW = 1
    B = 2
    C = 4
    SCISSOR = 8
    ABC = 7
    ALL = 15

    def __str__(self) -> str:
        return "|".join(str(axis.name) for axis in self) or "none"

    # IntFlag makes each result by a lookup in Python, which takes 1 us, and a command needs forty results.
    def __and__(self, other: int) -> Finger:
        if type(other) is Finger and (mask := self._value_ & other._value_) in _MASKS:
            return _MASKS[mask]
        return super().__and__(other)

    def __or__(self, other: int) -> Finger:
        if type(other) is Finger and (mask := self._value_ | other._value_) in _MASKS:
            return _MASKS[mask]
        return super().__or__(other)

    def __invert__(self) -> Finger:
        return _MASKS[~self._value_ & 15]


_MASKS: Final = {mask: Finger(mask) for mask in range(16)}

JAW: Final = Finger.A
"""The one axis of a 2F or a Hand-E: another name of ``Finger.A``."""
NO_AXES: Final = Finger(0)
"""The empty mask."""


def names_of(axes: Finger) -> list[str]:
    """The names of the axes of a mask, in the order of their registers."""
    return [str(axis.name) for axis in axes]


OPEN: Final = 0
"""Position request of a fully open finger (it reads 6-7 there)."""
CLOSED: Final = 255
"""Position request of a fully closed finger (it reads 240 or more there)."""
WIDTH_NORMAL: Final = 100
"""Scissor request between wide and pinch."""
WIDTH_WIDE: Final = 0
"""Scissor request with B and C furthest apart."""
WIDTH_PINCH: Final = 255
"""Scissor request with B and C together."""
SPEED_MIN: Final = 0
"""Slowest, not standing: 22 mm/s nominal (manual 2012, 4.6), full closing in 10.0 s (thesis, table A1.1)."""
SPEED_MAX: Final = 255
"""Fastest: 110 mm/s nominal (manual 2012, 4.6), full closing in 2.1 s (thesis, table A1.1)."""
FORCE_MIN: Final = 0
"""Weakest, not nothing: 15 N nominal (manual 2014, p. 47)."""
FORCE_MAX: Final = 255
"""Strongest: 60 N nominal (manual 2014, p. 47)."""

DEFAULT_SPEED: Final = 128
"""Used until ``set_speed()``, ``set_force()`` or an argument sets another."""
DEFAULT_FORCE: Final = 64
"""Used until ``set_speed()``, ``set_force()`` or an argument sets another."""


class Code(IntEnum):
    """A field of the status: prints as its name and behaves as its number everywhere else.

    ``print(fault)`` and ``f"{fault}"`` show ``NONE``; ``f"{fault:02X}"`` and JSON show the number.
    """

    def __str__(self) -> str:
        return self.name


class Mode(Code):
    """rMOD / gMOD: the grasping mode of simple control; ignored while the scissor has its own registers."""

    BASIC = 0
    PINCH = 1
    WIDE = 2
    SCISSOR = 3


class ObjectStatus(Code):
    """gDTA, gDTB, gDTC, gDTS: the state of an axis, as reported by the gripper.

    The gripper also reports IN_MOTION for an axis at rest that has received no request; for people, use
    :meth:`RobotiqStatus.axis_state`. The thesis's table swaps 1 and 2; the
    hardware reports 1 for a contact while opening (see docs/decisions/thesis-map.md).
    """

    IN_MOTION = 0
    """Moving; meaningful only while the go bit is set."""
    CONTACT_OPENING = 1
    """Stopped by a contact while opening."""
    CONTACT_CLOSING = 2
    """Stopped by a contact while closing."""
    AT_POSITION = 3
    """At the requested position."""

    @property
    def is_contact(self) -> bool:
        """Whether an obstacle stopped the axis."""
        return self in (ObjectStatus.CONTACT_OPENING, ObjectStatus.CONTACT_CLOSING)


CONTROLLER_FAULTS: Final = {
    0x04: "no 24 V supply",
    0x05: "no gripper is connected",
    0x09: "it is booting",
    0x0C: "emergency stop",
    0x0E: "over-current",
}
"""Faults of the Universal Controller (kFLT), from the manual of the 2F."""


class Initialization(Code):
    """gIMC: progress of the activation or of a mode change."""

    RESET = 0
    """Reset, or in automatic release."""
    ACTIVATING = 1
    CHANGING_MODE = 2
    COMPLETE = 3


class Severity(Enum):
    """Severity of a fault: the manual's classes."""

    NONE = "none"
    PRIORITY = "priority"
    """Not a defect: the gripper delays or ignores the action."""
    MINOR = "minor"
    """Clears by itself."""
    MAJOR = "major"
    """Needs a reset and a new activation."""


_FAULTS: Final[dict[str, tuple[Severity, str]]] = {
    "NONE": (Severity.NONE, "no fault"),
    "ACTIVATION_PENDING": (Severity.PRIORITY, "the action waits until the activation has finished"),
    "MODE_CHANGE_PENDING": (Severity.PRIORITY, "the action waits until the mode change has finished"),
    "NOT_ACTIVATED": (Severity.PRIORITY, "the action waits until the gripper is activated"),
    "OVER_TEMPERATURE": (Severity.MINOR, "the gripper is too hot: let it cool down"),
    "COMMUNICATION_NOT_READY": (Severity.MINOR, "the communication chip is not ready, it may be booting"),
    "SCISSOR_INTERFERENCE": (Severity.MINOR, "interference on the scissor for less than 20 s"),
    "UNDER_VOLTAGE": (Severity.MAJOR, "the supply voltage is too low"),
    "AUTOMATIC_RELEASE": (Severity.MINOR, "an automatic release is in progress"),
    "INTERNAL_FAULT": (Severity.MAJOR, "an internal fault of the gripper"),
    "ACTIVATION_FAULT": (Severity.MAJOR, "the activation failed: interference or another error"),
    "SCISSOR_BLOCKED": (Severity.MAJOR, "interference on the scissor for more than 20 s"),
    "OVER_CURRENT": (Severity.MAJOR, "a motor drew too much current"),
    "AUTOMATIC_RELEASE_DONE": (Severity.MAJOR, "an automatic release has been completed"),
}
_ADAPTIVE: Final = "2F"
"""Marks the values of faults that only the 2F and the Hand-E have."""
_SHARED: Final = frozenset({0x00, 0x05, 0x07, 0x09, 0x0B, 0x0D, 0x0F})
"""The codes that mean the same on all models."""


class Fault(Code):
    """gFLT: the fault codes of the thesis's table 4, and the codes of the 2F and the Hand-E.

    Some codes differ in meaning between a 3-Finger and its siblings; a status decodes them for its model, and
    ``Fault(code)`` is the fault of the 3-Finger. A code that is missing in a table becomes a new member,
    ``Fault(0x0C).name == "UNKNOWN_0x0C"``, with severity MAJOR: an unknown fault is never reported as no
    fault. Two faults are equal if they are the same; compared with a number, the code counts.
    """

    NONE = 0x00
    ACTIVATION_PENDING = 0x05
    MODE_CHANGE_PENDING = 0x06
    NOT_ACTIVATED = 0x07
    COMMUNICATION_NOT_READY = 0x09
    """On a 2F or a Hand-E also: a second without a message, reported once (see passing faults)."""
    SCISSOR_INTERFERENCE = 0x0A
    AUTOMATIC_RELEASE = 0x0B
    ACTIVATION_FAULT = 0x0D
    SCISSOR_BLOCKED = 0x0E
    AUTOMATIC_RELEASE_DONE = 0x0F
    # Only a 2F and a Hand-E have these (their manuals, fault codes).
    OVER_TEMPERATURE = 0x08, _ADAPTIVE
    UNDER_VOLTAGE = 0x0A, _ADAPTIVE
    INTERNAL_FAULT = 0x0C, _ADAPTIVE
    OVER_CURRENT = 0x0E, _ADAPTIVE

    def __new__(cls, code: int, family: str = "") -> Fault:
        member = int.__new__(cls, code)
        member._value_ = (code, family) if family else code  # type: ignore[assignment]  # so it is no alias
        return member

    @classmethod
    def adaptive(cls, code: int) -> Fault:
        """The fault of a code, 0..15, on a 2F or a Hand-E."""
        return cls(code if code in _SHARED else (code, _ADAPTIVE))  # type: ignore[arg-type]

    @classmethod
    def _missing_(cls, value: object) -> Fault | None:
        code, *family = value if isinstance(value, tuple) else (value,)
        if isinstance(code, bool) or family not in ([], [_ADAPTIVE]):
            return None
        try:
            number = int(operator.index(code))
        except TypeError:
            return None
        if not 0 <= number <= 15:
            return None
        key: object = (number, *family) if family else number
        if key in cls._value2member_map_:
            return cls(key)  # type: ignore[arg-type]
        # IntEnum's constructor refuses new values. Make and register the member here, so that
        # Fault(12) is Fault(12) and hashes, compares and prints like the others.
        member = int.__new__(cls, number)
        member._name_ = f"UNKNOWN_0x{number:02X}"
        member._value_ = key  # type: ignore[assignment]
        cls._value2member_map_[key] = member
        return member

    def __eq__(self, other: object) -> bool:
        return self is other if isinstance(other, Fault) else int(self) == other

    def __ne__(self, other: object) -> bool:
        return not self == other

    __hash__ = int.__hash__

    # Enum would show the value, which is a pair for some.
    def __format__(self, spec: str) -> str:
        return format(int(self), spec) if spec else self.name

    def __repr__(self) -> str:
        return f"<Fault.{self.name}: {int(self)}>"

    def __reduce_ex__(self, protocol: object) -> tuple[type[Fault], tuple[object]]:
        return Fault, (self._value_,)

    @property
    def severity(self) -> Severity:
        """The class of the fault; an unknown code counts as MAJOR, and :meth:`Hand.recover` resets none."""
        return _FAULTS[self._name_][0] if self._name_ in _FAULTS else Severity.MAJOR

    @property
    def description(self) -> str:
        """The fault in one sentence."""
        if self._name_ in _FAULTS:
            return _FAULTS[self._name_][1]
        return f"fault code 0x{int(self):02X}, which the manual does not assign"

    @property
    def is_known(self) -> bool:
        """Whether the manual of the model assigns the code."""
        return self._name_ in _FAULTS

    @property
    def is_serious(self) -> bool:
        """Whether the fault is MINOR or MAJOR, and so ends a move."""
        return self.severity in (Severity.MINOR, Severity.MAJOR)


class State(Enum):
    """The state of a hand: the thirteen states of the thesis, and RESET.

    DO_ states last until their request is acknowledged (DO_SHUTDOWN until the hand has stopped), WF_ states
    (wait for) until the gripper reports the result.
    """

    # Members compare by identity. Enum hashes the name, which is too slow for a lookup at every poll.
    __hash__: ClassVar[Callable[[object], int]] = object.__hash__

    DISCONNECTED = "disconnected"
    """No link: before the first status, or while it is being opened again."""
    DO_ACTIVATION = "do_activation"
    WF_ACTIVATION = "wf_activation"
    RUNNING_IDLE = "running_idle"
    """Active; every command has been delivered (the fingers may be moving)."""
    RUNNING_CC = "running_cc"
    """Active; a changed command is on its way to the gripper."""
    FAULT = "fault"
    """The gripper reports a minor or a major fault."""
    DO_ATR = "do_atr"
    WF_ATR = "wf_atr"
    ATR_DONE = "atr_done"
    """The automatic release is complete; only a reset leads out."""
    DO_RESET = "do_reset"
    WF_RESET = "wf_reset"
    RESET = "reset"
    """Connected but not activated: waits for activate()."""
    DO_SHUTDOWN = "do_shutdown"
    SHUTDOWN = "shutdown"
    """stop() has ended; the hand may be started again."""


class Trigger(Enum):
    """An event that can change the state of a hand.

    ``ASK_`` marks a call of the user, ``SEEN_`` a condition found in a status; the others concern the link
    and the delivery of a request. DELIVERED comes, too, if there is nothing left to deliver: the request
    was dropped, or is in force already. HALT_RESETS is a halt in a state that shows no activation and no
    release, while one drives the fingers or is about to: only a reset ends it.
    """

    __hash__: ClassVar[Callable[[object], int]] = object.__hash__  # see State

    ASK_START = "start()"
    ASK_ACTIVATE = "activate()"
    ASK_COMMAND = "a command"
    ASK_HOLD = "hold()"
    ASK_HALT = "halt()"
    ASK_RELEASE = "atr()"
    ASK_RESET = "reset()"
    ASK_STOP = "stop()"
    HALT_RESETS = "halt(), by a reset"
    ACTIVATES = "gripper is reset, and is to be activated"
    DELIVERED = "request acknowledged"
    SEEN_READY = "gripper is active"
    SEEN_BUSY = "gripper is activating"
    SEEN_RESET = "gripper is reset"
    SEEN_STRANDED = "gripper has rACT and does not activate"
    SEEN_FAULT = "gripper reports a fault"
    SEEN_RELEASED = "automatic release completed"
    LINK_LOST = "link lost"
    STOPPED = "shutdown finished"

    @property
    def is_seen(self) -> bool:
        """Whether this is a condition found in a status."""
        return self.name.startswith("SEEN_")


class StopLevel(IntEnum):
    """The strength of a stop: of several stops the strongest counts."""

    LEAVE = 0
    """End the hand and leave the fingers as they are."""
    KEEP = 1
    """Hold axes that move, and leave rGTO set if every axis is seen at rest."""
    HALT = 2
    """Clear rGTO; the hand keeps running."""
    SHUTDOWN = 3
    """Clear rGTO, and wait for the echo of the whole last image."""
    RESET = 4
    """Clear rACT. This clears faults, releases the part and ends an activation."""

    @classmethod
    def of(cls, *, halt: bool, keep_grip: bool) -> Self:
        """The level for the arguments of ``stop()``."""
        if not halt:
            return cls(cls.LEAVE)
        return cls(cls.KEEP if keep_grip else cls.SHUTDOWN)

    @property
    def done(self) -> str:
        """The participle for messages: the fingers are ..."""
        return {StopLevel.LEAVE: "left as they are", StopLevel.KEEP: "held"}.get(self, "stopped")

    @property
    def prevails(self) -> str:
        """The warning about a weaker stop that comes later."""
        return f"a stronger stop has begun: the fingers are {self.done}"
