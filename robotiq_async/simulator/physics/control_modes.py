"""The goals of the axes under a request, and the fixed sequences: activation, mode change, automatic release.

All of it is data: a :data:`Goals` tuple has the target of each axis, a sequence is a tuple of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from robotiq_async.values.checks import check_byte, check_int
from robotiq_async.values.enums import (
    CLOSED,
    OPEN,
    SPEED_MAX,
    SPEED_MIN,
    WIDTH_WIDE,
    Mode,
)
from robotiq_async.values.model import THREE_FINGER

from .axis import Goal

if TYPE_CHECKING:
    from collections.abc import Sequence

    from robotiq_async.values.request import Request


Goals = tuple[Goal | None, ...]
"""Goals of A, B, C and the scissor; None for an axis at rest."""

SCISSOR_LOW: Final = 15
"""Scissor reading when it is open: two drivers use 15..232."""
SCISSOR_HIGH: Final = 232
"""Scissor reading when the scissor mode has closed it, its closing stop (manual)."""
PINCH_CLOSED_READING: Final = 113
"""Reading of a fully closed finger in the pinch mode (manual)."""
MODE_POSITION: Final = {Mode.BASIC: 137, Mode.PINCH: 219, Mode.WIDE: 24, Mode.SCISSOR: SCISSOR_LOW}
"""Scissor reading of each mode (manual). The scissor mode begins with the open scissor (TAMS)."""

# No source gives the speed and force of the gripper's own motions; full speed keeps the waits short.
_SEQUENCE_SPEED: Final = SPEED_MAX
_SEQUENCE_FORCE: Final = 128
_RELEASE_SPEED: Final = SPEED_MIN


def check_scissor_limit(limit: tuple[int, int]) -> tuple[int, int]:
    """The range that a software limit leaves the scissor: it must lie within 6..232."""
    low = check_int("scissor_limit", limit[0], THREE_FINGER.stroke.open_reading, SCISSOR_HIGH)
    return low, check_int("scissor_limit", limit[1], low, SCISSOR_HIGH)


def check_ends(ends: tuple[int, int]) -> tuple[int, int]:
    """The readings of an open and a closed finger."""
    opened = check_byte("the open reading of ends", ends[0])
    return opened, check_int("the closed reading of ends", ends[1], opened + 1, 255)


def finger_limit(mode: Mode | None) -> int | None:
    """The reading at which a mode stops the fingers, or None; no mode while the scissor has registers."""
    return PINCH_CLOSED_READING if mode is Mode.PINCH else None


def requested(request: Request, readings: Sequence[int]) -> Goals:
    """The goals of the axes under a request while rGTO = 1.

    Simple control (rICF = 0, rICS = 0) lets A's registers drive all fingers, or in the scissor mode the
    scissor alone while the fingers stay at their readings, rICF = 1 or not (manual 2012, 4.6).
    """
    own = tuple(Goal(axis.position, axis.speed, axis.force) for axis in request.axes)
    if not request.model.has_modes:
        return own
    grip = own[0]
    scissor_grips = not request.individual_scissor and request.mode is Mode.SCISSOR
    if scissor_grips:
        fingers = tuple(Goal(reading, grip.speed, grip.force, is_reading=True) for reading in readings[:3])
    elif request.individual_fingers:
        fingers = own[:3]
    else:
        fingers = (grip, grip, grip)
    if request.individual_scissor:
        return *fingers, own[3]
    return *fingers, grip if scissor_grips else _on_its_own(MODE_POSITION[request.mode])


def activation(mode: Mode | None, seconds: float, counts: int, fastest: float) -> tuple[Goals, ...]:
    """Fingers close, then open, each in half the seconds; the scissor goes to the mode's (None: basic).

    A full stroke has so many counts. It is never faster than the gripper, in counts a second.
    """
    rate = fastest if seconds == 0 else min(fastest, counts / (seconds / 2))
    close, open_, scissor = (
        _on_its_own(position)._replace(rate=rate, clears=True)
        for position in (CLOSED, OPEN, MODE_POSITION[Mode.BASIC if mode is None else mode])
    )
    return (close, close, close, scissor), (open_, open_, open_, None)


def mode_change(mode: Mode) -> tuple[Goals, ...]:
    """Fingers open, then the scissor goes to the position of the mode."""
    open_ = _on_its_own(OPEN)
    return (open_, open_, open_, None), (None, None, None, _on_its_own(MODE_POSITION[mode]))


def release(request: Request) -> tuple[Goals, ...]:
    """Every axis opens slowly; a jaw closes if the request has that direction."""
    finger = Goal(OPEN if request.release_opens else CLOSED, _RELEASE_SPEED, _SEQUENCE_FORCE)
    return ((finger, finger, finger, Goal(WIDTH_WIDE, _RELEASE_SPEED, _SEQUENCE_FORCE)),)


def _on_its_own(position: int) -> Goal:
    return Goal(position, _SEQUENCE_SPEED, _SEQUENCE_FORCE, is_reading=True)
