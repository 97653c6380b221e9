"""Programs of labs and ours on the same bad line, in one table: make race.

Ours run in virtual time (tests/dropins/lockstep.py), until so many exchanges were made on each wire. Theirs
are packages that an index has; they run in real time, at the same simulated gripper behind a socket. A value
is wrong if the gripper has not shown it lately, or if a move is called done that is not.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import cycle
from typing import Any, Final

from robotiq_async import JAW, TWO_FINGER_85
from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values.registers import Registers

AGE_S: Final = 0.08  # a status may be 30 ms old, and a reply on the slowest wire takes its time
TIME_OUT_S: Final = 2.0  # that our programs are given
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
    """What a program has met.

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
    """What programs do with the copied class, or with another that has its calls, until so many exchanges."""

    def __init__(self, driver: Any, gripper: Watched, exchanges: int, wait: Callable[[float], None]) -> None:
        self.tally = Tally()
        self._driver = driver
        self._gripper = gripper
        self._exchanges = exchanges
        self._wait = wait

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
