"""The recent writes, and which of them a status shows.

A write acts one device cycle after it is acknowledged, and a slow device may show the write before the last,
or skip one. So a status is compared with every image of the last half second and the one before those. If it
shows one of them, the gripper follows us; if it shows anything else, another client commands it.
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
"""How long after its acknowledgement a write may take to show. The slowest device cycle considered is 0.2
s."""
SILENT_S: Final = 0.25
"""How long a change without an echo (speed, force) may take to act: the slowest device cycle and 0.05 s."""


class Phase(Enum):
    """The phases of a write."""

    __hash__ = object.__hash__

    SENT = "on the line"
    ACKNOWLEDGED = "acknowledged: it acts within a device cycle"
    SHOWN = "a status has shown it"
    IN_DOUBT = "the link went down before the acknowledgement: it may still act"
    OVERTAKEN = "acknowledged, but another client's request showed first: it may still act"


_WAITING: Final = frozenset({Phase.IN_DOUBT, Phase.OVERTAKEN})
"""The write may still act, but is not what the gripper has."""
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
    """Its echo if software limits replace requests."""


class WriteHistory:
    """Compares the echo of each status with the recent writes. Has no clock.

    Attributes:
        last_number: the number of the last write.
        limits: the software limits that the gripper echoes in place of requests.
        replaced: the requests that the newest status is the first to show limited, each with its limit.
    """

    def __init__(self) -> None:
        self.last_number = 0
        self.limits = Limits()
        self.replaced: dict[Finger, tuple[int, int]] = {}
        self._writes: deque[_Write] = deque()
        self._shown: _Write | None = None
        # Both flags keep the common case fast: usually no write waits, and none has an alias.
        self._has_alias = False
        self._has_waiting = False

    @property
    def is_in_doubt(self) -> bool:
        """Whether there is a write of which it is not known if it acts."""
        return self._has_waiting and len(self._writes) > 1 and self._any_waits()

    def _any_waits(self) -> bool:
        return any(each.phase in _WAITING for each in self._writes)

    @property
    def all_look_alike(self) -> bool:
        """Whether the writes have the same echo, so that no status can tell which of them acts."""
        return len({each.echo for each in self._writes}) <= 1

    def restart(self, image: Request, echo: Echo, now: float) -> None:
        """Forget all writes: the gripper has ``image`` now and shows it as ``echo``."""
        self.last_number += 1
        self._shown = _Write(self.last_number, image, echo, now, Phase.SHOWN)
        self._writes = deque([self._shown])
        self._has_waiting = False

    def adopt(self, image: Request, echo: Echo, now: float) -> None:
        """Restart, but keep the writes that may still show.

        These are writes under way when another client wrote, or not acknowledged before the link went down.
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
        """Add a write that is about to be sent; return its number."""
        self.last_number += 1
        alias = self.limits.alias(image)
        self._has_alias = self._has_alias or alias is not None
        self._writes.append(_Write(self.last_number, image, image.echo, now, alias=alias))
        return self.last_number

    def acknowledged(self, now: float) -> None:
        last = self._writes[-1]
        last.phase, last.time = Phase.ACKNOWLEDGED, now

    def lost(self) -> None:
        """The link is down: a write without acknowledgement may or may not have arrived."""
        if self._writes and self._writes[-1].phase is Phase.SENT:
            self._writes[-1].phase = Phase.IN_DOUBT
            self._has_waiting = True

    def see(self, status: RobotiqStatus, asked: float) -> Request | None:
        """Return the image of ours that a status shows, or None.

        The gripper takes images in order, so a status shows the first one after the last shown that fits its
        echo. While an older image is in the window, a slow device may show it again.

        Args:
            status: the status.
            asked: when it was asked for. It may show the state of that time.
        """
        self._forget(asked)
        echo = status.echo
        # The common case first: nothing has changed since the last poll.
        shown = self._shown
        is_shown = shown is not None and shown.echo == echo and shown.number >= self._writes[0].number
        if is_shown and not self._has_alias:
            assert shown is not None
            return shown.image
        # A control loop leaves a hundred writes in the window: look at each once.
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

    def learn_limits(self, status: RobotiqStatus) -> bool:
        """Learn the limits that a status may show in place of the last writes; return whether it may."""
        shown = self._shown
        waiting = [each for each in self._writes if shown is not None and each.number > shown.number]
        if shown is None or not waiting or any(each.phase is not Phase.ACKNOWLEDGED for each in waiting):
            return False
        if not any(self.limits.learn(shown.image, each.image, status) for each in waiting):
            return False
        for each in waiting:
            each.alias = self.limits.alias(each.image)
        self._has_alias = True
        return True

    def _is_limited(self, write: _Write, echo: Echo, now: float) -> bool:
        """Whether an echo shows a write with limits in place of its requests.

        If the gripper showed the same echo before, the write may not act yet: then wait for SILENT_S.
        """
        if write.alias != echo:
            return False
        is_new = self._shown is None or self._shown.echo != echo
        return is_new or (write.phase is Phase.ACKNOWLEDGED and now - write.time >= SILENT_S)

    def _settle(self, write: _Write, echo: Echo) -> None:
        """If a write shows as limits in place of requests, make it a write of these limits."""
        if echo == write.echo:
            self.limits.forget(write.image, echo)
        else:
            limits = self.limits.apply(write.image)
            self.replaced = {axis: (write.image.position(axis), limit) for axis, limit in limits.items()}
            write.image, write.echo = write.image.with_positions(limits), echo
        write.alias = None

    def newest_overtaken(self) -> Request | None:
        """The newest write after the one that shows that was overtaken by another client's.

        The gripper acknowledged it and takes writes in order: once an older one of ours shows, it has this.
        """
        shown = 0 if self._shown is None else self._shown.number
        overtaken = [
            each.image for each in self._writes if each.phase is Phase.OVERTAKEN and each.number > shown
        ]
        return overtaken[-1] if overtaken else None

    def newest_that_shows_like(self, image: Request) -> Request:
        """The newest image that has arrived for certain and has the same echo as this one.

        The gripper has that image, or is about to: speed and force have no echo.
        """
        alike = {each.echo for each in self._writes if each.image is image}
        newest = [each.image for each in self._writes if each.phase in _ARRIVED and each.echo in alike]
        return newest[-1] if newest else image

    def acts(self, number: int, now: float) -> bool:
        """Whether the write of this number, or a later one, acts by now.

        It does when its echo has shown, or a long enough time after its acknowledgement.
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
        # All these have the same echo. Equal images act at once; a speed or a force may take SILENT_S.
        return age >= SILENT_S or all(each.image == last.image for each in waiting)

    def is_old(self, number: int, now: float) -> bool:
        """Whether the write of this number never showed, and was acknowledged so long ago that it acts."""
        if self._shown is None or self._shown.number >= number:
            return False
        return any(
            each.number == number and each.phase is not Phase.SENT and now - each.time >= WINDOW_S
            for each in self._writes
        )

    def _forget(self, now: float) -> None:
        """Drop the writes that are older than the window, except the newest of them: the gripper has that."""
        writes = self._writes
        if len(writes) == 1:
            return
        old: list[_Write] = []
        while writes and now - writes[0].time > WINDOW_S:  # the oldest write is the first
            old.append(writes.popleft())
        settled = [each for each in old if each.phase in _SETTLED]
        on_the_line = [each for each in old if each.phase is Phase.SENT]  # the last write at most
        writes.extendleft(reversed([*settled[-1:], *on_the_line]))
        self._has_waiting = self._has_waiting and self._any_waits()
