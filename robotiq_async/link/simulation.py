"""Options of a simulated gripper in its address: ``sim://?speedup=10&object=150``."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from ..values.checks import check_byte

SLOWEST: Final = 0.01
FASTEST: Final = 1000.0
"""Faster than that, whole motions pass between two polls."""
_OPTIONS: Final = ("speedup", "object")


@dataclass(frozen=True, slots=True)
class Simulation:
    """The options of a simulated gripper.

    Attributes:
        speedup: simulated seconds in one second of the clock, 0.01..1000.
        object: position in counts, 0..255, at which the fingers A, B and C meet an object when they close;
            None for no object.
    """

    speedup: float = 1.0
    object: int | None = None

    def __str__(self) -> str:
        speedup = int(self.speedup) if self.speedup == int(self.speedup) else self.speedup
        options = [f"speedup={speedup!r}"] if speedup != 1 else []
        options += [] if self.object is None else [f"object={self.object}"]
        return f"?{'&'.join(options)}" if options else ""


NOTHING_SPECIAL: Final = Simulation()


def parse_simulation(query: str) -> Simulation:
    """Parse the part after ``sim://``: nothing, or ``?OPTION=VALUE&...``.

    Raises:
        ValueError: an unknown option, one given twice, or a value outside its range.
    """
    given: dict[str, str] = {}
    for part in query.removeprefix("?").split("&") if query else ():
        name, separator, value = part.partition("=")
        if name not in _OPTIONS:
            raise ValueError(f"no option {name!r}; known are: {', '.join(_OPTIONS)}")
        if not separator or name in given:
            raise ValueError(f"{name} must be given once, as {name}=VALUE")
        given[name] = value
    return Simulation(
        speedup=_speedup(given["speedup"]) if "speedup" in given else 1.0,
        object=_object(given["object"]) if "object" in given else None,
    )


def _speedup(text: str) -> float:
    is_number = re.fullmatch(r"[0-9]{1,9}(\.[0-9]{1,9})?", text)
    if not is_number or not SLOWEST <= float(text) <= FASTEST:
        raise ValueError(f"speedup must be a number in {SLOWEST:g}..{FASTEST:g}, got {text!r}")
    return float(text)


def _object(text: str) -> int:
    if not re.fullmatch(r"[0-9]{1,9}", text):
        raise ValueError(f"object must be an integer in 0..255, got {text!r}")
    return check_byte("object", int(text))
