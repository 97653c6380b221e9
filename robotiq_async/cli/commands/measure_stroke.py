"""``robotiq-async measure stroke``."""

from __future__ import annotations

import os
import re
from collections.abc import Awaitable, Callable, Coroutine, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter

from ...link import is_remote
from ...values import why_not_after
from ..addresses import gripper_words, is_simulated, named_model
from ..arguments import AddressArgument, Flag, PointCount, Yes
from ..consent import consent
from ..failures import CommandError, UsageError, file_errors
from .measure import check, gripper_to_measure
from .measure_force import prompt

if TYPE_CHECKING:
    from ...hands import Hand
    from ...values import Point, Points

STROKE_WARNING: Final = """the jaw MOVES to {count} positions, from open to closed, at its least force, and
waits at each for the figure of a calliper. Nothing but the calliper may be between the fingertips; take it
out before you answer. If the gripper is not active yet the jaw opens and closes first, and a held part
drops."""
CALLIPER_QUESTION: Final = "At {position} counts: what does the calliper show between the fingertips, in mm?"
MET: Final = """The fingertips met at {position} counts: that is the closed end. If they met something else,
press Ctrl-C, take it out and begin again."""
OPEN_IS_ZERO: Final = "an open jaw cannot have an opening of 0 mm"
TOUCH: Final = "The fingertips touch at {position} counts: that is the closed end."
DOUBT: Final = """From {first} to {last} counts this falls by {mm:g} mm, nominal are {nominal:.1f}. If the
calliper is not in millimetres, press Ctrl-C and begin again: nothing is written yet."""
DOUBTFUL: Final = 2.0
"""The ratio of a fall to the nominal one, either way, that is doubted. Custom fingertips make the
opening wider or narrower, and hardly change by how much it falls."""
OPENING_FORM: Final = r"[0-9]{1,3}(?:\.[0-9]{1,2})?"

Calliper = Callable[[int], Awaitable[float]]  # takes the position, in counts


def stroke(
    address: AddressArgument,
    /,
    *,
    output: Annotated[Path, Parameter(metavar="FILE.csv")] = Path("stroke.csv"),
    points: PointCount = 5,
    overwrite: Annotated[Flag, Parameter(help="Replace an existing file.")] = False,
    yes: Yes = False,
) -> Coroutine[None, None, None]:
    """Measure the opening of a jaw at some positions, with a calliper. THE FINGERS MOVE.

    It goes to each position, from open to closed, and asks for the reading of a
    calliper between the fingertips. The file has the reading of each position and the figure,
    and is the option stroke of a hand: millimetres then follow this gripper and its
    fingertips. Between two points the nominal shape is stretched, so that two points,
    open and closed, will do for custom fingertips. At sim:// a simulated calliper
    answers. Unless the gripper is simulated it asks first; without a terminal it
    needs --yes.

    For example:

        robotiq-async measure stroke "sim://?model=2f85"
        robotiq-async measure stroke "rtu:///dev/ttyS0?model=2f85" --output my.csv
        robotiq-async status "rtu:///dev/ttyS0?model=2f85" --stroke my.csv

    Args:
        output: The file; it is written when all points are there.
        points: Number of positions, 2..50.
        yes: Do not ask.
    """
    check(address, output, None, plot=False)
    if output.exists() and not overwrite:
        raise UsageError(f"{output} exists: choose another --output, or pass --overwrite")
    if len(named_model(address).axes) > 1 and not is_remote(address):
        raise UsageError(f"a width is measured between the fingertips of a jaw; {address} names a 3-Finger")
    if not os.access(output.parent, os.W_OK):  # before somebody has measured for nothing
        raise CommandError(f"{output}: its folder does not exist, or cannot be written to")
    consent(address, STROKE_WARNING.format(count=points), yes=yes)
    return _measure(address, output, points)


async def _measure(address: str, output: Path, count: int) -> None:
    from ...calibration import write_stroke

    print(gripper_words(address), flush=True)
    async with gripper_to_measure(address, 1.0) as hand:
        points = await measured(hand, count, _calliper(address, hand))
    with file_errors(output):
        write_stroke(output, points, hand.model)
    print(output)


async def measured(hand: Hand, count: int, calliper: Calliper) -> Points:
    """The points of a jaw, from open to closed; the calliper is read at each.

    Custom fingertips may meet before the gripper's end: a contact is the closed end.

    Raises:
        CommandError: the jaw does not open, did not move on, or the gripper has more than one axis.
        RobotiqError: as :meth:`Hand.move`.
    """
    if len(hand.model.axes) > 1:
        raise CommandError("a width is measured between the fingertips of a jaw; this is a 3-Finger")
    points: list[Point] = []
    for number in range(count):
        result = await hand.move(round(255 * number / (count - 1)), force=0)
        (position,) = result.positions.values()
        has_met = result.object_detected
        if has_met and not number:
            raise CommandError(f"something blocks the opening at {position} counts")
        if has_met:
            print(MET.format(position=position), flush=True)
        # At its ends, and after a small step, the jaw is where it was.
        if not points or position > points[-1][0]:
            points.append(await _point_after(points, calliper, position))
            if len(points) == 2:
                _doubt(hand, *points)
        is_closed = points[-1][1] == 0
        if is_closed and not has_met:
            print(TOUCH.format(position=position), flush=True)
        if has_met or is_closed:
            break
    if len(points) < 2:
        raise CommandError(f"the jaw did not move on from {points[0][0]} counts")
    return tuple(points)


def _doubt(hand: Hand, first: Point, last: Point) -> None:
    """Say so if the first two figures look like inches or centimetres."""
    opening_mm = hand.model.stroke.opening_mm
    mm, nominal = first[1] - last[1], opening_mm(first[0]) - opening_mm(last[0])
    if not nominal / DOUBTFUL <= mm <= nominal * DOUBTFUL:
        print(DOUBT.format(first=first[0], last=last[0], mm=mm, nominal=nominal), flush=True)


async def _point_after(points: Sequence[Point], calliper: Calliper, position: int) -> Point:
    while True:
        mm = await calliper(position)
        why = why_not_after(points[-1], (position, mm)) if points else OPEN_IS_ZERO * (mm == 0)
        if not why:
            return position, mm
        print(f"{why}. Please measure again.", flush=True)


def _calliper(address: str, hand: Hand) -> Calliper:
    if not is_simulated(address):
        return _typed

    async def simulated(position: int) -> float:
        mm = hand.model.stroke.opening_mm(position)
        print(f"{position} counts: the simulated calliper shows {mm:g} mm", flush=True)
        return mm

    return simulated


async def _typed(position: int) -> float:
    while True:
        text = await prompt(CALLIPER_QUESTION.format(position=position))
        if re.fullmatch(OPENING_FORM, text):
            return float(text)
        print("Millimetres with at most two decimals, such as 42.5, please.", flush=True)
