"""Outbox: what a control loop asks for, on its way to the agent. The last value wins."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from ...enums import AXES, Finger
from ...errors import ControlLostError, NotStartedError, RobotiqError
from ...log import log
from ..network.bus import Urgency
from .requests import Posted
from .session import RemoteSession

UNDER_WAY: Final = 4
"""Requests that may be unanswered at a time; 200 a second need no more up to 20 ms of round trip."""
ANSWER_S: Final = 1.0


class Outbox:
    """Merges what is asked while enough is under way. What it sends keeps its place among other requests."""

    def __init__(self, session: RemoteSession) -> None:
        """Send through a session."""
        self._session = session
        self._lease = 0
        """What waits was asked for under this lease."""
        self._waiting: dict[Finger, dict[str, int]] = {}
        self._under_way = 0
        self._motions = 0

    @property
    def is_moving(self) -> bool:
        """Whether a motion was asked for that the agent has not answered for yet."""
        return self._motions > 0 or any("position" in changes for changes in self._waiting.values())

    def put(self, axes: Finger, changes: dict[str, int]) -> None:
        """Ask axes for something."""
        if self._lease != self._session.lease:
            self.clear()
            self._lease = self._session.lease
        for axis in AXES:
            if axis in axes:
                self._waiting.setdefault(axis, {}).update(changes)
        self._send_next()

    def clear(self) -> None:
        """What waits is not to be sent any more."""
        self._waiting.clear()

    def flush(self) -> None:
        """Send what waits now: something is asked for after it."""
        if self._lease != self._session.lease or not self._session.is_in_control:
            self.clear()
        if self._waiting:
            waiting, self._waiting = self._waiting, {}
            is_motion = any("position" in changes for changes in waiting.values())
            arguments = {"axes": {str(int(axis)): changes for axis, changes in waiting.items()}}
            call = self._session.call(arguments)
            posted = self._session.post(call, "cmd/command", timeout=ANSWER_S, urgency=Urgency.COMMAND)
            self._under_way += 1
            asking = self._session.spawn(self._await(posted))
            asking.add_done_callback(lambda _: self._done())
            if is_motion:
                self.count_motion(asking)

    def count_motion(self, asking: asyncio.Task[Any]) -> None:
        """Something is under way that may set axes going."""
        self._motions += 1

        def done(_: object) -> None:
            self._motions -= 1

        asking.add_done_callback(done)

    @contextmanager
    def motion(self) -> Iterator[None]:
        """A motion is asked for, and waited for."""
        self._motions += 1
        try:
            yield
        finally:
            self._motions -= 1

    def _send_next(self) -> None:
        if self._under_way < UNDER_WAY and not self._session.is_over:
            self.flush()

    def _done(self) -> None:
        self._under_way -= 1
        try:
            self._send_next()
        except RobotiqError as error:
            log.warning("%s: a command was not sent: %s", self._session.name, error)

    async def _await(self, posted: Posted) -> None:
        try:
            await self._session.answer(posted)
        except (ControlLostError, NotStartedError):
            pass  # the next command() raises it
        except (RobotiqError, TypeError, ValueError) as error:
            log.warning("%s: a command was not carried out: %s", self._session.name, error)
