"""What a check of a gripper comes to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType
from typing import Any, Final

Figure = int | float | str | bool | None | list[Any]
"""What JSON takes, for the figures of a check."""
Options = Mapping[str, int | float]
"""Options of a hand, by the names of its constructor."""

NO_OPTIONS: Final[Options] = MappingProxyType({})


class Verdict(Enum):
    """How a check ended."""

    AS_ASSUMED = "as assumed"
    DIFFERS = "differs"
    UNTOLD = "could not be told"


@dataclass(frozen=True, slots=True)
class Check:
    """One check that was made, or could not be.

    Attributes:
        name: of the assumption, see :mod:`.catalogue`.
        verdict: how it ended.
        found: what was found, in a sentence.
        follows: what follows for the user, where it differs.
        options: those that make the library right, where it differs.
        figures: what was measured, with the unit at the end of each name.
    """

    name: str
    verdict: Verdict
    found: str
    follows: str = ""
    options: Options = field(default_factory=lambda: NO_OPTIONS)
    figures: Mapping[str, Figure] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """The same in types that JSON takes."""
        return {
            "name": self.name,
            "verdict": self.verdict.value,
            "found": self.found,
            "follows": self.follows,
            "options": dict(self.options),
            "figures": dict(self.figures),
        }
