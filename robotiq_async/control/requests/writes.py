"""What was written, and what the gripper shows of it.

A write acts one device cycle after it is acknowledged, and a slow device may show the one before last or
skip one. So a status is compared with every image of the last half second and the one before those: if
it shows one of them it is ours; if it shows something else, another client commands the gripper.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

from ...values.enums import Finger
from ...values.registers import Echo
from ...values.request import Request
from ...values.status import RobotiqStatus
from .limits import Limits

WINDOW_S: Final = 0.5
"""How long after its acknowledgement a write may still be about to show; the slowest device cycle that is
reckoned with is 0.2 s."""
SILENT_S: Final = 0.25
"""How long a change without an echo (speed, force) is given to act: the slowest device cycle and more."""


class Phase(Enum):
    """How far a write has come."""

    __hash__ = object.__hash__

    SENT = "on the line"
    ACKNOWLEDGED = "it has arrived, and acts within a device cycle"
    SHOWN = "a status has shown it"
    IN_DOUBT = "the link went down under it: it may have arrived, and may still act"
    OVERTAKEN = "acknowledged, but another client's request showed first: it may still act"


_WAITING: Final = frozenset({Phase.IN_DOUBT, Phase.OVERTAKEN})
"""It counts while it may still act, and not as what the gripper has."""
_SETTLED: Final = frozenset({Phase.ACKNOWLEDGED, Phase.SHOWN})
_ARRIVED: Final = frozenset({Phase.ACKNOWLEDGED, Phase.SHOWN, Phase.OVERTAKEN})


@dataclass(slots=True)
class _Write:
    number: int
    image: Request
    echo: Echo
    time: float
    phase: Phase = Phase.SENT
    alias: Echo | None = None
    """How it is echoed where a limit takes the place of a request."""


class WriteHistory:
    """Compares echoes with what was written. Fed with writes and statuses; keeps no clock."""

    def __init__(self) -> None:
        """Know nothing yet: :meth:`restart` tells what the gripper shows."""
        self._writes: deque[_Write] = deque()
        self.last_number = 0
        """The number of the last image."""
        self._shown: _Write | None = None
        self.limits = Limits()
        self.replaced: dict[Finger, tuple[int, int]] = {}
        """The requests that the newest status is the first to show limited, each with its limit."""
        self._has_alias = False
        """Whether a write may show as limits in place of its requests."""
        self._has_waiting = False
        """Whether a write may be in a phase that waits; the usual case is none of many."""

    @property
    def is_in_doubt(self) -> bool:
        """Whether a write may or may not act, and has not shown so far."""
        return self._has_waiting and len(self._writes) > 1 and self._any_waits()

    def _any_waits(self) -> bool:
        return any(each.phase in _WAITING for each in self._writes)

    @property
    def all_look_alike(self) -> bool:
        """Whether what is shown and what waits cannot be told apart by the echo."""
        return len({each.echo for each in self._writes}) <= 1

    def restart(self, image: Request, echo: Echo, now: float) -> None:
        """Take an image for what the gripper has now, and an echo for how it shows; forget the rest."""
        self.last_number += 1
        self._shown = _Write(self.last_number, image, echo, now, Phase.SHOWN)
        self._writes = deque([self._shown])
        self._has_waiting = False

    def adopt(self, image: Request, echo: Echo, now: float) -> None:
        """Restart, but what has not shown yet may still come.

        That is a write that was on its way when another client wrote, or one that was not acknowledged
        before the link went down: it may have arrived all the same.
        """
        shown = self._shown.number if self._shown is not None else self.last_number
        waiting = [each for each in self._writes if each.number > shown]
        self.restart(image, echo, now)
        for each in waiting:
            self.last_number += 1
            phase = Phase.OVERTAKEN if each.phase in _ARRIVED else Phase.IN_DOUBT
            self._writes.append(replace(each, number=self.last_number, time=now, phase=phase))
            self._has_waiting = True

    def writing(self, image: Request, now: float) -> int:
        """An image is about to be sent; returns the number it goes by."""
        self.last_number += 1
        alias = self.limits.alias(image)
        self._has_alias = self._has_alias or alias is not None
        self._writes.append(_Write(self.last_number, image, image.echo, now, alias=alias))
        return self.last_number

    def acknowledged(self, now: float) -> None:
        """The last image was acknowledged."""
        last = self._writes[-1]
        last.phase, last.time = Phase.ACKNOWLEDGED, now

    def lost(self) -> None:
        """The link is down: what was not acknowledged may have arrived, or not."""
        if self._writes and self._writes[-1].phase is Phase.SENT:
            self._writes[-1].phase = Phase.IN_DOUBT
            self._has_waiting = True

    def see(self, status: RobotiqStatus, asked: float) -> Request | None:
        """The image that a status shows, or None if it shows none of ours.

        The gripper takes images in order, so the first one that fits, counted from the one shown last,
        is the one shown. An older one may come back for as long as it is remembered.

        Args:
            status: the status.
            asked: when it was asked for. What it shows may be as old as that.
        """
        self._forget(asked)
        echo = status.echo
        # The usual case first: nothing has changed since the last poll.
        shown = self._shown
        is_shown = shown is not None and shown.echo == echo and shown.number >= self._writes[0].number
        if is_shown and not self._has_alias:
            assert shown is not None
            return shown.image
        # A stream of commands leaves a hundred writes in the window: what is usual costs one look at each.
        fitting = [
            each
            for each in self._writes
            if each.echo == echo or (each.alias is not None and self._is_limited(each, echo, asked))
        ]
        if not fitting:
            return None
        number = shown.number if shown is not None else 0
        newer = [each for each in fitting if each.number > number]
        if newer:
            self._shown = newer[0]
            self._shown.phase = Phase.SHOWN
            self._settle(self._shown, echo)
        if self._has_alias:
            self._has_alias = any(each.alias is not None for each in self._writes)
        return (newer or fitting)[0].image

    def suspect_limits(self, status: RobotiqStatus) -> bool:
        """Whether what a status shows can be limits in place of what was written last."""
        shown = self._shown
        waiting = [each for each in self._writes if shown is not None and each.number > shown.number]
        if shown is None or not waiting or any(each.phase is not Phase.ACKNOWLEDGED for each in waiting):
            return False
        if not any(self.limits.suspect(shown.image, each.image, status) for each in waiting):
            return False
        for each in waiting:
            each.alias = self.limits.alias(each.image)
        self._has_alias = True
        return True

    def _is_limited(self, write: _Write, echo: Echo, now: float) -> bool:
        """Whether a write shows as limits in place of its requests.

        What the gripper shows already may be that, or that the write does not act yet: that takes its time.
        """
        if write.alias != echo:
            return False
        tells = self._shown is None or self._shown.echo != echo
        return tells or (write.phase is Phase.ACKNOWLEDGED and now - write.time >= SILENT_S)

    def _settle(self, write: _Write, echo: Echo) -> None:
        """From here on a write is what is shown of it, if that is limits in place of requests."""
        if echo == write.echo:
            self.limits.forget(write.image, echo)
        else:
            limits = self.limits.apply(write.image)
            self.replaced = {axis: (write.image.position(axis), limit) for axis, limit in limits.items()}
            write.image, write.echo = write.image.with_positions(limits), echo
        write.alias = None

    def newest_that_shows_like(self, image: Request) -> Request:
        """The newest image that has arrived for certain and cannot be told from this one by its echo.

        That is what the gripper has, or will have in a moment: speed and force have no echo.
        """
        alike = {each.echo for each in self._writes if each.image is image}
        newest = [each.image for each in self._writes if each.phase in _ARRIVED and each.echo in alike]
        return newest[-1] if newest else image

    def acts(self, number: int, now: float) -> bool:
        """Whether the image of this number, or a later one, acts by now.

        That is when its echo has been seen, or when enough time has passed since its acknowledgement.
        """
        if self._shown is None or self._shown.number >= number:
            return True
        waiting = [each for each in self._writes if each.number <= number]
        if not waiting:
            return True
        last = waiting[-1]
        if last.phase is Phase.SENT:
            return False
        age = now - last.time
        if age >= WINDOW_S:
            return True
        waiting = [self._shown, *(each for each in waiting if each.number > self._shown.number)]
        if any(each.echo != last.echo for each in waiting):
            return False
        # The echo cannot tell the waiting images apart. Equal ones change nothing; a speed or a force does.
        return age >= SILENT_S or all(each.image == last.image for each in waiting)

    def is_old(self, number: int, now: float) -> bool:
        """Whether the image of this number has not shown, and was acknowledged so long ago that it acts."""
        if self._shown is None or self._shown.number >= number:
            return False
        return any(
            each.number == number and each.phase is not Phase.SENT and now - each.time >= WINDOW_S
            for each in self._writes
        )

    def _forget(self, now: float) -> None:
        """Drop what is older than the window, but for the newest of that: the gripper has it, or ought to."""
        writes = self._writes
        if len(writes) == 1:
            return
        old: list[_Write] = []
        while writes and now - writes[0].time > WINDOW_S:  # times only rise: what is old stands first
            old.append(writes.popleft())
        settled = [each for each in old if each.phase in _SETTLED]
        on_the_line = [each for each in old if each.phase is Phase.SENT]  # no other comes after it
        writes.extendleft(reversed([*settled[-1:], *on_the_line]))
        self._has_waiting = self._has_waiting and self._any_waits()
