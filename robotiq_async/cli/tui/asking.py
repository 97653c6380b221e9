"""Questions of the monitor: a yes, or axes and a position. Pure: text and keys.

They are no screens of textual's: with one above another, every paint draws both, and the loop that paints is
the one that polls.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from rich.text import Text

from ...runtime import now
from ...tools.wording import axis_name
from ...values import CLOSED, Finger, Model

READING_S: Final = 0.3
"""A yes counts only after this time: an earlier one was typed before the question could be read."""
NO: Final = frozenset({"escape", "q", "ctrl+c"})
"""Keys that cancel every question."""
_ERASE: Final = frozenset({"backspace", "delete", "ctrl+h"})
_LETTERS: Final = {"a": Finger.A, "b": Finger.B, "c": Finger.C, "s": Finger.SCISSOR}


class Question:
    """Asks before a dangerous action; ``yes`` is called after a yes."""

    def __init__(self, question: str, warning: str, yes: Callable[[], None]) -> None:
        self._question, self._warning, self._yes = question, warning, yes
        self._asked_at = now()

    @property
    def is_open(self) -> bool:
        """Whether a yes counts: not before the question could be read."""
        return now() - self._asked_at >= READING_S

    @property
    def text(self) -> Text:
        text = Text(f"{self._question}\n\n", "bold")
        text.append(self._warning, "bold yellow")
        text.append("\n\ny yes    n no    space halt")
        return text

    def press(self, key: str) -> bool:
        """Take a key by textual's name; returns whether it was the last. A yes does not count too early."""
        if key == "y" and self.is_open:
            self._yes()
            return True
        return key in NO or key == "n"


class TargetQuestion:
    """Asks for axes of a model and a position; a jaw is chosen from the start. Only Enter moves anything."""

    def __init__(self, model: Model, move: Callable[[Finger, int], None]) -> None:
        self._move = move
        self._model = model
        self._there = model.all_axes
        self._axes = self._there if len(model.axes) == 1 else Finger(0)
        self._digits = ""

    @property
    def text(self) -> Text:
        text = Text("move axes to a position\n\naxes     ", "bold")
        for axis in self._there:
            text.append(axis_name(axis, self._model), "reverse" if axis in self._axes else "dim not bold")
            text.append(" ")
        text.append(f"\nposition {self._digits}", "bold")
        text.append("_", "blink")
        text.append(f"   0 open .. {CLOSED} closed", "dim not bold")
        text.append("\n\nEnter MOVES them at once.", "bold yellow")
        letters = " ".join(letter for letter, axis in _LETTERS.items() if axis in self._there)
        text.append(f"\n\n{letters} axes    0-9 position    ESC no    space halt")
        return text

    def press(self, key: str) -> bool:
        """Letters choose axes, digits write the position."""
        if key in NO:
            return True
        if key == "enter" and self._axes and self._digits:
            self._move(self._axes, int(self._digits))
            return True
        if key in _LETTERS:
            self._axes ^= _LETTERS[key] & self._there
        elif key in _ERASE:
            self._digits = self._digits[:-1]
        elif len(key) == 1 and key in "0123456789" and int(self._digits + key) <= CLOSED:
            self._digits = str(int(self._digits + key))
        return False


Asking = Question | TargetQuestion  # takes the keys, except the keys that halt
