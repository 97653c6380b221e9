"""Why a run ends before it is done."""

from __future__ import annotations

from typing import Final

ENDINGS: Final = {
    "done": "every stage that was asked for has run",
    "declined": "the answer was not Enter",
    "stopped": "a key was pressed, or the terminal closed",
    "interrupted": "Ctrl-C, or a signal",
    "refused": "nothing was written: the gripper is not in a state for it",
    "link": "the link failed",
    "fault": "the gripper reports a fault",
    "envelope": "an axis left the range of its stage",
    "time": "the time of a stage was over",
    "foreign": "the gripper echoes what this program has not written",
    "inactive": "the gripper is not active, and the stage needs it",
    "deviation": "a check about safety differs",
    "disk": "the report cannot be written",
}
"""By the word that stands in the report."""


class EndError(Exception):
    """The run ends here.

    Attributes:
        why: one of :data:`ENDINGS`.
        words: what happened, in a sentence.
    """

    def __init__(self, why: str, words: str) -> None:
        """Keep why, and what happened."""
        assert why in ENDINGS
        self.why = why
        self.words = words
        super().__init__(f"{why}: {words}")
