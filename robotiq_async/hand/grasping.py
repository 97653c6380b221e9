"""Grasping: closing around something, and hearing what becomes of the grip. For any hand."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Iterator
from typing import Final, Self

from ..enums import Finger
from ..errors import NotStartedError
from ..grasping import SLIP_COUNTS, GraspResult, GripEvent, GripWatch
from ..protocol import Hand, HandStream
from ..wire.checks import check_int, check_mask
from ..wire.status import RobotiqStatus

_KEPT: Final = 1000
"""Statuses that wait for a reader of events: most tell nothing, and it goes through them in no time."""


class GripEvents:
    """An async iterator over what becomes of grips; made by ``hand.grip_events()``, for one reader.

    It is a stream of statuses that keeps to itself those that tell nothing, and begins and ends as that does.
    """

    def __init__(self, statuses: HandStream[RobotiqStatus], watch: GripWatch) -> None:
        """Make events of statuses."""
        self._statuses = statuses
        self._watch = watch
        self._events: deque[GripEvent] = deque()

    @property
    def holds(self) -> Finger:
        """The watched axes that are in contact after the newest event."""
        return self._watch.holds

    @property
    def missed(self) -> int:
        """Statuses that were not looked at because the reader was slow."""
        return self._statuses.missed

    def __aiter__(self) -> Self:
        """The stream itself."""
        return self

    async def __anext__(self) -> GripEvent:
        """The next event. A cancelled wait loses nothing.

        Raises:
            StopAsyncIteration: the hand was stopped, or the stream was closed.
            RobotiqConnectionError: the hand gave up on its link.
            RuntimeError: another task is waiting on the same stream, or the hand runs in another event loop.
        """
        while not self._events:
            self._events.extend(self._watch.see(await anext(self._statuses)))
        return self._events.popleft()

    def take_nowait(self) -> GripEvent | None:
        """The next event if there is one already."""
        while not self._events and (status := self._statuses.take_nowait()) is not None:
            self._events.extend(self._watch.see(status))
        return self._events.popleft() if self._events else None

    def drain(self) -> Iterator[GripEvent]:
        """What is there already, one after the other."""
        while (event := self.take_nowait()) is not None:
            yield event

    async def aclose(self) -> None:
        """End the stream; a waiting reader ends too. Idempotent."""
        self._events.clear()
        await self._statuses.aclose()


class Grasping:
    """A hand that closes around something. Asks no more of it than any hand can do."""

    async def grasp(
        self: Hand,
        fingers: Finger | int = Finger.ABC,
        *,
        at_least: int | None = None,
        speed: int | None = None,
        force: int | None = None,
        timeout: float | None = None,
    ) -> GraspResult:
        """Close fingers until each of them has met something or is closed, and say which of them hold it.

        Too few contacts are a result and not an error: the result is false, and the fingers stay as they are.
        Cancelled or timed out, those that still move are held; a finger in contact keeps its grip.

        What holds is what the gripper calls a contact while closing. A thin object between fingertips may
        never be called one; and a contact latches: a finger that stood in one before still counts, also when
        the part has been taken out meanwhile. Open first, or ask for more force.

        Args:
            fingers: mask of the axes that close; the others stay as they are.
            at_least: contacts that make a grasp, 1..as many as there are axes; None for all of them.
            speed: new speed of these axes, 0..255; None leaves it.
            force: new force of these axes, 0..255; None leaves it.
            timeout: seconds; None for twice the expected time plus 2 s.

        Returns:
            Who holds it, and how each axis ended.

        Raises:
            TypeError: an argument of the wrong type; nothing is sent.
            ValueError: an argument outside its range; nothing is sent.
            MoveTimeoutError: an axis still moved when the time was over.
            MoveSupersededError: another command, halt(), reset() or another client took over an axis.
            GripperFaultError: the gripper reports a minor or a major fault.
            RobotiqError: as :meth:`move`.
        """
        axes = check_mask(fingers)
        every = axes.bit_count()
        wanted = every if at_least is None else check_int("at_least", at_least, 1, every)
        return GraspResult(await self.close(axes, speed=speed, force=force, timeout=timeout), wanted)

    def grip_events(
        self: Hand,
        fingers: Finger | int = Finger.ABC,
        *,
        since: RobotiqStatus | None = None,
        slip: int = SLIP_COUNTS,
    ) -> GripEvents:
        """What becomes of the grips from now on: contacts gained and lost, parts that slip.

        For one reader. It waits out a lost link, tells nothing meanwhile, and when the link is back what has
        become of the grips; it ends after :meth:`stop`. Up to 1000 statuses wait for a slow reader, which is
        5 s of them; of what happened in those that were missed, it learns what is left of it.

        It tells what the gripper reports. A contact latches: a part that is pulled out is noticed when its
        finger closes on, which it does when more force is asked for, and by the manual not before.

        Args:
            fingers: mask of the axes that are watched.
            since: the status to begin with, ``result.status`` of a grasp or a move: what changes between that
                and the first status that is read is told, too. None for the newest one.
            slip: counts that an axis in contact may move without being told, 1..255.

        Raises:
            TypeError: an argument of the wrong type.
            ValueError: an argument outside its range.
        """
        watch = GripWatch(fingers, slip=slip)
        if since is not None and not isinstance(since, RobotiqStatus):
            raise TypeError(f"since must be None or a RobotiqStatus, got {since!r}")
        with contextlib.suppress(NotStartedError):  # then the first status is where it begins
            watch.see(self.status if since is None else since)
        return GripEvents(self.statuses(_KEPT), watch)
