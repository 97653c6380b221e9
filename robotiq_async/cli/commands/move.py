"""``robotiq-async move``."""

from __future__ import annotations

from collections.abc import Coroutine
from typing import Annotated

from cyclopts import Parameter

from ...calibration import Units, force_of, position_of, speed_of
from ...link import is_remote
from ...tools.wording import axis_name
from ...values import Finger, check_timeout
from ..addresses import gripper_words, is_simulated
from ..arguments import (
    USUAL_LINK,
    AddressArgument,
    Amount,
    FingersArgument,
    Flag,
    Force,
    LinkOptions,
    Position,
    Speed,
    Yes,
)
from ..consent import consent
from ..failures import usage

WARNING = """this MOVES {fingers} to {position}.
If it is not active yet ALL its fingers open and close to their stops first, and a held part drops."""

IN_FORCE = "rGTO stays set: the grip is in force."
LET_GO = "rGTO is clear now: the vendor says that a held part stays held; that is not measured."
HINT = " With --keep it stays set."


def move(
    position: Position,
    address: AddressArgument = "sim://",
    /,
    *,
    fingers: FingersArgument = Finger.ABC,
    speed: Speed = None,
    force: Force = None,
    timeout: Annotated[float | None, Parameter(metavar="SECONDS")] = None,
    keep: Flag = False,
    yes: Yes = False,
    link: LinkOptions = USUAL_LINK,
) -> Coroutine[None, None, None]:
    """Move axes and wait until they have stopped. THE FINGERS MOVE.

    A gripper that is not active yet is activated first: its fingers then open and
    close to their stops. An axis that meets an object stops there; that is a
    success, and is in the table. Unless the gripper is simulated it asks
    first; without a terminal it needs --yes.

    At the end it stops every axis (rGTO = 0), also axes that hold something. According
    to the vendor the part stays held then; that is not measured on a 3-Finger. The next
    move does not resume that grip. With --keep rGTO stays set if everything has come to
    rest, also after Ctrl-C, and the next move leaves the other axes their grip. Speed and
    force cannot be read back: the other axes get 128 and 64 then.

    For example:

        robotiq-async move 255
        robotiq-async move 40mm "rtu:///dev/ttyUSB0?model=2f85" --speed 80mm/s
        robotiq-async move 100 tcp://192.168.1.11 --fingers A,B --speed 64
        robotiq-async move 255 192.168.1.11 --fingers scissor --force 0 --yes
        robotiq-async move 255 192.168.1.11 --keep

    Args:
        position: 0 is open, 255 closed, of the scissor wide and pinch; or 40mm, nominal without --stroke.
        fingers: The axes that move: ABC, A,B, scissor, all.
        speed: 0 is the slowest (a full stroke in 10 s, of a jaw in 2.5 to 5 s), 255 the fastest; or 80mm/s.
        force: 0 is the weakest, 255 the strongest; or 60N, a label and no measured force.
        timeout: Seconds until it gives up (default: from distance and speed).
        keep: Let a grip stay in force when the command ends.
        yes: Do not ask.
    """
    with usage():
        check_timeout("timeout", timeout)
    if not is_simulated(address):
        from ..connect import make_hand

        hand = make_hand(address, link)  # only to check: wrong usage is told before the question
        with usage():
            axes = hand.model.mask(fingers)
            if not is_remote(address):  # there the agent knows the gripper
                counts_of(hand.units, axes, position, speed, force)
        # Asked here and not in the coroutine: a question would block the event loop.
        consent(address, WARNING.format(fingers=axis_name(axes, hand.model), position=position), yes=yes)
    return _move(position, address, fingers, speed, force, timeout, keep, link)


def counts_of(
    units: Units, axes: Finger, position: Amount, speed: Amount | None, force: Amount | None
) -> dict[str, int | None]:
    """Position, speed and force in counts, by the names that a move has for them."""
    return {
        "position": position_of(units, axes, **position.argument),
        "speed": speed_of(units, **(speed.argument if speed else {})),
        "force": force_of(units, **(force.argument if force else {})),
    }


async def _move(
    position: Amount,
    address: str,
    fingers: Finger,
    speed: Amount | None,
    force: Amount | None,
    timeout: float | None,
    keep: bool,
    link: LinkOptions,
) -> None:
    from ..connect import connected
    from ..output.tables import print_outcomes

    print(gripper_words(address), flush=True)
    async with connected(address, link, halt=True, keep_grip=keep) as hand:
        with usage():
            # Before an activation moves anything.
            counts = counts_of(hand.units, hand.model.mask(fingers), position, speed, force)
        if not hand.is_activated:
            print("Activating: the fingers open and close.", flush=True)
            await hand.activate()
        result = await hand.move(**counts, fingers=fingers, timeout=timeout)
    print_outcomes(result)
    if result.status.contacts:  # also of axes that did not move
        print(IN_FORCE if hand.status.go_echo else LET_GO + HINT * (not keep))
