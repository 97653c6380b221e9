"""Stage 5: stopping in the middle of slow motions of the fingers, or of the jaw."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final, NamedTuple

from ....calibration import SpeedCalibration
from ....values import Finger, Request, RobotiqStatus
from ..bench import Bench
from ..catalogue import EndError, Figure
from ..motions import MARGIN, are_near, go, in_place, motion_envelope
from ..watch import AxesAtRest, StageWatch

STOPPING_S: Final = 90.0
SPEED: Final = 64
STOPPING_COUNTS: Final = 80
LEG_S: Final = 12.0
COUNTS: Final = 10
"""Counts of a stop over a quick link. A slow one adds the way of its exchanges: 11 counts in 80 ms."""


async def stopping(bench: Bench) -> None:
    """Write rGTO = 0, rGTO = 1 again, a new request, and a hold, each half way."""
    watch = bench.watch(STOPPING_S)
    start = await watch.look()
    if any(start.position(finger) > 100 for finger in bench.fingers):
        raise EndError("refused", "the fingers are not open; begin with --from 3")
    home = {finger: start.position(finger) for finger in bench.fingers}
    image = in_place(start, speed=SPEED)
    await watch.write(image)
    far = {finger: home[finger] + STOPPING_COUNTS for finger in bench.fingers}
    watch.confine(motion_envelope(start, far))
    away = replace(image, go=True).with_positions(far)
    await _halt(bench, watch, away, home)
    await _resume(bench, watch, away, far)
    await _new_target(bench, watch, image, home)
    await _hold(bench, watch, image, home)
    watch.confine(motion_envelope(start, far))
    if await go(watch, image, home, LEG_S) is None:
        raise EndError("time", "the fingers did not return to where they began")


async def _until_past(watch: StageWatch, is_past: Callable[[RobotiqStatus], bool]) -> RobotiqStatus:
    status = await watch.until(is_past, LEG_S)
    if status is None:
        raise EndError("time", f"the fingers did not get half way within {LEG_S:g} s")
    return status


async def _halt(bench: Bench, watch: StageWatch, away: Request, home: dict[Finger, int]) -> None:
    await watch.write(away)
    status = await _until_past(
        watch, lambda s: all(s.position(f) >= home[f] + STOPPING_COUNTS // 2 for f in bench.fingers)
    )
    stop = await _stop(bench, watch, replace(away, go=False), status)
    words = f"{stop.counts} counts and {1000 * stop.seconds:.0f} ms at speed {SPEED}{stop.on_the_way}"
    follows = "Do not rely on a software stop; report this."
    bench.judge("stop.halt", stop.is_quick, words, follows, **stop.figures)


class _StopTrial(NamedTuple):
    """A stop: the counts that a finger still moved, and the time that the link took of it."""

    counts: int
    seconds: float  # until rest
    exchange_s: float  # from requesting the last status before it to its acknowledgement
    rate: float  # counts a second before it

    @property
    def allowed(self) -> float:
        """Counts of a quick stop, and of the time in which the gripper could not know of it."""
        return COUNTS + self.rate * self.exchange_s

    @property
    def is_quick(self) -> bool:
        return self.counts <= self.allowed

    @property
    def on_the_way(self) -> str:
        if self.counts <= COUNTS:
            return ""
        return f", of which {self.rate * self.exchange_s:.0f} may come from exchanges on this link"

    @property
    def figures(self) -> dict[str, Figure]:
        return {
            "counts": self.counts,
            "allowed_counts": round(self.allowed, 1),
            "seconds": self.seconds,
            "exchange_s": self.exchange_s,
        }


async def _stop(bench: Bench, watch: StageWatch, image: Request, status: RobotiqStatus) -> _StopTrial:
    """Write an image that stops, and watch the fingers until they rest."""
    rest = AxesAtRest(bench.fingers)
    rest.lasts(status, 0.3)  # from here on
    began, before, asked = rest.moved_at, rest.positions, bench.link.asked
    acknowledged = await watch.write(image)
    await watch.until(lambda now: rest.lasts(now, 0.3), 4.0)
    counts = max(abs(at - was) for at, was in zip(rest.positions, before, strict=True))
    rate = SpeedCalibration.usual(bench.model).counts_per_s(SPEED)
    return _StopTrial(counts, rest.moved_at - began, acknowledged - asked, rate)


async def _resume(bench: Bench, watch: StageWatch, away: Request, far: dict[Finger, int]) -> None:
    await watch.write(away)
    resumes = await watch.until(lambda status: are_near(status, far, MARGIN), LEG_S) is not None
    where = [watch.last.position(finger) for finger in bench.fingers] if watch.last else []
    found = "continues to its target" if resumes else f"stays at {where} with rGTO set again"
    follows = "No option is needed: a hand writes new requests after a stop. Please report this."
    bench.judge("stop.resume", resumes, found, follows)
    await watch.until_still(2.0)


async def _half_way_home(
    bench: Bench, watch: StageWatch, image: Request, home: dict[Finger, int]
) -> RobotiqStatus:
    near = {finger: home[finger] + 10 for finger in bench.fingers}
    await watch.write(replace(image, go=True).with_positions(near))
    return await _until_past(
        watch, lambda s: all(s.position(f) <= home[f] + STOPPING_COUNTS - 30 for f in bench.fingers)
    )


async def _new_target(bench: Bench, watch: StageWatch, image: Request, home: dict[Finger, int]) -> None:
    """Move towards home; half way back out a little."""
    await _half_way_home(bench, watch, image, home)
    turned = {finger: home[finger] + STOPPING_COUNTS - 10 for finger in bench.fingers}
    await watch.write(replace(image, go=True).with_positions(turned))
    turns = await watch.until(lambda status: are_near(status, turned, MARGIN), LEG_S) is not None
    found = "the fingers turn, and stop at the new target" if turns else "the new request is ignored"
    bench.judge("stop.target", turns, found, "A motion cannot be replaced: report this.")
    await watch.until_still(2.0)


async def _hold(bench: Bench, watch: StageWatch, image: Request, home: dict[Finger, int]) -> None:
    status = await _half_way_home(bench, watch, image, home)
    here = {finger: status.position(finger) for finger in bench.fingers}
    stop = await _stop(bench, watch, replace(image, go=True).with_positions(here), status)
    words = f"within {stop.counts} counts, {1000 * stop.seconds:.0f} ms{stop.on_the_way}"
    follows = "hold() stops too late: use halt(). Please report this."
    bench.judge("stop.hold", stop.is_quick, words, follows, **stop.figures)
