"""Programs of labs and ours on the same bad line, in one table: make race.

Ours run in virtual time (tests/dropins/lockstep.py), until so many exchanges were made on each wire. Theirs
are packages that an index has; they run in real time, at the same simulated gripper behind a socket. A value
is wrong if the gripper has not shown it lately, or if a move is called done that is not.
"""

from __future__ import annotations

import argparse
import asyncio
import logging
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Coroutine, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import chain, cycle, product
from typing import Any, Final, Self

from robotiq_async import JAW, TWO_FINGER_85
from robotiq_async.dropins.ur import RobotiqGripper
from robotiq_async.simulator import SimulatedGripper, Trouble, UrcapSimulatorServer
from robotiq_async.values.registers import Registers
from tests.dropins.lockstep import WIRES, bad, inside, line, rest
from tests.grippers import activate_beforehand

AGE_S: Final = 0.08  # a status may be 30 ms old, and a reply on the slowest wire takes its time
TIME_OUT_S: Final = 2.0  # that our programs are given
HANG_S: Final = 5.0  # a call that has not come back for so long never does
COUNTS: Final = 2  # a gripper may rest beside its target


class Watched(SimulatedGripper):
    """A gripper that keeps what it has shown, and counts the exchanges."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.exchanges = 0
        self._shown: deque[tuple[float, float]] = deque(maxlen=100)

    def status_registers(self) -> Registers:
        self.exchanges += 1
        self._shown.append((time.monotonic(), self.position(JAW)))
        return super().status_registers()

    def write(self, address_offset: int, registers: Any) -> None:
        self.exchanges += 1
        super().write(address_offset, registers)

    def has_shown(self, value: float, since: float) -> bool:
        """Whether a position lies between those that it had since then."""
        lately = [position for when, position in self._shown if when >= since - AGE_S]
        lately.append(self.position(JAW))
        return min(lately) - COUNTS <= value <= max(lately) + COUNTS


@dataclass
class Tally:
    """The experiences of a program.

    Attributes:
        calls: that were made.
        exceptions: by their names.
        wrong: answers that were not true.
        longest: the longest call, in seconds.
    """

    calls: int = 0
    exceptions: Counter[str] = field(default_factory=Counter)
    wrong: int = 0
    longest: float = 0.0

    def call(self, function: Callable[[], Any], is_true: Callable[[Any, float], bool]) -> Any:
        """Make a call; None if it raises."""
        began = time.monotonic()
        self.calls += 1
        try:
            answer = function()
        except Exception as error:  # noqa: BLE001  # it is counted
            self.exceptions[type(error).__name__] += 1
            return None
        finally:
            self.longest = max(self.longest, time.monotonic() - began)
        self.wrong += not is_true(answer, began)
        return answer


def sweep(steps: int) -> Iterator[int]:
    """Targets there and back, as a hand at a leader gives them."""
    there = [round(255 * step / steps) for step in range(steps)]
    return cycle([*there, 255, *reversed(there[1:])])


class Loop:
    """A loop of programs with the copied class, or another with its calls, until so many exchanges."""

    def __init__(self, driver: Any, gripper: Watched, exchanges: int, wait: Callable[[float], None]) -> None:
        self.tally = Tally()
        self._driver = driver
        self._gripper = gripper
        self._exchanges = exchanges
        self._wait = wait

    def end(self) -> None:
        """End after the present call."""
        self._exchanges = 0

    @property
    def _goes_on(self) -> bool:
        return self._gripper.exchanges < self._exchanges

    def _is_at(self, target: int) -> bool:
        return TWO_FINGER_85.has_reached(target, round(self._gripper.position(JAW)))

    def follow(self) -> Tally:
        """GELLO's loop: read the position, wait for 10 ms, move."""
        targets = sweep(32)
        while self._goes_on:
            self.tally.call(self._driver.get_current_position, self._gripper.has_shown)
            self._wait(0.01)
            self._move(next(targets))
        return self.tally

    def go(self) -> Tally:
        """Moves that are waited for, and what they say that they reached."""
        targets = sweep(5)
        while self._goes_on:
            self._go(next(targets))
            self._wait(0.01)
        return self.tally

    def watch(self) -> Tally:
        """Moves, and a loop that reads OBJ until the fingers rest."""
        targets = sweep(5)
        while self._goes_on:
            target = next(targets)
            self._move(target)
            while self._look(target) == 0 and self._goes_on:
                self._wait(0.005)
        return self.tally

    def _move(self, target: int) -> None:
        self.tally.call(
            lambda: self._driver.move(target, 255, 10), lambda answer, _: answer == (True, target)
        )

    def _go(self, target: int) -> None:
        self.tally.call(
            lambda: self._driver.move_and_wait_for_pos(target, 255, 10),
            lambda answer, began: (
                self._is_at(target)
                and self._gripper.has_shown(answer[0], began)
                and answer[1].name == "AT_DEST"
            ),
        )

    def _look(self, target: int) -> int | None:
        answer: int | None = self.tally.call(
            lambda: self._driver._get_var("OBJ"), lambda answer, _: answer == 0 or self._is_at(target)
        )
        return answer


PROGRAMS: Final = {"follow": Loop.follow, "move and wait": Loop.go, "wait for OBJ": Loop.watch}


# -- the lines -------------------------------------------------------------------------------------------

Server = Any
Disturb = Callable[[Server], Coroutine[Any, Any, None]]


async def second_client(server: Server) -> None:
    """Another client sends the fingers to 128 each second, in the middle of what the program does."""
    while True:
        await asyncio.sleep(1.03)
        await server.fault_injector.begin(Trouble("foreign", 128))


async def restarts(server: Server) -> None:
    """The port is gone for half a second, each five seconds."""
    while True:
        await asyncio.sleep(5)
        await server.stop()
        await asyncio.sleep(0.5)
        await server.start()


async def nothing(server: Server) -> None:
    """Nothing beside the replies."""


LINES: Final[dict[str, tuple[float, Disturb]]] = {
    "1 in 100": (0.01, nothing),
    "1 in 1,000": (0.001, nothing),
    "second client": (0.0, second_client),
    "restarts": (0.0, restarts),
}
LATE_S: Final = 0.3


# -- ours, in virtual time -------------------------------------------------------------------------------


def ours(exchanges: int, wires: Iterable[str], names: Iterable[str]) -> Iterator[tuple[str, ...]]:
    """Rows of our class on each wire and line."""
    for name, wire in product(names, wires):
        share, disturb = LINES[name]
        if name == "restarts" and wire == "rtu":
            continue  # a serial port has no server that restarts
        for title, program in PROGRAMS.items():
            with line(wire, kind=Watched) as here:
                driver = RobotiqGripper(response_timeout=0.1)
                driver.connect(here.address, socket_timeout=TIME_OUT_S)
                here.server.policy = bad(share, LATE_S)
                inside(partial(here.begin, partial(disturb, here.server)))
                tally = program(Loop(driver, here.gripper, exchanges, rest))
                here.server.policy = bad(0, 0)
                yield row(name, f"dropins.ur, {wire}", title, here.gripper.exchanges, tally)
                driver.disconnect()


def row(name: str, who: str, title: str, exchanges: int, tally: Tally, hangs: int = 0) -> tuple[str, ...]:
    raised = ", ".join(f"{count:,} {error}" for error, count in tally.exceptions.most_common()) or "0"
    longest = f"{tally.longest:.2f} s"
    return (
        name,
        who,
        title,
        f"{exchanges:,}",
        f"{tally.calls:,}",
        raised,
        f"{tally.wrong:,}",
        str(hangs),
        longest,
    )


# -- theirs, in real time --------------------------------------------------------------------------------


class Served:
    """A simulated 2F-85 at a URCap's port, in a thread with a loop of its own."""

    def __init__(self, share: float, disturb: Disturb) -> None:
        self.gripper = Watched(model=TWO_FINGER_85, spread=False)
        self.server = UrcapSimulatorServer(self.gripper)
        self._share, self._disturb = share, disturb
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        self._do(self._open())
        return self

    def __exit__(self, *_: object) -> None:
        self._disturbing.cancel()
        self._do(self.server.stop())
        self._loop.call_soon_threadsafe(self._loop.stop)

    async def _open(self) -> None:
        await self.server.start()
        await activate_beforehand(self.gripper)
        self.server.policy = bad(self._share, LATE_S)
        self._disturbing = self._loop.create_task(self._disturb(self.server))

    def _do(self, work: Coroutine[Any, Any, None]) -> None:
        asyncio.run_coroutine_threadsafe(work, self._loop).result()


def copied_class(port: int) -> Any:
    """The class of ur_rtde's examples, which GELLO has a copy of: rcs-ur5e brings it to the index."""
    from tests.urcap.live import example_of_ur_rtde  # noqa: PLC0415  # needs that environment

    driver = example_of_ur_rtde().RobotiqGripper()
    driver.connect("127.0.0.1", port, socket_timeout=0.2)
    return driver


class Airo:
    """airo-robots by the calls of the copied class: a width as counts."""

    def __init__(self, port: int) -> None:
        from airo_robots.grippers.hardware.robotiq_2f85_urcap import Robotiq2F85  # noqa: PLC0415

        self._driver = Robotiq2F85("127.0.0.1", port)

    def get_current_position(self) -> int:
        return round(230 - float(self._driver.get_current_width()) / 0.085 * 230)

    def move(self, position: int, _speed: int, _force: int) -> tuple[bool, int]:
        self._driver.move(0.085 * (1 - position / 230))
        return True, position


class PyRobotiqUR:
    """pyRobotiqUR by the calls of the copied class."""

    def __init__(self, port: int) -> None:
        import pyrobotiqur  # noqa: PLC0415

        self._driver = pyrobotiqur.RobotiqGripper("127.0.0.1", port)
        self._driver.connect()

    def get_current_position(self) -> int:
        return int(self._driver.get_position())

    def move(self, position: int, _speed: int, _force: int) -> tuple[bool, int]:
        self._driver.move(position, speed=255, force=10, wait=False)
        return True, position


THEIRS: Final = {"copied class (rcs-ur5e)": copied_class, "airo-robots": Airo, "pyRobotiqUR": PyRobotiqUR}


def theirs(exchanges: int, seconds: float, names: Iterable[str]) -> Iterator[tuple[str, ...]]:
    """Rows of the programs of others; one that hangs is left behind."""
    for name, (who, make) in product(names, THEIRS.items()):
        programs = PROGRAMS if make is copied_class else {"follow": Loop.follow}
        for title, program in programs.items():
            with Served(*LINES[name]) as here:
                loop = Loop(make(here.server.port), here.gripper, exchanges, time.sleep)
                working = threading.Thread(target=program, args=(loop,), daemon=True)
                working.start()
                working.join(seconds)
                calls = loop.tally.calls
                working.join(HANG_S)
                hangs = int(working.is_alive() and loop.tally.calls == calls)
                loop.end()
                yield row(name, who, title, here.gripper.exchanges, loop.tally, hangs)


HEAD: Final = (
    "line",
    "program",
    "what it does",
    "exchanges",
    "calls",
    "exceptions",
    "wrong",
    "hangs",
    "longest call",
)


def main() -> None:
    """The table, row by row."""
    parser = argparse.ArgumentParser(prog="make race", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--exchanges", type=int, default=100_000, help="of ours, on each wire (%(default)s)")
    parser.add_argument("--seconds", type=float, default=60, help="of each of theirs (%(default)s)")
    parser.add_argument("--wires", nargs="*", default=WIRES)
    parser.add_argument("--lines", nargs="*", default=[*LINES], choices=[*LINES])
    parser.add_argument("--ours", action="store_true", help="ours alone")
    given = parser.parse_args()
    logging.disable()  # a line of the log for each lost reply
    print("| " + " | ".join(HEAD) + " |\n" + "| -- " * len(HEAD) + "|")
    both = chain(
        () if given.ours else theirs(given.exchanges, given.seconds, given.lines),
        ours(given.exchanges, given.wires, given.lines),
    )
    for each in both:
        print("| " + " | ".join(each) + " |", flush=True)


if __name__ == "__main__":
    main()
