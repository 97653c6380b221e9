"""Amounts: positions, speeds and forces as people give them, turned into the counts that a gripper takes.

An amount is given once: in counts, in millimetres, as a fraction, or in newtons of a label. Two at a time are
refused, even if they agree. Each is refused in its own unit, and nothing is clamped. Only counts are sent,
in this process and to other hosts.
"""

from __future__ import annotations

from typing import Final

from ..values.checks import check_optional_byte, repr_of
from ..values.enums import Finger
from .units import Units

OPENINGS: Final = ("mm", "open_fraction")
"""The arguments of calls that replace a position."""
RATES: Final = ("mm_per_s",)
"""The arguments that replace a speed."""
LABELS: Final = ("label_n",)
"""The arguments that replace a force."""
UNITS: Final = frozenset((*OPENINGS, *RATES, *LABELS))
"""All arguments in other units: this process converts them to counts, and an agent refuses them."""


def position_of(
    units: Units,
    axes: Finger,
    counts: int | None = None,
    mm: float | None = None,
    open_fraction: float | None = None,
    name: str = "position",
) -> int | None:
    """A position in counts; None if no amount is given. ``name`` is the name of the argument in counts.

    Raises:
        TypeError: of the wrong type, or more than one of the amounts is given.
        ValueError: outside its range, or millimetres or a fraction for the scissor.
    """
    if mm is None and open_fraction is None:
        try:
            return check_optional_byte(name, counts)
        except TypeError as error:
            raise TypeError(f"{error}; millimetres are mm=40.5") from None
    _check_one({name: counts, "mm": mm, "open_fraction": open_fraction})
    if Finger.SCISSOR in axes:
        given = "open_fraction" if mm is None else "mm"
        raise ValueError(f"{given} is of fingers, for the scissor has no opening: fingers must not be {axes}")
    if open_fraction is not None:
        return units.position(open_fraction=open_fraction)
    assert mm is not None, "one of the two is given"
    return units.position(mm=mm)


def speed_of(
    units: Units, counts: int | None = None, mm_per_s: float | None = None, name: str = "speed"
) -> int | None:
    """A speed in counts, as :func:`position_of`."""
    if mm_per_s is None:
        return check_optional_byte(name, counts)
    _check_one({name: counts, "mm_per_s": mm_per_s})
    return units.speed(mm_per_s=mm_per_s)


def force_of(
    units: Units, counts: int | None = None, label_n: float | None = None, name: str = "force"
) -> int | None:
    """A force in counts, as :func:`position_of`."""
    if label_n is None:
        return check_optional_byte(name, counts)
    _check_one({name: counts, "label_n": label_n})
    return units.force(label_n=label_n)


def needed(call: str, counts: int | None, *names: str) -> int:
    """An amount that a call cannot do without.

    Raises:
        TypeError: none was given.
    """
    if counts is None:
        raise TypeError(f"{call}() needs one of {', '.join(names)}")
    return counts


def _check_one(given: dict[str, object]) -> None:
    twice = [f"{name}={repr_of(value)}" for name, value in given.items() if value is not None]
    if len(twice) > 1:
        raise TypeError(f"one of {', '.join(given)} can be given, got {' and '.join(twice)}")
