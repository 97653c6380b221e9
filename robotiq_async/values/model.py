"""Model: the properties of one gripper of the family, as data.

All models have the registers of one finger. A 2F or a Hand-E is finger A of a 3-Finger whose object status
lies in byte 0 instead of byte 1 (manuals of the 2F-85/2F-140 and of the Hand-E, chapter on registers).
None of this has run on real hardware yet.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from typing import Final

from . import registers as reg
from .checks import check_axis, check_int, check_mask, repr_of
from .enums import Fault, Finger, names_of
from .registers import Field, RegisterMap
from .stroke import Stroke

TOLERANCE: Final = 2
"""Counts between a request and the position reached (manual: within 1-2)."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Model:
    """A model of gripper. The four of them are constants; compare them with ``is``.

    Attributes:
        name: in addresses, files and on the command line: ``3f``, ``2f85``, ``2f140``, ``hand-e``.
        title: name for people.
        axes: its axes, in the order of their registers.
        object_status: fields with the object status of each axis.
        faults: the fault of each code, 0..15.
        tcp: registers over Modbus TCP.
        rtu: registers on a serial line.
        stroke: openings of the fingers by position.
        open_reading_min: the least, in counts, that an open finger reads.
        open_reading_max: the most.
        closed_reading_min: the least, in counts, that a closed finger reads.
        speeds_mm_s: nominal speeds at the values 0 and 255.
        forces_n: nominal forces at the values 0 and 255.
        has_modes: whether it has grasping modes, and request bits that choose individual control.
        all_axes: its axes, as a mask.
        names: of the axes.
    """

    name: str
    title: str
    axes: tuple[Finger, ...]
    object_status: tuple[Field, ...]
    faults: tuple[Fault, ...]
    tcp: RegisterMap
    rtu: RegisterMap
    stroke: Stroke
    open_reading_min: int
    open_reading_max: int
    closed_reading_min: int
    speeds_mm_s: tuple[float, float]
    forces_n: tuple[float, float]
    has_modes: bool = False
    # Worked out once: statuses are decoded at every poll.
    all_axes: Finger = field(init=False)
    names: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "all_axes", Finger(sum(self.axes)))
        object.__setattr__(self, "names", tuple(names_of(self.all_axes)))

    def __repr__(self) -> str:
        return self.title

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return model_of, (self.name,)

    def fault(self, code: object) -> Fault:
        """The fault of a code.

        Raises:
            TypeError: not an int.
            ValueError: outside 0..15.
        """
        return self.faults[check_int("fault", code, 0, 15)]

    def mask(self, fingers: object) -> Finger:
        """A mask of axes of this model. ``Finger.ABC`` are its fingers and ``Finger.ALL`` its axes.

        Raises:
            TypeError: not a Finger or an int.
            ValueError: not a mask, or an axis that the model does not have.
        """
        mask = check_mask(fingers)
        if mask in (Finger.ABC, Finger.ALL):
            return mask & self.all_axes
        if missing := mask & ~self.all_axes:
            raise ValueError(
                f"fingers must be axes of a {self.title} ({', '.join(self.names)}), got {missing}"
            )
        return mask

    def has_reached(self, request: int, position: int) -> bool:
        """Whether an axis that rests at a position, in counts, can have reached a request."""
        if abs(request - position) <= TOLERANCE:
            return True
        # A stop may lie before the request, but not behind it.
        if request <= self.open_reading_max:
            return request < position <= self.open_reading_max + TOLERANCE
        return request > position >= self.closed_reading_min - TOLERANCE


THREE_FINGER: Final = Model(
    name="3f",
    title="3-Finger",
    axes=(Finger.A, Finger.B, Finger.C, Finger.SCISSOR),
    object_status=reg.gDT,
    faults=tuple(Fault(code) for code in range(16)),
    tcp=reg.TCP_REGISTERS,
    rtu=reg.RTU_REGISTERS,
    # Manual of the 3-Finger, specifications: stroke, speed, force. Readings: the manual's worked example.
    stroke=Stroke(155.0, open_reading=6, closed_reading=241),
    open_reading_min=6,
    open_reading_max=7,
    closed_reading_min=240,
    speeds_mm_s=(22.0, 110.0),
    forces_n=(15.0, 60.0),
    has_modes=True,
)
"""The 3-Finger gripper (S-Model): the default everywhere."""

_JAW_AXES: Final = (Finger.A,)
_ADAPTIVE_FAULTS: Final = tuple(Fault.adaptive(code) for code in range(16))
# No model of these speaks Modbus TCP (but for the retired universal controller): a gateway passes on the
# registers of the serial line. The vendor's software reads with function 3, newer manuals list 4 and 23.
# Manuals and public drivers know three registers of either block; no source covers more.
_GATEWAY: Final = RegisterMap(request=0x03E8, status=0x07D0, read_function=3, device_id=9, count=3)


def _with_jaw(
    name: str,
    title: str,
    mm: float,
    speeds_mm_s: tuple[float, float],
    forces_n: tuple[float, float],
    arc: tuple[float, float] | None = None,
) -> Model:
    return Model(
        name=name,
        title=title,
        axes=_JAW_AXES,
        object_status=(reg.gOBJ,),
        faults=_ADAPTIVE_FAULTS,
        tcp=_GATEWAY,
        # Manual of the 2F-85 and 2F-140 (4.7.5): function 23, which the vendor's software uses as well.
        # Whether gateways pass it on is unknown.
        rtu=replace(_GATEWAY, write_function=23),
        # A 2F-85 reads 3 and 227 to 230 (PickNik's driver); no other source gives the readings of the others.
        stroke=Stroke(mm, open_reading=3, closed_reading=228, arc=arc),
        # Recorded: 2 and 3 open, 225 to 230 closed; 12 and 13 open on units of 2015 and in the manual.
        open_reading_min=2,
        open_reading_max=13,
        closed_reading_min=224,
        speeds_mm_s=speeds_mm_s,
        forces_n=forces_n,
    )


# Arc of a 2F-85: fits the pads of the public model in MuJoCo Menagerie within 0.1 mm; they meet at its end.
# Arc of a 2F-140: the link from knuckle to inner finger in ros-industrial's description; the joint's limit.
_ARC_85: Final = (0.869, 0.775)
_ARC_140: Final = (0.868, 0.70)

# Manual of the 2F-85 and 2F-140, specifications; manual of the Hand-E, the 130 N come from its example.
TWO_FINGER_85: Final = _with_jaw("2f85", "2F-85", 85.0, (20.0, 150.0), (20.0, 235.0), _ARC_85)
"""The gripper with two fingers that opens by 85 mm."""
TWO_FINGER_140: Final = _with_jaw("2f140", "2F-140", 140.0, (30.0, 250.0), (10.0, 125.0), _ARC_140)
"""The gripper with two fingers that opens by 140 mm."""
HAND_E: Final = _with_jaw("hand-e", "Hand-E", 50.0, (20.0, 150.0), (20.0, 130.0))
"""The parallel gripper Hand-E, which opens by 50 mm."""

MODELS: Final = {model.name: model for model in (THREE_FINGER, TWO_FINGER_85, TWO_FINGER_140, HAND_E)}
"""The models by name."""


def model_of(value: object, name: str = "model") -> Model:
    """A model, also by its name; None is the 3-Finger."""
    if value is None:
        return THREE_FINGER
    if isinstance(value, Model):
        return value
    if not isinstance(value, str):
        raise TypeError(f"{name} must be a Model or one of {', '.join(MODELS)}, got {repr_of(value)}")
    if value.lower() not in MODELS:
        meant = get_close_matches(value.lower(), MODELS, 1, 0.8)
        hint = f"; did you mean {meant[0]}?" if meant else ""
        raise ValueError(f"{name} must be one of {', '.join(MODELS)}, got {value!r:.100}{hint}")
    return MODELS[value.lower()]


def index_of(model: Model, finger: object) -> int:
    """The place of one axis among the registers of a model.

    Raises:
        TypeError: not a Finger or an int.
        ValueError: not exactly one axis, or one that the model does not have.
    """
    axis = finger if type(finger) is Finger and finger in model.axes else check_axis(finger)
    if axis not in model.axes:
        raise ValueError(f"finger must be an axis of a {model.title} ({', '.join(model.names)}), got {axis}")
    return model.axes.index(axis)
