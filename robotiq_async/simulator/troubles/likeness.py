"""Likeness: a simulated gripper like the one of a report of ``robotiq-async verify``."""

# Theory of operation
#
# A report has figures of the gripper as a client saw them, over its link. Each is turned back into a figure
# of the gripper: the time of an exchange is taken off, and of a range (the longest silence that passed, the
# shortest that did not) the middle is taken. Figures that the report lacks stay as usual. A check that
# differs and that no simulator can have is named in ``unknown``. Effects that are shorter than an exchange
# do not show in a report, and so not here.

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

from robotiq_async.calibration.motion_profile import MotionProfile
from robotiq_async.values.enums import Fault, Finger
from robotiq_async.values.model import Model, model_of

from ..physics.control_modes import SCISSOR_HIGH, SCISSOR_LOW
from ..physics.controller import usual_motion
from ..physics.gripper import SimulatedGripper
from ..physics.habits import Habits
from ..physics.spread import SEED, Spread
from .like_hardware import own_habits
from .trouble import Trouble

if TYPE_CHECKING:
    from .fault_injector import FaultInjector

SCHEMA: Final = 1
_SPEEDS: Final = (0, 64, 255)
"""The speeds of stage 6."""
_NO_DELAY_S: Final = 0.001
"""An exchange over TCP that takes no longer needs no delay."""
_SLOW_LINK_S: Final = 0.01
_USUAL_BYTE_S: Final = 10 / 115200
_TIMERS_S: Final = 0.0004
_WATCH_STEP_S: Final = 0.005
"""Seconds between two reads of a watch, if they take less."""
_MOST_SEEDS: Final = 3000
_FORGOTTEN_S: Final = 4.0
"""Seconds for which stage 8 leaves a gripper without its client at first."""
_HAD: Final = frozenset(
    {
        *(
            "read.registers",
            "read.counts",
            "read.round_trip",
            "read.silence",
            "read.idle",
            "read.connections",
        ),
        *("write.echo", "write.spacing", "write.function_23", "activation.time", "axis.lag"),
        *("stroke.time", "stroke.readings", "stroke.opening", "stroke.force", "stroke.scissor"),
        *("soft.halt", "soft.speed", "loss.first_motion", "loss.idle"),
    }
)
"""The checks that a simulator can have otherwise."""


class RunningServer(Protocol):
    """A running server of the gripper."""

    @property
    def link(self) -> str: ...

    @property
    def fault_injector(self) -> FaultInjector: ...


@dataclass(frozen=True, slots=True)
class Likeness:
    """The figures of a gripper and its link in a report, as far as a simulator can have it. Immutable.

    Attributes:
        model: of the gripper.
        link: "tcp", "rtu", "rtu+tcp", "urcap" or "tunnel".
        device_id: the only unit id that answered; None if several did, or if the report has no unit id.
        habits: its habits.
        motion: its motion in time; None for the usual one.
        ends: its readings open, and closed with the least force; None for the usual ones.
        device_cycle: seconds from a write to its effect; None for the usual time.
        exchange_s: seconds of an exchange; None if the report has no figure.
        spread: whether axes stop beside their requests.
        seed: the number of the gripper: of a 3-Finger one with its readings.
        scissor_limit: the ends of the scissor; None for the usual ones.
        troubles: misbehaviour of the link and the gripper, all the time.
        unknown: names of checks that differ and that no simulator can have.
    """

    model: Model
    link: str = "tcp"
    device_id: int | None = None
    habits: Habits = field(default_factory=Habits)
    motion: MotionProfile | None = None
    ends: tuple[int, int] | None = None
    device_cycle: float | None = None
    exchange_s: float | None = None
    spread: bool = True
    seed: int = SEED
    scissor_limit: tuple[int, int] | None = None
    troubles: tuple[Trouble, ...] = ()
    unknown: tuple[str, ...] = ()

    @classmethod
    def from_file(cls, path: Path | str) -> Likeness:
        """The likeness in a ``report.json``.

        Raises:
            OSError: the file cannot be read.
            ValueError: it is no such report.
        """
        try:
            report = json.loads(Path(path).read_text(encoding="utf-8"))
        except ValueError as error:
            raise ValueError(f"{path} is no report of robotiq-async verify: {error}") from error
        return cls.from_report(report)

    @classmethod
    def from_report(cls, report: object) -> Likeness:
        """The likeness in the content of a ``report.json``; it may lack any of the checks.

        Raises:
            ValueError: it is no such report, or one of another schema.
        """
        if not isinstance(report, Mapping):
            raise ValueError(f"report must be an object, got {type(report).__name__}")
        if report.get("schema") != SCHEMA:
            raise ValueError(f"the schema of report must be {SCHEMA}, got {report.get('schema')!r}")
        try:
            return _ReportReader(report).likeness()
        except (KeyError, TypeError, AttributeError, IndexError) as error:
            raise ValueError(f"this is no report of robotiq-async verify: {error!r}") from error

    def gripper(self, clock: Callable[[], float], *, speedup: float = 1.0) -> SimulatedGripper:
        """A new gripper like the one of the report, on a clock."""
        limit = self.scissor_limit or (SCISSOR_LOW, SCISSOR_HIGH)
        return SimulatedGripper(
            clock,
            model=self.model,
            habits=self.habits,
            motion=self.motion,
            ends=self.ends,
            device_cycle=self.device_cycle,
            spread=self.spread,
            seed=self.seed,
            scissor_limit=limit,
            speedup=speedup,
        )

    async def begin(self, server: RunningServer) -> None:
        """Give the link of a running server the times and the troubles of the report."""
        for trouble in self.troubles:
            await server.fault_injector.begin(trouble)
        if self.exchange_s is None:
            return
        if server.link in ("rtu", "rtu+tcp"):
            count = self.model.rtu.count
            # A read has 8 bytes, and its reply 5 beside the registers.
            rest = self.exchange_s - (13 + 2 * count) * _USUAL_BYTE_S - _TIMERS_S
            line: Any = server  # which keeps this silence
            line.reply_silence = max(line.reply_silence, rest)
        elif self.exchange_s > _NO_DELAY_S:
            await server.fault_injector.begin(Trouble("delay", self.exchange_s))


class _ReportReader:
    """One report, read."""

    def __init__(self, report: Mapping[str, Any]) -> None:
        self._checks = {each["name"]: each for each in report["checks"]}
        self._report = report
        self._registers = report["registers"] or {}
        self._model = model_of(report["model"])
        self._link: str = report["link"]
        self._exchange_s = self._seconds("read.round_trip", "at_20_ms_p50_ms") or 0.0

    def likeness(self) -> Likeness:
        habits, unknown = self._habits(), []
        for name, check in self._checks.items():
            if check["verdict"] == "differs" and name not in _HAD and not name.startswith("host."):
                unknown.append(name)
        is_jaw = len(self._model.axes) == 1
        return Likeness(
            self._model,
            self._link,
            self._device_id(),
            habits,
            self._motion(),
            self._ends() if is_jaw else None,
            self._cycle(),
            self._exchange_s or None,
            spread=self._figure("axis.accuracy", "counts") != 0,
            seed=SEED if is_jaw else self._seed(),
            scissor_limit=self._scissor(),
            troubles=self._troubles(),
            unknown=tuple(unknown),
        )

    # -- figures ---------------------------------------------------------------------------------------------

    def _figure(self, check: str, name: str) -> Any:  # noqa: ANN401  # as in JSON
        return self._checks.get(check, {}).get("figures", {}).get(name)

    def _seconds(self, check: str, name: str) -> float | None:
        figure = self._figure(check, name)
        return None if figure is None else float(figure) / 1000

    def _differs(self, check: str) -> bool:
        return bool(self._checks.get(check, {}).get("verdict") == "differs")

    # -- the gripper -----------------------------------------------------------------------------------------

    def _device_id(self) -> int | None:
        several = len(self._figure("read.others", "units") or ()) > 1
        return None if several else self._registers.get("device_id")

    def _habits(self) -> Habits:
        activation, lag = self._figure("activation.time", "seconds"), self._seconds("axis.lag", "worst_ms")
        found: dict[str, Any] = {"activation_time": own_habits(self._model).activation_time}
        if activation is not None:
            found["activation_time"] = max(0.0, activation - self._late())
        if lag is not None and self._differs("axis.lag"):
            # Of a lag within an exchange only a part shows, by chance.
            found["status_lag"] = lag + (self._exchange_s / 2 if self._exchange_s > _SLOW_LINK_S else 0.0)
        if (silence := self._silence()) is not None:
            found["silence_fault"] = silence
        return Habits(
            **found,
            write_spacing=self._spacing(),
            lets_go_on_halt=self._differs("soft.halt"),
            echoes_limits=self._differs("stroke.scissor"),
        )

    def _late(self) -> float:
        """Seconds from an acknowledgement to its effect, and from a change to the read that shows it."""
        return (self._seconds("write.echo", "p50_ms") or 0.0) + (self._exchange_s + _WATCH_STEP_S) / 2

    def _cycle(self) -> float | None:
        echo = self._seconds("write.echo", "p50_ms")
        if echo:
            # Counted from its acknowledgement, an exchange after it was sent; and reads follow one another:
            # the read that shows the effect was sent half an exchange later than needed.
            return echo + self._exchange_s / 2
        counts, profile = self._figure("stop.halt", "counts"), self._motion()
        if echo is None or self._exchange_s < _SLOW_LINK_S or not counts or profile is None:
            return echo
        # An effect within an exchange shows in no echo, but in the way that a stop takes.
        took = (counts - 0.5) / profile.rates[64] - self._exchange_s
        return float(min(max(0.0, took), 0.85 * self._exchange_s))

    def _silence(self) -> float | None:
        """Seconds of silence that bring fault 0x09: between the longest without and the shortest with it."""
        shown = self._figure("read.silence", "faults") or []
        faulty = [seconds for seconds, first, _ in shown if first == Fault.COMMUNICATION_NOT_READY]
        if not faulty:
            return None
        least = min(faulty)
        return float(least + max((seconds for seconds, *_ in shown if seconds < least), default=0.0)) / 2

    def _spacing(self) -> float:
        # The second write is not sent before the first is acknowledged: no gap is shorter than an exchange.
        least = 1000 * self._exchange_s
        gaps = self._figure("write.spacing", "gap_pairs_acted") or []
        lost = [max(gap, least) for gap, counted, acted in gaps if acted < counted]
        if not lost:
            return 0.0
        longest = max(lost)
        kept = [max(gap, least) for gap, counted, acted in gaps if acted == counted]
        shortest = min((gap for gap in kept if gap > longest), default=2 * longest)
        return float(longest + shortest) / 2000

    def _ends(self) -> tuple[int, int] | None:
        opened, closed = self._figure("stroke.readings", "open"), self._figure("stroke.readings", "closed")
        return (min(opened), min(closed)) if opened and closed else None

    def _seed(self) -> int:
        """The number of a 3-Finger with these readings."""
        opened, closed = self._figure("stroke.readings", "open"), self._figure("stroke.readings", "closed")
        if not opened or not closed:
            return SEED
        stroke = self._model.stroke
        for seed in range(SEED, SEED + _MOST_SEEDS):
            fingers = [Spread(seed, axis) for axis in self._model.axes if axis in Finger.ABC]
            if sorted({stroke.open_reading + each.open_reading for each in fingers}) == opened and (
                sorted({stroke.closed_reading + each.closed_reading for each in fingers}) == closed
            ):
                return seed
        return SEED

    def _scissor(self) -> tuple[int, int] | None:
        readings = self._figure("stroke.scissor", "readings")
        if not readings:
            return None
        low, high = readings
        return (low, high) if self._model.stroke.open_reading <= low <= high <= SCISSOR_HIGH else None

    def _motion(self) -> MotionProfile | None:
        times = {speed: self._figure("stroke.time", f"speed_{speed}_s") for speed in _SPEEDS}
        if None in times.values():
            return None
        usual, late = usual_motion(self._model), self._late()
        closings = {speed: took - late for speed, took in times.items()}
        if usual.is_straight:
            counts = self._model.stroke.counts
            factors = [(speed, counts / took / usual.rates[speed]) for speed, took in closings.items()]
            rates = tuple(rate * _between(factors, speed) for speed, rate in enumerate(usual.rates))
            return replace(usual, source="a report of verify", runs=1, rates=rates)
        return self._of_a_jaw(usual, closings, late)

    def _of_a_jaw(self, usual: MotionProfile, closings: dict[int, float], late: float) -> MotionProfile:
        """The usual profile with the rates, the start, the overrun and the give of the report."""
        low, high = self._ends() or (self._model.stroke.open_reading, self._model.stroke.closed_reading)
        pressed = usual.pressing / 2  # the last count comes in the middle of the pressing
        start, landing, counts = usual.start_closing_s, usual.landing, high - low
        slowest = (counts + pressed) / max(0.1, closings[0] - start)
        points = [(0, slowest)]
        for speed in _SPEEDS[1:]:
            way = max(0.05, closings[speed] - start - landing / slowest)
            points.append((speed, (counts - landing + pressed) / way))
        rates = tuple(_between(points, speed) for speed in range(256))
        own = replace(usual, source="a report of verify", runs=1, rates=rates)
        if None not in (openings := [self._figure("stroke.opening", f"speed_{s}_s") for s in _SPEEDS]):
            # Of an opening the last count comes half a count's time before the stop is reached.
            ways = [own.opening_s(counts - 0.5, s) - own.start_opening_s for s in _SPEEDS]
            starts = [took - late - way for took, way in zip(openings, ways, strict=True)]
            own = replace(own, start_opening_s=max(0.0, sum(starts) / len(starts)))
        slow, fast = (self._figure("soft.speed", f"speed_{speed}") for speed in (0, 255))
        if slow is not None and fast is not None:
            # Stage 7 touches the part for the second time then.
            usually = Spread(SEED, Finger.A).overrun(1, 1.0) if self._figure("axis.accuracy", "counts") else 0
            own = replace(own, overrun=float(max(0, fast - slow - usually)))
        least, greatest = self._figure("stroke.force", "least"), self._figure("stroke.force", "greatest")
        if least is not None and greatest is not None:
            own = replace(own, give=float(max(0, greatest - least)))
        return own

    # -- the link --------------------------------------------------------------------------------------------

    def _troubles(self) -> tuple[Trouble, ...]:
        troubles = []
        places = self._figure("read.others", "places")
        if places and not any(place.startswith("function 4") for place in places):
            troubles.append(Trouble("function-3-only"))
        if self._figure("read.connections", "connections") == 1 and self._link != "rtu":
            troubles.append(Trouble("one-connection-only"))
        if self._differs("write.function_23"):
            troubles.append(Trouble("no-function-23"))
        if self._differs("loss.first_motion") and self._link != "rtu":
            troubles.append(Trouble("wake-needed"))
        if (idle := self._idle()) is not None:
            troubles.append(Trouble("idle-reset", idle))
        if refused := self._figure("read.counts", "refused"):
            served = min(int(each.partition(":")[0]) for each in refused) - 1
            troubles.append(Trouble("registers", max(1, served)))
        return tuple(troubles)

    def _idle(self) -> float | None:
        """Seconds without a request after which the activation is lost."""
        for check in ("read.idle", "loss.idle"):
            if self._differs(check):
                seconds: float = self._figure(check, "seconds") or _FORGOTTEN_S
                # Shorter silences of the stages did not lose it.
                return 0.75 * seconds
        return None


def _between(points: Sequence[tuple[int, float]], speed: int) -> float:
    """The figure at a speed, on straight lines between points that cover all speeds."""
    for (left, at_left), (right, at_right) in pairwise(points):
        if speed <= right:
            return at_left + (at_right - at_left) * (speed - left) / (right - left)
    return points[-1][1]
