"""Random lives of a serial line, in virtual time: calls of its users, and troubles of the device.

    python -m tests.link.lives                     the whole set, against what is written in lives.txt
    python -m tests.link.lives shared 7            what happened in one life
    python -m tests.link.lives --write             write lives.txt, when the behaviour was changed on purpose

A life gives the same result each time: what was sent and when, how each call ended and when. A change of the
link that should change nothing is right if all lives stay as they were. test_lives.py looks at every third.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import logging
import random
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import pytest
import serial

from robotiq_async import RobotiqConnectionError
from robotiq_async.values.model import TWO_FINGER_85
from robotiq_async.values.registers import RTU_REGISTERS, RegisterMap
from tests.link.scripted_device import SPOILT, Device, unopened, wrong_checksum
from tests.serial_line import with_crc
from tests.virtual import run
from tests.virtual_line import VirtualLine

LIVES: Final = {"16": 210, "23": 210, "shared": 120}
"""Lives of each kind of line: with a write function, or with two users that have different unit ids."""
KNOWN: Final = Path(__file__).with_suffix(".txt")
CALLS: Final = 25
IMAGE: Final = (0x0900, 0x00FF, 0x4060, 0, 0, 0, 0, 0)
CHOICES: Final = ("read",) * 5 + ("send",) * 2 + ("both",) * 2 + ("stop", "cancel", "nothing", "close")


class Call(NamedTuple):
    """A call of a user: which, how it ended, and when."""

    user: int
    what: str
    result: object
    ended_s: float


class Life(NamedTuple):
    """The events on a line."""

    calls: list[Call]
    frames: list[str]

    def __str__(self) -> str:
        """A line of lives.txt: what one can compare by eye, and a digest of everything."""
        digest = hashlib.sha256(json.dumps(self, separators=(",", ":")).encode()).hexdigest()[:16]
        ends = Counter(_kind(call.result) for call in self.calls)
        writes = sum(frame[2:4] in ("10", "17") for frame in self.frames)
        return f"{digest} {len(self.frames)} frames {writes} writes " + " ".join(
            f"{count} {name}" for name, count in sorted(ends.items())
        )


def live(kind: str, seed: int) -> Life:
    """One life."""
    return run(lambda: _life(kind, random.Random(f"{kind} {seed}")))


async def _life(kind: str, rng: random.Random) -> Life:
    with pytest.MonkeyPatch.context() as patch:
        VirtualLine(patch)
        device = Device(serial.serial_for_url(VirtualLine.FAR))
        maps = _maps(kind)
        users = [_User(number, maps, device, rng) for number in range(len(maps))]
        device.echoes = rng.random() < 0.15
        device.least_pause = rng.choice((0.0, 0.0, 0.0, 0.0015))
        device.most = rng.choice((8, 8, 8, 3)) if kind == "23" else 8
        device.refuses = rng.random() < 0.5
        calls: list[Call] = []
        if rng.random() < 0.3:
            for user in users:  # one after the other
                await user.live(calls)
        else:
            await asyncio.gather(*(user.live(calls) for user in users))
        frames = [request.hex() for request in device.requests]
        await asyncio.sleep(0.5)  # late replies
        device.close()
    return Life(calls, frames)


def _maps(kind: str) -> list[RegisterMap]:
    jaw = replace(TWO_FINGER_85.rtu, is_sure=True)
    return {"16": [RTU_REGISTERS], "23": [jaw], "shared": [RTU_REGISTERS, replace(jaw, device_id=12)]}[kind]


class _User:
    """One of those on the line. Its random numbers are its own: its plans do not depend on other users."""

    def __init__(self, number: int, maps: list[RegisterMap], device: Device, rng: random.Random) -> None:
        self._number = number
        self._unit = maps[number].device_id
        self._device = device
        self._rng = random.Random(rng.random())
        self._loop = asyncio.get_running_loop()
        self._began = self._loop.time()
        self._link = unopened(VirtualLine.NEAR, maps[number], shares_line=len(maps) > 1)
        self._images = 0

    async def live(self, calls: list[Call]) -> None:
        # Never at the same instant as the other: who comes first would depend on the turns of the loop.
        apart = 0.00013 * self._number
        for _ in range(CALLS):
            await asyncio.sleep(self._rng.choice((0.0, 0.001, 0.005, 0.03)) + apart)
            if self._rng.random() < 0.25:
                self._trouble()
            what = self._rng.choice(CHOICES) if self._link.is_open else "open"
            result: object
            try:
                result = await getattr(self, f"_{what}")()
            except RobotiqConnectionError as error:
                result = f"{type(error).__name__}: {error}"
            calls.append(Call(self._number, what, result, round(self._loop.time() - self._began, 5)))
        await self._link.close()

    # -- its calls -------------------------------------------------------------------------------------

    async def _open(self) -> None:
        await self._link.open()

    async def _close(self) -> None:
        await self._link.close()

    async def _read(self) -> object:
        return await self._link.read()

    async def _send(self) -> object:
        return await self._link.send(lambda: IMAGE)

    async def _nothing(self) -> object:
        return await self._link.send(lambda: None)

    async def _both(self) -> object:
        if not self._link.reads_with_writes:
            return "not served"
        answer = await self._link.send_and_read(lambda: IMAGE)
        return answer and [
            answer.registers,
            answer.doubt and f"{type(answer.doubt).__name__}: {answer.doubt}",
        ]

    async def _stop(self) -> object:
        self._images += 1
        return await self._link.stop_or_read(lambda: IMAGE if self._images % 2 else None)

    async def _cancel(self) -> object:
        reading = asyncio.ensure_future(self._link.read())
        await asyncio.sleep(self._rng.choice((0.001, 0.01, 0.06)))
        reading.cancel()
        await asyncio.wait([reading])
        if reading.cancelled():
            return "cancelled"
        if (error := reading.exception()) is not None:
            return f"{type(error).__name__}: {error}"
        return reading.result()

    # -- troubles --------------------------------------------------------------------------------------

    def _trouble(self) -> None:
        device, rng, later = self._device, self._rng, self._loop.call_later
        match rng.randrange(9):
            case 0:
                device.spoil = SPOILT[rng.choice(list(SPOILT))]
            case 1:
                device.loses = rng.randrange(1, 4)
            case 2:
                device.keep = rng.randrange(1, 3)
            case 3:
                extra = bytes(rng.randrange(1, 4))
                device.spoil = lambda reply: reply + extra
            case 4:
                code = rng.choice((1, 2, 4, 6, 11))
                device.spoil = lambda reply: with_crc(bytes((reply[0], reply[1] | 0x80, code)))
            case 5:
                later(rng.uniform(0, 0.05), device.send, bytes(rng.randrange(1, 5)))
            case 6:
                device.late = {self._unit: rng.choice((0.04, 0.055, 0.12))}
                later(rng.uniform(0.05, 0.4), device.late.clear)
            case 7:
                device.spoil, device.spoils_all = wrong_checksum, rng.random() < 0.5
                later(0.1, setattr, device, "spoils_all", False)
            case _:
                device.has_23 = rng.random() < 0.7


def _kind(result: object) -> str:
    """The outcome of a call, in one word."""
    if isinstance(result, str):
        return result.partition(":")[0].partition(" ")[0]
    return "done"


def known() -> dict[tuple[str, int], str]:
    """The lives as they were when lives.txt was written, by kind and seed."""
    found = {}
    for line in KNOWN.read_text(encoding="utf-8").splitlines():
        kind, seed, life = line.split(" ", 2)
        found[kind, int(seed)] = life
    return found


def every_life() -> Iterator[tuple[str, int]]:
    return ((kind, seed) for kind, count in LIVES.items() for seed in range(count))


def main(arguments: list[str]) -> int:
    """Compare all lives, show one, or write them down."""
    logging.disable(logging.CRITICAL)
    match arguments:
        case [kind, seed]:
            life = live(kind, int(seed))
            print(*life.calls, *life.frames, life, sep="\n")  # noqa: T201
        case ["--write"]:
            lines = [f"{kind} {seed} {live(kind, seed)}\n" for kind, seed in every_life()]
            KNOWN.write_text("".join(lines), encoding="utf-8")
        case []:
            before = known()
            now = {each: str(live(*each)) for each in every_life()}
            others = [each for each in now if now[each] != before[each]]
            for each in others:
                print(*each, f"was {before[each]}", f"is  {now[each]}", sep="\n  ")  # noqa: T201
            print(f"{len(now) - len(others)} as they were, {len(others)} not")  # noqa: T201
            return bool(others)
        case _:
            print(__doc__)  # noqa: T201
            return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
