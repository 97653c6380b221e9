"""Activation, reset, automatic release and shutdown, each as a generator.

A sequence is sent a status and yields the image to write now, or None. After an image, the next status it is
sent shows the effect of that image. The first status decides whether the sequence begins at all: another
client may have changed the gripper since the call. A sequence does no I/O and has no clock; its caller limits
its time.

A gripper may acknowledge a write that comes soon after another one and forget it (manual of 2014: space
them by 10 ms). A sequence therefore yields a stop or a reset again if it does not show when it should act. It
never yields an activation or a release again, because they move the fingers; these keep their distance from
the write before them.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import replace

from ..values.enums import Fault, Severity, Trigger
from ..values.errors import GripperFaultError, NotActivatedError
from ..values.request import Request
from ..values.status import RobotiqStatus
from .requests.writes import WINDOW_S
from .triggers import classify, is_activating

Sequence = Generator[Request | None, RobotiqStatus, None]
Image = Callable[[RobotiqStatus], Request]
"""Makes the image to begin from, given the newest status."""


def activation(at_rest: Image) -> Sequence:
    """Raise rACT and wait for gIMC = 3. The fingers open and close to their stops.

    Does nothing if the gripper is no longer reset.

    Raises:
        GripperFaultError: the activation ended in a major fault.
        NotActivatedError: the gripper was reset after the activation had begun, or does not show it.
    """
    status = yield None
    if classify(status) is not Trigger.SEEN_RESET:
        return
    status = yield replace(at_rest(status), activate=True)
    asked, begun = status.timestamp, False
    while classify(status) is not Trigger.SEEN_READY:
        if status.fault.severity is Severity.MAJOR:
            raise GripperFaultError(status.fault)
        # The first statuses may be from before the write: until the activation shows, a reset counts only if
        # it lasts. The gripper may have forgotten the write, or another client may have taken it back.
        is_sure = begun or status.timestamp - asked > WINDOW_S
        if is_sure and classify(status) is Trigger.SEEN_RESET:
            why = "was reset while it activated" if begun else "does not show the activation"
            raise NotActivatedError(f"the gripper {why} (power cycle, or another client)")
        begun = begun or status.activation_echo
        status = yield None


def reset(at_rest: Image) -> Sequence:
    """Clear rACT and wait for gACT = 0 and gIMC = 0. This clears faults and releases the part."""
    status = yield None
    yield from _until_reset(replace(at_rest(status), activate=False))


def _until_reset(image: Request) -> Sequence:
    status = yield image
    while classify(status) is not Trigger.SEEN_RESET:
        status = yield image if status.activation_echo else None


def automatic_release(at_rest: Image) -> Sequence:
    """Raise rATR and wait for fault 0x0F. All axes open slowly; afterwards the gripper needs a reset.

    Does nothing if the gripper was reset: the image has rACT set and would activate it.

    Raises:
        NotActivatedError: the gripper was reset meanwhile; it may have been activated again since.
    """
    status = yield None
    if not status.activation_echo:
        return
    asked, begun = status.timestamp, False
    status = yield replace(at_rest(status), activate=True, release=True)
    while status.fault is not Fault.AUTOMATIC_RELEASE_DONE:
        begun = begun or status.fault is Fault.AUTOMATIC_RELEASE
        # gIMC is 0 during a release. Until the release shows, a status may be from before the write, and its
        # fault from before the release.
        goes_on = status.is_reset or status.fault is Fault.AUTOMATIC_RELEASE
        is_sure = begun or (status.timestamp - asked > WINDOW_S and not status.fault.is_serious)
        if classify(status) is Trigger.SEEN_RESET or (is_sure and not goes_on):
            raise NotActivatedError("the gripper was reset during the automatic release")
        status = yield None


def shutdown(last_image: Callable[[RobotiqStatus], Request | None]) -> Sequence:
    """Clear rGTO, if an axis may move, and wait until the gripper echoes the whole image.

    A write acts one device cycle after its acknowledgement. gGTO = 0 alone may be from before the previous
    write, and the next client would adopt an echo that is about to change.

    Args:
        last_image: makes the image to leave the gripper with; None if there is nothing to stop.
    """
    status = yield None
    last = last_image(status)
    if last is not None:
        yield from stop_fingers(last, status)


def stop_fingers(last: Request, status: RobotiqStatus) -> Sequence:
    """Write the last image, repeatedly if need be, until the gripper echoes it.

    ``status`` is the one that it was made from.
    """
    was_active = classify(status) is Trigger.SEEN_READY
    status = yield last
    while status.echo != last.echo:
        # A gripper that was reset meanwhile is at rest, and this image would activate it.
        is_being_reset = last.activate and not status.activation_echo
        if is_being_reset and classify(status) is Trigger.SEEN_RESET:
            return
        status = yield None if is_being_reset else last
    if was_active and last.activate and is_activating(status):
        # Another client has reset the gripper just before, and this image has activated it.
        yield from _until_reset(replace(last, activate=False))
