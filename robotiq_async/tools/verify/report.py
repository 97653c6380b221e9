"""What a run has found, as data: ``report.json``."""

from __future__ import annotations

import platform
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

from ...runtime.version import __version__
from ...values.model import THREE_FINGER, Model
from ...values.registers import RegisterMap
from ...values.status import RobotiqStatus
from .catalogue import CATALOGUE, Check, Verdict, checks_of

T = TypeVar("T")

SCHEMA: Final = 1
"""Version of what stands in report.json; docs/hardware.md describes it."""


@dataclass
class Report:
    """A run, while it goes on and after it.

    Attributes:
        link: "tcp", "rtu" or "rtu+tcp".
        model: of the gripper.
        stages: those that have come to their end.
        entered: those that have begun.
        checks: by name.
        why: how it ended, see :mod:`.endings`; empty while it goes on.
        words: the same in a sentence.
        registers: how the gripper is asked; None if it was not found.
        found: the first status; None if there was none.
        last: the newest status after the fingers were stopped; None if there was none.
        label: what the user wants it to be called.
    """

    link: str
    model: Model = THREE_FINGER
    stages: list[int] = field(default_factory=list)
    entered: list[int] = field(default_factory=list)
    checks: dict[str, Check] = field(default_factory=dict)
    why: str = ""
    words: str = ""
    registers: RegisterMap | None = None
    found: RobotiqStatus | None = None
    last: RobotiqStatus | None = None
    label: str = ""

    def complete(self) -> None:
        """Say of the checks of stages that have begun and were not reached that they could not be told."""
        for name, assumption in checks_of(self.model).items():
            if assumption.stage in self.entered and name not in self.checks:
                self.checks[name] = Check(name, Verdict.UNTOLD, "not reached")

    @property
    def differing(self) -> list[Check]:
        """The checks that differ, in their order."""
        return self._in_order(Verdict.DIFFERS)

    @property
    def untold(self) -> list[Check]:
        """Those that could not be told."""
        return self._in_order(Verdict.UNTOLD)

    @property
    def options(self) -> dict[str, int | float]:
        """Options of a hand that make the library right; of several values of one, the greatest."""
        options: dict[str, int | float] = {}
        for check in self.differing:
            for name, value in check.options.items():
                options[name] = max(value, options.get(name, value))
        return options

    def _in_order(self, verdict: Verdict) -> list[Check]:
        return [
            self.checks[name]
            for name in CATALOGUE
            if name in self.checks and self.checks[name].verdict is verdict
        ]

    def as_dict(self) -> dict[str, Any]:
        """All of it in types that JSON takes."""
        registers = self.registers
        return {
            "schema": SCHEMA,
            "label": self.label,
            "library": __version__,
            "python": platform.python_version(),
            "system": platform.system(),
            "machine": platform.machine(),
            "link": self.link,
            "model": self.model.name,
            "registers": registers
            and {
                "device_id": registers.device_id,
                "read_function": registers.read_function,
                "request_address": registers.request,
                "status_address": registers.status,
            },
            "ended": {"why": self.why, "words": self.words},
            "stages": self.stages,
            "entered": self.entered,
            "found": self.found and list(self.found.registers),
            "last": self.last and list(self.last.registers),
            "options": self.options,
            "checks": [self.checks[name].as_dict() for name in CATALOGUE if name in self.checks],
        }
