"""Convention: the numbers by which a learning stack calls an open and a closed gripper. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Final

from ..values.checks import as_float, check_number, repr_of, single


@dataclass(frozen=True, slots=True)
class Convention:
    """The scale of a learning stack, linear in the share of the travel that is open. Immutable.

    Stacks differ in range and sign, and a wrong sign opens where it should grip: no scale is the default.

        hand.command(open_fraction=Convention.DROID.fraction(action))
        state = Convention.DROID.value(status.open_fraction(JAW))

    For another stack: ``Convention("bench", open=0.0, closed=5.0)``. No convention measures an opening: the
    metres of POLYMETIS_2F85 are linear in counts, and up to 2.8 mm off the arc of the linkage.

    Attributes:
        name: for messages and tables.
        open: the number of an open gripper.
        closed: the number of a closed gripper, which presses.

    Raises:
        TypeError: ``name`` is not a text, or another argument is not a number.
        ValueError: a number beyond 1e9, or two equal numbers.
    """

    name: str
    open: float
    closed: float

    DROID: ClassVar[Convention]
    RLDS: ClassVar[Convention]
    LIBERO: ClassVar[Convention]
    HIL_SERL: ClassVar[Convention]
    MANISKILL: ClassVar[Convention]
    LEROBOT: ClassVar[Convention]
    UR_RTDE: ClassVar[Convention]
    POLYMETIS_2F85: ClassVar[Convention]
    RADIANS_2F85: ClassVar[Convention]
    RADIANS_2F140: ClassVar[Convention]

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise TypeError(f"name must be a text, got {repr_of(self.name)}")
        for end in ("open", "closed"):
            object.__setattr__(self, end, check_number(end, getattr(self, end), -1e9, 1e9))
        if self.open == self.closed:
            raise ValueError(f"open and closed must differ, got {self.open:g} for both")

    def fraction(self, value: object, *, clamp: bool = False) -> float:
        """The share of the travel that is open, for ``open_fraction=``: exactly 1 and 0 at the two ends.

        Args:
            value: a number, or an array or a tensor with one element.
            clamp: whether a number beyond the range counts as its end, as for policies, which overshoot.

        Raises:
            TypeError, ValueError: no number; beyond the range and not clamped; NaN and infinity always.
        """
        low, high = sorted((self.open, self.closed))
        number = as_float(value := single(value))
        if clamp and number is not None and math.isfinite(number):
            value = min(max(number, low), high)
        number = check_number("value", value, low, high, f"a number of {self.name}")
        return abs(number - self.closed) / abs(self.open - self.closed)

    def value(self, open_fraction: float) -> float:
        """The number of an opening, as of ``status.open_fraction(JAW)``; raises as :meth:`fraction`."""
        share = check_number("open_fraction", open_fraction, 0.0, 1.0)
        return share * self.open + (1 - share) * self.closed


# Sources as read; of MANISKILL, RLDS and the radians nothing was run.
Convention.DROID = Convention("DROID", 0.0, 1.0)  # droid/franka/robot.py; pi0, Positronic, GELLO's sign
Convention.RLDS = Convention("RLDS", 1.0, 0.0)  # "+1 = open, 0 = close": Octo, OpenVLA, Bridge, RT-1
Convention.LIBERO = Convention("LIBERO", -1.0, 1.0)  # robosuite, robotiq_85_gripper.py: format_action
Convention.HIL_SERL = Convention("HIL_SERL", 1.0, -1.0)  # franka_env.py: -0.5 and less closes
Convention.MANISKILL = Convention("MANISKILL", 1.0, -1.0)  # panda.py: the limits of the fingers' joints
Convention.LEROBOT = Convention("LEROBOT", 100.0, 0.0)  # RANGE_0_100 of its grippers
Convention.UR_RTDE = Convention("UR_RTDE", 1.0, 0.0)  # robotiq_gripper.h: normalized, against its counts
Convention.POLYMETIS_2F85 = Convention("POLYMETIS_2F85", 0.085, 0.0)  # robotiq_2f_gripper.py
Convention.RADIANS_2F85 = Convention("RADIANS_2F85", 0.0, 0.8)  # driver joint of the public URDFs
Convention.RADIANS_2F140 = Convention("RADIANS_2F140", 0.0, 0.7)
CONVENTIONS: Final = {each.name: each for each in vars(Convention).values() if isinstance(each, Convention)}
