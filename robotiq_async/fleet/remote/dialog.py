"""Dialog: the requests of one run of a hand to its agent, and their outcomes."""

from __future__ import annotations

import asyncio
import os
import secrets
from collections.abc import Callable, Coroutine
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

from ...runtime import Log
from ...values import Finger, NotStartedError, RobotiqError, StopLevel, check_seconds
from ..control.lease import LEASE_WINDOW_S, WINDOW_MAX_S, WINDOW_MIN_S
from ..errors import AgentError, ControlLostError, NotAllowedError
from ..network.bus import Bus, Urgency
from ..wire.envelope import AgentAnswer, AgentCall, outcome
from ..wire.names import GripperName
from ..wire.settings import moved_by
from ..wire.values import Fields
from .errand import HALT_S, Errand, NoAnswerError
from .lease_state import ClientLease, OwnSettings, own_label
from .mirror import Mirror

OWN: Final = ("info", "lease", "halt", "cmd/cancel")
"""Requests whose arguments come from this library: a TypeError in the answer is not the user's."""
RECENT_S: Final = 0.5
"""Seconds in which a message of the agent must follow an empty reply to prove that access was denied."""
EARLY_S: Final = 0.005  # seconds until all commands are repeated when the agent waits for a lost one
LAST_ANSWER_S: Final = 0.5  # seconds for the answer to a command whose lease has ended
UNDER_WAY: Final = 4  # unanswered requests of a loop: enough for 200 a second up to a round trip of 20 ms
COMMAND_S: Final = 1.0  # seconds for the answer to a command of a loop
MOTIONS: Final = ("move", "set_position", "hold")
"""Commands after whose cancellation axes are to be held. An activation, for example, continues."""


class Dialog:
    """Numbers requests, repeats each until it is answered, and ends the wait when the agent falls silent.

    It belongs to the event loop that it was made in. Commands of a loop are merged while UNDER_WAY requests
    are unanswered: for each axis the last value wins. They keep their order among other requests.

    Attributes:
        name, loop, log, mirror, lease: of this run.
        client: identifies the hand to the agent, in all its runs: a lease of an earlier one is its own.
        process: of the run. After a fork, parent and child have the same hand, and are two clients.
        number: of the newest request.
        window: of the leases, in seconds.
        settings: the speeds and forces that were carried out.
        is_over: whether the run has ended, or is ending.
        has_ended: whether all of it has ended.
    """

    def __init__(
        self,
        name: GripperName,
        bus: Bus,
        mirror: Mirror,
        before: Dialog | None = None,
        *,
        receive: Callable[[bytes, float], object] = lambda *_: None,
    ) -> None:
        """``before`` is the last run; ``receive`` takes an answer's status, and the time of the question."""
        self.name = name
        self.loop: asyncio.AbstractEventLoop = asyncio.get_running_loop()
        self.mirror = mirror
        self.log: Log = mirror.log
        self.lease: ClientLease = ClientLease(str(name))
        self.process: int = os.getpid()
        self.client: str = secrets.token_hex(8)
        self.number: int = 0
        if before is not None and before.process == self.process:
            self.client, self.number = before.client, before.number
        self.window: float = LEASE_WINDOW_S
        self.settings: OwnSettings = OwnSettings()
        self.is_over: bool = False
        self.has_ended: bool = False
        self._bus = bus
        self._receive = receive
        self._tasks: set[asyncio.Task[Any]] = set()
        self._received: asyncio.Future[None] = self.loop.create_future()
        """Done with the next message of the agent."""
        self._pending: set[Errand] = set()
        self._halts: set[asyncio.Task[Any]] = set()
        self._cancels: set[asyncio.Task[Any]] = set()  # of MOTIONS
        self._commands: dict[int, Errand] = {}  # commands without an answer, in their order
        self._resending: asyncio.TimerHandle | None = None
        self._waiting: dict[Finger, dict[str, int]] = {}  # commands of a loop that were not sent yet
        self._oldest: AgentCall | None = None
        """The lease, and the newest stamp, at the time of the oldest of these."""
        self._under_way = 0

    # -- requests --------------------------------------------------------------------------------------

    def call(self, arguments: Fields | None = None) -> AgentCall:
        self.number += 1
        mirror, lease = self.mirror, self.lease.number
        return AgentCall(
            self.name.base, self.client, mirror.epoch, lease, self.number, mirror.stamp, arguments or {}
        )

    async def ask(self, verb: str, arguments: Fields | None = None, **how: Any) -> Any:  # noqa: ANN401
        return await self.send(self.call(arguments), verb, **how)

    async def ask_quietly(self, verb: str, arguments: Fields, timeout: float) -> None:
        """Ask, and ignore errors: the answer itself has the effect."""
        with suppress(RobotiqError):
            await self.ask(verb, arguments, timeout=timeout)

    async def send(self, call: AgentCall, verb: str, **how: Any) -> Any:  # noqa: ANN401
        return await self.answer(self.post(call, verb, **how))

    def post(
        self,
        call: AgentCall,
        verb: str,
        *,
        timeout: float,
        urgency: Urgency = Urgency.COMMAND,
        agents: int = 1,
    ) -> Errand:
        """Send a request, before any that is posted later. Wait for its answer with :meth:`answer`.

        With Urgency.STOP that wait continues if the agent falls silent.
        """
        errand = Errand(self.name, call, verb, timeout, urgency, agents, self._resend, self._resend_all_soon)
        if self.is_over and not errand.is_allowed_after_stop:
            errand.end()
            raise NotStartedError("the hand was stopped")
        self._pending.add(errand)
        if errand.is_command:
            self._commands[call.number] = errand
        self._send(errand)
        return errand

    async def answer(self, errand: Errand) -> Any:  # noqa: ANN401
        """Wait for the answer to a request, and return or raise its outcome.

        Raises:
            NoAnswerError: no answer; the request may have been carried out.
            NotAllowedError: no reply but to a command, although the agent is there: access was denied.
            NotStartedError: the hand was stopped.
            AgentError: the answer of another gripper, or of another version.
            ProtocolError: the answer is malformed.
        """
        begun: bool | None = None
        try:
            answer = await self._reply(errand)
            begun = answer.begun
        except NoAnswerError:
            if not errand.is_allowed_after_stop:
                self.check_running()
            raise
        finally:
            self._forget(errand)
            if errand.is_command:
                self.settings.note(errand.call.number, errand.carries, begun)
        if errand.status:
            self._receive(errand.status, errand.asked_at)
        try:
            return answer.outcome(self.mirror.read_status)
        except (TypeError, ValueError) as error:
            if errand.verb not in OWN:
                raise
            raise AgentError(f"{self.name}: its agent does not understand {errand.verb}: {error}") from error
        except ControlLostError as error:
            if errand.verb != "lease":
                self.check_running()  # the lease was given back at the end of the run
            if errand.verb != "halt" and error.reason != "late" and errand.call.lease == self.lease.number:
                self.lose_lease(error.reason, str(error))
            raise

    # -- halts and cancellations -----------------------------------------------------------------------

    def halt(self, agents: int = 1, arguments: Fields | None = None) -> asyncio.Task[Any]:
        """Halt the gripper, until so many agents have confirmed it; the request is sent within this call."""
        call = self.call({"label": own_label(), **(arguments or {})})
        errand = self.post(call, "halt", timeout=HALT_S, urgency=Urgency.STOP, agents=agents)
        return self.spawn(self.answer(errand), self._halts)

    async def halted(self) -> None:
        """Wait until the present halts have ended, successfully or not."""
        await asyncio.gather(*self._halts, return_exceptions=True)

    def cancel(self, name: str, call: AgentCall) -> None:
        """The call of a command was cancelled: hold the axes that it set in motion."""
        if self.lease.is_held and not self.is_over:
            self.spawn(self._cancel(call), *([self._cancels] if name in MOTIONS else []))

    async def _cancel(self, call: AgentCall) -> None:
        try:
            await self.ask("cmd/cancel", {"number": call.number}, timeout=self.window)
        except RobotiqError as error:
            if getattr(error, "reason", "late") == "late":
                # Without renewals the lease ends, and the agent holds moving axes.
                self.lose_lease("expired", "a command could not be cancelled")

    @property
    def needed_level(self) -> StopLevel:
        """The ending that a run needs at least, because of stops that are not acknowledged yet."""
        if self._halts:
            return StopLevel.SHUTDOWN
        holds = self._cancels or any(each.verb == "cmd/hold" for each in self._commands.values())
        return StopLevel.KEEP if holds else StopLevel.LEAVE

    # -- commands of a loop ----------------------------------------------------------------------------

    @property
    def is_moving(self) -> bool:
        """Whether a motion was requested that the agent has not answered yet."""
        waits = any("position" in changes for changes in self._waiting.values())
        return waits or bool(self._cancels) or any(moved_by(each.carries) for each in self._commands.values())

    def put(self, axes: Finger, changes: dict[str, int]) -> None:
        """Send changes of axes with the waiting changes, once fewer than UNDER_WAY commands are open."""
        if self._oldest is None or not self._is_under_this_lease(self._oldest):
            self.clear()
            self._oldest = self.call()
        for axis in axes:
            self._waiting.setdefault(axis, {}).update(changes)
        if self._under_way < UNDER_WAY:
            self.flush()

    def clear(self, why: str = "") -> None:
        if self._waiting and why:
            self.log.info("%s: commands that were not sent yet are dropped", why)
        self._waiting.clear()
        self._oldest = None

    def flush(self) -> None:
        """Send the waiting commands now, because another request follows."""
        oldest, self._oldest = self._oldest, None
        waiting, self._waiting = self._waiting, {}
        if waiting and oldest is not None and self._is_under_this_lease(oldest):
            arguments = {"axes": {str(int(axis)): changes for axis, changes in waiting.items()}}
            # With the stamp of its first command: the time of waiting here counts like time in the network.
            call = replace(self.call(arguments), seen=oldest.seen)
            errand = self.post(call, "cmd/command", timeout=COMMAND_S)
            self._under_way += 1
            self.spawn(self._await(errand)).add_done_callback(lambda _: self._command_done())

    def _is_under_this_lease(self, oldest: AgentCall) -> bool:
        return self.lease.is_held and (oldest.epoch, oldest.lease) == (self.mirror.epoch, self.lease.number)

    def _command_done(self) -> None:
        self._under_way -= 1
        if self._under_way < UNDER_WAY and not self.is_over:
            try:
                self.flush()
            except RobotiqError as error:
                self.log.warning("a command was not sent: %s", error)

    async def _await(self, errand: Errand) -> None:
        try:
            await self.answer(errand)
        except NotStartedError:
            pass  # the next command() raises it
        except (RobotiqError, TypeError, ValueError) as error:
            # The end of the lease is raised by the next command().
            if not isinstance(error, ControlLostError) or error.reason == "late":
                self.log.warning("a command was not carried out: %s", error)

    # -- the agent and the lease -----------------------------------------------------------------------

    def set_window(self, seconds: float) -> None:
        self.window = check_seconds("window", seconds, WINDOW_MIN_S, WINDOW_MAX_S)

    def heard(self) -> None:
        """A current message of the agent has arrived."""
        if not self._received.done():
            self._received.set_result(None)

    def fall_silent(self) -> None:
        """End the waits of all requests until now, except requests that end motion."""
        for errand in self._pending:
            if not errand.is_allowed_after_stop:
                errand.fail(NoAnswerError(self.name, errand.verb, "the agent fell silent"))

    def lose_lease(self, reason: str, why: str) -> None:
        """The lease has ended: no command under it will be answered."""
        if self.lease.lose(reason, why):
            self._await_last_answers(reason)
            self.log.warning("lost control: %s", why)

    def release_lease(self) -> None:
        if self.lease.is_held:
            self._await_last_answers("released")
        self.lease.release()

    def _await_last_answers(self, reason: str) -> None:
        # The agent knows the outcome of the commands under a lease that has ended, so they are repeated for
        # another moment. Without its answer each gets its own error: the words of the agent about another
        # request, such as that nothing was done, may not hold for this one.
        for errand in self._commands.values():
            if errand.call.lease == self.lease.number:
                why = f"{self.name}: the lease has ended ({reason}){outcome(None, errand.verb)}"
                errand.end_soon(LAST_ANSWER_S, ControlLostError(why, reason))

    # -- the end ---------------------------------------------------------------------------------------

    def end(self) -> None:
        """The run ends: from now on only requests that end motion are sent."""
        self.is_over = True
        self.fall_silent()

    async def close(self) -> None:
        """End the requests and tasks that :meth:`end` has left."""
        for task in self._tasks:
            task.cancel()
        self._received.cancel()
        pending = list(self._pending)
        for errand in pending:
            errand.end()
        await asyncio.gather(*(errand.ended() for errand in pending))
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def finish(self) -> None:
        """All of the run has ended."""
        self.is_over = self.has_ended = True

    def check_running(self) -> None:
        if self.is_over and not self.has_ended:
            raise NotStartedError("the hand was stopped")
        if self.is_over:
            raise NotStartedError("the hand is not started: use 'async with' or start()")
        if self.loop.is_closed():
            raise NotStartedError("the event loop that the hand ran in was closed: make a new hand")

    def spawn(self, work: Coroutine[Any, Any, Any], *noted_in: set[asyncio.Task[Any]]) -> asyncio.Task[Any]:
        task = self.loop.create_task(work)
        for those in (self._tasks, *noted_in):
            those.add(task)
            task.add_done_callback(those.discard)
        return task

    # -- copies and replies ----------------------------------------------------------------------------

    def _send(self, errand: Errand) -> None:
        number = errand.call.number
        before = [each for each in self._commands if each < number] if errand.is_command else ()
        is_question = errand.verb == "info"
        copy = self._bus.ask(
            self.name.question(self._bus.who or self.client) if is_question else self.name.key(errand.verb),
            errand.packed(max(before, default=0)),
            timeout=errand.left,
            urgency=Urgency.QUESTION if is_question else errand.urgency,
            decides=errand.decides,
        )
        errand.add(copy)

    def _resend(self, errand: Errand) -> None:
        # A full network drops requests and answers.
        may = errand.is_allowed_after_stop or not self.is_over
        if errand.left and not errand.answered.done() and may:
            self._send(errand)

    def _resend_all_soon(self) -> None:
        # A command was lost, and the agent refuses later commands: repeat all, in their order.
        if self._resending is None:
            self._resending = self.loop.call_later(EARLY_S, self._resend_all)

    def _resend_all(self) -> None:
        self._resending = None
        for errand in list(self._commands.values()):
            self._resend(errand)

    def _forget(self, errand: Errand) -> None:
        self._commands.pop(errand.call.number, None)
        self._pending.discard(errand)
        errand.end()

    async def _reply(self, errand: Errand) -> AgentAnswer:
        answer = await errand.wait()
        if answer is None and errand.was_empty and not errand.is_halt and await self._is_agent_present():
            # Just after a link has come up, zenoh may not know the agent yet. The second request is carried
            # out once at most: its number and its stamp are the same.
            errand.begin()
            self._resend(errand)
            answer = await errand.wait()
        if answer is not None:
            return answer
        # The access rules give no lease to a client that may not command (keys/access.py).
        may_be_denied = errand.was_empty and not errand.verb.startswith("cmd/")
        is_heard = not self.mirror.is_silent  # enough for a halt, which has been repeated all the time
        if may_be_denied and (is_heard if errand.is_halt else await self._is_agent_present()):
            raise NotAllowedError(f"{self.name}: no reply to {errand.verb}: access denied")
        raise NoAnswerError(self.name, errand.verb)

    async def _is_agent_present(self) -> bool:
        # By a message from now on: a link that is down now may have delivered one just before.
        if self._received.done():
            self._received = self.loop.create_future()
        sign = self._received
        await asyncio.wait({sign}, timeout=RECENT_S)
        return sign.done() and not sign.cancelled()
