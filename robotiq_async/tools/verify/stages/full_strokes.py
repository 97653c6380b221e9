"""Stage 6: full strokes of the fingers at three speeds, and of the scissor. Nothing is between them."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from ....calibration import profile_of
from ....hands import units_of
from ....values import CLOSED, FORCE_MAX, OPEN, Finger, ObjectStatus, Request, RobotiqStatus
from ..bench import Bench
from ..catalogue import EndError, Figure
from ..motions import in_place, resting_envelope
from ..watch import AxesAtRest, StageWatch

FULL_STROKES_S: Final = 180.0
SPEEDS: Final = (0, 64, 255)
STROKE_S: Final = 20.0  # twice the time of the slowest one
SCISSOR_SPEED: Final = 64
SPEED_SHARE: Final = 0.2
PRESSING_SPEED: Final = 64
GIVE: Final = 7  # counts: one 2F-85 reads 225 or 226 at the least force, and 230 from 80 on
PART_OF_STROKE: Final = 0.9


async def full_strokes(bench: Bench) -> None:
    """Move the scissor with open fingers, then the fingers, slowly at first."""
    watch = bench.watch(FULL_STROKES_S)
    start = await watch.look()
    await watch.write(in_place(start))
    await _fingers_to(bench, watch, start, OPEN, 64)
    if Finger.SCISSOR in bench.model.all_axes:
        await _scissor(bench, watch, start.position(Finger.SCISSOR))
    times: dict[int, float] = {}
    openings: dict[int, float] = {}
    readings: list[list[int]] = []
    for speed in SPEEDS:
        before = await watch.look()
        closed, took = await _fingers_to(bench, watch, before, CLOSED, speed)
        opened, back = await _fingers_to(bench, watch, closed, OPEN, speed)
        times[speed], openings[speed] = took, back
        readings.append([each.position(finger) for each in (opened, closed) for finger in bench.fingers])
    _judge_times(bench, times)
    _judge_readings(bench, readings)
    if len(bench.fingers) == 1:
        _judge_openings(bench, openings)
        await _press(bench, watch, readings[1][-1])


async def _fingers_to(
    bench: Bench, watch: StageWatch, start: RobotiqStatus, goal: int, speed: int, force: int = 0
) -> tuple[RobotiqStatus, float]:
    """Move fingers; return the status at the end, and the seconds until the last was seen to move."""
    watch.confine(resting_envelope(start, bench.fingers))
    image = in_place(start, speed=speed, force=force)
    image = replace(image, go=True).with_positions(dict.fromkeys(bench.fingers, goal))
    return await _stroke(watch, image, bench.fingers)


async def _press(bench: Bench, watch: StageWatch, least: int) -> None:
    """Close once with the greatest force: the closed stop of a jaw gives."""
    before = await watch.look()
    closed, _ = await _fingers_to(bench, watch, before, CLOSED, PRESSING_SPEED, FORCE_MAX)
    most = closed.position(bench.fingers[0])
    await _fingers_to(bench, watch, closed, OPEN, PRESSING_SPEED)
    found = f"closed at {least} with the least force, and at {most} with the greatest"
    follows = "Its closed stop is softer than any known: please report this."
    bench.judge("stroke.force", 0 <= most - least <= GIVE, found, follows, least=least, greatest=most)


async def _stroke(watch: StageWatch, image: Request, axes: tuple[Finger, ...]) -> tuple[RobotiqStatus, float]:
    began = await watch.write(image)
    rest = AxesAtRest(axes)

    def is_over(status: RobotiqStatus) -> bool:
        # Where limits are echoed, the scissor's echo does not reveal the end: two seconds of rest do.
        if rest.lasts(status, 2.0):
            return True
        stands = all(status.finger_status(axis) is not ObjectStatus.IN_MOTION for axis in axes)
        return status.echo == image.echo and stands and rest.lasts(status, 0.5)

    status = await watch.until(is_over, STROKE_S)
    if status is None:
        raise EndError("time", f"a stroke did not finish within {STROKE_S:g} s")
    return status, rest.moved_at - began


async def _scissor(bench: Bench, watch: StageWatch, home: int) -> None:
    echoes: list[Figure] = []
    readings: list[Figure] = []
    for goal in (0, 255, home):
        start = await watch.look()
        watch.confine(resting_envelope(start, (Finger.SCISSOR,)))
        image = replace(in_place(start, speed=SCISSOR_SPEED), go=True).with_positions({Finger.SCISSOR: goal})
        status, _ = await _stroke(watch, image, (Finger.SCISSOR,))
        if goal != home:
            echoes.append(status.requested_position(Finger.SCISSOR))
            readings.append(status.position(Finger.SCISSOR))
    words = f"0 and 255 are echoed as {echoes[0]} and {echoes[1]}, and read {readings[0]} and {readings[1]}"
    follows = "No option is needed: a hand learns the limits, and its moves end there."
    bench.judge("stroke.scissor", echoes == [0, 255], words, follows, echoes=echoes, readings=readings)


def _judge_times(bench: Bench, times: dict[int, float]) -> None:
    figures: dict[str, Figure] = {f"speed_{speed}_s": took for speed, took in times.items()}
    usual = units_of(None, None, bench.model).closing_s
    share = max(abs(took / usual(speed) - 1) for speed, took in times.items())
    words = ", ".join(f"{took:.2f} s at speed {speed}" for speed, took in times.items())
    if share > SPEED_SHARE:
        words += f"; up to {100 * share:.0f} % off the assumption"
    follows = "Run robotiq-async measure speed, and give its table to the hand as calibration."
    bench.judge("stroke.time", share <= SPEED_SHARE, words, follows, **figures)


def _judge_openings(bench: Bench, times: dict[int, float]) -> None:
    profile, counts = profile_of(bench.model), bench.model.stroke.counts
    assert profile is not None, "a jaw has one"
    share = max(abs(took / profile.opening_s(counts, speed) - 1) for speed, took in times.items())
    words = ", ".join(f"{took:.2f} s at speed {speed}" for speed, took in times.items())
    if share > SPEED_SHARE:
        words += f"; up to {100 * share:.0f} % off the assumption"
    follows = "No option is needed: no time limit is that short. Please report this."
    figures: dict[str, Figure] = {f"speed_{speed}_s": took for speed, took in times.items()}
    bench.judge("stroke.opening", share <= SPEED_SHARE, words, follows, **figures)


def _judge_readings(bench: Bench, readings: list[list[int]]) -> None:
    model = bench.model
    opened = sorted({each for row in readings for each in row[: len(bench.fingers)]})
    closed = sorted({each for row in readings for each in row[len(bench.fingers) :]})
    words = f"open {opened[0]} to {opened[-1]}, closed {closed[0]} to {closed[-1]}"
    figures: dict[str, Figure] = {"open": list(opened), "closed": list(closed)}
    is_usual = model.open_reading_min <= opened[0] and opened[-1] <= model.open_reading_max
    is_usual = is_usual and closed[0] >= model.closed_reading_min
    if is_usual:
        bench.as_assumed("stroke.readings", words, **figures)
    elif closed[0] - opened[-1] < PART_OF_STROKE * model.stroke.counts:
        bench.inconclusive("stroke.readings", f"{words}: something was in the way", **figures)
    else:
        follows = "No option is needed: a hand uses gDT, not positions. Please report this."
        bench.differs("stroke.readings", words, follows, **figures)
