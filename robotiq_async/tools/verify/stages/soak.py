"""Stage 9: reading for minutes, then small motions at higher and higher rates."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Final

from ....hands import POLL_INTERVAL_S, percentile
from ....link import ModbusTransport
from ....values import Finger, Request, RobotiqConnectionError
from ..bench import Bench
from ..catalogue import EndError, Figure
from ..motions import MARGIN, are_near, go, in_place, resting_envelope
from ..watch import StageWatch

SOAK_RATES: Final = (10, 20, 50, 100)
SPEED: Final = 64
SWING: Final = 15
FAILED: Final = 1e-4
LEAST_READS: Final = 10_000  # with fewer, a single failure would be too many
MOST_FAILURES: Final = 20


async def soak(bench: Bench) -> None:
    """Read at the usual interval, then command."""
    await _read(bench)
    await _command(bench)


async def _read(bench: Bench) -> None:
    loop, times = asyncio.get_running_loop(), list[float]()
    watch = bench.watch(bench.lengths.soak + 120)
    await watch.look()
    failures: list[Figure] = []
    repeated = _repeats(bench)
    until = loop.time() + bench.lengths.soak
    while loop.time() < until:
        began = loop.time()
        try:
            if not bench.link.is_open:
                await bench.link.open()
            await watch.look()
            times.append(loop.time() - began)
        except RobotiqConnectionError as error:
            failures.append(str(error))
            if len(failures) > MOST_FAILURES:
                raise
        await asyncio.sleep(max(0.0, began + POLL_INTERVAL_S - loop.time()))
    times.sort()
    failed = len(failures) + _repeats(bench) - repeated
    figures: dict[str, Figure] = {
        "reads": len(times),
        "failed": failed,
        "p50_ms": 1000 * percentile(times, 0.5),
        "p99_ms": 1000 * percentile(times, 0.99),
        "worst_ms": 1000 * times[-1],
        "failures": failures,
    }
    words = f"{failed} of {len(times) + len(failures)} reads failed"
    follows = "Check cable, shield and switch: each lost connection ends the moves that a program awaits."
    bench.judge("soak.reads", failed <= FAILED * max(len(times), LEAST_READS), words, follows, **figures)


def _repeats(bench: Bench) -> int:
    return bench.link.link.dialogues.repeats if isinstance(bench.link.link, ModbusTransport) else 0


async def _command(bench: Bench) -> None:
    """Move finger A back and forth a little; at each rate the last command must be followed."""
    if not bench.link.is_open:  # the last read failed
        await bench.link.open()
    watch = bench.watch(len(SOAK_RATES) * (bench.lengths.commands + 20))
    start = await watch.look()
    image = in_place(start, speed=SPEED)
    await watch.write(image)
    home = start.position(Finger.A)
    step = 1 if home < 128 else -1
    reached = [home - MARGIN, home + MARGIN, home + step * (SWING + MARGIN)]
    envelope = resting_envelope(start, (Finger.A,)) | {Finger.A: (min(reached), max(reached))}
    watch.confine(envelope)
    achieved: list[Figure] = []
    for rate in SOAK_RATES:
        sent, seconds, ends = await _burst(bench, watch, image, home, step, rate)
        achieved.append([rate, sent / seconds])
        if not ends:
            found = f"after commands at {rate} Hz the last one is not followed"
            follows = f"Write no faster: write_spacing={2 / rate:g}."
            options = {"write_spacing": min(0.1, 2 / rate)}
            bench.differs("soak.commands", found, follows, options, rates=achieved)
            return
    if await go(watch, image, {Finger.A: home}, 5.0) is None:
        raise EndError("time", f"{bench.first} did not come back within 5 s")
    watch.confine(envelope)
    bench.as_assumed("soak.commands", "followed to the last one at each rate", rates=achieved)


async def _burst(
    bench: Bench, watch: StageWatch, image: Request, home: int, step: int, rate: int
) -> tuple[int, float, bool]:
    """Send commands at a rate; return their number, the seconds, and whether the last was followed."""
    loop = asyncio.get_running_loop()
    began, sent = loop.time(), 0
    moving = replace(image, go=True)
    while loop.time() - began < bench.lengths.commands:
        due = loop.time() + 1 / rate
        await watch.write(moving.with_positions({Finger.A: home + step * (5 + sent % 6)}), spaced=False)
        sent += 1
        await watch.look()
        await asyncio.sleep(max(0.0, due - loop.time()))
    seconds = loop.time() - began
    await asyncio.sleep(0.1)
    last = {Finger.A: home + step * SWING}
    await watch.write(moving.with_positions(last))
    ends = await watch.until(lambda status: are_near(status, last, MARGIN), 3.0) is not None
    await watch.until_still(2.0)
    return sent, seconds, ends
