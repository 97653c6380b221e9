"""One run of a remote hand, from its start to its stop: what it hears, what it asks, and its lease."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Coroutine, Mapping
from contextlib import suppress
from typing import Any, Final

from ...concurrency import wait_shielded
from ...control.triggers import Trigger
from ...enums import State
from ...errors import (
    ConnectFailedError,
    ConnectionLostError,
    ControlLostError,
    MoveTimeoutError,
    NotAllowedError,
    NotStartedError,
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
from ..wire.values import Fields, read_statistics, reading
from .mirror import Mirror
from .requests import NoAnswerError, Posted, Requests, label

RENEWALS: Final = 5
"""So often in a window the lease is renewed, and silence looked for."""
ANSWER_S: Final = 0.5
"""For an answer that the agent gives at once; asked again within the time that there is."""
CONNECT_S: Final = 5.0
HALT_S: Final = 2.0
RELEASE_S: Final = 0.9
"""With the second that closing a session of zenoh may take, within the two of a stop."""


class RemoteSession:
    """One run. Everything happens in the event loop it was made in.

    Attributes:
        mirror: what has been heard.
        waiters: who waits for a state.
        is_in_control: whether this hand holds the lease, as far as it knows.
        is_over: whether the run has ended, or is about to.
        has_ended: whether nothing of it is left.
        lease: number of the lease it holds, or held last.
        lost: why control was lost; None while it is held, or was never asked for.
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
        """Begin to listen.

        Args:
            name: the gripper's.
            bus: an open session.
            channels: of the hand: they were opened before, perhaps, and are read afterwards.
            wants_control: whether the lease is acquired, and again when the agent was lost.
            owns_bus: whether the bus is closed at the end.
            before: what the run before this one has heard.
        """
        self.name = name
        self.loop = asyncio.get_running_loop()
        self.waiters = StateWaiters()
        self.mirror = Mirror(name.mark, channels, self.waiters.reached, before)
        self.is_over = False
        self.has_ended = False
        self.is_in_control = False
        self.lost: ControlLostError | None = None
        self.statistics: Statistics = Counters().snapshot(0)
        self._bus = bus
        self._channels = channels
        self._wants_control = wants_control
        self.lease = 0
        self._owns_bus = owns_bus
        self._closing: asyncio.Task[None] | None = None
        self._acquiring = asyncio.Lock()
        self._window = WINDOW_S
        self._heard_at = 0.0
        self._requests = Requests(name, bus)
        self._tasks: set[asyncio.Task[Any]] = set()
        self._is_catching_up = False
        self._renewing: asyncio.Task[Any] | None = None
        channels.reopen(self.loop)
        self.mirror.begin(now())
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
            await self.acquire()
        self.spawn(self._keep())
        await self._wait_for_gripper(deadline)

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
                # A change of state is heard before the status that shows it; an answer carries both.
                await self.ask("info", timeout=ANSWER_S)
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
        with reading("its figures"):
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

    async def close(self, *, halt: bool) -> None:
        """End the run; within two seconds, also when cancelled meanwhile, and whoever asks waits for it."""
        if self._closing is None:
            self.is_over, self._wants_control = True, False
            self.mirror.shut_down(State.DO_SHUTDOWN, Trigger.ASK_STOP, now())
            self._closing = self.loop.create_task(self._close(halt=halt))
        await wait_shielded(self._closing)
        self._closing.result()

    async def _close(self, *, halt: bool) -> None:
        try:
            if self.is_in_control:
                self.is_in_control = False
                await self.ask("lease", {"what": "release", "halt": halt}, timeout=RELEASE_S)
        except RobotiqError as error:
            log.warning(
                "%s: the agent did not acknowledge the end (%s): it holds what moves", self.name, error
            )
        finally:
            self._undo()
            for task in self._tasks:
                task.cancel()
            await self._requests.close()
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
        """Whether the loop was closed under it: its tasks can never end then."""
        return not self.has_ended and self.loop.is_closed()

    def abandon(self) -> None:
        """Count as over when the loop was closed under it; the agent holds what moves by itself."""
        log.warning("%s: the event loop was closed before stop()", self.name)
        self.is_in_control = False
        self.waiters = StateWaiters()
        self._end()

    def check_running(self) -> None:
        """Refuse what only a hand that runs can do.

        Raises:
            NotStartedError: it does not.
        """
        if self.is_over:
            raise NotStartedError("the hand is not started: use 'async with' or start()")
        if self.loop.is_closed():
            raise NotStartedError("the event loop that the hand ran in was closed: start() it again")

    def check_loop(self) -> None:
        """Refuse a call from another thread or event loop.

        Raises:
            RuntimeError: it is one.
        """
        check_loop(self.loop, "the hand")

    # -- what is heard ---------------------------------------------------------------------------------

    def _hear(self, _key: str, payload: bytes) -> None:
        try:
            with reading("news"):
                if payload[:1] == b"{":
                    self._hear_fields(json.loads(payload))
                else:
                    self._hear_status(payload, in_turn=True)
        except RobotiqError as error:
            log.warning("%s: %s", self.name, error)
        if self.mirror.has_missed():
            self._catch_up()  # an event was dropped on the way

    def _hear_status(self, payload: bytes, *, in_turn: bool) -> None:
        message = unpack(payload)
        if self.mirror.is_about_another(message.mark):
            return
        if self.mirror.epoch not in (0, message.epoch):
            self._lose_control("closed", "the agent was started anew")
            self._requests.fall_silent()  # what the former one was asked it does not answer
        self._heard_at = now()
        self.mirror.hear(message, self._heard_at, in_turn=in_turn)
        self._requests.hear()
        if self.is_in_control and message.lease > self.lease and in_turn:
            self.spawn(self._renew())  # it says why

    def _hear_fields(self, fields: Mapping[str, Any]) -> None:
        if self.mirror.is_about_another(fields["mark"]):
            return
        if "statistics" in fields:
            self.statistics = read_statistics(fields["statistics"])
            return
        self._hear_status(bytes.fromhex(fields["status"]), in_turn=True)
        self.mirror.hear_events(fields["events"])

    def _catch_up(self) -> None:
        if not self._is_catching_up and not self.is_over:
            self._is_catching_up = True
            self.spawn(self._fetch_events())

    async def _fetch_events(self) -> None:
        """Ask for the events that were missed."""
        try:
            while self.mirror.has_missed():
                info = await self.ask("info", {"since": self.mirror.events}, timeout=ANSWER_S)
                with reading("events"):
                    events = info["events"]
                    if info["epoch"] == self.mirror.epoch and events:
                        self.mirror.skip_events(events[0]["index"] - 1)
                        self.mirror.hear_events(events)
                await asyncio.sleep(0.02)
        except RobotiqError as error:
            log.info("%s: missed events could not be fetched: %s", self.name, error)
        finally:
            self._is_catching_up = False

    async def _keep(self) -> None:
        """Look for silence, renew the lease, and acquire it again when that is due."""
        interval, woken = self._window / RENEWALS, now()
        while True:
            await asyncio.sleep(interval)
            late, woken = now() - woken - interval, now()
            # After a hold-up of this loop, what has arrived meanwhile is heard first.
            if late < interval and woken - self._heard_at > self._window:
                self._fall_silent(woken)
            if self.is_in_control and (self._renewing is None or self._renewing.done()):
                self._renewing = self.spawn(self._renew())
            elif self._wants_control and not self.is_in_control and not self.mirror.is_silent:
                await self._acquire_again()

    async def _acquire_again(self) -> None:
        try:
            await self.acquire()
        except ControlLostError:
            self._wants_control = False  # somebody else was first; whose turn it is then people decide
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
        async with self._acquiring:
            if self.is_in_control:
                await self._renew()  # it may have been lost without a word
            if self.is_in_control:
                return  # asked for again, the agent would take what is under way for forgotten
            what = {"what": "take" if take else "acquire", "label": label()}
            value = await self.ask("lease", what, timeout=ANSWER_S)
            with reading("a lease"):
                self.lease = int(value["lease"])
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

    async def _renew(self) -> None:
        with suppress(RobotiqError):
            await self.ask("lease", {"what": "renew"}, timeout=self._window)

    def _lose_control(self, reason: str, why: str) -> None:
        if not self.is_in_control:
            return
        self.is_in_control = False
        # After a halt or a take of somebody else nobody takes it back without having been asked to.
        self._wants_control = self._wants_control and reason not in ("taken", "halted", "held", "released")
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
        return self._requests.make(self.mirror, self.lease, arguments or {})

    def post(self, call: Call, verb: str, **how: Any) -> Posted:  # noqa: ANN401
        """Send a request; see :meth:`Requests.post`."""
        return self._requests.post(call, verb, **how)

    async def send(self, call: Call, verb: str, **how: Any) -> Any:  # noqa: ANN401
        """Send a request and wait for its answer; see :meth:`answer`."""
        return await self.answer(self.post(call, verb, **how))

    async def answer(self, posted: Posted) -> Any:  # noqa: ANN401
        """Wait for the answer to a request; see :meth:`Requests.answer`.

        Raises:
            NotStartedError: the run has ended meanwhile.
        """
        try:
            answer, news = await self._requests.answer(posted)
        except NoAnswerError:
            self.check_running()
            raise
        if news:
            self._hear_status(news, in_turn=False)
        try:
            return answer.outcome(self.mirror.clock)
        except MoveTimeoutError as error:
            error.status = self.mirror.renumbered(error.status)
            raise
        except ControlLostError as error:
            if posted.verb != "lease":
                self.check_running()  # the lease was given back at the end of the run
            if posted.verb != "halt" and error.reason != "late" and posted.call.lease == self.lease:
                self._lose_control(error.reason, str(error))
            raise

    def call_off(self, call: Call) -> asyncio.Task[Any] | None:
        """Nobody waits for a request any more: what it set going is to be held."""
        if not self.is_in_control or self.is_over:
            return None

        async def ask() -> None:
            with suppress(RobotiqError):  # then the lease ends, and the agent holds by itself
                await self.ask("cmd/cancel", {"number": call.number}, timeout=self._window)

        return self.spawn(ask())

    def spawn(self, work: Coroutine[Any, Any, Any]) -> asyncio.Task[Any]:
        """Do something beside; it ends with the run."""
        task = self.loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def current_state(self) -> State:
        """Where the hand is."""
        return self.mirror.state
