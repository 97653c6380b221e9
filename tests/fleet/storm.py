"""Commands under faults: is each setting right, each outcome true, and nothing late?

``python -m tests.fleet.storm direct|proxy|router [COMMANDS] [SEED]``. In the world of tests.fleet.world the
holder asks without end, each time for values of its own. Meanwhile links are cut, hosts are frozen,
agents are killed, the gripper is away, and a rival takes the lease or halts. With a proxy everything arrives
twice and out of order; behind a router no link is ever closed, and what was sent arrives later.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import json
import random
import sys
from bisect import bisect_left, bisect_right
from collections import Counter, defaultdict
from collections.abc import Awaitable, Callable
from operator import attrgetter
from typing import Any, Final, NamedTuple

from robotiq_async import Finger, RobotiqError
from robotiq_async.values.request import Request
from tests.fleet.programs import say
from tests.fleet.world import World, world
from tests.virtual import virtual

A: Final = Finger.A
WAYS: Final = ("direct", "proxy", "router")
USUAL: Final = {"speed": 128, "force": 64}  # of the hand's options: no client asks for these
VALUES: Final = [value for value in range(2, 250) if value not in USUAL.values()]  # of the holder, in turn
OF_RIVAL: Final = {"speed": 251, "force": 252}
AT_A_TIME: Final = 4
LATE_S: Final = 1.0
NONE_LATE_S: Final = LATE_S + 0.2
"""The window, and one write."""
SETTINGS: Final = ("speed", "force")


class Note(NamedTuple):
    """One call: when, for what, when it ended and how."""

    begun: float
    asked: dict[str, int]
    end: float
    outcome: str

    @property
    def word(self) -> str:
        for words in ("nothing was done", "had begun", "may have been carried out"):
            if words in self.outcome:
                return words
        return self.outcome.partition(":")[0]


class Image(NamedTuple):
    """A write for finger A, and its time."""

    at: float
    position: int
    speed: int
    force: int

    def has(self, asked: dict[str, int]) -> bool:
        return all(getattr(self, what) == value for what, value in asked.items())


class Storm:
    """One run."""

    def __init__(self, here: World, way: str, count: int, seed: int) -> None:
        self.here = here
        self.way = way
        self.count = count
        self.chance = random.Random(seed)
        self.notes: list[Note] = []
        self.rivals: list[Note] = []
        self.faults: Counter[str] = Counter()
        self.number = 0
        self.since = len(here.gripper.writes)
        self.runs = 0

    async def run(self) -> None:
        self.spoil()
        holder = self.here.holder
        asking = [holder.host.create_task(self.ask()) for _ in range(AT_A_TIME)]
        while not all(task.done() for task in asking):
            await self.fault()
            await asyncio.sleep(self.chance.uniform(0.3, 2.0))
        for task in asking:
            task.result()
        await asyncio.sleep(2.0)

    def spoil(self) -> None:
        self.here.network.keeps_links = self.way == "router"
        if self.way == "proxy":
            for name in ("holder", "other"):
                for stream in self.here.network.both(name, self.here.agent.host.name):
                    stream.copies, stream.jitter, stream.lateness = 2, 0.03, 0.1

    # -- the clients -----------------------------------------------------------------------------------

    async def note(self, notes: list[Note], asked: dict[str, int], call: Callable[[], Any]) -> None:
        begun = self.here.now()
        try:
            if (going := call()) is not None:
                await going
            outcome = "sent" if going is None else "done"
        except RobotiqError as error:
            outcome = f"{type(error).__name__}: {error}"
        notes.append(Note(begun, asked, self.here.now(), outcome))
        if "Error" in outcome:
            await asyncio.sleep(0.1)  # a gripper that is away refuses each at once

    async def ask(self) -> None:
        hand = self.here.holder.hand
        while self.number < self.count:
            if not hand.is_in_control:
                with contextlib.suppress(RobotiqError):
                    await hand.acquire()
                await asyncio.sleep(0.05)
                continue
            self.number += 1
            await self.ask_one(VALUES[self.number % len(VALUES)], 20 + self.number % 200)

    async def ask_one(self, value: int, position: int) -> None:
        hand, both = self.here.holder.hand, {"position": position, "speed": value, "force": value}
        match self.chance.choices(["speed", "force", "position", "move", "command"], [4, 4, 2, 1, 3])[0]:
            case "speed":
                await self.note(self.notes, {"speed": value}, lambda: hand.set_speed(value, A))
            case "force":
                await self.note(self.notes, {"force": value}, lambda: hand.set_force(value, A))
            case "position":
                asked = {"position": position}
                await self.note(self.notes, asked, lambda: hand.set_position(position, A))
            case "move":
                how: dict[str, Any] = {"speed": value, "force": value, "timeout": 1.0}
                await self.note(self.notes, both, lambda: hand.move(position, A, **how))
            case _:
                await self.note(self.notes, both, lambda: hand.command(A, **both))
                await asyncio.sleep(0.01)

    async def rival(self) -> None:
        hand = self.here.other.hand
        with contextlib.suppress(RobotiqError):
            await hand.take()
            for what, value in {"position": 7, **OF_RIVAL}.items():
                call = functools.partial(getattr(hand, f"set_{what}"), value, A)
                await self.note(self.rivals, {what: value}, call)
            await hand.release(halt=self.chance.random() < 0.5)

    # -- the faults ------------------------------------------------------------------------------------

    async def fault(self) -> None:
        faults: dict[str, Callable[[float], Awaitable[None]]] = {
            "take": lambda _: self.here.other.do(self.rival()),
            "halt": lambda _: self.here.other.do(self.halted()),
            "cut": self.cut,
            "agent frozen": lambda seconds: self.frozen(self.here.agent.host, seconds),
            "client frozen": lambda seconds: self.frozen(self.here.holder.host, seconds),
            "agent killed": self.killed,
            "gripper away": self.away,
        }
        name = self.chance.choice([*faults, "take"])
        self.faults[name] += 1
        await faults[name](self.chance.choice([0.2, 0.6, 0.95, 1.5, 2.5]))

    async def halted(self) -> None:
        with contextlib.suppress(RobotiqError):
            await self.here.other.hand.halt()

    async def cut(self, seconds: float) -> None:
        out, back = self.chance.choice([(True, True), (True, False), (False, True)])
        self.here.cut(self.here.holder, out=out, back=back)
        await asyncio.sleep(seconds)
        self.here.mend(self.here.holder)

    async def frozen(self, host: Any, seconds: float) -> None:
        self.here.freeze(host)
        await asyncio.sleep(seconds)
        self.here.thaw(host)

    async def killed(self, seconds: float) -> None:
        self.here.kill(self.here.agent.host)
        await asyncio.sleep(seconds)
        self.runs += 1
        await self.here.start_agent(f"agent {self.runs}")
        self.spoil()

    async def away(self, seconds: float) -> None:
        await self.here.servers["left"].stop()
        await asyncio.sleep(seconds)
        await self.here.servers["left"].start()

    # -- the judgement ---------------------------------------------------------------------------------

    def report(self) -> dict[str, Any]:
        images = [
            Image(write.time, axis.position, axis.speed, axis.force)
            for write in self.here.gripper.writes[self.since :]
            if (image := Request.from_registers(write.registers)).activate
            for axis in image.axes[:1]
        ]
        wrong: list[str] = []
        latest = 0.0
        for what in SETTINGS:
            found, late = self.wrong(what, images)
            wrong, latest = wrong + found, max(late, latest)
        false = [str(note) for note in self.notes if self.is_false(note, images)]
        return {
            "way": self.way,
            "commands": len(self.notes),
            "faults": dict(self.faults),
            "images": len(images),
            "outcomes": dict(Counter(note.word for note in self.notes)),
            "wrong settings": len(wrong),
            "false outcomes": len(false),
            "latest, s": round(latest, 2),
            "examples": [*wrong[:5], *false[:5]],
        }

    def wrong(self, what: str, images: list[Image]) -> tuple[list[str], float]:
        """Changes that were neither asked for just now nor restored; and how late the latest was."""
        own = [note for note in self.notes if what in note.asked]
        of_value: defaultdict[int, list[float]] = defaultdict(list)
        for note in own:
            of_value[note.asked[what]].append(note.begun)
        wrong, latest, before = [], 0.0, USUAL[what]
        for image in images:
            value = getattr(image, what)
            if value != before:
                asked = [begun for begun in of_value[value] if begun <= image.at]
                late = image.at - asked[-1] if asked else float("inf")
                if late <= NONE_LATE_S:
                    latest = max(latest, late)
                elif value not in self.restored(what, own, images, image.at):
                    wrong.append(f"{what} {value} at {image.at:.3f}, before {before}, late {late:.2f}")
            before = value
        return wrong, latest

    def restored(self, what: str, own: list[Note], images: list[Image], at: float) -> set[int]:
        """The values that a motion may restore: the holder's last, the rival's, or the usual ones.

        The holder's last is the newest that was carried out, or a later one of unknown outcome that the
        gripper got in time.
        """
        last: set[int] = {USUAL[what]}
        for note in own:
            if note.begun <= at:
                if note.outcome == "done" and note.end <= at:
                    last = {note.asked[what]}
                elif note.word != "nothing was done" and self.came_in_time(what, note, images):
                    last |= {note.asked[what]}
        rivals = [note for note in self.rivals if what in note.asked and note.begun <= at]
        last |= {OF_RIVAL[what]} if rivals else set()
        return last | ({USUAL[what]} if not any(note.outcome == "done" for note in rivals) else set())

    def came_in_time(self, what: str, note: Note, images: list[Image]) -> bool:
        first = bisect_left(images, note.begun, key=attrgetter("at"))
        last = bisect_right(images, note.begun + NONE_LATE_S, key=attrgetter("at"))
        return any(getattr(image, what) == note.asked[what] for image in images[first:last])

    def is_false(self, note: Note, images: list[Image]) -> bool:
        begun = bisect_left(images, note.begun, key=attrgetter("at"))
        was_there = images[begun - 1 : begun] if begun else []
        since = images[begun : bisect_right(images, note.end, key=attrgetter("at"))]
        if note.word in ("done", "had begun"):
            return not any(self.is_shown(note, image) for image in (*was_there, *since))
        if note.word == "nothing was done":
            # A hold may be at any position, and the same value is asked for again after some seconds.
            again = [
                n.begun for n in self.notes if n.begun > note.begun and n.asked.items() & note.asked.items()
            ]
            until = min([note.end + 5.0, *again])
            near = images[begun : bisect_left(images, until, key=attrgetter("at"))]
            is_certain = "speed" in note.asked or "force" in note.asked
            return (
                is_certain
                and not any(i.has(note.asked) for i in was_there)
                and any(image.has(note.asked) for image in near)
            )
        return False

    def is_shown(self, note: Note, image: Image) -> bool:
        """Whether an image has what was asked for, or what superseded it before it could be written."""
        later = [each for each in self.notes if note.begun <= each.begun <= note.end]
        return all(
            getattr(image, what) in (value, *(each.asked[what] for each in later if what in each.asked))
            for what, value in note.asked.items()
        )


def storm(way: str, count: int, seed: int) -> dict[str, Any]:
    found: dict[str, Any] = {}

    @virtual
    async def run() -> None:
        async with world() as here:
            it = Storm(here, way, count, seed)
            await it.run()
            found.update(it.report())

    run()
    return found


if __name__ == "__main__":
    given = [*sys.argv[1:], *("direct", "10000", "1")[len(sys.argv) - 1 :]]
    say(json.dumps(storm(given[0], int(given[1]), int(given[2])), indent=1))
