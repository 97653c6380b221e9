"""Activation and automatic release, each as a generator.

A procedure is sent a status and yields the image to write now, or None. After an image, the next status that
it is sent can show the effect. The first status decides whether the procedure begins at all: another client
may have changed the gripper since the call. A procedure does no I/O and has no clock; its caller limits its
time. It never yields its image again, even if a gripper may have forgotten it: the image moves the fingers.
It returns why it has failed, if it has. An activation may outlast it: one that a fault has stopped may
continue as that clears, and one whose link was lost continues. The ledger keeps it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import replace
from typing import Final

from ..values.enums import Fault, Severity, State, Trigger
from ..values.errors import GripperFaultError
from ..values.request import Request
from ..values.status import RobotiqStatus
from .evidence import classify
from .gate import at_rest
from .ledger import WINDOW_S, Ledger
from .stops import Duty, Ended

RESET_S: Final = 5.0
"""Time for a stranded gripper to show a reset: as long as reset() waits."""

Steps = Generator[Request | None, RobotiqStatus, str]
Image = Callable[[RobotiqStatus], Request]  # makes the image to begin from, given the newest status


class Procedure(Duty):
    """An activation or an automatic release. With no image to send, the shown image counts as its write."""

    def __init__(self, ledger: Ledger, begin: Callable[[Image], Steps]) -> None:
        self.releases = begin is automatic_release
        self.activates = not self.releases
        of_release, of_activation = (State.DO_ATR, State.WF_ATR), (State.DO_ACTIVATION, State.WF_ACTIVATION)
        super().__init__(of_release if self.releases else of_activation)
        self._steps: Final = begin(lambda status: at_rest(ledger.base, status))
        next(self._steps)  # to its first yield: the first status decides whether it begins

    def next_image(self, ledger: Ledger, status: RobotiqStatus) -> Request | Ended | None:
        """The image to write now; None if it waits."""
        if self.writes and not ledger.acts(self.writes[-1]):
            return None
        try:
            return self._steps.send(status)
        except StopIteration as end:
            return Ended(end.value)


def activation(image: Image) -> Steps:
    """Raise rACT and wait for gIMC = 3. The fingers open and close to their stops."""
    status = yield None
    # Only a rising rACT activates [manual 2012, 4.6]: there is none unless the gripper is reset.
    if classify(status) is not Trigger.SEEN_RESET:
        return ""
    status = yield replace(image(status), activate=True)
    asked, begun = status.timestamp, False
    while classify(status) is not Trigger.SEEN_READY:
        if status.fault.severity is Severity.MAJOR:
            return str(GripperFaultError(status.fault))
        # The first statuses may be from before the write: until the activation shows, a reset counts only if
        # it lasts [follows]. The gripper may have forgotten the write, or another client have taken it back.
        is_sure = begun or status.timestamp - asked > WINDOW_S
        if is_sure and classify(status) is Trigger.SEEN_RESET:
            why = "was reset while it activated" if begun else "does not show the activation"
            return f"the gripper {why} (power cycle, or another client)"
        begun = begun or status.activation_echo
        status = yield None
    return ""


def reset_and_activation(image: Image) -> Steps:
    """Clear rACT of a stranded gripper, and activate it once that shows."""
    status = yield None
    asked, status = status.timestamp, (yield replace(image(status), activate=False))
    while classify(status) is not Trigger.SEEN_RESET:
        if status.timestamp - asked > RESET_S:
            return "the gripper has rACT, does not activate, and does not report a reset"
        status = yield None
    return (yield from activation(image))


def automatic_release(image: Image) -> Steps:
    """Raise rATR and wait for fault 0x0F. All axes open slowly; afterwards the gripper needs a reset."""
    status = yield None
    # The image has rACT set, and would activate a gripper that was reset.
    if not status.activation_echo:
        return ""
    asked, begun = status.timestamp, False
    status = yield replace(image(status), activate=True, release=True)
    while status.fault is not Fault.AUTOMATIC_RELEASE_DONE:
        begun = begun or status.fault is Fault.AUTOMATIC_RELEASE
        # gIMC is 0 during a release [manual 2014, p. 50].
        releases = status.is_reset or status.fault is Fault.AUTOMATIC_RELEASE
        if classify(status) is Trigger.SEEN_RESET or (begun and not releases):
            return "the gripper was reset during the automatic release"
        # Until the release shows, a status may be from before the write, and its fault from before the
        # release [follows].
        is_sure = status.timestamp - asked > WINDOW_S and not status.fault.is_serious
        if is_sure and not releases:
            return "the gripper does not show the automatic release (its write was lost)"
        status = yield None
    return ""
