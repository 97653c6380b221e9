"""What a person asks of a hand through a program: a key of the monitor, a button of a viewer."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from .control.motion import MoveResult
from .enums import (
    AXES,
    DEFAULT_FORCE,
    DEFAULT_SPEED,
    FORCE_MAX,
    SPEED_MAX,
    WIDTH_NORMAL,
    WIDTH_PINCH,
    WIDTH_WIDE,
    Fault,
    Finger,
    Initialization,
    State,
)
from .errors import MoveSupersededError, NotStartedError
from .protocol import Hand
from .session.clock import now

ENDING: Final = frozenset({"halt", "reset", "release"})
"""Whoever asks for one of these wants no recovery to go on by itself."""


@dataclass(frozen=True, slots=True)
class Action:
    """One thing to ask for, without arguments.

    Attributes:
        name: one word.
        what: it in a few words.
        run: does it; gives how it ended, in words.
        moves: whether fingers move, or may let go.
        warning: what happens that nobody may expect; a person is asked first. Empty: nothing.
    """

    name: str
    what: str
    run: Callable[[Hand], Awaitable[str]]
    moves: bool = True
    warning: str = ""


class Operator:
    """A person at a hand, and whether this person has moved anything.

    Attributes:
        hand: the hand.
        speed: what the axes get, 0..255.
        force: what the axes get, 0..255.
    """

    def __init__(self, hand: Hand, *, speed: int = DEFAULT_SPEED, force: int = DEFAULT_FORCE) -> None:
        """Listen to what is written; asks for nothing.

        Args:
            hand: started before or after.
            speed: what the hand was made with.
            force: what the hand was made with.
        """
        self.hand = hand
        self.speed = speed
        self.force = force
        self._requests = hand.requests(1)
        self._asking = 0
        """Motions asked for that have not ended."""
        self._moved = False
        self._changing = asyncio.Lock()
        self._recoveries: set[asyncio.Future[str]] = set()

    @property
    def has_moved(self) -> bool:
        """Whether anything was written while something that moves was asked for, or may be right now."""
        self._listen()
        # A request that is on its way is told of only when its fate is known.
        return self._moved or self._asking > 0

    async def act(self, action: Action) -> str:
        """Carry out an action; gives how it ended, in words.

        When cancelled, a move is held; a sequence that has begun (activation, release, reset) goes on.

        Raises:
            RobotiqError: it could not be carried out.
        """
        if action.name in ENDING:
            for recovery in self._recoveries:
                recovery.cancel()
        if not action.moves:
            return await action.run(self.hand)
        with self._counted():
            return await (self._recover(action) if action.name == "recover" else action.run(self.hand))

    async def _recover(self, action: Action) -> str:
        """It waits for faults and goes on by itself: nobody who has halted since may be surprised by that."""
        work = asyncio.ensure_future(action.run(self.hand))
        self._recoveries.add(work)
        try:
            await asyncio.wait({work})
        finally:
            work.cancel()
            self._recoveries.discard(work)
        if work.cancelled():
            raise MoveSupersededError("something else was asked for meanwhile")
        return work.result()

    async def move(
        self, position: int, fingers: Finger, *, speed: int | None = None, force: int | None = None
    ) -> str:
        """Move axes; gives how it ended, in words.

        Raises:
            TypeError, ValueError, RobotiqError: as :meth:`Hand.move`.
        """
        with self._counted():
            return in_words(await self.hand.move(position, fingers, speed=speed, force=force))

    async def leave(self) -> str:
        """Stop the hand, and the fingers only if this person has moved them; tells what became of them.

        Ends as :meth:`Hand.stop` does.
        """
        has_moved, rests = self.has_moved, self.hand.state in (State.RESET, State.ATR_DONE)
        began = now()
        await self.hand.stop(halt=has_moved)
        if not has_moved:
            return "The fingers were left as they are: nothing here has moved them."
        if rests or self._stands_still(began):
            return "The fingers were stopped: they had been moved from here."
        return "The fingers had been moved from here and may STILL MOVE: the gripper was not seen to stop."

    async def set_speed(self, value: int) -> str:
        """Set the speed of all axes, also of a motion under way; gives it in words.

        Raises:
            TypeError, ValueError, RobotiqError: as :meth:`Hand.set_speed`.
        """
        await self.hand.set_speed(value)
        self.speed = value
        return str(value)

    async def set_force(self, value: int) -> str:
        """Set the force of all axes; more tightens a grip. Gives it in words.

        Raises:
            TypeError, ValueError, RobotiqError: as :meth:`Hand.set_force`.
        """
        await self.hand.set_force(value)
        self.force = value
        return str(value)

    async def change_speed(self, by: int) -> str:
        """Set the speed of all axes so much higher, or as high as it can be; one change after the other.

        Raises:
            RobotiqError: as :meth:`set_speed`.
        """
        async with self._changing:
            return await self.set_speed(max(0, min(self.speed + by, SPEED_MAX)))

    async def change_force(self, by: int) -> str:
        """Set the force of all axes so much higher, or as high as it can be; one change after the other.

        Raises:
            RobotiqError: as :meth:`set_force`.
        """
        async with self._changing:
            return await self.set_force(max(0, min(self.force + by, FORCE_MAX)))

    @contextmanager
    def _counted(self) -> Iterator[None]:
        """Around something that moves: what is written meanwhile is its doing."""
        self._listen()
        self._requests = self.hand.requests(1)  # the one before ends when the hand is stopped
        self._asking += 1
        try:
            yield
        except asyncio.CancelledError:
            self._moved = True  # what it has begun may be written yet
            raise
        finally:
            self._listen()
            self._asking -= 1

    def _listen(self) -> None:
        for _ in self._requests.drain():
            self._moved |= self._asking > 0

    def _stands_still(self, since: float) -> bool:
        """Whether the gripper has shown since then that nothing moves it: no go, activation or release."""
        try:
            status = self.hand.status
        except NotStartedError:
            return False
        busy = status.go_echo or status.initialization is Initialization.ACTIVATING
        return status.timestamp >= since and not busy and status.fault is not Fault.AUTOMATIC_RELEASE


def in_words(result: MoveResult) -> str:
    """How a move ended: ``A at 241, B CONTACT_CLOSING at 130, C at 241; 2.31 s``."""
    ends = []
    for axis in AXES:
        if axis in result.outcomes:
            how = f" {result.outcomes[axis].name}" if axis in result.contacts else ""
            ends.append(f"{axis.name}{how} at {result.positions[axis]}")
    return f"{', '.join(ends)}; {result.duration:.2f} s"


async def _open(hand: Hand) -> str:
    return in_words(await hand.open())


async def _close(hand: Hand) -> str:
    return in_words(await hand.close())


def _width(position: int) -> Callable[[Hand], Awaitable[str]]:
    async def run(hand: Hand) -> str:
        return in_words(await hand.move(position, Finger.SCISSOR))

    return run


async def _halt(hand: Hand) -> str:
    await hand.halt()
    return "every axis stands still" + (": the gripper is reset" if hand.state is State.RESET else "")


async def _activate(hand: Hand) -> str:
    await hand.activate()
    return "the gripper is active"


async def _reset(hand: Hand) -> str:
    await hand.reset()
    return "the gripper is reset"


async def _release(hand: Hand) -> str:
    await hand.atr()
    return "released; only a reset helps now"


async def _recover(hand: Hand) -> str:
    await hand.recover()
    return "the gripper is active"


_ALL: Final = (
    Action("open", "open the fingers", _open),
    Action("close", "close the fingers", _close),
    Action("wide", "B and C furthest apart", _width(WIDTH_WIDE)),
    Action("normal", "B and C as usual", _width(WIDTH_NORMAL)),
    Action("pinch", "B and C together", _width(WIDTH_PINCH)),
    Action("halt", "stop every axis", _halt, moves=False),
    Action(
        "activate",
        "activate the gripper",
        _activate,
        warning="The fingers MOVE: they open and close to their stops.",
    ),
    Action("reset", "reset the gripper", _reset, warning="The gripper lets go: what it holds DROPS."),
    Action(
        "release",
        "release in a fault",
        _release,
        warning="All fingers OPEN slowly, whatever the fault: what they hold DROPS.",
    ),
    Action(
        "recover",
        "do what the fault needs",
        _recover,
        warning="A major fault needs a reset and an activation: what it holds DROPS, the fingers MOVE.",
    ),
)
ACTIONS: Final = MappingProxyType({action.name: action for action in _ALL})
"""Every action by its name."""
