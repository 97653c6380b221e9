"""One run of a remote hand, from its start to its stop: what it hears, what it asks, and its lease."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Coroutine, Mapping
from contextlib import suppress
from typing import Any, Final

from ...concurrency import wait_shielded
from ...enums import State
from ...errors import (
    ConnectFailedError,
    ConnectionLostError,
    ControlLostError,
    NotAllowedError,
    NotStartedError,
    ProtocolError,
    RobotiqError,
)
from ...log import log
from ...session.clock import now
from ...session.event_loop import check_loop
from ...session.state_waiters import StateWaiters
from ...session.statistics import Counters, Statistics
from ...session.streams import Channels
from ..control.lease import WINDOW_S
from ..network.bus import Bus, Undo
from ..wire.envelope import Call
from ..wire.names import GripperName
from ..wire.status_message import unpack
from ..wire.values import Fields, read_statistics
from .mirror import Mirror
from .missed_events import MissedEvents
from .requests import NoAnswerError, Requests, label

RENEWALS: Final = 5
"""So often in a window the lease is renewed, and silence looked for."""
ANSWER_S: Final = 0.5
"""For an answer that the agent gives at once; asked again within the time that there is."""
CONNECT_S: Final = 5.0
HALT_S: Final = 2.0
BY_OTHERS: Final = ("taken", "halted", "held")
"""Reasons for which nobody comes back without having been asked to."""
RELEASE_S: Final = 1.5


class RemoteSession:
    """One run. Everything happens in the event loop it was made in.

    Attributes:
        mirror: what has been heard.
        waiters: who waits for a state.
        is_in_control: whether this hand holds the lease, as far as it knows.
        is_over: whether the run has ended.
        lost: why control was lost; None while it is held, or was never asked for.
    """

    def __init__(self, name: GripperName, bus: Bus, channels: Channels, *, wants_control: bool) -> None:
        """Begin to listen."""
        self.name = name
        self.loop = asyncio.get_running_loop()
        self.waiters = StateWaiters()
        self.mirror = Mirror(name.mark, channels, self.waiters.reached)
        self.is_over = False
        self.is_in_control = False
        self.lost: ControlLostError | None = None
        self.statistics: Statistics = Counters().snapshot(0)
        self._bus = bus
        self._channels = channels
        self._wants_control = wants_control
        self._lease = 0
        self._lease_run = 0  # the run of the agent that the number is of
        self._window = WINDOW_S
        self._heard_at = 0.0  # something current
        self._arrived_at = 0.0  # anything
        self._requests = Requests(name, bus)
        self._tasks: set[asyncio.Task[Any]] = set()
        self._missed = MissedEvents(
            self.mirror,
            lambda since: self.ask("info", {"since": since}, timeout=ANSWER_S),
            self.spawn,
        )
        self._renewing: asyncio.Task[Any] | None = None
        self._finding_out: asyncio.Task[Any] | None = None
        self._looking: asyncio.Task[Any] | None = None
        channels.reopen(self.loop)
        # One wildcard, and every payload says what it is about: samples may come under the wrong key.
        self._undo: Undo = bus.subscribe(name.key("*"), self._hear)

    # -- start and end ---------------------------------------------------------------------------------

    async def connect(self, timeout: float) -> None:
        """Wait until the agent is heard, and acquire the lease if that is wanted.

        Raises:
            ConnectFailedError: nobody there.
            NotAllowedError: the agent is there, and does not answer.
            ControlLostError: another client commands the gripper.
            ConnectFailedError: the agent does not reach the gripper.
        """
        deadline = now() + timeout
        while not await self._ask_info(deadline):
            if now() >= deadline:
                await self._give_up()
            await asyncio.sleep(0.05)
        if self._wants_control:
            await self._acquire_until(deadline)
        self.spawn(self._keep())
        await self._wait_for_gripper(deadline)

    async def _acquire_until(self, deadline: float) -> None:
        """Acquire the lease; again when an answer was lost, until it is time to give up."""
        while True:
            try:
                return await self.acquire()
            except (NoAnswerError, ControlLostError) as error:
                if getattr(error, "reason", "late") != "late" or now() >= deadline:
                    raise

    async def _wait_for_gripper(self, deadline: float) -> None:
        """Wait until the agent has reached the gripper.

        Raises:
            ConnectFailedError: it has not.
        """
        known = set(State) - {State.DISCONNECTED, State.SHUTDOWN, State.DO_SHUTDOWN}
        if self.mirror.state in known:
            return
        with self.waiters.watching(known, {}) as reached:
            try:
                async with asyncio.timeout(max(ANSWER_S, deadline - now())):
                    await reached
            except TimeoutError:
                problem = (await self.ask("info", timeout=ANSWER_S))["problem"]
                raise ConnectFailedError(
                    str(self.name), f"its agent does not reach the gripper: {problem or 'the link is down'}"
                ) from None

    async def _ask_info(self, deadline: float) -> bool:
        """Whether the agent has answered."""
        try:
            info = await self.ask("info", timeout=min(ANSWER_S, max(0.05, deadline - now())))
        except (NoAnswerError, NotAllowedError):
            return False
        self._window = float(info["window"])
        self.statistics = read_statistics(info["statistics"])
        return True

    async def _give_up(self) -> None:
        """Say what can be told apart of why nobody answered."""
        keys = await self._bus.announced(self.name.key("alive", "*"), timeout=ANSWER_S)
        if keys:
            raise NotAllowedError(f"{self.name}: the agent is there, and does not answer: access denied")
        raise ConnectFailedError(
            str(self.name),
            "no agent of it is heard: none runs, or the network or a certificate is in the way",
        )

    async def close(self, failure: NotStartedError, *, halt: bool) -> None:
        """End the run; within two seconds, also when cancelled meanwhile."""
        self.is_over = True
        work = asyncio.ensure_future(self._close(failure, halt=halt))
        await wait_shielded(work)
        work.result()

    async def _close(self, failure: NotStartedError, *, halt: bool) -> None:
        if self.is_in_control:
            self.is_in_control = False
            try:
                await self.ask("lease", {"what": "release", "halt": halt}, timeout=RELEASE_S)
            except RobotiqError as error:
                log.warning(
                    "%s: the agent did not acknowledge the end (%s): it holds what moves", self.name, error
                )
        self._undo()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._requests.fall_silent()
        self.waiters.fail(lambda: failure)
        self._channels.end()

    def check_running(self) -> None:
        """Refuse what only a hand that runs can do.

        Raises:
            NotStartedError: it does not.
        """
        if self.is_over:
            raise NotStartedError("the hand was stopped")

    def check_loop(self) -> None:
        """Refuse a call from another thread or event loop.

        Raises:
            RuntimeError: it is one.
        """
        check_loop(self.loop, "the hand")

    # -- what is heard ---------------------------------------------------------------------------------

    def _hear(self, _key: str, payload: bytes) -> None:
        try:
            if payload[:1] == b"{":
                self._hear_fields(json.loads(payload))
            else:
                self._hear_status(payload, in_turn=True)
        except (ProtocolError, ValueError, KeyError, TypeError) as error:
            log.warning("%s: %s", self.name, error)

    def _hear_status(self, payload: bytes, *, in_turn: bool, asked: float | None = None) -> None:
        message, arrival = unpack(payload), now()
        if self.mirror.is_about_another(message.mark):
            return
        if self.mirror.is_superseded(message, arrival, self._window):
            return
        if self.mirror.epoch not in (0, message.epoch):
            self._lose_control("closed", "the agent was started anew")
        self._arrived_at = arrival
        if not self.mirror.hear(message, arrival, in_turn=in_turn, window=self._window, asked=asked):
            return  # it has been on its way for so long that it says nothing about now
        self._heard_at = arrival
        self._requests.hear()
        if self.is_in_control and message.lease > self._lease and in_turn:
            self._find_out_soon()
        if message.events > self.mirror.events and in_turn:
            self._missed.fetch()  # an event was dropped on the way

    def _hear_fields(self, fields: Mapping[str, Any]) -> None:
        if self.mirror.is_about_another(fields["mark"]):
            return
        if "statistics" in fields:
            self.statistics = read_statistics(fields["statistics"])
        elif fields["epoch"] == self.mirror.epoch and self.mirror.hear_events(fields["events"]):
            self._missed.fetch()

    async def _keep(self) -> None:
        """Look for silence, renew the lease, and acquire it again when that is due."""
        interval, woken = self._window / RENEWALS, now()
        while True:
            await asyncio.sleep(interval)
            late, woken = now() - woken - interval, now()
            # After a hold-up of this loop, what has arrived meanwhile is heard first.
            if late < interval and woken - self._heard_at > self._window:
                self._fall_silent(woken)
            if self.mirror.is_silent and woken - self._arrived_at < interval:
                self._look_again()
            if self.is_in_control:
                self._renew_soon()
            elif self._wants_control and not self.mirror.is_silent:
                await self._acquire_again()

    def _look_again(self) -> None:
        """What is heard seems to be old: it is, or the agent's clock stood still. An answer tells."""
        if self._looking is None or self._looking.done():
            self._looking = self.spawn(self._ask_quietly("info", {}, ANSWER_S))

    async def _acquire_again(self) -> None:
        try:
            await self._acquire({"what": "acquire", "again": self._lease, "run": self._lease_run})
        except ControlLostError as error:
            if error.reason in BY_OTHERS:
                # Somebody else was first, or has stepped in meanwhile; whose turn it is people decide.
                self._wants_control, self.lost = False, error
        except RobotiqError:
            pass  # again in a moment

    def _fall_silent(self, at: float) -> None:
        if self.mirror.is_silent:
            return
        log.warning("%s: the agent is silent", self.name)
        self.mirror.fall_silent(at)
        self._lose_control("expired", "the agent is silent")
        self._requests.fall_silent()

    # -- control ---------------------------------------------------------------------------------------

    async def acquire(self, *, take: bool = False) -> None:
        """Get the lease.

        Raises:
            ControlLostError: another client holds it, and it is not to be taken away.
            RobotiqError: the agent did not answer.
        """
        await self._acquire({"what": "take" if take else "acquire"})

    async def _acquire(self, what: Fields) -> None:
        call = self.call({**what, "label": label()})
        value = await self.send(call, "lease", timeout=ANSWER_S)
        self._lease, self._lease_run = value["lease"], self.mirror.epoch
        self.is_in_control, self._wants_control, self.lost = True, True, None

    async def release(self, *, halt: bool) -> None:
        """Give the lease back.

        Raises:
            RobotiqError: the agent did not answer, or the fingers were not seen to stop.
        """
        self._wants_control = False
        if self.is_in_control:
            self._lose_control("released", "it was given back")
            await self.ask("lease", {"what": "release", "halt": halt}, timeout=RELEASE_S)

    def _renew_soon(self) -> None:
        """Unless an answer is awaited already."""
        if self._renewing is None or self._renewing.done():
            self._renewing = self.spawn(self._ask_quietly("lease", {"what": "renew"}, self._window))

    def _find_out_soon(self) -> None:
        """The agent says that the lease has ended; the answer to a request under it says why."""
        if self._finding_out is None or self._finding_out.done():
            self._finding_out = self.spawn(self._find_out())

    async def _find_out(self) -> None:
        lease, run = self._lease, self._lease_run
        await self._ask_quietly("lease", {"what": "renew"}, self._window / RENEWALS)
        if (lease, run) == (self._lease, self.mirror.epoch):
            # Nobody answers. When the lease is asked for again the agent says whether somebody stepped in.
            self._lose_control("expired", "its agent says that the lease has ended")

    async def _ask_quietly(self, verb: str, arguments: Fields, timeout: float) -> None:
        """For what the answer does by itself."""
        with suppress(RobotiqError):
            await self.ask(verb, arguments, timeout=timeout)

    def _lose_control(self, reason: str, why: str) -> None:
        if not self.is_in_control:
            return
        self.is_in_control = False
        # After a halt or a take of somebody else nobody takes it back without having been asked to.
        self._wants_control = self._wants_control and reason not in (*BY_OTHERS, "released")
        self.lost = ControlLostError(f"{self.name} is not commanded from here any more: {why}", reason)
        if reason != "released":
            log.warning("%s", self.lost)

    def check_control(self) -> None:
        """Refuse commands of a hand that only reads, or has lost the lease.

        Raises:
            ConnectionLostError: the agent is silent.
            ControlLostError: the hand does not hold the lease.
        """
        if self.mirror.is_silent:
            raise ConnectionLostError(f"{self.name}: the agent is silent: nothing was asked")
        if not self.is_in_control:
            lost = self.lost
            if lost is None:
                raise ControlLostError("this hand only reads: acquire() the lease first", "released")
            raise ControlLostError(str(lost), lost.reason)

    # -- asking ----------------------------------------------------------------------------------------

    async def ask(self, verb: str, arguments: Fields | None = None, **how: Any) -> Any:  # noqa: ANN401
        """Ask the agent, once; see :meth:`Requests.send` for what else it takes and raises."""
        return await self.send(self.call(arguments), verb, **how)

    def call(self, arguments: Fields | None = None) -> Call:
        """The next request, under the present lease."""
        return self._requests.make(self.mirror, self._lease, arguments or {})

    async def send(self, call: Call, verb: str, **how: Any) -> Any:  # noqa: ANN401
        """Send a request and wait for its answer; see :meth:`Requests.send`.

        Raises:
            NotStartedError: the run has ended meanwhile.
        """
        asked = now()
        try:
            answer, news = await self._requests.send(call, verb, **how)
        except NoAnswerError:
            self.check_running()
            raise
        if news:
            self._hear_status(news, in_turn=False, asked=asked)
        try:
            return answer.outcome(self.mirror.clock)
        except ControlLostError as error:
            if verb != "halt" and error.reason != "late" and call.lease == self._lease:
                self._lose_control(error.reason, str(error))
            raise

    def call_off(self, call: Call) -> None:
        """Nobody waits for a request any more: what it set going is to be held."""
        if self.is_in_control and not self.is_over:
            # If it is not heard the lease ends, and the agent holds by itself.
            self.spawn(self._ask_quietly("cmd/cancel", {"number": call.number}, self._window))

    def spawn(self, work: Coroutine[Any, Any, Any]) -> asyncio.Task[Any]:
        """Do something beside; it ends with the run."""
        task = self.loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def current_state(self) -> State:
        """Where the hand is."""
        return State.SHUTDOWN if self.is_over else self.mirror.state
