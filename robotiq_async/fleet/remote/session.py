"""RemoteSession: one run of a remote hand, from its start to its stop."""

# Theory of operation
#
# The agent has the gripper. A run here has three things, which change for different reasons:
#
# * the mirror: the last words of the agent about the gripper (mirror.py). Every message names its gripper and
#   the run of its agent. A message about another gripper is dropped, and so is an older one than the last.
# * the lease: whether this client commands (lease_state.py). The keeper renews it several times in a window.
# * the dialog: requests without an answer (dialog.py), each an errand (errand.py).
#
# Silence ends control on both sides. Without renewals for a window the agent holds moving axes; when nothing
# was heard for a window the lease here is lost, and requests get no answer any more. If this loop was held
# up, that is no silence: the messages that have arrived are handled first. A new run of the agent ends the
# lease at once.
#
# Events are numbered, and the network may drop some: the missing ones are fetched, as far as the agent still
# has them.
#
# The end takes 2 s at most. It sends only requests that end motion, and the lease goes with the strongest
# level that was requested: a halt or a hold without an answer makes a gentle one stronger.

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from typing import Any, Final

from ...hands import Channels, StateWaiters, Statistics
from ...runtime import Limit, Log, now
from ...values import (
    ConnectFailedError,
    ConnectionLostError,
    NotStartedError,
    RobotiqError,
    State,
    StopLevel,
    Trigger,
)
from ..errors import AgentError, NotAllowedError
from ..limited_log import LimitedLog
from ..network.bus import Bus, Undo
from ..wire.names import GripperName
from ..wire.status_message import unpack
from ..wire.values import reading
from .dialog import Dialog
from .errand import NoAnswerError
from .lease_keeper import ANSWER_S, RENEWALS, LeaseKeeper
from .mirror import Mirror

PAUSE_S: Final = 0.02
"""Seconds between two questions for events: 50 a second, half the budget of a client."""
CONNECT_S: Final = 5.0  # seconds to find the agent
END_S: Final = 1.9  # seconds for the end of a run: a stop promises 2 s
BUS_S: Final = 1.0  # of END_S: seconds that closing a session of zenoh may take


class RemoteSession:
    """One run: receives the messages of the agent, and notices its silence.

    Attributes:
        waiters: calls that wait for a state.
        dialog: the requests to the agent.
        keeper: of the lease.
    """

    def __init__(
        self,
        name: GripperName,
        bus: Bus,
        channels: Channels,
        *,
        owns_bus: bool,
        before: Dialog | None,
    ) -> None:
        """Subscribe to the gripper. The channels outlive the run; ``before`` is the last one's dialog."""
        self.waiters: StateWaiters = StateWaiters()
        mirror = None if before is None else before.mirror
        self.mirror: Mirror = Mirror(name.mark, channels, self.waiters.reached, mirror, Log(str(name)))
        self.dialog: Dialog = Dialog(name, bus, self.mirror, before, receive=self._receive_answer)
        self.keeper: LeaseKeeper = LeaseKeeper(self.dialog, bus)
        self.statistics: Statistics | None = None
        self._bus = bus
        self._channels = channels
        self._owns_bus = owns_bus
        self._closing: asyncio.Task[None] | None = None
        self._arrived_at = 0.0  # arrival of the last message, current or not
        self._other_version: AgentError | None = None  # the error of the last message, if it was of another
        self._is_fetching = False
        self._querying: asyncio.Task[Any] | None = None
        channels.reopen(self.dialog.loop)
        self.mirror.begin(now())
        self._unreadable = LimitedLog(self.mirror.log)
        # One wildcard, not a subscription for each key, with which zenoh has delivered samples under wrong
        # keys (docs/decisions/fleet.md). So every payload identifies its gripper, too.
        self._undo: Undo = bus.subscribe(name.key("*"), self._receive)

    # -- start and end ---------------------------------------------------------------------------------

    async def connect(self, timeout: float, *, acquires: bool) -> None:
        """Wait for the agent, and acquire the lease if that is requested; errors as of RemoteHand.start()."""
        limit = Limit(timeout)
        try:
            while not await self._ask_info(limit):
                if limit.left <= 0:
                    await self._give_up()
                await asyncio.sleep(0.05)
            if acquires:
                await self.keeper.begin(limit)
            self.dialog.spawn(self._supervise())
            await self._wait_for_gripper(limit.left)
        finally:
            limit.stop()

    async def _wait_for_gripper(self, seconds: float) -> None:
        known = set(State) - {State.DISCONNECTED, State.SHUTDOWN, State.DO_SHUTDOWN}
        if self.mirror.state in known:
            return
        with self.waiters.watching(known, {}) as reached:
            with Limit(max(ANSWER_S, seconds)) as limit:
                await reached
            # An event arrives before the status that shows it; an answer brings the newest status.
            info = await self.dialog.ask("info", timeout=ANSWER_S)
            if limit.is_over:
                why = f"its agent cannot reach the gripper: {info['problem'] or 'the link is down'}"
                raise ConnectFailedError(str(self.dialog.name), why)

    async def _ask_info(self, limit: Limit) -> bool:
        try:
            info = await self.dialog.ask("info", timeout=min(ANSWER_S, max(0.05, limit.left)))
        except (NoAnswerError, NotAllowedError):
            return False
        with reading("its figures"):
            self.dialog.set_window(info["window"])
            self._receive_summary(info)
        return True

    async def _give_up(self) -> None:
        name = self.dialog.name
        if self._other_version is not None:
            raise AgentError(f"{name}: its agent sends {self._other_version.message}")
        if await self._bus.announced(name.key("alive", "*"), timeout=ANSWER_S):
            raise NotAllowedError(f"{name}: the agent is running, but does not answer: access denied")
        why = "no agent was found: none is running, or the network or a certificate prevents the connection"
        raise ConnectFailedError(str(name), why)

    def close(self, level: StopLevel) -> asyncio.Task[None]:
        """End the run within 2 s; all calls return the same task, which ends with the run.

        From this call on only requests that end motion are sent. Of several calls the strongest level
        applies. A hold or a halt that is not acknowledged yet makes a gentle level stronger.
        """
        if self._closing is None:
            level = max(level, self.dialog.needed_level)
            self.dialog.end()
            self.mirror.shut_down(State.DO_SHUTDOWN, Trigger.ASK_STOP, now())
            self._closing = self.dialog.loop.create_task(self._close())
        self.keeper.end(level)
        return self._closing

    async def _close(self) -> None:
        try:
            with Limit(END_S - BUS_S if self._owns_bus else END_S) as limit:
                await self.dialog.halted()
                await self.keeper.released()
            if limit.is_over:
                raise TimeoutError
        except (RobotiqError, TimeoutError) as error:
            why = str(error) or "no answer in time"
            self.dialog.log.warning(
                "the release was not acknowledged (%s): the agent is to hold the moving axes", why
            )
        finally:
            self._undo()
            self.keeper.end_watch()
            await self.dialog.close()
            if self._owns_bus:
                await self._bus.close()
            self._end()

    def _end(self) -> None:
        self.dialog.finish()
        self.mirror.shut_down(State.SHUTDOWN, Trigger.STOPPED, now())
        self.waiters.fail(lambda: NotStartedError("the hand was stopped"))
        self._channels.end()

    @property
    def is_over(self) -> bool:
        """Whether the run has ended, or is ending."""
        return self.dialog.is_over

    def check_running(self) -> None:
        self.dialog.check_running()

    @property
    def loop(self) -> asyncio.AbstractEventLoop:
        """The event loop that it runs in."""
        return self.dialog.loop

    # -- messages -------------------------------------------------------------------------------------

    def _receive(self, _key: str, payload: bytes) -> None:
        try:
            with reading("a message"):
                if payload[:1] == b"{":
                    self._receive_fields(json.loads(payload))
                else:
                    self._receive_status(payload, in_turn=True)
        except RobotiqError as error:
            self._other_version = error if isinstance(error, AgentError) else None
            self._unreadable.warn("a message was dropped: %s", error)
        if self.mirror.has_missed() and not self.is_over and not self._is_fetching:
            self._is_fetching = True
            self.dialog.spawn(self._fetch_events())

    async def _fetch_events(self) -> None:
        # The network dropped events; the agent keeps the last ones.
        mirror = self.mirror
        try:
            while mirror.has_missed():
                info = await self.dialog.ask("info", {"since": mirror.events}, timeout=ANSWER_S)
                with reading("events"):
                    events = info["events"]
                    if info["epoch"] == mirror.epoch and events:
                        mirror.skip_events(events[0]["index"] - 1)
                        mirror.receive_events(events)
                await asyncio.sleep(PAUSE_S)
        except RobotiqError as error:
            self.dialog.log.info("missed events could not be fetched: %s", error)
        finally:
            self._is_fetching = False

    def _receive_answer(self, payload: bytes, asked: float) -> None:
        self._receive_status(payload, in_turn=False, asked=asked)

    def _receive_status(self, payload: bytes, *, in_turn: bool, asked: float | None = None) -> bool:
        # Returns whether it is about this gripper.
        message, arrival = unpack(payload), now()
        if self.mirror.is_about_another(message.mark):
            return False
        if self.mirror.is_of_another_run(message, arrival, self.dialog.window):
            return False
        if self.mirror.epoch not in (0, message.epoch):
            self.dialog.lose_lease("closed", "the agent was restarted")
            self.dialog.fall_silent()  # requests to the previous run will not be answered
        self._arrived_at = arrival
        # A copy of an earlier one may arrive when the agent is gone.
        is_new = message.epoch != self.mirror.epoch or message.stamp > self.mirror.stamp
        if not self.mirror.receive(message, arrival, in_turn=in_turn, window=self.dialog.window, asked=asked):
            return True  # about this gripper, but too old
        if is_new:
            self.dialog.heard()
        if in_turn:
            self.keeper.receive(message.lease)
        return True

    def _receive_fields(self, fields: Mapping[str, Any]) -> None:
        if self.mirror.is_about_another(fields["mark"]):
            return
        if "statistics" in fields:
            self._receive_summary(fields)
        elif self._receive_status(bytes.fromhex(fields["status"]), in_turn=True):
            self.mirror.receive_events(fields["events"])

    def _receive_summary(self, fields: Mapping[str, Any]) -> None:
        self.statistics = Statistics.from_dict(fields["statistics"])
        self.mirror.receive_points(fields)
        self.mirror.receive_inhibit(fields)

    async def _supervise(self) -> None:
        interval = self.dialog.window / RENEWALS
        while True:
            due = now() + interval
            await asyncio.sleep(interval)
            woken = now()
            # After a delay of this loop, the messages that have arrived are handled first.
            if woken - due < interval and woken - self.mirror.received_at > self.dialog.window:
                self._fall_silent(woken)
            if self.mirror.is_silent and woken - self._arrived_at < interval:
                self._query_agent()
            self.keeper.maintain()

    def _query_agent(self) -> None:
        # All that arrives seems old: it is, or the clock of the agent stopped. The answer to a question
        # decides.
        if self._querying is None or self._querying.done():
            self._querying = self.dialog.spawn(self.dialog.ask_quietly("info", {}, ANSWER_S))

    def _fall_silent(self, at: float) -> None:
        if self.mirror.is_silent:
            return
        self.dialog.log.warning("the agent is silent")
        self.mirror.fall_silent(at)
        self.dialog.lose_lease("expired", "the agent is silent")
        self.dialog.fall_silent()

    def check_control(self) -> None:
        if self.mirror.is_silent:
            raise ConnectionLostError(f"{self.dialog.name}: the agent is silent: nothing was sent")
        self.dialog.lease.check()
