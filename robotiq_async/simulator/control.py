"""What a request asks of the four axes, and the fixed sequences: activation, mode change, automatic release.

All of it is data: a :data:`Goals` tuple says where each axis goes, a sequence is a tuple of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from robotiq_async.closing_time import CLOSED_READING
from robotiq_async.enums import CLOSED, OPEN, SPEED_MAX, SPEED_MIN, WIDTH_WIDE, Mode
from robotiq_async.request import AxisRequest, Request

if TYPE_CHECKING:
    from collections.abc import Sequence

Goals = tuple[AxisRequest | None, ...]
"""Where A, B, C and the scissor go; None for an axis that stands still."""

SCISSOR_LOW: Final = 24
"""Scissor reading in wide mode, its opening stop (manual)."""
SCISSOR_HIGH: Final = 232
"""Scissor reading when the scissor mode has closed it, its closing stop (manual)."""
PINCH_CLOSED_READING: Final = 113
"""Where a finger of the pinch mode is fully closed (manual)."""
MODE_POSITION: Final = {Mode.BASIC: 137, Mode.PINCH: 219, Mode.WIDE: SCISSOR_LOW, Mode.SCISSOR: SCISSOR_LOW}
"""Scissor reading of each mode (manual). The scissor mode starts from the open scissor: our choice."""

# No source says how fast or strong the gripper moves on its own; full speed keeps the waits short.
_SEQUENCE_SPEED: Final = SPEED_MAX
_SEQUENCE_FORCE: Final = 128
_RELEASE_SPEED: Final = SPEED_MIN


def finger_stop(mode: Mode | None) -> int:
    """The closing stop of the fingers in counts; no mode while the scissor has its own registers."""
    return PINCH_CLOSED_READING if mode is Mode.PINCH else CLOSED_READING


def requested(request: Request, readings: Sequence[int]) -> Goals:
    """What a request asks of the axes while rGTO = 1.

    Simple control (rICF = 0, rICS = 0) lets A's registers drive all fingers, or in the scissor mode the
    scissor alone while the fingers stay at their readings.
    """
    grip = request.axes[0]
    scissor_grips = not request.individual_scissor and request.mode is Mode.SCISSOR
    if request.individual_fingers:
        fingers = request.axes[:3]
    elif scissor_grips:
        fingers = tuple(AxisRequest(reading, grip.speed, grip.force) for reading in readings[:3])
    else:
        fingers = (grip, grip, grip)
    if request.individual_scissor:
        return *fingers, request.axes[3]
    return *fingers, grip if scissor_grips else _on_its_own(MODE_POSITION[request.mode])


def activation(mode: Mode | None) -> tuple[Goals, ...]:
    """Fingers close, then open; the scissor goes to its mode meanwhile (basic without one)."""
    close, open_ = _on_its_own(CLOSED), _on_its_own(OPEN)
    scissor = _on_its_own(MODE_POSITION[Mode.BASIC if mode is None else mode])
    return (close, close, close, scissor), (open_, open_, open_, None)


def mode_change(mode: Mode) -> tuple[Goals, ...]:
    """Fingers open, then the scissor goes to the position of the mode."""
    open_ = _on_its_own(OPEN)
    return (open_, open_, open_, None), (None, None, None, _on_its_own(MODE_POSITION[mode]))


def release() -> tuple[Goals, ...]:
    """Every axis opens slowly."""
    open_ = AxisRequest(OPEN, _RELEASE_SPEED, _SEQUENCE_FORCE)
    return ((open_, open_, open_, AxisRequest(WIDTH_WIDE, _RELEASE_SPEED, _SEQUENCE_FORCE)),)


def _on_its_own(position: int) -> AxisRequest:
    return AxisRequest(position, _SEQUENCE_SPEED, _SEQUENCE_FORCE)
