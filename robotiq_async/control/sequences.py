"""How the hand gets from one state to another, as suspended code.

Each sequence is a generator. It is sent a status and yields the image to write at once, or None; after an
image, the next status it is sent is one that shows what came of it. The first status it is sent decides
whether there is anything to begin at all: between being asked for and being carried out, somebody else
may have done something to the gripper. There is no I/O, no clock and no event loop here; whoever waits
for a sequence bounds it in time.

A gripper may acknowledge a write that comes soon after another one and forget it (manual of 2014: space
them by 10 ms). A stop or a reset that does not show when it should act is therefore yielded again. An
activation and a release are not, for they move the fingers: they keep their distance from the write before.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import replace

from ..values.enums import Fault, Severity
from ..values.errors import GripperFaultError, NotActivatedError
from ..values.request import Request
from ..values.status import RobotiqStatus
from ..values.trigger import Trigger
from .requests.writes import WINDOW_S
from .triggers import classify

Sequence = Generator[Request | None, RobotiqStatus, None]
"""Yields what to write now, is sent the next status that counts."""
Image = Callable[[RobotiqStatus], Request]
"""The image to begin from, given the newest status."""


def activation(at_rest: Image) -> Sequence:
    """Raise rACT and wait for gIMC = 3. The fingers open and close to their stops.

    Does nothing when the gripper is not reset any more.

    Raises:
        GripperFaultError: the activation ended in a major fault.
        NotActivatedError: the gripper fell back to reset after it had begun.
    """
    status = yield None
    if classify(status) is not Trigger.SEEN_RESET:
        return
    status = yield replace(at_rest(status), activate=True, release=False)
    begun = False
    while classify(status) is not Trigger.SEEN_READY:
        if status.fault.severity is Severity.MAJOR:
            raise GripperFaultError(status.fault)
        # The first statuses may still be from before the request: a reset means a loss only afterwards.
        if begun and classify(status) is Trigger.SEEN_RESET:
            raise NotActivatedError(
                "the gripper was reset while it activated (power cycle, or another client)"
            )
        begun = begun or status.activation_echo
        status = yield None


def reset(at_rest: Image) -> Sequence:
    """Clear rACT and wait for gACT = 0 and gIMC = 0. Clears faults; the gripper lets go."""
    status = yield None
    image = replace(at_rest(status), activate=False, release=False)
    status = yield image
    while classify(status) is not Trigger.SEEN_RESET:
        status = yield image if status.activation_echo else None


def automatic_release(at_rest: Image) -> Sequence:
    """Raise rATR and wait for fault 0x0F. All axes open slowly; only a reset helps afterwards.

    Does nothing when the gripper has been reset: the raised rACT would activate it.

    Raises:
        NotActivatedError: the gripper was reset meanwhile; perhaps it was activated again at once.
    """
    status = yield None
    if not status.activation_echo:
        return
    asked, begun = status.timestamp, False
    status = yield replace(at_rest(status), activate=True, release=True)
    while status.fault is not Fault.AUTOMATIC_RELEASE_DONE:
        begun = begun or status.fault is Fault.AUTOMATIC_RELEASE
        # gIMC is 0 during a release. Until it has been seen, a status may be from before the request, and the
        # fault from before the release.
        goes_on = status.is_reset or status.fault is Fault.AUTOMATIC_RELEASE
        is_sure = begun or (status.timestamp - asked > WINDOW_S and not status.fault.is_serious)
        if classify(status) is Trigger.SEEN_RESET or (is_sure and not goes_on):
            raise NotActivatedError("the gripper was reset during the automatic release")
        status = yield None


def shutdown(last_image: Callable[[RobotiqStatus], Request | None]) -> Sequence:
    """Clear rGTO, if anything may move, and wait until the echo of the complete last image is back.

    A write acts one device cycle after its acknowledgement. Waiting for gGTO = 0 alone could match the
    state before the previous write, and whoever connects next would adopt an echo about to change.

    Args:
        last_image: the image to leave the gripper with, given the newest status; None for nothing to stop.
    """
    status = yield None
    last = last_image(status)
    if last is not None:
        yield from stop_fingers(last)


def stop_fingers(last: Request) -> Sequence:
    """Write the last image, again if need be, until its echo is back: the end of a shutdown."""
    status = yield last
    while status.echo != last.echo:
        # If it was reset meanwhile, it is at rest, and this image would activate it.
        is_being_reset = last.activate and not status.activation_echo
        if is_being_reset and classify(status) is Trigger.SEEN_RESET:
            return
        status = yield None if is_being_reset else last
