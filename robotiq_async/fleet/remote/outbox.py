"""Outbox: commands of a control loop on their way to the agent. For each axis the last value wins."""

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
from .client import Client
from .pending_request import PendingRequest

UNDER_WAY: Final = 4  # unanswered requests at a time: enough for 200 a second up to a round trip of 20 ms
ANSWER_S: Final = 1.0  # seconds for the answer to a command


class Outbox:
    """Merges commands while UNDER_WAY requests are unanswered. They keep their order among other requests."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._asked: Call | None = None
        """The lease, and the newest stamp, at the time of the oldest waiting command."""
        self._waiting: dict[Finger, dict[str, int]] = {}
        self._under_way = 0
        self._motions = 0

    @property
    def is_moving(self) -> bool:
        """Whether a motion was asked for that the agent has not answered yet."""
        return self._motions > 0 or any("position" in changes for changes in self._waiting.values())

    def put(self, axes: Finger, changes: dict[str, int]) -> None:
        if self._asked is None or not self._is_under_this_lease(self._asked):
            self.clear()
            self._asked = self._client.call()
        for axis in axes:
            self._waiting.setdefault(axis, {}).update(changes)
        self._send_next()

    def clear(self) -> None:
        self._waiting.clear()
        self._asked = None

    def drop(self) -> None:
        if self._waiting:
            self._client.log.info("stopped: commands that were not sent yet are dropped")
        self.clear()

    def flush(self) -> None:
        """Send the waiting commands now, because another request follows."""
        asked, self._asked = self._asked, None
        waiting, self._waiting = self._waiting, {}
        if waiting and asked is not None and self._is_under_this_lease(asked):
            is_motion = any("position" in changes for changes in waiting.values())
            arguments = {"axes": {str(int(axis)): changes for axis, changes in waiting.items()}}
            # With the stamp of its first command: the time in the outbox counts like time in the network.
            call = replace(self._client.call(arguments), seen=asked.seen)
            posted = self._client.requests.post(
                call, "cmd/command", timeout=ANSWER_S, urgency=Urgency.COMMAND
            )
            self._under_way += 1
            asking = self._client.spawn(self._await(posted))
            asking.add_done_callback(lambda _: self._done())
            if is_motion:
                self.count_motion(asking)

    def _is_under_this_lease(self, asked: Call) -> bool:
        lease = self._client.lease
        return lease.is_held and (asked.epoch, asked.lease) == (self._client.mirror.epoch, lease.number)

    def count_motion(self, asking: asyncio.Task[Any]) -> None:
        """Count a request as a motion until it is answered."""
        self._motions += 1

        def done(_: object) -> None:
            self._motions -= 1

        asking.add_done_callback(done)

    @contextmanager
    def motion(self) -> Iterator[None]:
        self._motions += 1
        try:
            yield
        finally:
            self._motions -= 1

    def _send_next(self) -> None:
        if self._under_way < UNDER_WAY and not self._client.is_over:
            self.flush()

    def _done(self) -> None:
        self._under_way -= 1
        try:
            self._send_next()
        except RobotiqError as error:
            self._client.log.warning("a command was not sent: %s", error)

    async def _await(self, posted: PendingRequest) -> None:
        try:
            await self._client.answer(posted)
        except NotStartedError:
            pass  # the next command() raises it
        except ControlLostError as error:
            if error.reason == "late":  # any other is raised by the next command()
                self._client.log.warning("a command was not carried out: %s", error)
        except (RobotiqError, TypeError, ValueError) as error:
            self._client.log.warning("a command was not carried out: %s", error)
