"""The first hour with a real gripper: guarded stages, checks of assumptions, and a report.

It uses the link and no hand: a hand's belief cannot hide the gripper's behaviour. None of this has met
hardware yet. docs/decisions/verify.md has the reasons.
"""

from __future__ import annotations

from .bench import Lengths
from .catalogue import CATALOGUE, ENDINGS, Check, CheckVerdict
from .report import Report
from .runner import Plan, Runner
from .watch import ENTER, Person

__all__ = [
    "CATALOGUE",
    "ENDINGS",
    "ENTER",
    "Check",
    "CheckVerdict",
    "Lengths",
    "Person",
    "Plan",
    "Report",
    "Runner",
]
