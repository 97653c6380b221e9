"""Outbox: what a control loop asks for, on its way to the agent. The last value wins."""

from __future__ import annotations

from collections.abc import Coroutine
from typing import Any, Final

from ...enums import AXES, Finger
from ...errors import ControlLostError, RobotiqError
from ...log import log
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

    def flush(self) -> None:
        """Send what waits now: what is asked for after it is to come after it."""
        if self._waiting and not self._session.is_over:
            waiting, self._waiting = self._waiting, {}
            arguments = {"axes": {str(int(axis)): changes for axis, changes in waiting.items()}}
            sent = self._session.send(self._session.call(arguments), "cmd/command", timeout=ANSWER_S)
            is_motion = any("position" in changes for changes in waiting.values())
            self._under_way += 1
            self._motions += is_motion
            self._session.spawn(self._wait(sent, is_motion=is_motion))

    def _send_next(self) -> None:
        if self._under_way < UNDER_WAY:
            self.flush()

    async def _wait(self, sent: Coroutine[Any, Any, Any], *, is_motion: bool) -> None:
        try:
            await sent
        except ControlLostError:
            pass  # the next command() raises it
        except (RobotiqError, TypeError, ValueError) as error:
            log.warning("%s: a command was not carried out: %s", self._session.name, error)
        finally:
            self._under_way -= 1
            self._motions -= is_motion
            self._send_next()
