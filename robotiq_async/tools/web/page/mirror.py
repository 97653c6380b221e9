"""What the page's process knows of the hands, and how it asks for something."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count, zip_longest
from time import monotonic
from typing import Any, Final

from ....values.enums import DEFAULT_FORCE, DEFAULT_SPEED, State
from ....values.model import THREE_FINGER, Model, model_of
from ....values.status import RobotiqStatus

HISTORY_S: Final = 30.0
SAMPLE_S: Final = 0.2
"""Between two points of a curve: 150 of them."""
EVENTS: Final = 100
QUIET_S: Final = 1.5
"""After this the program that feeds the page counts as silent."""


@dataclass(frozen=True, slots=True)
class Sample:
    """A point of the curves.

    Attributes:
        at: monotonic seconds of this process.
        positions: in counts, of A, B, C and the scissor; None while they are not known.
        currents: the peaks since the sample before, in mA.
    """

    at: float
    positions: tuple[int, ...] | None
    currents: tuple[int, ...]


@dataclass(slots=True)
class HandMirror:
    """A hand, as the page knows it.

    Attributes:
        index: which one.
        address: of the gripper.
        state: where the hand is.
        status: the newest; None before the first.
        age: seconds since it was read, when this was told.
        problem: why the hand could not be started; empty if it was.
        statistics: the newest.
        samples: of the last half minute.
        events: the newest, with a number each.
        peaks: of the currents since the last sample.
        changes: grows with everything that is told.
    """

    index: int
    address: str
    state: State = State.DISCONNECTED
    status: RobotiqStatus | None = None
    age: float = 0.0
    problem: str = ""
    statistics: dict[str, Any] = field(default_factory=dict)
    samples: deque[Sample] = field(default_factory=deque)
    events: deque[tuple[int, dict[str, Any]]] = field(default_factory=lambda: deque(maxlen=EVENTS))
    peaks: list[int] = field(default_factory=list)
    changes: int = 0
    event_count: int = 0

    @property
    def model(self) -> Model:
        """The model of the gripper; before the first status the 3-Finger."""
        return THREE_FINGER if self.status is None else self.status.model

    @property
    def is_lost(self) -> bool:
        """Whether what the status says is old."""
        return self.status is None or self.state in (State.DISCONNECTED, State.SHUTDOWN)

    def hear(self, told: dict[str, Any]) -> None:
        """Take in what the other process tells."""
        self.state, self.problem = State[told["state"]], told["problem"]
        if "registers" in told:
            self.status = RobotiqStatus.from_registers(
                told["registers"],
                timestamp=told["timestamp"],
                sequence=told["sequence"],
                model=model_of(told["model"]),
            )
            self.age = told["age"]
        self.statistics = told.get("statistics", self.statistics)
        for event in told["events"]:
            self.event_count += 1
            self.events.append((self.event_count, event))
        self.peaks = [max(pair) for pair in zip_longest(self.peaks, told["peaks"], fillvalue=0)]
        self._sample(monotonic())
        self.changes += 1

    def _sample(self, now: float) -> None:
        # Half a millisecond of grace: ticks of a float do not add up.
        if self.samples and now - self.samples[-1].at < SAMPLE_S - 0.0005:
            return
        if self.samples and now - self.samples[-1].at > QUIET_S:
            self.samples.append(Sample(now - SAMPLE_S, None, tuple(self.peaks)))  # a gap, and not a line
        status = None if self.is_lost else self.status
        positions = None if status is None else tuple(status.position(axis) for axis in status.model.axes)
        self.samples.append(Sample(now, positions, tuple(self.peaks)))
        self.peaks = [0] * len(self.peaks)
        while now - self.samples[0].at > HISTORY_S:
            self.samples.popleft()


class Mirror:
    """All hands, and the way to the process that has them.

    Attributes:
        hands: in the order of their addresses.
        control: whether the pages may command.
        speed: where the sliders begin.
        force: where the sliders begin.
    """

    def __init__(
        self,
        addresses: tuple[str, ...],
        *,
        control: bool,
        say: Callable[[dict[str, Any]], None],
        speed: int = DEFAULT_SPEED,
        force: int = DEFAULT_FORCE,
    ) -> None:
        """Know nothing yet.

        Args:
            addresses: of the hands.
            control: whether the pages may command.
            say: tells the other process something.
            speed: where the sliders begin.
            force: where the sliders begin.
        """
        self.hands = [HandMirror(index, address) for index, address in enumerate(addresses)]
        self.control = control
        self.speed = speed
        self.force = force
        self._say = say
        self._numbers = count(1)
        self._answers: dict[int, Callable[[bool, str], None]] = {}
        self._heard_at = monotonic()

    @property
    def is_quiet(self) -> bool:
        """Whether the other process has stopped talking: what is shown is old then."""
        return monotonic() - self._heard_at > QUIET_S

    def hear(self, line: bytes) -> None:
        """Take in a line of the other process."""
        told = json.loads(line)
        self._heard_at = monotonic()
        for each in told["hands"]:
            self.hands[each["hand"]].hear(each)
        for answer in told["answers"]:
            tell = self._answers.pop(answer["number"], None)
            if tell is not None:
                tell(answer["ok"], answer["words"])

    def ask(
        self,
        page: str,
        hand: int,
        name: str,
        arguments: dict[str, Any],
        answered: Callable[[bool, str], None],
        *,
        at: float,
    ) -> None:
        """Ask for a command; ``answered`` is called with whether and how it ended.

        Args:
            page: who asks.
            hand: which one is to do it.
            name: of the command.
            arguments: of the command.
            answered: is called later.
            at: the time of this process that the browser knew when it asked.
        """
        number = next(self._numbers)
        self._answers[number] = answered
        asked = {"page": page, "number": number, "at": at, "hand": hand, "name": name, "arguments": arguments}
        self._say({"do": asked})

    def gone(self, page: str) -> None:
        """A page has ended, or its browser cannot be heard: what it has set in motion is held."""
        self._say({"gone": page})

    def count(self, pages: int) -> None:
        """Tell how many browsers look."""
        self._say({"pages": pages})

    def beat(self) -> None:
        """Say that this process lives."""
        self._say({"beat": True})
