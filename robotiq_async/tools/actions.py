"""The actions of a person at a hand: each has a key of the monitor and a button of the page."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from ..hands import Hand
from ..runtime import now
from ..values import (
    DEFAULT_FORCE,
    DEFAULT_SPEED,
    FORCE_MAX,
    SPEED_MAX,
    WIDTH_NORMAL,
    WIDTH_PINCH,
    WIDTH_WIDE,
    Fault,
    Finger,
    Inhibit,
    Initialization,
    MoveResult,
    MoveSupersededError,
    NotStartedError,
    RobotiqStateError,
    State,
    check_byte,
)

HALTED: Final = "HALT was pressed"
"""The reason of a person's halt."""
INHIBIT_STAYS: Final = "motion is refused until a person permits it"
CANCELS_RECOVERY: Final = frozenset({"halt", "reset", "release"})
"""Actions that cancel a recovery which waits for a fault to clear."""


@dataclass(frozen=True, slots=True)
class Action:
    """An action without arguments."""

    name: str  # one word
    what: str  # a short description
    run: Callable[[Operator], Awaitable[str]]  # carries it out; returns a short description of the outcome
    moves: bool = True  # whether fingers move, or may let go
    warning: str = ""  # a consequence that may surprise; a person must confirm it first


class Operator:
    """A person who operates a hand. Knows whether this person has moved anything.

    Attributes:
        hand: the hand.
        who: the person's place, as the others hear of it: a halt from there stays, as :meth:`Hand.inhibit`.
            Empty for a program, whose halt does not.
        speed: of all axes, 0..255, as last set by this person.
        force: of all axes, 0..255, as last set by this person.
    """

    def __init__(
        self, hand: Hand, *, who: str = "", speed: int = DEFAULT_SPEED, force: int = DEFAULT_FORCE
    ) -> None:
        """Listen to the requests of the hand; nothing is written.

        Args:
            hand: started before or after.
            who: the person's name or place, for an inhibit; empty for a program.
            speed: of the hand's constructor.
            force: of the hand's constructor.

        Raises:
            TypeError: speed or force is not an int.
            ValueError: speed or force is outside 0..255.
        """
        self.hand = hand
        self.who = who
        self.speed: int = check_byte("speed", speed)
        self.force: int = check_byte("force", force)
        self._requests = hand.requests(1)
        self._asking = 0
        """Number of unfinished motions that this person has requested."""
        self._moved = False
        self._changing = asyncio.Lock()
        self._recoveries: set[asyncio.Future[str]] = set()

    @property
    def has_moved(self) -> bool:
        """Whether a motion of this person has caused a request, or may cause one right now."""
        self._listen()
        # A request is published when its acknowledgement has come, or is overdue.
        return self._moved or self._asking > 0

    async def act(self, action: Action) -> str:
        """Carry out an action; returns a short description of the outcome.

        Cancelling holds a move; a sequence that runs (activation, release, reset) continues.

        Raises:
            RobotiqError: it could not be carried out.
        """
        if action.name in CANCELS_RECOVERY:
            for recovery in self._recoveries:
                recovery.cancel()
        if not action.moves:
            return await action.run(self)
        with self._counted():
            return await (self._recover(action) if action.name == "recover" else action.run(self))

    async def _recover(self, action: Action) -> str:
        """Recover. While it waits for a fault to clear, another action cancels it."""
        work = asyncio.ensure_future(action.run(self))
        self._recoveries.add(work)
        try:
            await asyncio.wait({work})
        finally:
            work.cancel()
            self._recoveries.discard(work)
        if work.cancelled():
            raise MoveSupersededError("another action took over")
        return work.result()

    async def move(
        self, position: int, fingers: Finger, *, speed: int | None = None, force: int | None = None
    ) -> str:
        """Move axes; returns a short description of the outcome.

        Raises:
            TypeError, ValueError, RobotiqError: as :meth:`Hand.move`.
        """
        with self._counted():
            return describe(await self.hand.move(position, fingers, speed=speed, force=force))

    async def permit(self, seen: Inhibit | None) -> str:
        """Permit motion after the halt that this person saw as the question was put; returns the outcome.

        Args:
            seen: the inhibit at that time; None permits nothing.

        Raises:
            RobotiqError: as :meth:`Hand.permit`: a halt came later.
        """
        if seen is None:
            return "motion was not inhibited"
        await self.hand.permit(who=self.who, seen=seen)
        return "motion is permitted again"

    async def leave(self) -> str:
        """Stop the hand, and the fingers if this person has moved them; returns how the fingers ended.

        It takes no longer than :meth:`Hand.stop`.
        """
        has_moved, rests = self.has_moved, self.hand.state in (State.RESET, State.ATR_DONE)
        began = now()
        await self.hand.stop(halt=has_moved)
        if not has_moved:
            return "The fingers were left as they are: no command from here moved them."
        if rests or self._stands_still(began):
            return "The fingers were stopped, because a command from here moved them."
        return "A command from here moved the fingers. They may STILL MOVE: no status confirmed the stop."

    async def set_speed(self, value: int) -> str:
        """Set the speed of all axes, also while they move; returns it as text.

        Raises:
            TypeError, ValueError, RobotiqError: as :meth:`Hand.set_speed`.
        """
        await self.hand.set_speed(value)
        self.speed = check_byte("value", value)
        return str(value)

    async def set_force(self, value: int) -> str:
        """Set the force of all axes; a higher force tightens a grip. Returns it as text.

        Raises:
            TypeError, ValueError, RobotiqError: as :meth:`Hand.set_force`.
        """
        await self.hand.set_force(value)
        self.force = check_byte("value", value)
        return str(value)

    async def change_speed(self, by: int) -> str:
        """Change the speed of all axes, within 0..255; concurrent changes add up.

        Raises:
            RobotiqError: as :meth:`set_speed`.
        """
        async with self._changing:
            return await self.set_speed(max(0, min(self.speed + by, SPEED_MAX)))

    async def change_force(self, by: int) -> str:
        """Change the force of all axes, within 0..255; concurrent changes add up.

        Raises:
            RobotiqError: as :meth:`set_force`.
        """
        async with self._changing:
            return await self.set_force(max(0, min(self.force + by, FORCE_MAX)))

    @contextmanager
    def _counted(self) -> Iterator[None]:
        """Count the requests that are written during a motion as caused by it."""
        self._listen()
        self._requests = self.hand.requests(1)  # a stop ends the previous stream
        self._asking += 1
        try:
            yield
        except asyncio.CancelledError:
            self._moved = True  # its request may still be written
            raise
        finally:
            self._listen()
            self._asking -= 1

    def _listen(self) -> None:
        for _ in self._requests.drain():
            self._moved |= self._asking > 0

    def _stands_still(self, since: float) -> bool:
        """Whether a status since then has no go, activation or release bit."""
        try:
            status = self.hand.status
        except NotStartedError:
            return False
        busy = status.go_echo or status.initialization is Initialization.ACTIVATING
        return status.timestamp >= since and not busy and status.fault is not Fault.AUTOMATIC_RELEASE


def describe(result: MoveResult) -> str:
    """Describe the outcome of a move: ``A at 241, B in contact at 130, C at 241; 2.31 s``."""
    ends = []
    for axis, position in result.positions.items():
        how = " in contact" if axis in result.contacts else ""
        ends.append(f"{axis.name}{how} at {position}")
    return f"{', '.join(ends)}; {result.duration:.2f} s"


async def _open(operator: Operator) -> str:
    return describe(await operator.hand.open())


async def _close(operator: Operator) -> str:
    return describe(await operator.hand.close())


def _done(call: Callable[[Hand], Awaitable[None]], outcome: str) -> Callable[[Operator], Awaitable[str]]:
    async def run(operator: Operator) -> str:
        await call(operator.hand)
        return outcome

    return run


def _width(position: int) -> Callable[[Operator], Awaitable[str]]:
    async def run(operator: Operator) -> str:
        hand = operator.hand
        if Finger.SCISSOR not in hand.model.all_axes:
            raise RobotiqStateError(f"a {hand.model.title} has no scissor")
        return describe(await hand.move(position, Finger.SCISSOR))

    return run


async def _halt(operator: Operator) -> str:
    hand = operator.hand
    await (hand.inhibit(HALTED, who=operator.who) if operator.who else hand.halt())
    words = "every axis has stopped" + (": the gripper is reset" if hand.state is State.RESET else "")
    return f"{words}; {INHIBIT_STAYS}" if operator.who else words


async def _permit(operator: Operator) -> str:
    return await operator.permit(operator.hand.inhibited)


_IN_ORDER: Final = (
    Action("open", "open the fingers", _open),
    Action("close", "close the fingers", _close),
    Action("wide", "B and C furthest apart", _width(WIDTH_WIDE)),
    Action("normal", "B and C as usual", _width(WIDTH_NORMAL)),
    Action("pinch", "B and C together", _width(WIDTH_PINCH)),
    Action("halt", "stop every axis", _halt, moves=False),
    Action(
        "permit",
        "permit motion after a halt",
        _permit,
        moves=False,
        warning="Look at the gripper first: a program may MOVE its fingers at once.",
    ),
    Action(
        "activate",
        "activate the gripper",
        _done(lambda hand: hand.activate(), "the gripper is active"),
        warning="The fingers MOVE: they open and close to their stops.",
    ),
    Action(
        "reset",
        "reset the gripper",
        _done(lambda hand: hand.reset(), "the gripper is reset"),
        warning="The gripper lets go: the part DROPS.",
    ),
    Action(
        "release",
        "release in a fault",
        _done(lambda hand: hand.atr(), "released; only a reset helps now"),
        warning="All fingers OPEN slowly, in any fault: the part DROPS.",
    ),
    Action(
        "recover",
        "recover from the fault",
        _done(lambda hand: hand.recover(), "the gripper is active"),
        warning="A major fault needs a reset and an activation: the part DROPS, the fingers MOVE.",
    ),
)
ACTIONS: Final = MappingProxyType({action.name: action for action in _IN_ORDER})
"""The actions by name."""
