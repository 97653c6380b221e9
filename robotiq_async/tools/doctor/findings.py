"""Findings of an examination."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum


class Level(Enum):
    """Severity of a finding."""

    GOOD = "ok"
    DOUBT = "warn"
    BAD = "FAIL"


@dataclass(frozen=True, slots=True)
class Finding:
    """The result of one check.

    Attributes:
        level: severity.
        what: what was checked.
        found: the result.
        advice: what to do about it; empty if there is nothing to do.
    """

    level: Level
    what: str
    found: str
    advice: str = ""


Report = Callable[[Finding], None]


class GiveUpError(Exception):
    """No further check is possible; the reason has been reported."""
