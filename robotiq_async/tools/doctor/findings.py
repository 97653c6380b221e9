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
    """The result of one check."""

    level: Level  # severity
    what: str  # the subject of the check
    found: str  # the result
    advice: str = ""  # the remedy; may be empty


ReportFinding = Callable[[Finding], None]


class GiveUpError(Exception):
    """No further check is possible; the reason has been reported."""
