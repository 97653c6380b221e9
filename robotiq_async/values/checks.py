"""Argument checks: each names the argument, the value and the range, and nothing is clamped.

A wrong type is a TypeError, a value outside its range a ValueError.

An int is any object with ``__index__``, such as numpy's integers; a number is a real number or an int. An
array of numpy without dimensions is the number in it. The result is a plain int or float. A bool is refused:
it hints at a misplaced argument.
"""

from __future__ import annotations

import math
import operator
import sys
from contextlib import suppress
from numbers import Real
from typing import Final

from .enums import Finger

_BY_VALUE: Final = {int(axis): axis for axis in (Finger.A, Finger.B, Finger.C, Finger.SCISSOR)}


def check_byte(name: str, value: object) -> int:
    """A position, speed or force: an int in 0..255."""
    return check_int(name, value, 0, 255)


def check_optional_byte(name: str, value: object) -> int | None:
    """A value in 0..255, or None for no change."""
    return None if value is None else check_byte(name, value)


def check_int(name: str, value: object, low: int, high: int) -> int:
    """An int in low..high."""
    number = as_int(value)
    if number is None:
        raise TypeError(f"{name} must be an int in {low}..{high}, got {repr_of(value)}")
    if not low <= number <= high:
        raise ValueError(f"{name} must be in {low}..{high}, got {repr_of(value)}")
    return number


def repr_of(value: object) -> str:
    """A value for a message. Python refuses to write an int of more than 4,300 digits."""
    try:
        return repr(value)
    except ValueError:
        return f"a number of {int(value).bit_length()} bits" if isinstance(value, int) else "a huge number"


def as_int(value: object) -> int | None:
    """Convert to a plain int; None if it is not an int, or is a bool."""
    if type(value) is int:
        return value
    value = _element(value)
    if isinstance(value, bool):
        return None
    try:
        return int(operator.index(value))  # type: ignore[arg-type]  # TypeError: not an int
    except TypeError:
        return None


def check_mask(fingers: object) -> Finger:
    """A mask of axes: a Finger, or an int in 1..15."""
    mask = as_int(fingers)
    if mask is None:
        raise TypeError(f"fingers must be a Finger mask or an int in 1..15, got {repr_of(fingers)}")
    if not 1 <= mask <= 15:
        raise ValueError(f"fingers must be a mask of Finger members in 1..15, got {repr_of(mask)}")
    return Finger(mask)


def parse_fingers(name: str, text: str) -> Finger:
    """A mask of axes from words: ``ABC``, ``A,B``, ``scissor``, ``jaw``, ``all``."""
    mask = Finger(0)
    for word in text.upper().split(","):
        word = word.strip()
        if word in Finger.__members__:
            mask |= Finger[word]
        elif word and set(word) <= set("ABC"):
            for letter in word:
                mask |= Finger[letter]
        else:
            raise ValueError(f"{name} must name axes (ABC, or A,B, or scissor, or jaw, or all), got {word!r}")
    return mask


def check_axis(finger: object) -> Finger:
    """Exactly one axis."""
    if type(finger) is Finger and finger in _SINGLE:
        return finger
    value = as_int(finger)
    if value is None:
        raise TypeError(f"finger must be one Finger (A, B, C or SCISSOR), got {repr_of(finger)}")
    axis = _BY_VALUE.get(value)
    if axis is None:
        raise ValueError(
            f"finger must be one of Finger.A, B, C or SCISSOR (1, 2, 4 or 8), got {repr_of(finger)}"
        )
    return axis


def check_seconds(name: str, value: object, low: float, high: float) -> float:
    """A duration in seconds within low..high."""
    return check_number(name, value, low, high, "seconds")


def check_number(name: str, value: object, low: float, high: float, what: str = "a number") -> float:
    """A number within low..high; ``what`` is for the message."""
    number = as_float(value)
    if number is None:
        raise TypeError(f"{name} must be {what} in {low}..{high}, got {repr_of(value)}")
    if not low <= number <= high:
        raise ValueError(f"{name} must be {what} in {low}..{high}, got {repr_of(value)}")
    return number


def as_float(value: object) -> float | None:
    """Convert to a plain float, infinite on overflow; None if it is not a number, or is a bool.

    ``__float__`` alone is not enough: numpy's bool and its complex have it, too.
    """
    value = _element(value)
    number = value if isinstance(value, float | Real) and not isinstance(value, bool) else as_int(value)
    try:
        return None if number is None else float(number)
    except OverflowError:
        return math.inf
    except TypeError:  # it has __index__ and is not a number
        return None


def single(value: object) -> object:
    """The number in an array or a tensor with one element; anything else as it is."""
    item = getattr(value, "item", None)
    if as_float(value) is None and callable(item):
        with suppress(ValueError, RuntimeError):  # numpy's and torch's, of several
            return item()
    return value


def _element(value: object) -> object:
    """The number in an array of numpy without dimensions; anything else is itself.

    None for numpy's timedelta, which counts as an integer there.
    """
    if getattr(getattr(value, "dtype", None), "kind", "") == "m":
        return None
    if hasattr(type(value), "__setitem__") and getattr(value, "shape", None) == ():
        return value[()]  # type: ignore[index]
    return value


def check_timeout(name: str, value: object) -> float | None:
    """A timeout: None for no limit, or seconds above 0."""
    if value is None:
        return None
    number = as_float(value)
    if number is None:
        raise TypeError(f"{name} must be None or seconds above 0, got {repr_of(value)}")
    if not 0 < number <= sys.float_info.max:
        raise ValueError(f"{name} must be None or seconds above 0, got {repr_of(value)}")
    return number


def check_flag(name: str, value: object) -> bool:
    """True or False."""
    if not isinstance(value, bool):
        raise TypeError(f"{name} must be True or False, got {repr_of(value)}")
    return value


_SINGLE: Final = frozenset(_BY_VALUE.values())
