"""Moves under random faults for as long as you like, over real connections or in virtual time.

    python -m tests.adversity.soak --minutes 30 --link rtu --hands 2
    python -m tests.adversity.soak --minutes 300 --link rtu --virtual --starved

A hand, a simulated gripper and everything that watches them share one event loop. In cycles of some
seconds two users move axes, cancel, halt and run control loops, while the fault injector cuts, delays,
corrupts and refuses, and the application holds up the loop now and then. After each cycle everything comes to
rest and is compared. Several hands do so beside each other, on a serial line with one port for all of them.
With ``--silent`` others on that line look all the time for grippers that do not answer. With ``--starved``
the loop is also held up for seconds. With ``--virtual`` an hour takes some minutes, and a seed always takes
the same course.
Exits with 1 when a promise was broken.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import gc
import logging
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

import pytest

from robotiq_async import JAW, Finger, Model, MoveResult, RobotiqError, RobotiqHand, State, Tunnel
from robotiq_async.link.line import LONGEST_HUSH_S
from robotiq_async.link.serial.patience import QUESTION_S
from robotiq_async.simulator import KINDS, Trouble
from robotiq_async.values.model import MODELS, THREE_FINGER, model_of
from robotiq_async.values.registers import RTU_REGISTERS
from robotiq_async.values.states import RUNNING
from tests.adversity.fuzz import resident
from tests.adversity.watch import LoopWatch, VirtualLoopWatch, WriteWatch, check
from tests.adversity.world import (
    MODEL,
    RtuServer,
    Server,
    StampedGripper,
    TcpServer,
    ToolServer,
    UrcapServer,
    World,
    tunnel_through_an_arm,
)
from tests.arms import Arm
from tests.serial_line import SerialLine
from tests.virtual_line import VirtualLine

Cable = SerialLine | VirtualLine

SPEEDUP = 5.0
HOLD_UPS_S = (0.03, 0.1, 0.6)
STARVED_S = (*HOLD_UPS_S, 2.0, 6.0)
CYCLE_S = (4.0, 12.0)
FOR_EVER_S = 1e6
WRITE_S = 1.0
"""Longest write of a hand that has its line alone: a poll without an answer, the repeated read, the write."""
TURNS = 3
"""The turns of a line that these take. Before each one every other hand may have a turn."""
TURN_S = LONGEST_HUSH_S + QUESTION_S
"""Longest turn of a hand whose gripper does not answer."""
TROUBLES = [
    *(Trouble(kind) for kind in ("drop", "late", "half", "twice", "wrong-function", "wrong-length")),
    *(Trouble(kind) for kind in ("wrong-count", "wrong-unit", "wrong-echo", "release", "foreign")),
    Trouble("drop", on="write"),
    Trouble("silence", lasts=0.0),
    *(Trouble("delay", seconds) for seconds in (0.01, 0.1, 0.3)),
    *(Trouble("slow-device", seconds) for seconds in (0.02, 0.2)),
    *(Trouble("fault", code) for code in (5, 9, 12, 13)),
    *(Trouble(kind) for kind in ("silence", "pieces", "power-cut", "interference")),
    *(Trouble(kind) for kind in ("reset", "close", "refuse", "accept-silence", "exception")),
    *(Trouble(kind) for kind in ("wrong-transaction", "wrong-protocol")),
    *(Trouble("multiplexer", seconds) for seconds in (0.02, 0.3, 0.7)),
    *(Trouble(kind) for kind in ("wrong-checksum", "byte-before", "byte-after")),
    *(Trouble(kind, lasts=0.0) for kind in ("garbled", "seven-bits")),
    *(Trouble(kind) for kind in ("echo", "strict-silence")),
    *(Trouble(kind) for kind in ("unreadable", "unreadable", "lost-set", "one-by-one")),
]
"""Troubles; those that fit the link and the gripper happen."""
SERVERS: Final[dict[str, type[TcpServer | UrcapServer | ToolServer]]] = {
    "tcp": TcpServer,
    "urcap": UrcapServer,
    "tunnel": ToolServer,
}
MOVES_EVERYTHING = ("foreign", "release")
OF_A_SCISSOR = "interference"


class Setting(NamedTuple):
    """The options of a run; links and numbers are those of the command line."""

    link: str = "tcp"
    model: Model = MODEL
    hands: int = 1
    silent: int = 0
    seed: int = 1
    is_starved: bool = False


@dataclass
class Soak:
    """One hand in a run."""

    world: World
    line: Cable | None
    """The line that this run may pull out."""
    rng: random.Random
    loop: LoopWatch
    writes: WriteWatch
    write_s: float
    """Longest time that a write may take."""
    hold_ups: tuple[float, ...]
    """Seconds for which the application holds up the loop at a time."""
    arm: Arm | None = None
    """The arm at whose tool the gripper is, if there is one."""
    figures: Counter[str] = field(default_factory=Counter)
    broken: list[str] = field(default_factory=list)
    longest_stall: float = 0.0
    everything_moved: bool = False

    @property
    def hand(self) -> RobotiqHand:
        return self.world.hand

    def breach(self, what: str) -> None:
        self.broken.append(what)
        print(f"BROKEN: {what}", file=sys.stderr, flush=True)  # noqa: T201

    async def cycle(self) -> None:
        """Some seconds of use and trouble, then rest."""
        axes = Finger(self.rng.randrange(1, 16)) & self.hand.model.all_axes or JAW
        before = self.world.travels()
        self.writes.forget()
        self.everything_moved = False
        ends = self.loop.now + self.rng.uniform(*CYCLE_S)
        # Two users, on axes of their own where there are enough, else one: sharing an axis supersedes.
        masks = {axes & pair or axes for pair in (Finger.A | Finger.B, Finger.C | Finger.SCISSOR)}
        users = [self.user(mask, ends) for mask in masks]
        await asyncio.gather(*users, self.fault_injector(ends), self.application(ends))
        await self.bounded("rest", 60.0, self.rest())
        for axis, travel in self.world.travels().items():
            if axis not in axes and travel != before[axis] and not self.everything_moved:
                self.breach(f"{axis!r} moved, addressed were {axes!r}")

    def look(self) -> None:
        """Look at everything that was said and done in a cycle."""
        self.figures["cycles"] += 1
        for each in check(self.world, self.writes, self.loop):
            self.breach(each)

    async def user(self, axes: Finger, ends: float) -> None:
        """A user who moves these axes."""
        calls = (self.move, self.move, self.set_position, self.control_loop, self.cancelled_move, self.halt)
        while self.loop.now < ends:
            mask = Finger(int(axes) & self.rng.randrange(1, 16)) or axes
            await self.rng.choice(calls)(mask)
            if self.hand.state not in RUNNING and self.rng.random() < 0.3:
                self.everything_moved = True
                await self.bounded("recover", 95.0, self.checked("recover", self.hand.recover))
            await asyncio.sleep(self.rng.choice((0.0, 0.0, 0.01, 0.1)))

    async def move(self, axes: Finger) -> None:
        self.figures["moves asked"] += 1
        result = await self.bounded("move", 25.0, self.checked("move", lambda: self.random_move(axes)))
        if isinstance(result, MoveResult):
            self.figures["moves done"] += 1

    async def cancelled_move(self, axes: Finger) -> None:
        self.figures["moves cancelled"] += 1
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(self.rng.uniform(0, 0.5)):
                await self.checked("move", lambda: self.random_move(axes))

    def random_move(self, axes: Finger) -> Awaitable[MoveResult]:
        speed, force = self.writes.next_settings()
        return self.hand.move(self.random_target(axes), axes, speed=speed, force=force)

    def random_target(self, axes: Finger) -> int:
        """Anywhere, or some counts from where an axis is: short moves end before a late status has them."""
        if self.rng.random() < 0.5:
            return self.rng.randrange(256)
        here = self.world.gripper.position(next(iter(axes)))
        return min(255, max(0, round(here) + self.rng.randint(-30, 30)))

    async def set_position(self, axes: Finger) -> None:
        async def write() -> None:
            speed, force = self.writes.next_settings()
            self.hand.command(axes, speed=speed, force=force)  # leaves with the position
            await self.hand.set_position(self.rng.randrange(256), axes)

        await self.bounded("write", self.write_s, self.checked("write", write))

    async def control_loop(self, axes: Finger) -> None:
        for _ in range(self.rng.randrange(1, 40)):
            try:
                speed, force = self.writes.next_settings()
                self.hand.command(axes, position=self.rng.randrange(256), speed=speed, force=force)
                self.figures["commands"] += 1
            except RobotiqError:
                self.figures["commands refused"] += 1
            await asyncio.sleep(0.005)

    async def halt(self, _: Finger) -> None:
        await self.bounded("halt", 2.0, self.checked("halt", self.hand.halt))

    async def checked(self, what: str, call: Callable[[], Awaitable[Any]]) -> Any:
        """Make a call; its error is counted if it is one of the contract, and a breach if not."""
        try:
            return await call()
        except RobotiqError as error:
            self.figures[f"{what}: {type(error).__name__}"] += 1
        except Exception as error:  # noqa: BLE001  # that is what is looked for
            self.breach(f"{what} raised {error!r}")

    async def bounded(self, what: str, seconds: float, call: Awaitable[Any]) -> Any:
        """A call ends in time. What the application and other processes took is not the library's."""
        began = self.loop.now - self.loop.lost
        result = await call
        took = self.loop.now - self.loop.lost - began
        if took > seconds:
            self.breach(f"{what} took {took:.2f} s")
        return result

    async def fault_injector(self, ends: float) -> None:
        """One trouble after the other."""
        kinds = [trouble for trouble in TROUBLES if KINDS[trouble.kind].fits(self.world.server.link)]
        if Finger.SCISSOR not in self.hand.model.all_axes:
            kinds = [kind for kind in kinds if kind.kind != OF_A_SCISSOR]
        while self.loop.now < ends:
            await asyncio.sleep(self.rng.uniform(0.1, 1.5))
            if self.line is not None and self.rng.random() < 0.1:
                await self.pull(self.line)
                continue
            if self.arm is not None and self.rng.random() < 0.1:
                self.figures["trouble: arm dropped its clients"] += 1
                self.arm.drop_clients()
                continue
            trouble = self.rng.choice(kinds)
            self.figures["troubles"] += 1
            self.figures[f"trouble: {trouble.kind}"] += 1
            self.everything_moved |= trouble.kind in MOVES_EVERYTHING
            async with self.world.server.fault_injector.making(trouble):
                await asyncio.sleep(self.rng.choice((0.02, 0.2, 0.8)))
                if trouble.kind == "foreign":
                    self.writes.forget()
                    self.world.gripper.images.clear()

    async def pull(self, line: Cable) -> None:
        self.figures["trouble: line pulled"] += 1
        line.pull()
        await asyncio.sleep(self.rng.choice((0.02, 0.5)))
        line.plug()

    async def application(self, ends: float) -> None:
        """The program around the hand holds up the loop now and then."""
        while self.loop.now < ends:
            await asyncio.sleep(self.rng.uniform(0.5, 4.0))
            self.loop.hold_up(self.rng.choice(self.hold_ups))
            self.figures["loop held up"] += 1

    async def rest(self) -> None:
        """Recover, and wait until nothing moves."""
        while True:
            if self.hand.state is State.SHUTDOWN:
                await self.checked("start", self.hand.start)
            elif self.hand.state not in RUNNING and self.hand.state is not State.DISCONNECTED:
                self.everything_moved = True
                await self.checked("recover", self.hand.recover)
            await asyncio.sleep(0.7)
            if self.hand.state is State.RUNNING_IDLE and not self.world.gripper.is_moving:
                return

    async def restart(self) -> None:
        """Sometimes the hand is stopped and started again; the figures of its life are kept."""
        statistics = self.hand.statistics
        self.longest_stall = max(self.longest_stall, statistics.longest_stall)
        if self.rng.random() > 0.2:
            return
        self.collect()
        await self.bounded("stop", 2.0, self.hand.stop())
        await self.bounded("start", 5.0, self.checked("start", self.hand.start))
        self.figures["restarts"] += 1

    def collect(self) -> None:
        """Add up what the hand counts from each of its starts."""
        statistics = self.hand.statistics
        self.longest_stall = max(self.longest_stall, statistics.longest_stall)
        for name in ("polls", "writes", "overruns", "reconnects", "foreign_commands"):
            self.figures[name] += getattr(statistics, name)


@contextlib.asynccontextmanager
async def soaks(setting: Setting, loop: LoopWatch) -> AsyncIterator[list[Soak]]:
    """Everything in place, the hands started."""
    link, model, hands, silent, seed, is_starved = setting
    async with contextlib.AsyncExitStack() as stack:
        line: Cable | None = None
        if link == "rtu":
            line = stack.enter_context(line_for(hands, loop))
        them = []
        others = hands + silent - 1 if line is not None else 0
        write_s = WRITE_S + others * TURNS * TURN_S
        for number in range(hands):
            gripper = StampedGripper(
                asyncio.get_running_loop().time, speedup=SPEEDUP, device_cycle=0.005 * SPEEDUP, model=model
            )
            world, arm = await stack.enter_async_context(started(gripper, link, line, number))
            pulled = line if number == 0 else None
            rng, hold_ups = random.Random(seed + number), STARVED_S if is_starved else HOLD_UPS_S
            them.append(Soak(world, pulled, rng, loop, WriteWatch(model), write_s, hold_ups, arm))
        for number in range(hands, hands + silent):
            assert line is not None, "others need a line"
            stack.enter_context(looking(f"rtu://{line.near}", RTU_REGISTERS.device_id + number))
        yield them


@contextlib.contextmanager
def line_for(hands: int, loop: LoopWatch) -> Iterator[Cable]:
    """The serial line of so many hands."""
    if isinstance(loop, VirtualLoopWatch):
        with pytest.MonkeyPatch.context() as patch:
            yield VirtualLine(patch)
        return
    # In memory: pulling and plugging makes and removes a link, and a busy disk takes its time.
    memory = "/dev/shm" if Path("/dev/shm").is_dir() else None
    with tempfile.TemporaryDirectory(dir=memory) as folder, SerialLine(Path(folder), hands) as line:
        yield line


@contextlib.contextmanager
def looking(address: str, unit: int) -> Iterator[None]:
    """A hand that looks for a gripper which is not there."""
    task = asyncio.ensure_future(RobotiqHand(address, model="2f85", device_id=unit).start(wait=FOR_EVER_S))
    yield
    task.cancel()


@contextlib.asynccontextmanager
async def started(
    gripper: StampedGripper, link: str, line: Cable | None, number: int
) -> AsyncIterator[tuple[World, Arm | None]]:
    """A gripper with its server, and a hand; of several on a line it is the one with this number.

    With a tunnel it is at the tool of an arm.
    """
    server: Server
    unit = None
    if line is not None:
        unit = RTU_REGISTERS.device_id + number
        far = line.FAR if isinstance(line, VirtualLine) else line.fars[number]
        server = RtuServer(far, gripper, device_id=unit)
    else:
        server = SERVERS[link](gripper)
    async with contextlib.AsyncExitStack() as stack:
        await stack.enter_async_context(server)
        address: str | Tunnel = server.address if line is None else f"rtu://{line.near}"
        arm: Arm | None = None
        if link == "tunnel":
            arm, address = await stack.enter_async_context(tunnel_through_an_arm(server))
        async with RobotiqHand(address, model=gripper.model, device_id=unit) as hand:
            world = World(gripper, server, None, hand)
            watching = asyncio.create_task(world.watch())
            yield world, arm
            watching.cancel()
            await asyncio.gather(watching, return_exceptions=True)


async def run(minutes: float, setting: Setting, loop: LoopWatch) -> int:
    """Run it and print the figures as a table.

    Returns:
        The exit code.
    """
    began, memory = loop.now, 0
    async with soaks(setting, loop) as them:
        last_word = began
        while loop.now - began < 60 * minutes:
            await asyncio.gather(*(it.cycle() for it in them))
            for it in them:
                it.look()
            await asyncio.gather(*(it.restart() for it in them))
            if not memory and loop.now - began > 60 * minutes / 4:
                memory = resident()  # by now what grows once has grown: histories, samples, caches
            if loop.now - last_word > 60:
                last_word = loop.now
                done = sum(it.figures["moves done"] for it in them)
                broken = sum(len(it.broken) for it in them)
                passed = (last_word - began) / 60
                print(f"{passed:5.1f} min  {done} moves done, {broken} promises broken", flush=True)  # noqa: T201
        for it in them:
            it.collect()
    figures = sum((it.figures for it in them), Counter[str]())
    broken = sum(len(it.broken) for it in them)
    rows = [
        ("minutes", f"{(loop.now - began) / 60:.1f}"),
        ("promises broken", str(broken)),
        *((name, str(figures[name])) for name in sorted(figures)),
        ("longest stall that statistics saw, ms", f"{1000 * max(it.longest_stall for it in them):.0f}"),
        ("longest hold by library, simulator and checks, ms", f"{1000 * loop.hold.longest:.1f}"),
        ("memory growth in the last three quarters, MiB", f"{(resident() - memory) / 2**20:.1f}"),
    ]
    beside = f" beside {setting.silent} silent" if setting.silent else ""
    head = [(f"{setting.hands} {setting.model.title}{beside}, {setting.link}", "figure"), ("--", "--")]
    print("\n".join(f"| {name} | {value} |" for name, value in head + rows))  # noqa: T201
    return 1 if broken else 0


def main() -> int:
    """Read the options and run."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=30.0, help="how long (default: 30)")
    parser.add_argument(
        "--link",
        choices=("rtu", *SERVERS),
        default="tcp",
        help="Modbus TCP, a pseudo terminal, the text port of a UR, or a tunnel through an arm",
    )
    parser.add_argument("--hands", type=int, default=1, help="how many; on rtu they share the line")
    parser.add_argument("--silent", type=int, default=0, help="hands on an rtu line without a gripper")
    parser.add_argument("--model", type=model_of, default=MODEL, help=f"one of {', '.join(MODELS)}")
    parser.add_argument("--seed", type=int, default=int(time.time()), help="of everything that is random")
    parser.add_argument("--virtual", action="store_true", help="in virtual time: an hour takes some minutes")
    parser.add_argument("--starved", action="store_true", help="the loop is held up for seconds, too")
    options = parser.parse_args()
    if options.link == "urcap" and options.model is THREE_FINGER:
        parser.error("a UR has no 3-Finger: --model 2f85, for example")
    if options.silent and options.link != "rtu":
        parser.error("--silent needs --link rtu")
    print(f"seed {options.seed}", flush=True)  # noqa: T201
    logging.getLogger("robotiq_async").setLevel(logging.CRITICAL)
    # Most garbage here is that of the checks: it is collected between cycles, when nothing is measured.
    gc.freeze()
    gc.disable()
    loop = VirtualLoopWatch() if options.virtual else LoopWatch()
    with asyncio.Runner(loop_factory=loop.make_loop) as runner:
        hands = options.hands, options.silent
        setting = Setting(options.link, options.model, *hands, options.seed, options.starved)
        return runner.run(run(options.minutes, setting, loop))


if __name__ == "__main__":
    sys.exit(main())
