"""Outbox: what a control loop asks for, on its way to the agent. The last value wins."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from ...enums import AXES, Finger
from ...errors import ControlLostError, RobotiqError
from ...log import log
from ..network.bus import Urgency
from ..wire.envelope import Call
from .session import RemoteSession

UNDER_WAY: Final = 4
"""Requests that may be unanswered at a time; 200 a second need no more up to 20 ms of round trip."""
ANSWER_S: Final = 1.0


class Outbox:
    """Merges what is asked while enough is under way."""

    def __init__(self, session: RemoteSession) -> None:
        """Send through a session."""
        self._session = session
        self._waiting: dict[Finger, dict[str, int]] = {}
        self._asked: Call | None = None
        """As which the oldest of those that wait would have gone out: its lease, and what was heard then."""
        self._under_way = 0
        self._motions = 0

    @property
    def is_moving(self) -> bool:
        """Whether a motion was asked for that the agent has not answered for yet."""
        return self._motions > 0 or any("position" in changes for changes in self._waiting.values())

    def put(self, axes: Finger, changes: dict[str, int]) -> None:
        """Ask axes for something."""
        asked = self._session.call()
        if self._asked is None or (self._asked.epoch, self._asked.lease) != (asked.epoch, asked.lease):
            self._waiting.clear()  # what was asked under a lease that has ended
            self._asked = asked
        for axis in AXES:
            if axis in axes:
                self._waiting.setdefault(axis, {}).update(changes)
        self._send_next()

    def clear(self) -> None:
        """Forget what has not gone out."""
        self._waiting.clear()
        self._asked = None

    def _send_next(self) -> None:
        if self._waiting and self._under_way < UNDER_WAY and not self._session.is_over:
            self._under_way += 1
            self._session.spawn(self._send())

    async def _send(self) -> None:
        waiting, self._waiting = self._waiting, {}
        asked, self._asked = self._asked, None
        is_motion = any("position" in changes for changes in waiting.values())
        self._motions += is_motion
        arguments = {"axes": {str(int(axis)): changes for axis, changes in waiting.items()}}
        try:
            if asked is not None:
                # The time it has waited here counts like the time on its way.
                call = replace(
                    self._session.call(arguments), epoch=asked.epoch, lease=asked.lease, seen=asked.seen
                )
                await self._session.send(call, "cmd/command", timeout=ANSWER_S, urgency=Urgency.COMMAND)
        except ControlLostError as error:
            if error.reason == "late":  # any other is raised by the next command()
                log.warning("%s: a command was not carried out: %s", self._session.name, error)
        except (RobotiqError, TypeError, ValueError) as error:
            log.warning("%s: a command was not carried out: %s", self._session.name, error)
        finally:
            self._under_way -= 1
            self._motions -= is_motion
            self._send_next()
