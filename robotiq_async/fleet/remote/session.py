"""RemoteSession: one run of a remote hand, from its start to its stop."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Coroutine, Mapping
from contextlib import suppress
from typing import Any, Final

from ...runtime.clock import now
from ...runtime.concurrency import check_loop, wait_shielded
from ...runtime.log import Log
from ...session.streams import Channels
from ...session.waiting import StateWaiters
from ...values.checks import check_seconds
from ...values.enums import State, StopLevel, Trigger
from ...values.errors import (
    AgentError,
    ConnectFailedError,
    ConnectionLostError,
    ControlLostError,
    MoveTimeoutError,
    NotAllowedError,
    NotStartedError,
    RobotiqError,
)
from ...values.statistics import Counters, Statistics
from ..control.lease import WINDOW_MAX_S, WINDOW_MIN_S, WINDOW_S
from ..limited_log import LimitedLog
from ..network.bus import Bus, Undo
from ..wire.envelope import Call
from ..wire.names import GripperName
from ..wire.status_message import unpack
from ..wire.values import Fields, read_statistics, reading
from .lease_keeper import ANSWER_S, RENEWALS, Agents, LeaseKeeper
from .mirror import Mirror
from .outbox import Outbox
from .pending_request import PendingRequest
from .requests import NoAnswerError, Requests
from .stops import Stops

PAUSE_S: Final = 0.02
"""Seconds between two questions for events: 50 a second, half of what an agent answers to one client."""
CONNECT_S: Final = 5.0  # seconds to find the agent
OWN: Final = ("info", "lease", "halt", "cmd/cancel")
"""Requests whose arguments come from this library: a TypeError in the answer is not the user's."""


class RemoteSession:
    """One run. It belongs to the event loop that it was made in.

    Attributes:
        waiters: calls that wait for a state.
        requests, keeper, stops, outbox: the requests of this run, its lease, halts, and commands to be sent.
        is_over: whether the run has ended, or is ending.
        has_ended: whether all of it has ended.
        window: of the leases, in seconds.
    """

    def __init__(
        self,
        name: GripperName,
        bus: Bus,
        channels: Channels,
        *,
        wants_control: bool,
        owns_bus: bool = False,
        before: Mirror | None = None,
    ) -> None:
        """Subscribe to the gripper. The channels outlive the run; ``before`` is the mirror of the last."""
        self.name = name
        self.log = Log(str(name))
        self.loop = asyncio.get_running_loop()
        self.waiters = StateWaiters()
        self.mirror = Mirror(name.mark, channels, self.waiters.reached, before, self.log)
        self.is_over = False
        self.has_ended = False
        self.statistics: Statistics = Counters().snapshot(0)
        self._bus = bus
        self._channels = channels
        self._owns_bus = owns_bus
        self._closing: asyncio.Task[None] | None = None
        self.window = WINDOW_S
        self._arrived_at = 0.0  # arrival of the last message, current or not
        self.requests = Requests(name, bus)
        self._tasks: set[asyncio.Task[Any]] = set()
        self._is_fetching = False
        self.keeper = LeaseKeeper(self, wants_control=wants_control)
        self.stops = Stops(self)
        self.outbox = Outbox(self)
        self._querying: asyncio.Task[Any] | None = None
        channels.reopen(self.loop)
        self.mirror.begin(now())
        self._unreadable, self._misrouted = LimitedLog(self.log), LimitedLog(self.log)
        # One wildcard, not a subscription for each key: with those, zenoh has delivered samples under wrong
        # keys (docs/decisions/fleet.md). So every payload identifies its gripper, too.
        self._undo: Undo = bus.subscribe(name.key("*"), self._receive)
        self.agents = Agents(name, bus, self.keeper.forbid_reacquiring)

    # -- start and end ---------------------------------------------------------------------------------

    async def connect(self, timeout: float) -> None:
        """Wait for the agent, and acquire the lease if wanted; errors as of :meth:`RemoteHand.start`."""
        deadline = now() + timeout
        while not await self._ask_info(deadline):
            if now() >= deadline:
                await self._give_up()
            await asyncio.sleep(0.05)
        await self.keeper.begin(deadline)
        self.spawn(self._supervise())
        await self._wait_for_gripper(deadline)

    async def _wait_for_gripper(self, deadline: float) -> None:
        known = set(State) - {State.DISCONNECTED, State.SHUTDOWN, State.DO_SHUTDOWN}
        if self.mirror.state in known:
            return
        with self.waiters.watching(known, {}) as reached:
            try:
                async with asyncio.timeout(max(ANSWER_S, deadline - now())):
                    await reached
                # An event arrives before the status that shows it; an answer brings the newest status.
                await self.ask("info", timeout=ANSWER_S)
            except TimeoutError:
                problem = (await self.ask("info", timeout=ANSWER_S))["problem"]
                raise ConnectFailedError(
                    str(self.name), f"its agent cannot reach the gripper: {problem or 'the link is down'}"
                ) from None

    async def _ask_info(self, deadline: float) -> bool:
        try:
            info = await self.ask("info", timeout=min(ANSWER_S, max(0.05, deadline - now())))
        except (NoAnswerError, NotAllowedError):
            return False
        with reading("its figures"):
            self.window = check_seconds("window", info["window"], WINDOW_MIN_S, WINDOW_MAX_S)
            self.statistics = read_statistics(info["statistics"])
            self.mirror.receive_points(info)
        return True

    async def _give_up(self) -> None:
        keys = await self._bus.announced(self.name.key("alive", "*"), timeout=ANSWER_S)
        if keys:
            raise NotAllowedError(f"{self.name}: the agent is running, but does not answer: access denied")
        why = "no agent was found: none is running, or the network or a certificate prevents the connection"
        raise ConnectFailedError(str(self.name), why)

    async def close(self, level: StopLevel) -> None:
        """End the run within 2 s, also if the caller is cancelled; every caller waits for the end.

        From this call on only requests that end motion are sent. Of several calls the strongest level
        applies. A hold or a halt that is not acknowledged yet makes a gentle level stronger.
        """
        if self._closing is None:
            self.is_over = True
            is_holding = self.requests.has_undelivered_hold
            level = max(level, self.stops.undelivered, StopLevel.KEEP if is_holding else StopLevel.LEAVE)
            self.mirror.shut_down(State.DO_SHUTDOWN, Trigger.ASK_STOP, now())
            self.requests.end()
            self._closing = self.loop.create_task(self._close())
        self.keeper.end(level)
        await wait_shielded(self._closing)
        self._closing.result()

    async def _close(self) -> None:
        try:
            await self.keeper.released()
        except RobotiqError as error:
            self.log.warning("the release was not acknowledged (%s): the agent holds what moves", error)
        finally:
            await self.stops.halted()
            self._undo()
            self.agents.end()
            for task in self._tasks:
                task.cancel()
            await self.requests.close()
            await asyncio.gather(*self._tasks, return_exceptions=True)
            if self._owns_bus:
                await self._bus.close()
            self._end()

    def _end(self) -> None:
        self.is_over = self.has_ended = True
        self.mirror.shut_down(State.SHUTDOWN, Trigger.STOPPED, now())
        self.waiters.fail(lambda: NotStartedError("the hand was stopped"))
        self._channels.end()

    @property
    def lost_its_loop(self) -> bool:
        """Whether its event loop was closed: its tasks can never end then."""
        return not self.has_ended and self.loop.is_closed()

    def abandon(self) -> None:
        """Give up a run whose event loop was closed. Without renewals the agent holds what moves."""
        self.log.warning("the event loop was closed before stop()")
        self.keeper.abandon()
        self.waiters = StateWaiters()
        self._end()

    def check_running(self) -> None:
        if self.is_over and not self.has_ended:
            raise NotStartedError("the hand was stopped")
        if self.is_over:
            raise NotStartedError("the hand is not started: use 'async with' or start()")
        if self.loop.is_closed():
            raise NotStartedError("the event loop that the hand ran in was closed: start() it again")

    def check_loop(self, what: str = "the hand") -> None:
        check_loop(self.loop, what)

    # -- messages -------------------------------------------------------------------------------------

    def _receive(self, _key: str, payload: bytes) -> None:
        try:
            with reading("a message"):
                if payload[:1] == b"{":
                    self._receive_fields(json.loads(payload))
                else:
                    self._receive_status(payload, in_turn=True)
        except RobotiqError as error:
            self._unreadable.warn("a message was dropped: %s", error)
        if self.mirror.has_missed() and not self.is_over and not self._is_fetching:
            self._is_fetching = True
            self.spawn(self._fetch_events())

    async def _fetch_events(self) -> None:
        # The network dropped events; the agent keeps the last ones.
        mirror = self.mirror
        try:
            while mirror.has_missed():
                info = await self.ask("info", {"since": mirror.events}, timeout=ANSWER_S)
                with reading("events"):
                    events = info["events"]
                    if info["epoch"] == mirror.epoch and events:
                        mirror.skip_events(events[0]["index"] - 1)
                        mirror.receive_events(events)
                await asyncio.sleep(PAUSE_S)
        except RobotiqError as error:
            self.log.info("missed events could not be fetched: %s", error)
        finally:
            self._is_fetching = False

    def _is_about_another(self, mark: object) -> bool:
        if not self.mirror.is_about_another(mark):
            return False
        self._misrouted.warn("a message about another gripper was dropped")
        return True

    def _receive_status(self, payload: bytes, *, in_turn: bool, asked: float | None = None) -> bool:
        # Returns whether it is about this gripper.
        message, arrival = unpack(payload), now()
        if self._is_about_another(message.mark):
            return False
        if self.mirror.is_of_another_run(message, arrival, self.window):
            return False
        if self.mirror.epoch not in (0, message.epoch):
            self.keeper.lose("closed", "the agent was restarted")
            self.requests.fall_silent()  # requests to the previous run will not be answered
        self._arrived_at = arrival
        if not self.mirror.receive(message, arrival, in_turn=in_turn, window=self.window, asked=asked):
            return True  # about this gripper, but too old
        self.requests.receive()
        if in_turn:
            self.keeper.receive(message.lease)
        return True

    def _receive_fields(self, fields: Mapping[str, Any]) -> None:
        if self._is_about_another(fields["mark"]):
            return
        if "statistics" in fields:
            self.statistics = read_statistics(fields["statistics"])
            self.mirror.receive_points(fields)
            return
        if self._receive_status(bytes.fromhex(fields["status"]), in_turn=True):
            self.mirror.receive_events(fields["events"])

    async def _supervise(self) -> None:
        interval = self.window / RENEWALS
        while True:
            due = now() + interval
            await asyncio.sleep(interval)
            woken = now()
            # After a delay of this loop, messages that arrived meanwhile are handled first.
            if woken - due < interval and woken - self.mirror.received_at > self.window:
                self._fall_silent(woken)
            if self.mirror.is_silent and woken - self._arrived_at < interval:
                self._query_agent()
            self.keeper.maintain()

    def _query_agent(self) -> None:
        # All that arrives seems old: it is, or the clock of the agent stopped. The answer to a question
        # decides.
        if self._querying is None or self._querying.done():
            self._querying = self.spawn(self.ask_quietly("info", {}, ANSWER_S))

    def _fall_silent(self, at: float) -> None:
        if self.mirror.is_silent:
            return
        self.log.warning("the agent is silent")
        self.mirror.fall_silent(at)
        self.keeper.lose("expired", "the agent is silent")
        self.requests.fall_silent()

    # -- control ---------------------------------------------------------------------------------------

    def check_control(self) -> None:
        if self.mirror.is_silent:
            raise ConnectionLostError(f"{self.name}: the agent is silent: nothing was asked")
        self.keeper.check()

    # -- asking ----------------------------------------------------------------------------------------

    async def ask(self, verb: str, arguments: Fields | None = None, **how: Any) -> Any:  # noqa: ANN401
        return await self.send(self.call(arguments), verb, **how)

    def call(self, arguments: Fields | None = None) -> Call:
        return self.requests.make(self.mirror, self.keeper.lease, arguments or {})

    async def send(self, call: Call, verb: str, **how: Any) -> Any:  # noqa: ANN401
        return await self.answer(self.requests.post(call, verb, **how))

    async def answer(self, posted: PendingRequest) -> Any:  # noqa: ANN401
        """As :meth:`Requests.answer`, with the outcome of the answer, and NotStartedError after the end."""
        try:
            answer, status = await self.requests.answer(posted)
        except NoAnswerError:
            if not posted.is_allowed_after_stop:
                self.check_running()
            raise
        if status:
            self._receive_status(status, in_turn=False, asked=posted.asked_at)
        try:
            return answer.outcome(self.mirror.clock)
        except (TypeError, ValueError) as error:
            if posted.verb not in OWN:
                raise
            raise AgentError(f"{self.name}: its agent does not understand {posted.verb}: {error}") from error
        except MoveTimeoutError as error:
            error.status = self.mirror.renumbered(error.status)
            raise
        except ControlLostError as error:
            if posted.verb != "lease":
                self.check_running()  # the lease was given back at the end of the run
            if posted.verb != "halt" and error.reason != "late" and posted.call.lease == self.keeper.lease:
                self.keeper.lose(error.reason, str(error))
            raise

    async def ask_quietly(self, verb: str, arguments: Fields, timeout: float) -> None:
        """Ask, and ignore errors: the answer itself has the effect."""
        with suppress(RobotiqError):
            await self.ask(verb, arguments, timeout=timeout)

    def spawn(self, work: Coroutine[Any, Any, Any]) -> asyncio.Task[Any]:
        task = self.loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task
