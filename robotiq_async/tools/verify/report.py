"""The findings of a run: ``report.json``, and the page ``report.md`` for people."""

from __future__ import annotations

import platform
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

from ...runtime import __version__
from ...values import THREE_FINGER, Model, RegisterMap, RobotiqStatus
from .catalogue import CATALOGUE, ENDINGS, HARMLESS, LAST, Check, CheckVerdict, checks_of, left_out

T = TypeVar("T")

SCHEMA: Final = 1  # version of the fields in report.json; docs/hardware.md describes it


@dataclass
class Report:
    """A run, during it and after it."""

    link: str  # "tcp", "rtu", "rtu+tcp", "urcap" or "tunnel"
    model: Model = THREE_FINGER  # of the gripper
    stages: list[int] = field(default_factory=list)  # the completed stages
    entered: list[int] = field(default_factory=list)  # the stages that have begun
    checks: dict[str, Check] = field(default_factory=dict)  # by name
    why: str = ""  # its ending, see endings; empty while it runs
    words: str = ""  # the same in a sentence
    registers: RegisterMap | None = None  # of the gripper; None if it was not found
    found: RobotiqStatus | None = None  # the first status; None if none came
    last: RobotiqStatus | None = None  # the newest after the fingers were stopped; None if none came
    label: str = ""  # the user's title

    @property
    def is_unstopped(self) -> bool:
        """Whether a stage has written, and the rGTO = 0 at its end was not confirmed."""
        return self.last is None and any(number >= HARMLESS for number in self.entered)

    def identify(self, registers: RegisterMap | None, found: RobotiqStatus | None) -> None:
        """Note the gripper that was found, as far as it was."""
        self.registers, self.found = registers, found

    def stopped(self, status: RobotiqStatus | None) -> None:
        """Note the status after the fingers were stopped; None if none came."""
        self.last = status

    def end(self, why: str, words: str) -> None:
        """Note the ending of the run."""
        self.why, self.words = why, words

    def complete(self) -> None:
        """Note as inconclusive the checks that a stage has not reached."""
        for name, assumption in checks_of(self.model, self.link).items():
            if assumption.stage in self.entered and name not in self.checks:
                self.checks[name] = Check(name, CheckVerdict.INCONCLUSIVE, "not reached")

    @property
    def left_out(self) -> dict[str, str]:
        """The checks of stages that have begun which this link cannot have, by name, and why."""
        without = left_out(self.link).items()
        return {name: why for name, why in without if CATALOGUE[name].stage in self.entered}

    @property
    def differing(self) -> list[Check]:
        return self._in_order(CheckVerdict.DIFFERS)

    @property
    def inconclusive(self) -> list[Check]:
        return self._in_order(CheckVerdict.INCONCLUSIVE)

    @property
    def options(self) -> dict[str, int | float]:
        """Options of a hand that correct wrong assumptions; if one has several values, the greatest."""
        options: dict[str, int | float] = {}
        for check in self.differing:
            for name, value in check.options.items():
                options[name] = max(value, options.get(name, value))
        return options

    def _in_order(self, verdict: CheckVerdict) -> list[Check]:
        return [
            self.checks[name]
            for name in CATALOGUE
            if name in self.checks and self.checks[name].verdict is verdict
        ]

    def as_dict(self) -> dict[str, Any]:
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
            "left_out": self.left_out,
        }


UNUSABLE: Final = ("fault", "envelope", "time", "foreign", "deviation", "inactive", "unstopped")
"""Endings that must be understood before the gripper is relied on."""
NOT_JUDGED: Final = ("refused", "link")
DO_NOT_USE: Final = "Do not use this gripper with robotiq_async until the cause is known"
WITHOUT_ROS: Final = ("activation_timeout", "request_address", "status_address")
"""Options that are no parameters of the ROS node."""


def sentences(report: Report) -> tuple[str, str, str]:
    """Three sentences: on the use of the gripper as it is, on the checks, and on the report to send."""
    return _usable(report), _known(report), _to_report(report)


def is_unusable(report: Report) -> bool:
    """Whether the gripper must not be used: lines to paste would suggest that it can be."""
    return not report.why or report.is_unstopped or report.why in UNUSABLE


def _usable(report: Report) -> str:
    words = report.words.rstrip(".")
    if not report.why:
        return _unended(report)
    if report.is_unstopped:
        return f"THE FINGERS MAY STILL MOVE: the last rGTO = 0 was not confirmed ({words}). {DO_NOT_USE}."
    if report.why in UNUSABLE:
        return f"{DO_NOT_USE}: {words}."
    if report.why in NOT_JUDGED and 2 not in report.stages:
        return f"Whether this gripper can be used could not be judged: {words}."
    if not any(report.entered):
        return "Nothing is known about the gripper yet: no stage after 0 has begun."
    if not any(report.stages):
        return f"Too little is known about the gripper yet: stage {report.entered[-1]} was not finished."
    how = "as it is: no check differs"
    if report.options:
        how = "with " + ", ".join(f"{name}={value:g}" for name, value in report.options.items())
    elif report.differing:
        how = "as it is: the differences need no option"
    if not _missing(report):
        return f"This gripper can be used {how}."
    moved = "" if max(report.entered) > HARMLESS else " It has not moved yet."
    return f"So far nothing speaks against using this gripper {how}.{moved}"


def _unended(report: Report) -> str:
    """The sentence while the run lasts, and for ever if it was killed."""
    begun = [number for number in report.entered if number not in report.stages]
    if begun and begun[-1] >= HARMLESS:
        why = f"stage {begun[-1]} has begun, and the run has not ended, or was killed"
        return f"THE FINGERS MAY STILL MOVE: {why}. {DO_NOT_USE}."
    known = f"stage {report.stages[-1]} was the last that ended" if report.stages else "no stage has ended"
    return f"Whether this gripper can be used is not known: the run has not ended, or was killed; {known}."


def _missing(report: Report) -> list[int]:
    return [number for number in range(LAST + 1) if number not in report.stages]


def _known(report: Report) -> str:
    total, differing, inconclusive = len(report.checks), len(report.differing), len(report.inconclusive)
    as_assumed = total - differing - inconclusive
    words = f"{total} checks: {as_assumed} as assumed, {differing} different, {inconclusive} inconclusive"
    missing = _missing(report)
    rest = f"; not finished: stage {', '.join(map(str, missing))}" if missing else ""
    return f"{words}{rest}."


def _to_report(report: Report) -> str:
    names = [check.name for check in report.differing]
    if names:
        differ = "differs" if len(names) == 1 else "differ"
        found = f"{', '.join(names)} {differ} from the library's assumption"
        return f"Please send the folder with an issue: {found}."
    if not any(report.entered):
        return "There is nothing to send yet."
    if not any(report.stages):
        return "Please send the folder with an issue if this end surprises you."
    return "Please send the folder with an issue: a gripper without differences is worth knowing, too."


def lines(report: Report) -> dict[str, str]:
    """Lines to paste, by their purpose; the address is left to the user."""
    options = report.options
    model = None if report.model is THREE_FINGER else report.model.name
    hand = f', model="{model}"' if model else ""
    hand += "".join(f", {name}={value:g}" for name, value in options.items())
    toml = f'model = "{model}"\n' if model else ""
    toml += "".join(f"{name} = {value:g}\n" for name, value in options.items())
    ros = f" -p model:={model}" if model else ""
    ros += "".join(f" -p {name}:={value:g}" for name, value in options.items() if name not in WITHOUT_ROS)
    missing = [name for name in options if name in WITHOUT_ROS]
    note = f"  # the node has no parameter {', '.join(missing)}" if missing else ""
    return {
        "Python": f'RobotiqHand("ADDRESS"{hand})',
        "FLEET.toml": f'[grippers.NAME]\naddress = "ADDRESS"\n{toml}'.rstrip(),
        "ROS 2": f"ros2 run robotiq_async gripper --ros-args -p address:=ADDRESS{ros}{note}",
    }


def page(report: Report, pictures: tuple[str, ...] = (), why_none: str = "") -> str:
    """The text of the page."""
    fields = report.as_dict()
    head = [
        f"# A gripper, checked by robotiq_async {fields['library']}",
        "",
        *([f"**{report.label}**", ""] if report.label else []),
        *sentences(report),
        "",
        f"The run ended: {ENDINGS[report.why]}: {report.words.rstrip('.')}."
        if report.why
        else "The run has not ended, or was killed.",
        f"Checked as a {report.model}, link {report.link}.",
        f"Python {fields['python']} on {fields['system']}, {fields['machine']}.",
        "",
    ]
    paste = [] if is_unusable(report) else ["## Lines to paste", ""]
    paste += [
        line
        for name, text in (lines(report) if paste else {}).items()
        for line in (f"{name}:", "", "```", text, "```", "")
    ]
    table = ["## Checks", "", "| stage | check | assumed | | found |", "| -- | -- | -- | -- | -- |"]
    table += [_row(report.checks[name]) for name in CATALOGUE if name in report.checks]
    if report.left_out:
        table += ["", "Left out on this link:", ""]
        table += [f"- `{name}`: {why}" for name, why in report.left_out.items()]
    shown = [f"\n![{name}]({name})" for name in pictures] or (
        [f"\nNo pictures: {why_none}."] if why_none else []
    )
    return "\n".join([*head, *paste, *table, *shown]) + "\n"


def _row(check: Check) -> str:
    assumption = CATALOGUE[check.name]
    found = f"{check.found}. {check.follows}" if check.follows else check.found
    mark = "**DIFFERS**" if check.verdict is CheckVerdict.DIFFERS else check.verdict.value
    cells = (str(assumption.stage), f"`{check.name}`", assumption.assumed, mark, found)
    return f"| {' | '.join(cell.replace('|', '/').replace(chr(10), ' ') for cell in cells)} |"
