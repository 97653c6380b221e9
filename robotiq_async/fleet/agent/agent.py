"""Agent: serves the hands of one host to other hosts."""

from __future__ import annotations

import asyncio
import logging
import math
import secrets
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

from ...local import RobotiqHand
from ...runtime import Log, now
from ..control.lease import LEASE_WINDOW_S
from ..errors import AgentError
from ..limited_log import LimitedLog
from ..network.bus import Bus, MessageKind, Query, Sort, Undo
from ..wire.envelope import AgentCall, failure
from ..wire.names import ROOT, GripperName
from .questions import AgentQuestions
from .records import Records
from .served_hand import ServedHand

SUMMARY_S: Final = 1.0  # seconds from one summary to the next
BEATS: Final = 5  # statuses per window that are sent even if nothing changes
AGENT_LOOK_S: Final = 0.3  # seconds to wait for the tokens of other agents: a router may forward them late
EPOCH_BITS: Final = 53  # bits of an epoch: JSON readers that use doubles represent it exactly


class Agent:
    """Owns the hands of one host and serves them, each in a separate task.

    Attributes:
        hands: the served hands, each under the name of its gripper.
        epoch: random; identifies this run of the agent.
    """

    def __init__(
        self,
        site: str,
        host: str,
        hands: Mapping[str, RobotiqHand],
        bus: Bus,
        *,
        window: float = LEASE_WINDOW_S,
        records: Records | None = None,
        asleep: Callable[[], float] | None = None,
    ) -> None:
        """Serve hands that are not started, over an open bus. Sends nothing yet.

        Args:
            site: the site's name.
            host: this host's name.
            hands: by the names of their grippers.
            bus: stays open.
            window: of the leases, in seconds; see :class:`~robotiq_async.fleet.control.lease.Lease`.
            records: keeps, for the next run of the agent, which clients may reacquire the lease
                automatically. With None no client may after a restart.
            asleep: returns the seconds for which this machine has been suspended so far; None reads it
                from the system.
        """
        self._suspended = asleep or _suspended
        self._suspended_s = self._suspended()
        self.epoch: int = secrets.randbits(EPOCH_BITS)
        self._bus = bus
        self._records = records or Records()
        self._window = window
        self._running: asyncio.Task[Any] | None = None
        self._invalid_tokens = LimitedLog()
        self._conflicts: dict[str, LimitedLog] = {}
        """Warnings by gripper, limited: a token of another agent may come and go thousands of times."""
        self._prefix = f"{ROOT}/{site}/{host}"
        self.hands: dict[str, ServedHand] = {
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
        """Serve until cancelled; then stop the fingers and close the links.

        A gripper that cannot be reached is tried again every second. Axes that move when the agent connects
        are held, because their client is gone.

        Args:
            ready: called when the agent begins to answer requests.

        Raises:
            AgentError: another agent serves one of the grippers, or has the same site and host.
        """
        undo: list[Undo] = []
        hands = self.hands.values()
        self._running, loop = asyncio.current_task(), asyncio.get_running_loop()
        try:
            await self._refuse_beside_others()
            undo += [self._bus.announce(each.name.key("alive", str(self.epoch))) for each in hands]
            # Of several agents that start at the same moment the agent with the lowest epoch remains. An
            # agent that is there at the second look started before this one, and its token came late.
            if await self._refuse_beside_others(before=self.epoch):
                await self._refuse_beside_others()
            for each in hands:
                each.resume()
            undo.append(self._bus.watch(f"{self._prefix}/*/alive/*", self._report_conflict))
            questions = AgentQuestions(loop.time)
            sorts: dict[str, Sort] = {
                f"{self._prefix}/*/halt": lambda *_: MessageKind.HALT,
                f"{self._prefix}/*/lease": self._sort,
                f"{self._prefix}/*/cmd/*": self._sort,
            }
            # Questions about other grippers have no limit (network/configuration.py): zenoh drops them all.
            # At "info" clients of version 1 ask: the answer says that this is another version.
            sorts |= {each.name.key(verb): questions.sort for each in hands for verb in ("info/*", "info")}
            undo += [self._bus.serve(key, self._receive, sort) for key, sort in sorts.items()]
            ready()
            async with asyncio.TaskGroup() as group:
                for each in hands:
                    group.create_task(each.run())
                group.create_task(self._report())
        finally:
            for take_back in reversed(undo):
                take_back()
            if not loop.is_closed():
                await self._records.kept()

    async def _refuse_beside_others(self, *, before: float = math.inf) -> bool:
        """Refuse to serve beside an agent with an epoch ``before`` one; returns whether there is another."""
        await asyncio.sleep(AGENT_LOOK_S)
        others = await self._others()
        for epoch, name in others:
            if epoch < before:
                raise AgentError(f"{self._conflict_with(name)}: nothing was done")
        return bool(others)

    def _conflict_with(self, name: GripperName) -> str:
        if name.gripper in self.hands:
            return f"another agent serves {name} already"
        return (
            f"another agent with this host name serves {name}: give each agent a different host in its file"
        )

    async def _others(self) -> list[tuple[int, GripperName]]:
        """The grippers that other agents of this site and host serve, each with the epoch of that agent."""
        keys = await self._bus.announced(f"{self._prefix}/*/alive/*", timeout=AGENT_LOOK_S)
        return [other for other in map(self._other, keys) if other is not None]

    def _other(self, key: str) -> tuple[int, GripperName] | None:
        """The agent and gripper of a token; None if it is a token of this agent, or invalid."""
        try:
            epoch, name = int(key.rpartition("/")[2]), GripperName.of_key(key)
        except ValueError:
            self._invalid_tokens.warn("invalid liveliness token: %r", key)
            return None
        return (epoch, name) if epoch != self.epoch else None

    def _report_conflict(self, key: str, is_there: bool) -> None:
        other = self._other(key)
        if is_there and other is not None:
            _, name = other
            limited = self._conflicts.setdefault(name.gripper, LimitedLog(Log(name.gripper)))
            is_logged = limited.warn("%s: stop one of them", self._conflict_with(name), level=logging.ERROR)
            if is_logged and name.gripper in self.hands:
                self.hands[name.gripper].publisher.add({"kind": "conflict", "key": key})

    def _sort(self, key: str, read: Callable[[], bytes]) -> MessageKind:
        # In a thread of zenoh. Who commands does not wait for the requests of others, which say who they are.
        served = self.hands.get(key.split("/")[4])
        return (
            MessageKind.REQUEST if served is None or served.may_be_of_holder(read()) else MessageKind.OTHERS
        )

    def _receive(self, query: Query) -> None:
        self._look_at_clocks()
        if self._running is not None and self._running.cancelling():
            # Cancelled, but the tasks of the hands have not run since.
            for each in self.hands.values():
                each.refuse_requests()
        try:
            name = GripperName.of_key(query.key)
        except ValueError as no_name:
            refused = AgentError(f"not a request for one gripper: {no_name}")
            query.reply(failure(AgentCall("", ""), self.epoch, refused, begun=False).pack())
            return
        served = self.hands.get(name.gripper)
        if served is not None:  # else the key is wrong, or there is no such gripper
            served.receive(query.key.removeprefix(f"{name.base}/"), query)

    async def _report(self) -> None:
        interval = self._window / BEATS
        summary_due = now()
        while True:
            for each in self.hands.values():
                each.publisher.beat(interval)
            if now() >= summary_due:
                summary_due += SUMMARY_S
                for each in self.hands.values():
                    each.publisher.send_summary()
            self._look_at_clocks()
            await asyncio.sleep(interval)

    def _look_at_clocks(self) -> None:
        # The monotonic clock stops while the machine is suspended, so expired leases would look fresh.
        suspended = self._suspended()
        if suspended - self._suspended_s > self._window / BEATS:
            self._suspended_s = suspended
            for each in self.hands.values():
                each.wake()


def _suspended() -> float:
    """Seconds for which this machine has been suspended since its start; 0 where the system has no figure."""
    if not hasattr(time, "CLOCK_BOOTTIME"):
        return 0.0
    return time.clock_gettime(time.CLOCK_BOOTTIME) - time.clock_gettime(time.CLOCK_MONOTONIC)
