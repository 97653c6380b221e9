"""The surroundings of a stage: the gripper, the person, and the results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

from ...hands import POLL_INTERVAL_S, RESPONSE_TIMEOUT_S
from ...link import Address, Link, ModbusTransport, UrcapTransport
from ...values import Finger, Model, RegisterMap, RobotiqStatus, model_of
from .catalogue import CATALOGUE, NO_OPTIONS, Check, CheckVerdict, EndError, Figure, Options
from .recorded_link import RecordedExchange, RecordedLink
from .watch import Person, StageWatch

BENCH_CONNECT_S: Final = 2.0  # for a connection; short, so that a stop over a lost link is soon tried again
SPACING_S: Final = 0.02  # twice the time between two writes in the manual


@dataclass(frozen=True, slots=True)
class Lengths:
    """Durations of the long checks; a rehearsal has shorter ones."""

    reads: int = 300  # round trips at each of three rates
    idle: tuple[float, ...] = (0.5, 1.0, 1.5, 2.0, 5.0, 30.0, 60.0)  # seconds of silence in stage 1
    alone: tuple[float, ...] = (10.0, 60.0, 300.0)  # seconds without a client in stage 8
    soak: float = 600.0  # seconds of reading in stage 9
    commands: float = 5.0  # seconds of commands at each rate in stage 9
    interval: float | None = None  # seconds between two reads in a watch; None: as usual


@dataclass
class Bench:
    """The gripper under test and its surroundings."""

    address: Address  # of the gripper; any but sim
    person: Person  # beside it
    keep: Callable[[RecordedExchange], None]  # takes every frame
    lengths: Lengths = field(default_factory=Lengths)  # of the long checks
    checks: dict[str, Check] = field(default_factory=dict)  # the results so far, by name
    link: RecordedLink = field(init=False)  # to the gripper, once it has been found
    is_found: bool = False  # whether there is a link to it
    registers: RegisterMap | None = None  # of the gripper, once it has been found; None for a URCap's
    found: RobotiqStatus | None = None  # the first status
    spacing: float = SPACING_S  # seconds from one write to the next; stage 2 may raise it
    is_active: bool = False  # whether it was active at the end of the last stage

    @property
    def model(self) -> Model:
        return model_of(self.address.model)

    @property
    def fingers(self) -> tuple[Finger, ...]:
        return tuple(axis for axis in self.model.axes if axis in Finger.ABC)

    @property
    def first(self) -> str:
        """The name, for messages, of the moving part in stages that move one finger."""
        return "finger A" if len(self.fingers) > 1 else "the jaw"

    def another_link(
        self, registers: RegisterMap | None = None, keep: Callable[[RecordedExchange], None] | None = None
    ) -> RecordedLink:
        """Another link, not opened.

        ``registers`` are the gripper's unless given. Its frames are kept with the others unless
        ``keep`` is given.
        """
        there = registers or self.registers
        make: Callable[..., Link] = partial(UrcapTransport, self.address)
        if there is not None:  # function 23 is examined
            sure = replace(there, write_function=23, is_sure=True)
            make = partial(ModbusTransport, self.address, sure)
        link = make(connect_timeout=BENCH_CONNECT_S, response_timeout=RESPONSE_TIMEOUT_S)
        return RecordedLink(link, keep or self.keep, self.model)

    @property
    def interval(self) -> float:
        """Seconds between two reads in a watch."""
        return self.lengths.interval or POLL_INTERVAL_S

    def watch(self, seconds: float, *, allows_faults: bool = False) -> StageWatch:
        return StageWatch(
            self.link,
            self.person,
            seconds=seconds,
            interval=self.interval,
            spacing=self.spacing,
            allows_faults=allows_faults,
        )

    # -- findings --------------------------------------------------------------------------------------------

    def found_at(self, registers: RegisterMap | None) -> None:
        """Note where the gripper answers, and make the link to it; None for a URCap's."""
        self.registers = registers
        self.link, self.is_found = self.another_link(), True

    def first_seen(self, status: RobotiqStatus) -> None:
        """Note the first status."""
        self.found = status

    def leave_between_writes(self, seconds: float) -> None:
        """Leave more time from one write to the next."""
        self.spacing = max(self.spacing, seconds)

    def note_active(self, is_active: bool) -> None:
        """Note whether the gripper is active at the end of a stage."""
        self.is_active = is_active

    # -- results ---------------------------------------------------------------------------------------------

    def judge(
        self,
        name: str,
        holds: bool,
        found: str,
        follows: str,
        options: Options = NO_OPTIONS,
        /,
        **figures: Figure,
    ) -> None:
        """Add the result of a check: as assumed if it holds, else with the consequence for the user.

        Raises:
            EndError: it does not hold, and is about safety.
        """
        if holds:
            self._add(Check(name, CheckVerdict.AS_ASSUMED, found, figures=figures))
            return
        self._add(Check(name, CheckVerdict.DIFFERS, found, follows, options, figures))
        if CATALOGUE[name].is_safety:
            raise EndError("deviation", f"{name}: {found}")

    def as_assumed(self, name: str, found: str, **figures: Figure) -> None:
        self.judge(name, True, found, "", **figures)

    def differs(
        self, name: str, found: str, follows: str, options: Options = NO_OPTIONS, /, **figures: Figure
    ) -> None:
        self.judge(name, False, found, follows, options, **figures)

    def inconclusive(self, name: str, why: str, **figures: Figure) -> None:
        self._add(Check(name, CheckVerdict.INCONCLUSIVE, why, figures=figures))

    def _add(self, check: Check) -> None:
        assert check.name in CATALOGUE
        self.checks[check.name] = check
