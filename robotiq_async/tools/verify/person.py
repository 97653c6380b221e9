"""The person beside the gripper, as the stages see one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Protocol

ENTER: Final = "\n"


class Person(Protocol):
    """Answers, watches, and stops."""

    @property
    def has_stopped(self) -> bool:
        """Whether a key was pressed since the last answer, or nobody is there any more."""

    def tell(self, words: str) -> None:
        """Say something. While fingers move nothing is said: a terminal may keep who writes waiting."""

    def alarm(self, words: str) -> None:
        """Say at once what must not wait, while fingers may move; never blocks."""

    async def consents(self, words: str) -> bool:
        """Ask; only Enter agrees. What was typed before the question counts for nothing."""

    async def chooses(self, question: str, answers: Mapping[str, str]) -> str | None:
        """Ask for a key.

        Args:
            question: what is asked.
            answers: the keys, each with its meaning.

        Returns:
            One of the keys; None to end the run.
        """
