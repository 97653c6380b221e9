"""A connected hand for a sub-command."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

from .arguments import usage

if TYPE_CHECKING:
    from .. import RobotiqHand
    from ..actions import Operator


@asynccontextmanager
async def connected(address: str, *, halt: bool) -> AsyncIterator[RobotiqHand]:
    """A hand that has been read and not yet written to.

    Args:
        address: the gripper.
        halt: whether leaving stops the fingers; a command that only looks leaves them alone.

    Raises:
        UsageError: a malformed address.
        RobotiqError: no gripper there, or a link that failed.
    """
    from .. import RobotiqHand

    with usage():
        hand = RobotiqHand(address)
    try:
        await hand.start(activate=False)
        yield hand
    finally:
        await hand.stop(halt=halt)


@asynccontextmanager
async def operated(address: str, tell: Callable[[str], object]) -> AsyncIterator[Operator]:
    """A hand that has not been written to, for a person who may move it.

    Leaving stops the fingers only if this person has moved them.

    Args:
        address: the gripper.
        tell: is told in the end what has become of the fingers.

    Raises:
        UsageError: a malformed address.
        RobotiqError: no gripper there, or a link that failed.
    """
    from .. import RobotiqHand
    from ..actions import Operator

    with usage():
        hand = RobotiqHand(address)
    operator, has_started = Operator(hand), False
    try:
        await hand.start(activate=False)
        has_started = True
        yield operator
    finally:
        has_moved = operator.has_moved
        await hand.stop(halt=has_moved)
        if has_started:
            tell(_farewell(has_moved, operator.was_stopped))


def _farewell(has_moved: bool, was_stopped: bool) -> str:
    if not has_moved:
        return "The fingers were left as they are: nothing here has moved them."
    if was_stopped:
        return "The fingers were stopped: they had been moved from here."
    return "The fingers had been moved from here and may STILL MOVE: the gripper was not seen to take a stop."
