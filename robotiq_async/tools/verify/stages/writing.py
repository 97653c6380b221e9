"""Stage 2: writing with rGTO = 0. Nothing may move."""

from __future__ import annotations

import asyncio
from typing import Final

from ....hands import LONGEST_SPACING_S, percentile, usual_write_spacing
from ....link import registers_of
from ....values import Finger, Request, RobotiqConnectionError, RobotiqStatus
from ..bench import Bench
from ..catalogue import NO_OPTIONS, Figure, Options
from ..motions import as_found
from ..watch import StageWatch, describe

WRITING_S: Final = 60.0
WRITE_STILL_S: Final = 1.0
WRITE_PROBES: Final = 20
ECHO_S: Final = 0.02
LONGEST_ECHO_S: Final = 1.0
APART_S: Final = 0.1  # between two probes, so that no probe is forgotten
GAPS_S: Final = (0.002, 0.005, 0.011, 0.021)
"""Seconds between two writes; 1 ms more than the time in question where an early timer would decide."""
PAIRS: Final = 5
MOST_PAIRS: Final = 25  # tried at one distance until PAIRS of them count
LATE: Final = 1.5
READ_WRITE: Final = 23
WRITE_LATE_S: Final = 0.0005  # a first image was late if it took LATE times the usual, and this much more


async def writing(bench: Bench) -> None:
    """Write the same image, then positions without rGTO, then pairs of images close together."""
    watch = bench.watch(WRITING_S)
    watch.need_active(False)
    before = await watch.look()
    image = as_found(before)
    await _same(bench, watch, image)
    await _motion(bench, watch, image)
    marked = _marked(image, 2)
    await asyncio.sleep(APART_S)
    await watch.write(marked)
    if await _echoed(watch, marked) is not None:
        await _spacing(bench, watch, image, usual=await _echo(bench, watch, image))
    else:
        why = "the gripper echoes no positions while it is inactive; repeat this stage after stage 3"
        bench.inconclusive("write.echo", why)
        bench.inconclusive("write.spacing", why)
    if bench.address.is_rtu:
        await _function_23(bench, watch, image)
    await watch.write(image)
    await _echoed(watch, image)


async def _same(bench: Bench, watch: StageWatch, image: Request) -> None:
    """Write the image as found, twice; the first clears rGTO if it was left set."""
    await watch.write(image)
    before = await watch.watch_for(0.2)
    await watch.write(image)
    after = await watch.watch_for(0.5)
    if _lasting(before) == _lasting(after):
        bench.as_assumed("write.same", f"still {describe(after)}")
    else:
        found = f"from {describe(before)} to {describe(after)}"
        bench.differs("write.same", found, "Writing has side effects: send no commands, and report this.")


def _lasting(status: RobotiqStatus) -> tuple[object, ...]:
    """The part that must not change; a position may vary by a count, and 0x09 may show once."""
    return status.activation_echo, status.initialization, status.mode, status.echo


async def _motion(bench: Bench, watch: StageWatch, image: Request) -> None:
    before = await watch.look()
    await watch.write(_marked(image, 1))
    moved: list[str] = []

    def moves(status: RobotiqStatus) -> bool:
        moved.extend(
            f"{axis.name} from {before.position(axis)} to {status.position(axis)}"
            for axis in status.model.axes
            if abs(status.position(axis) - before.position(axis)) > 1
        )
        return bool(moved)

    if await watch.until(moves, WRITE_STILL_S) is None:
        bench.as_assumed("write.motion", f"nothing moved within {WRITE_STILL_S:g} s")
    else:
        await watch.write(image)
        follows = "Keep away from the fingers, and report this: a stop may not stop them."
        bench.differs("write.motion", f"with rGTO = 0 {', '.join(moved)}", follows)


async def _echo(bench: Bench, watch: StageWatch, image: Request) -> float:
    """Measure the time from the acknowledgement to the start of the first read with the echo.

    Returns:
        The usual seconds until a write is acknowledged.
    """
    times, lost, writes, sent = list[float](), 0, list[float](), list[float]()
    for number in range(WRITE_PROBES):
        await asyncio.sleep(APART_S)
        marked = _marked(image, number)
        acknowledged = await watch.write(marked)
        writes.append(acknowledged - bench.link.wrote)
        if await _echoed(watch, marked, interval=0.001) is None:
            lost += 1
        else:
            times.append(bench.link.asked - acknowledged)
            sent.append(bench.link.asked - bench.link.wrote)
    if not times:
        bench.inconclusive(
            "write.echo", f"none of {WRITE_PROBES} images was echoed within {LONGEST_ECHO_S:g} s"
        )
        return percentile(sorted(writes), 0.5)
    times.sort()
    p50, worst = percentile(times, 0.5), times[-1]
    figures: dict[str, Figure] = {
        "p50_ms": 1000 * p50,
        "worst_ms": 1000 * worst,
        "from_sending_p50_ms": 1000 * percentile(sorted(sent), 0.5),
        "lost": lost,
        "probes": WRITE_PROBES,
    }
    found = f"after {1000 * p50:.0f} ms, at most {1000 * worst:.0f} ms"
    found += f"; {lost} of {WRITE_PROBES} never" if lost else ""
    follows = "No option is needed: a hand waits for the echo. Commands and stops act that much later."
    bench.judge("write.echo", not lost and p50 <= ECHO_S, found, follows, **figures)
    return percentile(sorted(writes), 0.5)


async def _echoed(watch: StageWatch, image: Request, interval: float | None = None) -> RobotiqStatus | None:
    return await watch.until(lambda status: status.echo == image.echo, LONGEST_ECHO_S, interval)


async def _spacing(bench: Bench, watch: StageWatch, image: Request, usual: float) -> None:
    """Write pairs of images, closer and closer, and check whether the second acts.

    A pair whose first image was late on its way reached the gripper closer together than it was sent: it does
    not count, or a busy computer would be taken for a slow gripper.
    """
    kept, enough = list[Figure](), list[float]()
    for gap in reversed(GAPS_S):
        acted = counted = 0
        for number in range(MOST_PAIRS):
            took, acts = await _pair(bench, watch, image, gap, number)
            if took <= LATE * usual + WRITE_LATE_S:
                acted, counted = acted + acts, counted + 1
            if counted == PAIRS:
                break
        kept.append([1000 * gap, counted, acted])
        if counted < PAIRS:
            bench.inconclusive(
                "write.spacing",
                "writes were sent late: is this computer busy?",
                gap_pairs_acted=kept,
            )
            return
        if acted == PAIRS:
            enough.append(gap)
    _judge_spacing(bench, kept, enough)


async def _pair(
    bench: Bench, watch: StageWatch, image: Request, gap: float, number: int
) -> tuple[float, bool]:
    """Write twice, so far apart; the seconds to the first acknowledgement, and whether the second acts."""
    loop = asyncio.get_running_loop()
    await watch.pause(APART_S)
    acknowledged = await watch.write(_marked(image, 2 * number))
    began = bench.link.wrote
    await asyncio.sleep(max(0.0, began + gap - loop.time()))
    second = _marked(image, 2 * number + 1)
    await watch.write(second, spaced=False)
    shown = await watch.until(lambda status: status.echo == second.echo, 0.3)
    return acknowledged - began, shown is not None


async def _function_23(bench: Bench, watch: StageWatch, image: Request) -> None:
    """Write marked images with function 23; one that is refused is written with function 16."""
    loop, times = asyncio.get_running_loop(), list[float]()
    for number in range(WRITE_PROBES):
        if not await _is_answered(bench, watch, _marked(image, number), is_first=not times):
            follows = "No option is needed: a 3-Finger is written with function 16."
            options: Options = NO_OPTIONS
            if registers_of(bench.address).write_function == READ_WRITE:
                follows, options = "Without it the first command may be lost.", {"write_function": 16}
            found = f"function 23 is not answered ({len(times)} of {number + 1} were)"
            bench.differs("write.function_23", found, follows, options)
            return
        times.append(loop.time() - bench.link.wrote)
        await watch.look()
    times.sort()
    p50, worst = 1000 * percentile(times, 0.5), 1000 * times[-1]
    found = f"answered in {p50:.1f} ms, at most {worst:.1f} ms"
    bench.as_assumed("write.function_23", found, p50_ms=p50, worst_ms=worst)


async def _is_answered(bench: Bench, watch: StageWatch, image: Request, *, is_first: bool) -> bool:
    """Write with function 23. If the first one takes the link along, the reads after it decide."""
    try:
        return await watch.write_and_read(image)
    except RobotiqConnectionError:
        # A slow line is lost over a function that its device does not answer: the time for another read
        # after it is short. A device that does not answer a new connection ends the run.
        if not is_first:
            raise
        await bench.link.close()
        await asyncio.sleep(APART_S)
        await bench.link.open()
        await watch.look()
        return False


def _judge_spacing(bench: Bench, kept: list[Figure], enough: list[float]) -> None:
    if len(enough) == len(GAPS_S):
        bench.as_assumed("write.spacing", f"all {PAIRS} pairs at each distance", gap_pairs_acted=kept)
        return
    forgotten = max(set(GAPS_S) - set(enough))
    kept_at = min((gap for gap in enough if gap > forgotten), default=None)
    found = f"a write {1000 * forgotten:.0f} ms after another is acknowledged and forgotten"
    found += "" if kept_at is None else f", and a write {1000 * kept_at:.0f} ms later acts"
    options: Options = NO_OPTIONS
    follows = "No option is needed: a hand leaves enough time. Programs that write faster lose commands."
    if forgotten >= usual_write_spacing(bench.model):
        spacing = min(LONGEST_SPACING_S, 2 * forgotten)
        bench.leave_between_writes(spacing)
        options, follows = {"write_spacing": round(spacing, 3)}, "Leave more time between writes."
    bench.differs("write.spacing", found, follows, options, gap_pairs_acted=kept)


def _marked(image: Request, number: int) -> Request:
    """The image with another position request of finger A, which makes its echo unmistakable."""
    position = image.position(Finger.A)
    step = 1 + number % 20
    return image.with_positions({Finger.A: position - step if position > 127 else position + step})
