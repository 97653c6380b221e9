"""A report for people: ``report.md``."""

from __future__ import annotations

from typing import Final

from .advice import lines, sentences
from .catalogue import CATALOGUE
from .checks import Check, Verdict
from .endings import ENDINGS
from .report import Report

MARKS: Final = {
    Verdict.AS_ASSUMED: "as assumed",
    Verdict.DIFFERS: "**DIFFERS**",
    Verdict.UNTOLD: "could not be told",
}


def page(report: Report, pictures: tuple[str, ...] = ()) -> str:
    """The text of the page."""
    fields = report.as_dict()
    head = [
        f"# A gripper, looked at by robotiq_async {fields['library']}",
        "",
        *([f"**{report.label}**", ""] if report.label else []),
        *sentences(report),
        "",
        f"It ended because {ENDINGS.get(report.why, 'it was killed')}: {report.words.rstrip('.') or '-'}.",
        f"Link {report.link}; Python {fields['python']} on {fields['system']}, {fields['machine']}.",
        "",
        "## Lines to paste",
        "",
    ]
    paste = [
        line for name, text in lines(report).items() for line in (f"{name}:", "", "```", text, "```", "")
    ]
    table = ["## Checks", "", "| stage | check | assumed | | found |", "| -- | -- | -- | -- | -- |"]
    table += [_row(report.checks[name]) for name in CATALOGUE if name in report.checks]
    shown = [f"\n![{name}]({name})" for name in pictures]
    return "\n".join([*head, *paste, *table, *shown]) + "\n"


def _row(check: Check) -> str:
    assumption = CATALOGUE[check.name]
    found = f"{check.found}. {check.follows}" if check.follows else check.found
    cells = (str(assumption.stage), f"`{check.name}`", assumption.assumed, MARKS[check.verdict], found)
    return f"| {' | '.join(cell.replace('|', '/').replace(chr(10), ' ') for cell in cells)} |"
