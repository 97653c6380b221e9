"""The state of the hands in the process of the page, and the way to send commands."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import count, zip_longest
from time import monotonic
from typing import Any, Final

from ....values import (
    DEFAULT_FORCE,
    DEFAULT_SPEED,
    THREE_FINGER,
    Inhibit,
    Model,
    Points,
    RobotiqStatus,
    State,
    Stroke,
    model_of,
)
from ...description import Shape
from ...description.simulated import joints_and_parts

HISTORY_S: Final = 30.0
SAMPLE_S: Final = 0.2
"""Interval of the points of a curve: 150 points."""
EVENTS_SHOWN: Final = 100
LONGEST_ARGUMENTS: Final = 4096  # characters of the arguments of a command, as JSON
QUIET_S: Final = 1.5
"""Seconds without updates after which the other process counts as silent."""


@dataclass(frozen=True, slots=True)
class CurvePoint:
    """A point of the curves."""

    at: float  # monotonic seconds of this process
    positions: tuple[int, ...] | None  # in counts, of A, B, C and the scissor; None while they are unknown
    currents: tuple[int, ...] | None  # the peaks since the sample before, in mA; None if not known


@lru_cache(maxsize=64)
def _stroke(model: Model, points: Points) -> Stroke:
    return model.stroke.measured(points) if points else model.stroke


@dataclass(slots=True)
class HandMirror:
    """The state of a hand in the process of the page."""

    index: int  # number of the hand
    address: str
    state: State = State.DISCONNECTED
    status: RobotiqStatus | None = None  # the newest; None before the first
    joints: dict[str, float] | None = None  # from a simulation, beside the status; None without
    parts: tuple[Shape, ...] = ()  # the same, of the parts before the gripper
    age: float = 0.0  # seconds since the status was read, at the last update
    problem: str = ""  # why the hand could not be started; empty if it was
    inhibited: Inhibit | None = None  # why a person has the hand refuse motion
    statistics: dict[str, Any] = field(default_factory=dict)  # the newest
    samples: deque[CurvePoint] = field(default_factory=deque)  # of the last 30 s
    events: deque[tuple[int, dict[str, Any]]] = field(default_factory=lambda: deque(maxlen=EVENTS_SHOWN))
    peaks: list[int] = field(default_factory=list)  # of the currents since the last sample
    changes: int = 0  # number of updates
    event_count: int = 0

    @property
    def model(self) -> Model:
        """The model of the gripper; before the first status the 3-Finger."""
        return THREE_FINGER if self.status is None else self.status.model

    @property
    def is_lost(self) -> bool:
        """Whether the status is out of date."""
        return self.status is None or self.state in (State.DISCONNECTED, State.SHUTDOWN)

    def hear(self, update: dict[str, Any]) -> None:
        """Take in an update."""
        self.state, self.problem = State[update["state"]], update["problem"]
        told = update["inhibited"]
        self.inhibited = None if told is None else Inhibit.from_dict(told)
        if "registers" in update:
            model = model_of(update["model"])
            self.status = RobotiqStatus.from_registers(
                update["registers"],
                timestamp=update["timestamp"],
                sequence=update["sequence"],
                model=model,
                stroke=_stroke(model, tuple(map(tuple, update.get("stroke", ())))),
                has_current=update["has_current"],
            )
            self.age = update["age"]
            bodies = update["bodies"]
            self.joints, self.parts = (None, ()) if bodies is None else joints_and_parts(bodies)
        self.statistics = update.get("statistics", self.statistics)
        for event in update["events"]:
            self.event_count += 1
            self.events.append((self.event_count, event))
        self.peaks = [max(pair) for pair in zip_longest(self.peaks, update["peaks"], fillvalue=0)]
        self._sample(monotonic())
        self.changes += 1

    def _sample(self, now: float) -> None:
        # Half a millisecond of tolerance for rounding.
        if self.samples and now - self.samples[-1].at < SAMPLE_S - 0.0005:
            return
        if self.samples and now - self.samples[-1].at > QUIET_S:
            self.samples.append(CurvePoint(now - SAMPLE_S, None, None))  # a gap in the curve
        status = None if self.is_lost else self.status
        positions = None if status is None else tuple(status.position(axis) for axis in status.model.axes)
        currents = None if status is None or not status.has_current else tuple(self.peaks)
        self.samples.append(CurvePoint(now, positions, currents))
        self.peaks = [0] * len(self.peaks)
        while now - self.samples[0].at > HISTORY_S:
            self.samples.popleft()


class PageMirror:
    """The state of all hands, in the order of their addresses, and the way to the process that has them.

    ``speed`` and ``force`` are the initial values of the sliders; ``say`` sends to the other process.
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
        self.hands: list[HandMirror] = [HandMirror(index, address) for index, address in enumerate(addresses)]
        self.control = control
        self.speed = speed
        self.force = force
        self._say = say
        self._numbers = count(1)
        self._answers: dict[int, Callable[[bool, str], None]] = {}
        self._heard_at = monotonic()

    @property
    def is_quiet(self) -> bool:
        """Whether the other process has fallen silent: the values are out of date then."""
        return monotonic() - self._heard_at > QUIET_S

    def hear(self, line: bytes) -> None:
        """Take in a line of the other process."""
        message = json.loads(line)
        self._heard_at = monotonic()
        for each in message["hands"]:
            self.hands[each["hand"]].hear(each)
        for answer in message["answers"]:
            report = self._answers.pop(answer["number"], None)
            if report is not None:
                report(answer["ok"], answer["words"])

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
        """Send a command; ``answered`` is called with success and a description of the outcome.

        ``at`` is the time of this process that the browser had received.
        """
        if len(json.dumps(arguments)) > LONGEST_ARGUMENTS:  # a browser may send anything
            answered(False, "a command is not that long")
            return
        number = next(self._numbers)
        self._answers[number] = answered
        call = {"page": page, "number": number, "at": at, "hand": hand, "name": name, "arguments": arguments}
        self._say({"do": call})

    def gone(self, page: str) -> None:
        """Hold the motions of a page that has ended, or whose browser is lost."""
        self._say({"gone": page})

    def count(self, pages: int) -> None:
        """Send the number of browsers that show a page."""
        self._say({"pages": pages})

    def beat(self) -> None:
        """Send a heartbeat."""
        self._say({"beat": True})
