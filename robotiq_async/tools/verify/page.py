"""A report for people: three sentences, lines to paste, a table (``report.md``)."""

from __future__ import annotations

from typing import Final

from ...values.model import THREE_FINGER
from .catalogue import CATALOGUE, ENDINGS, LAST, Check, Verdict
from .report import Report

UNUSABLE: Final = ("fault", "envelope", "time", "foreign", "deviation", "inactive")
"""Endings after which nobody should rely on the gripper before they are understood."""
NOT_JUDGED: Final = ("refused", "link")
WITHOUT_ROS: Final = ("activation_timeout", "request_address", "status_address")
"""Options that are no parameters of the ROS node."""


def sentences(report: Report) -> tuple[str, str, str]:
    """Whether the gripper can be used as it is; what is known and what not; what to report."""
    return _usable(report), _known(report), _to_report(report)


def _usable(report: Report) -> str:
    words = report.words.rstrip(".")
    if report.why in UNUSABLE:
        return f"Do not use this gripper with robotiq_async before this is understood: {words}."
    if report.why in NOT_JUDGED and 2 not in report.stages:
        return f"Whether this gripper can be used could not be judged: {words}."
    if not any(report.stages):
        return "Nothing is known of the gripper yet: only this computer was looked at."
    how_far = "" if LAST in report.stages else f", as far as stage {max(report.stages, default=0)} can tell"
    if report.options:
        options = ", ".join(f"{name}={value:g}" for name, value in report.options.items())
        return f"This gripper can be used with {options}{how_far}."
    if report.differing:
        return f"This gripper can be used as it is{how_far}: what differs needs no option."
    return f"This gripper can be used as it is{how_far}: nothing that was checked differs."


def _known(report: Report) -> str:
    total, differing, untold = len(report.checks), len(report.differing), len(report.untold)
    as_assumed = total - differing - untold
    words = f"{total} checks: {as_assumed} as assumed, {differing} otherwise, {untold} undecided"
    missing = [number for number in range(LAST + 1) if number not in report.stages]
    rest = f"; not finished: stage {', '.join(map(str, missing))}" if missing else ""
    return f"{words}{rest}."


def _to_report(report: Report) -> str:
    names = [check.name for check in report.differing]
    if names:
        differ = "differs" if len(names) == 1 else "differ"
        found = f"{', '.join(names)} {differ} from what the library assumes"
        return f"Please send the folder with an issue: {found}."
    if not any(report.stages):
        return "There is nothing to send yet."
    return "Please send the folder with an issue: a gripper that is as assumed is worth knowing, too."


def lines(report: Report) -> dict[str, str]:
    """Lines to paste, by what they are for; the address is left to the user."""
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


MARKS: Final = {
    Verdict.AS_ASSUMED: "as assumed",
    Verdict.DIFFERS: "**DIFFERS**",
    Verdict.UNTOLD: "could not be told",
}


def page(report: Report, pictures: tuple[str, ...] = (), why_none: str = "") -> str:
    """The text of the page.

    Args:
        report: what it tells.
        pictures: files beside it.
        why_none: why there are no pictures.
    """
    fields = report.as_dict()
    head = [
        f"# A gripper, looked at by robotiq_async {fields['library']}",
        "",
        *([f"**{report.label}**", ""] if report.label else []),
        *sentences(report),
        "",
        f"It ended because {ENDINGS.get(report.why, 'it was killed')}: {report.words.rstrip('.') or '-'}.",
        f"Looked at as a {report.model}, link {report.link}.",
        f"Python {fields['python']} on {fields['system']}, {fields['machine']}.",
        "",
        "## Lines to paste",
        "",
    ]
    paste = [
        line for name, text in lines(report).items() for line in (f"{name}:", "", "```", text, "```", "")
    ]
    table = ["## Checks", "", "| stage | check | assumed | | found |", "| -- | -- | -- | -- | -- |"]
    table += [_row(report.checks[name]) for name in CATALOGUE if name in report.checks]
    shown = [f"\n![{name}]({name})" for name in pictures] or (
        [f"\nNo pictures: {why_none}."] if why_none else []
    )
    return "\n".join([*head, *paste, *table, *shown]) + "\n"


def _row(check: Check) -> str:
    assumption = CATALOGUE[check.name]
    found = f"{check.found}. {check.follows}" if check.follows else check.found
    cells = (str(assumption.stage), f"`{check.name}`", assumption.assumed, MARKS[check.verdict], found)
    return f"| {' | '.join(cell.replace('|', '/').replace(chr(10), ' ') for cell in cells)} |"
