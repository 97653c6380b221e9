"""Outbox: what a control loop asks for, on its way to the agent. The last value wins."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, Final

from ...values.enums import Finger
from ...values.errors import ControlLostError, NotStartedError, RobotiqError
from ..network.bus import Urgency
from ..wire.envelope import Call
from .pending_request import PendingRequest
from .session import RemoteSession

UNDER_WAY: Final = 4
"""Requests that may be unanswered at a time; 200 a second need no more up to 20 ms of round trip."""
ANSWER_S: Final = 1.0


class Outbox:
    """Merges what is asked while enough is under way. What it sends keeps its place among other requests."""

    def __init__(self, session: RemoteSession) -> None:
        self._session = session
        self._asked: Call | None = None
        """As which the oldest of those that wait would have gone out: its lease, and what was heard then."""
        self._waiting: dict[Finger, dict[str, int]] = {}
        self._under_way = 0
        self._motions = 0

    @property
    def is_moving(self) -> bool:
        """Whether a motion was asked for that the agent has not answered for yet."""
        return self._motions > 0 or any("position" in changes for changes in self._waiting.values())

    def put(self, axes: Finger, changes: dict[str, int]) -> None:
        """Ask axes for something."""
        if self._asked is None or not self._is_under_this_lease(self._asked):
            self.clear()
            self._asked = self._session.call()
        for axis in axes:
            self._waiting.setdefault(axis, {}).update(changes)
        self._send_next()

    def clear(self) -> None:
        """What waits is not to be sent any more."""
        self._waiting.clear()
        self._asked = None

    def drop(self) -> None:
        """The hand is stopped."""
        if self._waiting:
            self._session.log.info("stopped: what was asked for and not sent yet is dropped")
        self.clear()

    def flush(self) -> None:
        """Send what waits now: something is asked for after it."""
        asked, self._asked = self._asked, None
        waiting, self._waiting = self._waiting, {}
        if waiting and asked is not None and self._is_under_this_lease(asked):
            is_motion = any("position" in changes for changes in waiting.values())
            arguments = {"axes": {str(int(axis)): changes for axis, changes in waiting.items()}}
            # The time it has waited here counts like the time on its way.
            call = replace(self._session.call(arguments), seen=asked.seen)
            posted = self._session.post(call, "cmd/command", timeout=ANSWER_S, urgency=Urgency.COMMAND)
            self._under_way += 1
            asking = self._session.spawn(self._await(posted))
            asking.add_done_callback(lambda _: self._done())
            if is_motion:
                self.count_motion(asking)

    def _is_under_this_lease(self, asked: Call) -> bool:
        now = self._session
        return now.keeper.is_in_control and (asked.epoch, asked.lease) == (now.mirror.epoch, now.keeper.lease)

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
            self._session.log.warning("a command was not sent: %s", error)

    async def _await(self, posted: PendingRequest) -> None:
        try:
            await self._session.answer(posted)
        except NotStartedError:
            pass  # the next command() raises it
        except ControlLostError as error:
            if error.reason == "late":  # any other is raised by the next command()
                self._session.log.warning("a command was not carried out: %s", error)
        except (RobotiqError, TypeError, ValueError) as error:
            self._session.log.warning("a command was not carried out: %s", error)
