"""Inhibit: that motion is refused, until a person permits it again. control/state_machine.py keeps it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Final, Self

from .checks import as_float, repr_of

LONGEST_REASON: Final = 200  # characters of a reason, and of who gave it


@dataclass(frozen=True, slots=True)
class Inhibit:
    """Motion of a hand is refused, until a person permits it again.

    Attributes:
        reason: for people, 1..200 printable characters.
        who: the person or program that set it, 0..200 printable characters; empty if that was not said.
        since: seconds since 1970, as it may outlive a process.
        halts: how many halts of persons it stands for, from 1; the first gave the reason. A permit of the
            inhibit that a person saw lifts no halt that came later.

    Raises:
        TypeError: reason or who is not a str, since no number, or halts not an int.
        ValueError: one of them is too short, too long or not printable, or halts is less than 1.
    """

    reason: str
    who: str
    since: float
    halts: int = 1

    def __post_init__(self) -> None:
        """Check the fields."""
        _check("reason", self.reason, 1)
        _check("who", self.who, 0)
        if as_float(self.since) is None:
            raise TypeError(f"since must be seconds since 1970, got {repr_of(self.since)}")
        if type(self.halts) is not int:
            raise TypeError(f"halts must be an int, got {repr_of(self.halts)}")
        if self.halts < 1:
            raise ValueError(f"halts must be 1 or more, got {self.halts}")

    def again(self) -> Inhibit:
        """The same after one more halt."""
        return replace(self, halts=self.halts + 1)

    def as_dict(self) -> dict[str, Any]:
        """The fields in types that JSON accepts."""
        return asdict(self)

    @classmethod
    def from_dict(cls, fields: Mapping[str, Any]) -> Self:
        """The inhibit with this :meth:`as_dict`; KeyError, TypeError or ValueError for other fields."""
        return cls(fields["reason"], fields["who"], fields["since"], fields.get("halts", 1))

    def __str__(self) -> str:
        """``motion is inhibited: the guard is open (PLC)``."""
        return f"motion is inhibited: {self.reason}" + (f" ({self.who})" if self.who else "")


def _check(name: str, value: object, least: int) -> None:
    if not isinstance(value, str):
        raise TypeError(f"{name} must be a str, got {repr_of(value)}")
    if not least <= len(value) <= LONGEST_REASON or not value.isprintable():
        raise ValueError(
            f"{name} must be {least}..{LONGEST_REASON} printable characters, got {value[:300]!r}"
        )
