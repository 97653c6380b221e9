"""Outbox: what a control loop asks for, on its way to the agent. The last value wins."""

from __future__ import annotations

from typing import Final

from ...enums import AXES, Finger
from ...errors import ControlLostError, RobotiqError
from ...log import log
from ..network.bus import Urgency
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
        self._under_way = 0
        self._motions = 0

    @property
    def is_moving(self) -> bool:
        """Whether a motion was asked for that the agent has not answered for yet."""
        return self._motions > 0 or any("position" in changes for changes in self._waiting.values())

    def put(self, axes: Finger, changes: dict[str, int]) -> None:
        """Ask axes for something."""
        for axis in AXES:
            if axis in axes:
                self._waiting.setdefault(axis, {}).update(changes)
        self._send_next()

    def _send_next(self) -> None:
        if self._waiting and self._under_way < UNDER_WAY and not self._session.is_over:
            self._under_way += 1
            self._session.spawn(self._send())

    async def _send(self) -> None:
        waiting, self._waiting = self._waiting, {}
        is_motion = any("position" in changes for changes in waiting.values())
        self._motions += is_motion
        arguments = {"axes": {str(int(axis)): changes for axis, changes in waiting.items()}}
        try:
            if waiting:
                await self._session.ask("cmd/command", arguments, timeout=ANSWER_S, urgency=Urgency.COMMAND)
        except ControlLostError:
            pass  # the next command() raises it
        except (RobotiqError, TypeError, ValueError) as error:
            log.warning("%s: a command was not carried out: %s", self._session.name, error)
        finally:
            self._under_way -= 1
            self._motions -= is_motion
            self._send_next()
