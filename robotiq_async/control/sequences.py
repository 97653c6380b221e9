"""How the hand gets from one state to another, as suspended code.

Each procedure is a generator: it hands out the request image to send (None: just read) and is sent the
next status, read after that image was acknowledged. There is no I/O, no clock and no event loop here; a
test drives a procedure with ``next`` and ``send``. Whoever drives it bounds it in time.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

from ..enums import Fault, Severity
from ..errors import GripperFaultError, NotActivatedError
from ..wire.request import Request
from ..wire.status import RobotiqStatus
from .state_machine import Trigger, look

Procedure = Generator[Request | None, RobotiqStatus, RobotiqStatus]
"""Yields what to write before the next read, is sent that read, returns the status that ended it."""


def activation(image: Request) -> Procedure:
    """Raise rACT and wait for gIMC = 3. The fingers open and close to their stops.

    Raises:
        GripperFaultError: the activation ended in a major fault.
        NotActivatedError: the gripper fell back to reset after it had begun.
    """
    status = yield replace(image, activate=True, go=False, release=False)
    begun = False
    while look(status) is not Trigger.SEEN_READY:
        if status.fault.severity is Severity.MAJOR:
            raise GripperFaultError(status.fault)
        # The first statuses may still be from before the request: a reset means a loss only afterwards.
        if begun and look(status) is Trigger.SEEN_RESET:
            raise NotActivatedError(
                "the gripper was reset while it activated (power cycle, or another client)"
            )
        begun = begun or status.activation_echo
        status = yield None
    return status


def reset(image: Request) -> Procedure:
    """Clear rACT and wait for gACT = 0 and gIMC = 0. Clears faults; the gripper lets go."""
    status = yield replace(image, activate=False, go=False, release=False)
    while look(status) is not Trigger.SEEN_RESET:
        status = yield None
    return status


def automatic_release(image: Request) -> Procedure:
    """Raise rATR and wait for fault 0x0F. All axes open slowly; only a reset helps afterwards.

    Raises:
        NotActivatedError: the gripper was reset meanwhile.
    """
    status = yield replace(image, activate=True, go=False, release=True)
    while status.fault is not Fault.AUTOMATIC_RELEASE_DONE:
        if look(status) is Trigger.SEEN_RESET:
            raise NotActivatedError("the gripper was reset during the automatic release")
        status = yield None
    return status


def shutdown(image: Request) -> Procedure:
    """Clear rGTO and wait until the echo of the complete last image is back.

    A write acts one device cycle after its acknowledgement. Waiting for gGTO = 0 alone could match the
    state before the previous write, and whoever connects next would adopt an echo about to change.
    """
    last = replace(image, go=False)
    status = yield last
    while not echoes(status, last):
        status = yield None
    return status


def echoes(status: RobotiqStatus, image: Request) -> bool:
    """Whether a status shows all that is echoed of an image: rACT, rGTO and the four positions.

    rMOD is left out: it means nothing while the scissor has its own registers.
    """
    return signature_of_status(status) == signature_of(image)


Signature = tuple[bool, bool, int, int, int, int]
"""gACT, gGTO and the position echoes of A, B, C and the scissor."""


def signature_of(image: Request) -> Signature:
    """What a gripper that has taken over an image echoes."""
    a, b, c, s = (axis.position for axis in image.axes)
    return image.activate, image.go, a, b, c, s


def signature_of_status(status: RobotiqStatus) -> Signature:
    """What a status echoes."""
    # By hand for speed: this runs at every poll.
    word = status.registers
    return (
        bool(word[0] & 0x0100),
        bool(word[0] & 0x0800),
        word[1] & 0xFF,
        word[3] >> 8,
        word[4] & 0xFF,
        word[6] >> 8,
    )
