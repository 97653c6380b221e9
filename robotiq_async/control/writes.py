"""What was written and what the gripper shows of it.

A write acts one device cycle after it is acknowledged, and a slow device may show the one before last or
skip one. So a status is compared with every image of the last half second and the one before those: if
it shows one of them it is ours; if it shows something else, another client commands the gripper.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from typing import Final

from ..wire.request import Request
from ..wire.status import RobotiqStatus
from .sequences import Signature, signature_of, signature_of_status

WINDOW_S: Final = 0.5
"""How long after its acknowledgement a write may still be about to show; the slowest device cycle that is
reckoned with is 0.2 s."""
SILENT_S: Final = 0.25
"""How long a change without an echo (speed, force) is given to act: the slowest device cycle and more."""


@dataclass(slots=True)
class _Written:
    number: int
    image: Request
    signature: Signature
    time: float
    acknowledged: bool = False
    doubtful: bool = False
    """It counts while it may still act, and not as what the gripper has."""
    received: bool = False
    """It has arrived for certain."""


class EchoWatch:
    """Compares echoes with what was written. Fed with writes and statuses; keeps no clock."""

    def __init__(self) -> None:
        """Know nothing yet: :meth:`restart` tells what the gripper shows."""
        self._written: deque[_Written] = deque()
        self._number = 0
        self._shown: _Written | None = None

    @property
    def is_in_doubt(self) -> bool:
        """Whether a write may or may not have arrived, and has not shown so far."""
        # One entry is the usual case, and this is asked at every poll.
        return len(self._written) > 1 and any(each.doubtful for each in self._written)

    @property
    def last_number(self) -> int:
        """The number of the last image."""
        return self._number

    def restart(self, image: Request, signature: Signature, now: float) -> None:
        """Take an image for what the gripper has now, and a signature for how it shows; forget the rest."""
        self._number += 1
        self._shown = _Written(self._number, image, signature, now, acknowledged=True, received=True)
        self._written = deque([self._shown])

    def adopt(self, image: Request, signature: Signature, now: float) -> None:
        """The same, but what has not shown yet may still come.

        That is a write that was on its way when another client wrote, or one that was not acknowledged
        before the link went down: it may have arrived all the same.
        """
        shown = self._shown.number if self._shown is not None else self._number
        waiting = [each for each in self._written if each.number > shown]
        self.restart(image, signature, now)
        for each in waiting:
            self._number += 1
            again = replace(each, number=self._number, time=now, acknowledged=True, doubtful=True)
            self._written.append(again)

    def writing(self, image: Request, now: float) -> int:
        """An image is about to be sent; returns the number it goes by."""
        self._number += 1
        self._written.append(_Written(self._number, image, signature_of(image), now))
        return self._number

    def acknowledged(self, now: float) -> None:
        """The last image was acknowledged."""
        last = self._written[-1]
        last.acknowledged = last.received = True
        last.time = now

    def lost(self) -> None:
        """The link is down: what was not acknowledged may have arrived, or not."""
        last = self._written[-1] if self._written else None
        if last is not None and not last.acknowledged:
            last.acknowledged = last.doubtful = True

    def observe(self, status: RobotiqStatus, asked: float | None = None) -> Request | None:
        """The image that a status shows, or None if it shows none of ours.

        The gripper takes images in order, so the first one that fits, counted from the one shown last,
        is the one shown. An older one may come back for as long as it is remembered.
        """
        # What it shows may be as old as its request, however late the reply was looked at.
        self._forget(status.timestamp if asked is None else asked)
        signature = signature_of_status(status)
        # The usual case first: nothing has changed since the last poll.
        shown = self._shown
        if shown is not None and shown.signature == signature and shown.number >= self._written[0].number:
            return shown.image
        fitting = [each for each in self._written if each.signature == signature]
        if not fitting:
            return None
        number = shown.number if shown is not None else 0
        newer = [each for each in fitting if each.number > number]
        if newer:
            self._shown = newer[0]
            self._shown.doubtful, self._shown.received = False, True
        return (newer or fitting)[0].image

    def newest_that_shows_like(self, image: Request) -> Request:
        """The newest image that has arrived for certain and cannot be told from this one by its echo.

        That is what the gripper has, or will have in a moment: speed and force have no echo.
        """
        alike = {each.signature for each in self._written if each.image is image}
        newest = [each.image for each in self._written if each.received and each.signature in alike]
        return newest[-1] if newest else image

    def acts(self, number: int, now: float) -> bool:
        """Whether the image of this number, or a later one, acts by now.

        That is when its echo has been seen, or when enough time has passed since its acknowledgement.
        """
        if self._shown is not None and self._shown.number >= number:
            return True
        waiting = [each for each in self._written if each.number <= number]
        if not waiting or self._shown is None:
            return True
        last = waiting[-1]
        if not last.acknowledged:
            return False
        age = now - last.time
        if age >= WINDOW_S:
            return True
        waiting = [self._shown, *(each for each in waiting if each.number > self._shown.number)]
        if any(each.signature != last.signature for each in waiting):
            return False
        # The echo cannot tell the waiting images apart. Equal ones change nothing; a speed or a force does.
        return age >= SILENT_S or all(each.image == last.image for each in waiting)

    def is_settled(self, now: float) -> bool:
        """Whether the last image acts by now."""
        return self.acts(self._number, now)

    def _forget(self, now: float) -> None:
        """Drop what is older than the window, but for the newest of that: the gripper has it, or ought to."""
        written = self._written
        if len(written) == 1:
            return
        for each in [each for each in written if each.doubtful and now - each.time > WINDOW_S]:
            written.remove(each)
        certain = [each for each in written if each.acknowledged and not each.doubtful]
        old = [each for each in certain if now - each.time > WINDOW_S]
        while old and written[0] is not old[-1]:
            written.popleft()
