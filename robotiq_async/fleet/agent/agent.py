"""Agent: serves the hands of one host to other hosts."""

from __future__ import annotations

import asyncio
import logging
import secrets
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

from ...hand.robotiq_hand import RobotiqHand
from ...runtime.clock import now
from ...runtime.log import Log
from ...values.errors import AgentError
from ..control.lease import WINDOW_S
from ..limited_log import LimitedLog
from ..network.bus import Bus, Query, Undo
from ..wire.envelope import Answer
from ..wire.names import ROOT, GripperName
from ..wire.values import error_fields
from .questions import Questions
from .records import NoRecords, Records
from .served_hand import ServedHand

SUMMARY_S: Final = 1.0
BEATS: Final = 5
"""How many signs of life there are in a window, also when nothing happens."""
LOOK_S: Final = 0.3
"""How long another agent has to show itself: a router may not have told yet."""
EPOCH_BITS: Final = 53
"""Of an epoch: those who read JSON have doubles."""


class Agent:
    """Owns the hands of one host and serves them, each with a task of its own.

    Attributes:
        hands: what is served, by the name of the gripper.
        epoch: random: tells this run of the agent from all others.
    """

    def __init__(
        self,
        site: str,
        host: str,
        hands: Mapping[str, RobotiqHand],
        bus: Bus,
        *,
        window: float = WINDOW_S,
        records: Records | None = None,
        asleep: Callable[[], float] | None = None,
    ) -> None:
        """Serve hands that are not started over an open bus; nothing is sent yet.

        Args:
            site: the site's name.
            host: this host's name.
            hands: by the names of their grippers.
            bus: is left open.
            window: of the leases, in seconds; see :class:`~robotiq_async.fleet.control.lease.Lease`.
            records: where the next run of the agent finds who may come back to command by itself; None for
                nowhere: then nobody does.
            asleep: seconds for which this machine has been suspended so far; None asks the system.
        """
        self._asleep = asleep or _asleep
        self._slept = self._asleep()
        self.epoch = secrets.randbits(EPOCH_BITS)
        self._bus = bus
        self._records = records or NoRecords()
        self._window = window
        self._running: asyncio.Task[Any] | None = None
        self._strange = LimitedLog()
        self._conflicts: dict[str, LimitedLog] = {}
        """By gripper: a token of another agent may come and go thousands of times."""
        self._prefix = f"{ROOT}/{site}/{host}"
        self.hands = {
            name: ServedHand(
                GripperName(site, host, name),
                hand,
                bus,
                self._records,
                epoch=self.epoch,
                window=window,
            )
            for name, hand in hands.items()
        }

    async def run(self, ready: Callable[[], object] = lambda: None) -> None:
        """Serve until cancelled; then the fingers are stopped and the links closed.

        Grippers that cannot be reached are tried again and again. What moves when the agent has connected
        is held: whoever set it going is not there any more.

        Args:
            ready: is called when requests are answered from now on.

        Raises:
            AgentError: another agent serves one of the grippers, or has the same site and host.
        """
        undo: list[Undo] = []
        self._running, loop = asyncio.current_task(), asyncio.get_running_loop()
        try:
            await self._refuse_if_served()
            undo += [self._bus.announce(each.name.key("alive", str(self.epoch))) for each in self._all]
            await self._refuse_if_another_began()
            for each in self._all:
                each.resume()
            undo.append(self._bus.watch(f"{self._prefix}/*/alive/*", self._see_agent))
            undo.append(self._bus.serve(f"{self._prefix}/*/info", self._hear, Questions(loop.time).allow))
            undo += [
                self._bus.serve(f"{self._prefix}/*/{verb}", self._hear) for verb in ("lease", "halt", "cmd/*")
            ]
            ready()
            async with asyncio.TaskGroup() as group:
                for each in self._all:
                    group.create_task(each.run())
                group.create_task(self._tell())
        finally:
            for take_back in reversed(undo):
                take_back()
            if not loop.is_closed():
                await self._records.kept()

    @property
    def _all(self) -> list[ServedHand]:
        return list(self.hands.values())

    async def _refuse_if_served(self) -> None:
        await asyncio.sleep(LOOK_S)
        for _, name in await self._others():
            raise AgentError(f"{self._said_of(name)}: nothing was done")

    async def _refuse_if_another_began(self) -> None:
        """Of agents that start at the same moment the one with the lowest epoch stays."""
        for is_last in (False, True):
            await asyncio.sleep(LOOK_S)
            others = await self._others()
            for epoch, name in others:
                # One that does not go has been there for longer; it was only seen late.
                if is_last or epoch < self.epoch:
                    raise AgentError(f"{self._said_of(name)}: nothing was done")
            if not others:
                return

    def _said_of(self, name: GripperName) -> str:
        """What is wrong when another agent serves a gripper."""
        if name.gripper in self.hands:
            return f"another agent serves {name} already"
        return (
            f"another agent has this host name, and serves {name}: each needs a host of its own in its file"
        )

    async def _others(self) -> list[tuple[int, GripperName]]:
        """What other agents of this site and host serve, each with the other's epoch."""
        keys = await self._bus.announced(f"{self._prefix}/*/alive/*", timeout=LOOK_S)
        return [other for other in map(self._other, keys) if other is not None]

    def _other(self, key: str) -> tuple[int, GripperName] | None:
        """Whose token this is, if it is another agent's."""
        try:
            epoch, name = int(key.rpartition("/")[2]), GripperName.of_key(key)
        except ValueError:
            self._strange.warn("invalid liveliness token: %r", key)
            return None
        return (epoch, name) if epoch != self.epoch else None

    def _see_agent(self, key: str, is_there: bool) -> None:
        other = self._other(key)
        if is_there and other is not None:
            _, name = other
            limited = self._conflicts.setdefault(name.gripper, LimitedLog(Log(name.gripper)))
            is_told = limited.warn("%s: one of them has to go", self._said_of(name), level=logging.ERROR)
            if is_told and name.gripper in self.hands:
                self.hands[name.gripper].publisher.add({"kind": "conflict", "key": key})

    def _hear(self, query: Query) -> None:
        self._look_at_clocks()
        if self._running is not None and self._running.cancelling():
            # Told to end, and its tasks have not had a turn yet.
            for each in self._all:
                each.refuse_requests()
        try:
            name = GripperName.of_key(query.key)
        except ValueError as no_name:
            refused = AgentError(f"not a request for one gripper: {no_name}")
            query.reply(Answer("", 0, self.epoch, error=error_fields(refused)).pack())
            return
        served = self.hands.get(name.gripper)
        if served is not None:  # else it is another's, that came under a wrong key, or nobody's
            served.hear(query.key.removeprefix(f"{name.base}/"), query)

    async def _tell(self) -> None:
        """Signs of life, summaries, and an eye on the clock."""
        interval = self._window / BEATS
        summary_due = now()
        while True:
            for each in self._all:
                each.publisher.beat(interval)
            if now() >= summary_due:
                summary_due += SUMMARY_S
                for each in self._all:
                    each.publisher.send_summary()
            self._look_at_clocks()
            await asyncio.sleep(interval)

    def _look_at_clocks(self) -> None:
        """The clock that everything goes by stands still while the machine is suspended."""
        slept = self._asleep()
        if slept - self._slept > self._window / BEATS:
            self._slept = slept
            for each in self._all:
                each.wake()


def _asleep() -> float:
    """Seconds for which the machine has been suspended since it was started; 0 where nobody can tell."""
    if not hasattr(time, "CLOCK_BOOTTIME"):
        return 0.0
    return time.clock_gettime(time.CLOCK_BOOTTIME) - time.clock_gettime(time.CLOCK_MONOTONIC)
