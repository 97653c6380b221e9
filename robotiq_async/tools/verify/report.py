"""What a run has found, as data: ``report.json``."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, TypeVar, cast

from ...link.address import Address
from ...runtime.version import __version__
from ...values.registers import RegisterMap
from ...values.status import RobotiqStatus
from .catalogue import CATALOGUE
from .checks import Check, Verdict

T = TypeVar("T")

SCHEMA: Final = 1
"""Version of what stands in report.json; docs/hardware.md describes it."""


@dataclass
class Report:
    """A run, while it goes on and after it.

    Attributes:
        link: "tcp", "rtu" or "rtu+tcp".
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
        for name, assumption in CATALOGUE.items():
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


class Scrubber:
    """Takes out of texts what tells where a gripper is: addresses, ports of this machine, users, hosts."""

    def __init__(self, address: Address) -> None:
        """Know the address."""
        names = [str(address), f"{address.host}:{address.port}" if address.port else "", address.host]
        names += [platform.node(), os.path.expanduser("~")]
        self._secrets = sorted({name for name in names if len(name) > 1}, key=len, reverse=True)

    def clean(self, what: T) -> T:
        """The same without; looks into lists and objects."""
        cleaned: object = what
        if isinstance(what, str):
            cleaned = self._cleaned(what)
        elif isinstance(what, dict):
            cleaned = {key: self.clean(value) for key, value in what.items()}
        elif isinstance(what, list):
            cleaned = [self.clean(each) for each in what]
        return cast("T", cleaned)

    def _cleaned(self, text: str) -> str:
        for secret in self._secrets:
            text = text.replace(secret, "HIDDEN")
        return text


def write_files(folder: Path, files: Iterable[tuple[str, str]]) -> None:
    """Write texts into a folder, each whole or not at all.

    Raises:
        OSError: that failed.
    """
    for name, text in files:
        partial = folder / f".{name}.part"
        with open(partial, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(folder / name)


def as_json(fields: dict[str, Any]) -> str:
    """The text of report.json."""
    return json.dumps(fields, indent=2, ensure_ascii=False) + "\n"
