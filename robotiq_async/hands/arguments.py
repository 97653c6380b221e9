"""The arguments of a hand, described once: each call's docstring gets an ``Args:`` section by its signature.

A parameter that has no description here is a KeyError when the module of the call is imported.
"""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final, TypeVar

F = TypeVar("F", bound=Callable[..., Any])

WIDTH: Final = 96
SECTIONS: Final = "Args:\n"  # the first section of a constructor's docstring
STAYS: Final = (
    "It stays with the axes, also after a call that was cancelled or superseded: give it where it matters."
)
ARGUMENTS: Final = {
    "fingers": "the axes, a :class:`Finger` mask or the same integer, 1..15; the others stay as they are. "
    "``Finger.ABC`` are the fingers of the model, ``Finger.ALL`` its axes; others that it lacks are refused.",
    "position": "the target in counts, 0 (open) .. 255 (closed).",
    "mm": "instead of a position, the opening in millimetres, 0 .. the stroke of the model; not for the "
    "scissor.",
    "open_fraction": "instead of a position, the share of the travel that is open, 1 (open) .. 0 (closed); "
    "not for the scissor.",
    "speed": f"0 (the slowest) .. 255; None leaves the speed of these axes. {STAYS}",
    "new_speed": "0 (the slowest) .. 255, for these axes from now on.",
    "mm_per_s": "instead of a speed, millimetres of opening a second, in the range of the model's speeds.",
    "force": f"0 (the least, not none) .. 255, not linear; None leaves the force of these axes. {STAYS}",
    "new_force": "0 (the least, not none) .. 255, not linear, for these axes from now on.",
    "label_n": "instead of a force, newtons of a label, in the range of the model's: no measured force.",
    "timeout": "seconds above 0; None for twice the expected time plus 2 s, by the speeds at the call. A "
    "move that is slowed down afterwards needs a timeout that allows for it.",
    "at_least": "the contacts that make a grasp, 1 .. the number of axes; None for all of them.",
    "activate": "False writes nothing: a gripper that is reset stays in RESET.",
    "wait": "seconds to keep trying while nothing answers, 0..86400, counted while the event loop runs, for "
    "a gripper that is switched on later than the program. Its fingers may MOVE long after the call then.",
    "halt": "False disconnects and leaves the fingers as they are; for programs that only look.",
    "keep_grip": "whether a grip stays in force; None for the hand's own ``keep_grip``.",
    "reason": "for people, 1..200 printable characters.",
    "whose": "the person or program that does it, for the log; 0..200 printable characters.",
    "seen": "``hand.inhibited`` as the person was shown it, None for its value at the call: a halt that "
    "came later stays, also where the reason is the same.",
    "recovery": "seconds above 0 for all of it, while the event loop runs; None for 90.",
    "buffer": "items that are kept for a slow reader, 1..1000000.",
    "requests": "items that are kept for a slow reader, 1..1000000; None loses none.",
    "lost_after": "seconds, 0.01..3600; None waits for as long as the hand runs.",
    "watched": "the axes that are watched, a :class:`Finger` mask or the same integer, 1..15.",
    "since": "the status to begin with, ``result.status`` of a grasp or a move; None for the newest one.",
    "slip": "counts that an axis in contact may move without an event, 1..255.",
    "states": "one or more; the first that the hand is in ends the wait.",
    "waiting": "seconds above 0, while the event loop runs; None waits for as long as the hand runs.",
}


def describes_arguments(**same: str) -> Callable[[F], F]:
    """Add the section to a method. ``value="position"`` describes the parameter value as a position."""

    def describe(call: F) -> F:
        if call.__doc__ is not None:  # python -OO has none
            _, *names = inspect.signature(call).parameters
            call.__doc__ = with_arguments(call.__doc__, names, same)
        return call

    return describe


def with_arguments(text: str, names: Iterable[str], same: Mapping[str, str]) -> str:
    """A docstring with the section, before the section of errors."""
    lines = [
        textwrap.fill(
            f"{name}: {ARGUMENTS[same.get(name, name)]}",
            WIDTH,
            initial_indent=" " * 4,
            subsequent_indent=" " * 8,
        )
        for name in names
    ]
    section = "\n".join(("Args:", *lines))
    before, raises, after = inspect.cleandoc(text).partition("\n\nRaises:")
    return f"{before}\n\n{section}{raises}{after}"


def with_arguments_of(text: str, other: str) -> str:
    """A docstring with the sections of the original, for a class that is made with the same arguments."""
    return f"{inspect.cleandoc(text)}\n\n{SECTIONS}{inspect.cleandoc(other).partition(SECTIONS)[2]}"
