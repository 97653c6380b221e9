"""Watches over a stage that moves: the person, the fingers' range, the time, faults and other clients.

Every look can end the stage by an exception; the runner then stops the fingers.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from typing import Final, Protocol

from ...values import Fault, Finger, Model, Request, RobotiqStatus
from .catalogue import EndError
from .recorded_link import RecordedLink

ENTER: Final = "\n"


class Person(Protocol):
    """The operator at the terminal: answers, watches, and stops."""

    @property
    def has_stopped(self) -> bool:
        """Whether a key was pressed since the last answer, or the terminal has closed."""

    def tell(self, words: str) -> None:
        """Print something; never while fingers move, because a terminal may block."""

    def alarm(self, words: str) -> None:
        """Warn at once, even while fingers move; never blocks."""

    async def consents(self, words: str) -> bool:
        """Ask; only Enter agrees. Keys pressed before the question do not count."""

    async def chooses(self, question: str, answers: Mapping[str, str]) -> str | None:
        """Ask for one of the keys of ``answers``, which has their meanings; None ends the run."""


Envelope = Mapping[Finger, tuple[int, int]]  # the lowest and the highest position that each axis may have

ANYWHERE: Final[Envelope] = dict.fromkeys(Finger.ALL, (0, 255))
LASTING: Final = 3
"""Reads in a row that make 0x09 a fault: siblings report it once after a second of silence."""
WATCH_SLICE_S: Final = 0.05  # seconds between two checks of the person while nothing is sent
STILL_S: Final = 0.15
"""An axis rests once it has not moved for this long: the slowest takes 43 ms for a count (thesis, A1.1)."""
LIMITS: Final = 20, 225
"""A request beyond may be echoed as a software limit (drivers keep the scissor within 15..232)."""


class AxesAtRest:
    """Follows some axes, all unless they are named.

    Attributes:
        positions: the last ones.
        moved_at: the loop's time of the last change of a position.
    """

    def __init__(self, axes: Sequence[Finger] = ()) -> None:
        self._loop = asyncio.get_running_loop()
        self._axes = axes
        self.positions: list[int] = []
        self.moved_at: float = self._loop.time()

    def lasts(self, status: RobotiqStatus, seconds: float) -> bool:
        """Take in a status; returns whether no axis has moved for some seconds."""
        positions = [status.position(axis) for axis in self._axes or status.model.axes]
        if positions != self.positions:
            self.positions, self.moved_at = positions, self._loop.time()
        return self._loop.time() - self.moved_at >= seconds


class StageWatch:
    """Reads and writes for one stage, and ends it when something is wrong."""

    def __init__(
        self,
        link: RecordedLink,
        person: Person,
        *,
        seconds: float,
        interval: float,
        spacing: float,
        allows_faults: bool = False,
    ) -> None:
        """Begin. The times are the seconds of the whole stage, between two reads, and between two writes.

        ``allows_faults``: whether the stage expects faults.
        """
        self._envelope = ANYWHERE
        self._needs_active = True
        self._allows_faults = allows_faults
        self.last: RobotiqStatus | None = None  # the newest status
        self.model: Model = link.model  # of the gripper
        self._link = link
        self._person = person
        self._interval = interval
        self._spacing = spacing
        self._seconds = seconds
        self._loop = asyncio.get_running_loop()
        self._until = self._loop.time() + seconds
        self._not_ready = 0

    def confine(self, envelope: Envelope) -> None:
        """End the stage if an axis leaves its range; a stage says so before each motion."""
        self._envelope = envelope

    def need_active(self, needs: bool) -> None:
        """End the stage if the gripper is not active; from the beginning it must be."""
        self._needs_active = needs

    async def look(self) -> RobotiqStatus:
        """Read a status, and end the stage if anything is wrong."""
        self.check_stop()
        status = self.last = await self._link.read()
        self.check_stop()
        self._check(status)
        return status

    async def write(self, request: Request, *, spaced: bool = True) -> float:
        """Write an image unless the person has stopped; returns the time of its acknowledgement."""
        self.check_stop()
        due = self._link.wrote + self._spacing if spaced else 0.0
        if (left := due - self._loop.time()) > 0:
            await self.pause(left)
        return await self._link.write(request)

    async def write_and_read(self, request: Request) -> bool:
        """Write an image with function 23, if the device takes it; return whether that was answered."""
        self.check_stop()
        await self.pause(max(0.0, self._link.wrote + self._spacing - self._loop.time()))
        return await self._link.write_and_read(request)

    async def until(
        self, is_so: Callable[[RobotiqStatus], bool], seconds: float, interval: float | None = None
    ) -> RobotiqStatus | None:
        """Read until a status fulfils a condition; None if none does within some seconds."""
        end = self._loop.time() + seconds
        while True:
            began = self._loop.time()
            status = await self.look()
            if is_so(status):
                return status
            if self._loop.time() >= end:
                return None
            await asyncio.sleep(max(0.0, began + (interval or self._interval) - self._loop.time()))

    async def watch_for(self, seconds: float) -> RobotiqStatus:
        """Read for some seconds; returns the last status."""
        await self.until(lambda _: False, seconds)
        assert self.last is not None
        return self.last

    async def until_still(self, seconds: float) -> RobotiqStatus | None:
        """Read until no axis has moved for a while; None if one still moves after some seconds."""
        rest = AxesAtRest()
        return await self.until(lambda status: rest.lasts(status, STILL_S), seconds)

    async def pause(self, seconds: float) -> None:
        """Send nothing for some seconds; the person can still stop the stage."""
        end = self._loop.time() + seconds
        while (left := end - self._loop.time()) > 0:
            self.check_stop()
            await asyncio.sleep(min(WATCH_SLICE_S, left))
        self.check_stop()

    def check_stop(self) -> None:
        """End the stage if the person has stopped it, or its time is over."""
        if self._person.has_stopped:
            raise EndError("stopped", "a key was pressed, or the terminal was closed")
        if self._loop.time() > self._until:
            raise EndError("time", f"the stage did not finish within {self._seconds:g} s")

    # -- checks of a status ----------------------------------------------------------------------------------

    def _check(self, status: RobotiqStatus) -> None:
        if not self._allows_faults:
            self._check_fault(status)
        if self._needs_active and not status.is_activated:
            raise EndError("inactive", f"the gripper is no longer active: it is {describe(status)}")
        for axis in self.model.axes:
            low, high = self._envelope.get(axis, (0, 255))
            if not low <= status.position(axis) <= high:
                where = f"{axis.name} is at {status.position(axis)}, outside {low}..{high}"
                raise EndError("envelope", where)
        self._check_echo(status)

    def _check_fault(self, status: RobotiqStatus) -> None:
        fault = status.fault
        self._not_ready = self._not_ready + 1 if fault is Fault.COMMUNICATION_NOT_READY else 0
        passes = fault is Fault.COMMUNICATION_NOT_READY and self._not_ready < LASTING
        if fault.is_serious and not passes:
            raise EndError("fault", f"0x{int(fault):02X} {fault.name}: {fault.description}")

    def _check_echo(self, status: RobotiqStatus) -> None:
        expected = self._link.expected()
        # No source settles whether a gripper that is not active echoes positions.
        size = len(status.echo) if status.is_activated else 2
        if expected and not any(_may_echo(each[:size], status.echo[:size]) for each in expected):
            found = (
                f"rACT, rGTO and positions {show_echo(status.echo)}; written was {show_echo(expected[-1])}"
            )
            why = "another client commands the gripper, or the gripper forgot a write"
            raise EndError("foreign", f"{why}: it echoes {found}")


def _may_echo(request: tuple[int, ...], shown: tuple[int, ...]) -> bool:
    """Whether an echo repeats a request; one beyond a limit may be echoed as the limit."""
    return request[:2] == shown[:2] and all(
        wanted == got or wanted <= got <= LIMITS[0] or LIMITS[1] <= got <= wanted
        for wanted, got in zip(request[2:], shown[2:], strict=True)
    )


def show_echo(echo: tuple[int, ...]) -> str:
    return ", ".join(str(int(each)) for each in echo)


def describe(status: RobotiqStatus) -> str:
    """A status as text."""
    if status.is_activated:
        words = "active"
    else:
        words = "activating or changing its mode" if status.activation_echo else "not active"
    go = "rGTO is set" if status.go_echo else "rGTO is clear"
    where = ", ".join(f"{axis.name} {status.position(axis)}" for axis in status.model.axes)
    fault = "" if status.fault is Fault.NONE else f", fault 0x{int(status.fault):02X}"
    return f"{words}{fault}, {go}, positions {where}"
