"""A connected hand for a sub-command."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

from .arguments import usage

if TYPE_CHECKING:
    from .. import RobotiqHand


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
