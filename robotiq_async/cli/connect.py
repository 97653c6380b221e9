"""A connected hand for a sub-command."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from ..hands import POLL_INTERVAL_S, Hand, HandOptions
from ..link import is_remote
from ..local import RobotiqHand
from ..tools.actions import Operator
from ..values import DEFAULT_FORCE, DEFAULT_SPEED
from .arguments import USUAL_LINK, LinkOptions, need
from .failures import UsageError, usage


def make_hand(
    address: str,
    link: LinkOptions = USUAL_LINK,
    *,
    poll_interval: float = POLL_INTERVAL_S,
    speed: int = DEFAULT_SPEED,
    force: int = DEFAULT_FORCE,
    control: bool | None = True,
) -> Hand:
    """A hand that is not started. Only this function knows the class for each address.

    On another host it takes control, or not, or with the first command (None).
    """
    if is_remote(address):
        need("zenoh", "fleet")
        if link != USUAL_LINK:
            raise UsageError("a gripper on another host is set up there: its agent's file has these options")
        from ..fleet.remote.remote_hand import RemoteHand

        with usage():
            return RemoteHand(address, control=control)
    with usage():
        return RobotiqHand(address, **link.options(), poll_interval=poll_interval, speed=speed, force=force)


def make_served(options: HandOptions) -> RobotiqHand:
    """A hand for an agent, from its table in FLEET.toml."""
    return RobotiqHand(name=options.name, **{name: getattr(options, name) for name in HandOptions.in_files()})


def make_operator(address: str, link: LinkOptions, who: str, *, speed: int, force: int) -> Operator:
    """The operator of a hand that is not started; ``who`` is a person at the monitor or the page."""
    hand = make_hand(address, link, speed=speed, force=force, control=None)
    return Operator(hand, who=who, speed=speed, force=force)


@asynccontextmanager
async def connected(
    address: str, link: LinkOptions = USUAL_LINK, *, halt: bool, keep_grip: bool = False
) -> AsyncIterator[Hand]:
    """A started hand; nothing has been written to the gripper.

    ``halt`` is whether leaving stops the fingers (False for a command that only reads), ``keep_grip``
    whether a grip stays in force then.
    """
    hand = make_hand(address, link, control=halt)
    try:
        await hand.start(activate=False)
        yield hand
    finally:
        await hand.stop(halt=halt, keep_grip=keep_grip)
