"""Parts for a program that runs as a service around hands: signals, health, systemd's watchdog.

::

    hand = RobotiqHand("tcp://192.168.1.11")

    async def main():
        async with stops_on_signals(hand), watched_by_systemd(hand):
            await hand.start(wait=86400)  # FINGERS MOVE
            await work()

A signal stops the hands first, and only then ends the program. Else the fingers would move on while a
framework waits for its clients, or a task takes its time.
"""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass
from types import FrameType
from typing import Any, Final

import anyio

from ..hands import Hand
from ..runtime import INSIST_S, check_main_thread, ending_signals, log, now, pass_on
from ..sync import RobotiqHand as BlockingHand
from ..values import RUNNING, Fault, Finger, Inhibit, NotStartedError, RobotiqStatus, State, names_of

HEALTH_S: Final = 1.0
"""A status that is older proves nothing about the gripper: two hundred polls have brought none."""


@dataclass(frozen=True, slots=True)
class Health:
    """One hand at one moment.

    Attributes:
        name: of the hand, or its address.
        state: of the hand.
        status_age: seconds since the newest status was read; None before the first.
        fault: the gripper's fault in the newest status.
        holds: the fingers that hold a part by the newest status, as its ``part`` says.
        problem: the reason why the hand takes no motion commands now, in a sentence; empty if it does.
        inhibited: the reason of a person for which it refuses motion, or None.
    """

    name: str
    state: State
    status_age: float | None
    fault: Fault
    holds: Finger
    problem: str
    inhibited: Inhibit | None = None

    @property
    def is_ready(self) -> bool:
        """Whether the hand takes motion commands."""
        return not self.problem

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON; enumerations and masks as in a status."""
        return {
            "name": self.name,
            "is_ready": self.is_ready,
            "problem": self.problem,
            "state": self.state.name,
            "status_age": self.status_age,
            "fault": self.fault.name,
            "fault_code": int(self.fault),
            "severity": self.fault.severity.name,
            "description": self.fault.description,
            "holds": names_of(self.holds),
            "inhibited": None if self.inhibited is None else self.inhibited.as_dict(),
        }


def health(hand: Hand | BlockingHand) -> Health:
    """The health of a hand, at once, in any state and any thread: nothing is sent to the gripper."""
    try:
        status = hand.status
    except NotStartedError:
        status = None
    age = None if status is None else max(0.0, _now() - status.timestamp)
    part = None if status is None else status.part
    return Health(
        hand.name or hand.address,
        hand.state,
        age,
        Fault.NONE if status is None else status.fault,
        Finger(0) if part is None else part.holds,
        "; ".join(filter(None, (_problem(hand.state, age, status), str(hand.inhibited or "")))),
        hand.inhibited,
    )


def _now() -> float:
    try:
        return now()
    except RuntimeError:  # a thread without an event loop: of a web server, or beside a blocking hand
        return time.monotonic()


def _problem(state: State, age: float | None, status: RobotiqStatus | None) -> str:
    if state is State.SHUTDOWN:
        return "the hand is not started"
    if status is None or age is None:
        return "no status has been read yet"
    if state is State.DISCONNECTED or age > HEALTH_S:
        return f"the link is down: no status for {age:.1f} s"
    if status.controller_fault:
        return status.controller_fault_text
    if status.fault.is_serious:
        return f"fault 0x{int(status.fault):02X}: {status.fault.description}"
    if state in RUNNING:
        return ""
    # In an emergency stop a gripper waits for its activation, and shows why as a fault that ends nothing.
    fault = status.fault
    why = "" if fault is Fault.NONE else f", fault 0x{int(fault):02X}: {fault.description}"
    return f"the hand is in {state.name}{why}"


class Signals:
    """The signals that have come.

    Attributes:
        received: the number of the first signal; 0 if none came.
    """

    def __init__(self) -> None:
        self.received: int = 0

    def note(self, number: int) -> None:
        """A signal has come."""
        self.received = self.received or number


@asynccontextmanager
async def stops_on_signals(*hands: Hand, forward: bool = False) -> AsyncIterator[Signals]:
    """Stop hands on SIGINT, SIGTERM, SIGHUP and Windows' SIGBREAK, and then leave the block.

    All stops begin at once, in the next turn of the event loop. When they have ended, the
    block is cancelled, and the program continues after it. The NotStartedError of a call that a stop has
    ended does not leave the block, neither alone nor in the exception group of tasks. Further signals are
    ignored for 3 s after the first, and for 3 s after the stops have begun, where something has held up the
    event loop; later ones act as before the block. An ignored signal stays ignored. SIGKILL stops nothing,
    and neither does closing a console on Windows. For blocking hands there is
    :func:`robotiq_async.sync.stops_on_signals`.

    Args:
        hands: to stop; one that does not run is left alone.
        forward: for servers that end themselves in order: pass the signal on to the handler that was there
            before the block, instead of cancelling.

    Raises:
        TypeError: a hand is a blocking one, or none.
        RuntimeError: not in the main thread.
    """
    for each in hands:
        if not isinstance(each, Hand):
            raise TypeError(f"hands must be hands for asyncio, got {each!r}")
    check_main_thread()
    stops = _SignalStops(hands, forward=forward)
    with stops.handling():
        try:
            with stops.scope:
                yield stops.signals
        except (NotStartedError, BaseExceptionGroup) as error:
            if not stops.signals.received:
                raise
            if (others := _without_stopped(error)) is not None:
                raise others from None
        finally:
            await stops.ended()


class _SignalStops:
    """Stops hands at the first signal, and then leaves ``scope``, or passes the signal on."""

    def __init__(self, hands: Sequence[Hand], *, forward: bool) -> None:
        self.signals = Signals()
        self.scope = anyio.CancelScope()
        self._hands = hands
        self._forward = forward
        self._loop = asyncio.get_running_loop()
        self._stopping: list[asyncio.Task[None]] = []
        self._insist_at = 0.0
        """The time from which a further signal acts."""
        self._previous: dict[int, Any] = {}

    @contextmanager
    def handling(self) -> Iterator[None]:
        """Handle signals, and leave the handlers as they were."""
        self._previous = {number: signal.getsignal(number) for number in ending_signals()}
        try:
            for number in self._previous:
                signal.signal(number, self._handle)
            yield
        finally:
            for number, handler in self._previous.items():
                signal.signal(number, handler)

    async def ended(self) -> None:
        """Wait for the end of the stops, also when cancelled."""
        if self._stopping:
            with anyio.CancelScope(shield=True):
                await asyncio.wait(self._stopping)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if not self.signals.received:
            self.signals.note(number)
            self._insist_at = time.monotonic() + INSIST_S
            # A signal interrupts the loop anywhere: a stop has to begin in another turn.
            with suppress(RuntimeError):  # the loop was closed
                self._loop.call_soon_threadsafe(self._begin, number)
        elif time.monotonic() > self._insist_at:
            pass_on(self._previous[number], number, frame)

    def _begin(self, number: int) -> None:
        self._insist_at = time.monotonic() + INSIST_S
        self._stopping.append(self._loop.create_task(self._stop(number)))

    async def _stop(self, number: int) -> None:
        stops = (each.stop() for each in self._hands)
        for stopped in await asyncio.gather(*stops, return_exceptions=True):
            if isinstance(stopped, BaseException):
                log.error("a hand could not be stopped: %r", stopped)
        before = self._previous[number]
        if self._forward and callable(before):
            before(number, None)
        else:
            self.scope.cancel()


def _without_stopped(error: NotStartedError | BaseExceptionGroup[BaseException]) -> BaseException | None:
    """The errors that a stop does not explain, or None. Each task of a group has its own errors."""
    return error.split(NotStartedError)[1] if isinstance(error, BaseExceptionGroup) else None


@asynccontextmanager
async def watched_by_systemd(*hands: Hand) -> AsyncIterator[None]:
    """Notify systemd of readiness, life and health of the service; without systemd, do nothing.

    For a unit with ``Type=notify``. With ``WatchdogSec=`` the event loop notifies it twice in that time. When
    the loop hangs, or a hand has ended by itself, it gets no more notifications, and restarts the service. It
    does not restart it for a gripper that is off or in fault: ``systemctl status`` shows that.
    """
    tell = _Systemd()
    if not tell.is_there:
        yield
        return
    started: set[Hand] = set()

    def lives() -> bool:
        started.update(each for each in hands if each.state is not State.SHUTDOWN)
        return not any(each.state is State.SHUTDOWN for each in started)

    async def report() -> None:
        while True:
            words = ", ".join(
                f"{each.name}: {each.problem or each.state.name}" for each in map(health, hands)
            )
            tell(f"STATUS={words}", *(["WATCHDOG=1"] if lives() else []))
            await asyncio.sleep(tell.interval)

    tell("READY=1")
    reporting = asyncio.create_task(report(), name="robotiq_async systemd")
    try:
        yield
    finally:
        tell("STOPPING=1")
        reporting.cancel()
        await asyncio.wait([reporting])


class _Systemd:
    """The notification socket of the service manager (sd_notify(3)): datagrams of lines, and no answer."""

    def __init__(self) -> None:
        path = os.environ.get("NOTIFY_SOCKET", "")
        self._address = "\0" + path[1:] if path.startswith("@") else path
        microseconds = os.environ.get("WATCHDOG_USEC", "")
        self.interval = int(microseconds) / 2e6 if microseconds.isdecimal() and int(microseconds) else 5.0
        self.is_there = bool(path) and hasattr(socket, "AF_UNIX")

    def __call__(self, *lines: str) -> None:
        with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.setblocking(False)
            sender.sendto("\n".join(lines).encode(), self._address)
