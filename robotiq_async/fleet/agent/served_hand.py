"""One hand of an agent: it answers requests, and holds what moves when nobody commands any more."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Coroutine
from contextlib import suppress
from inspect import signature
from typing import Any, Final, TypeVar

from ...control.grip_keeper import KEEP_S
from ...control.motion import MoveResult
from ...control.state_machine import RUNNING
from ...enums import Finger
from ...errors import AgentError, ControlLostError, RobotiqConnectionError, RobotiqError
from ...hand import RobotiqHand
from ...log import Log
from ...session.timing.clock import now
from ...version import __version__
from ...wire.checks import check_byte, check_mask
from ..control.admission import Admission
from ..control.lease import Lease
from ..network.bus import Bus, Query
from ..wire.envelope import Answer, Call, failure, unpack_call
from ..wire.names import GripperName
from ..wire.values import Fields, result_fields
from .arguments import axes_of, label_of
from .publisher import HandPublisher

RETRY_S: Final = 1.0
"""From one attempt to reach a gripper that is not there to the next."""
COMMANDS: Final = frozenset(
    {"set_position", "set_speed", "set_force", "move", "hold", "activate", "reset", "atr", "recover"}
)
"""What a holder may ask for: the method of a hand of that name. Beside them there are command and cancel."""
T = TypeVar("T")
_REMEMBERED: Final = 256
"""Requests whose answers are kept for repetitions."""


class _Request:
    """Something under way, or answered already: a repetition gets the same answer.

    Attributes:
        reason: why it was called off; empty if it was not, or by its caller.
    """

    def __init__(self, name: str, call: Call, query: Query) -> None:
        self.name = name
        self.call = call
        self.queries = [query]
        self.answer: bytes | None = None
        self.task: asyncio.Task[MoveResult | None] | None = None
        self.reason = ""

    def call_off(self, reason: str = "") -> None:
        """Cancel it, if it is still under way."""
        if self.task is not None and not self.task.done():
            self.reason = reason
            self.task.cancel()


class ServedHand:
    """Serves one hand. Everything happens in the agent's event loop.

    Attributes:
        name: the gripper's.
        publisher: tells what happens to it.
    """

    def __init__(self, name: GripperName, hand: RobotiqHand, bus: Bus, *, epoch: int, window: float) -> None:
        """Serve a hand that is not started."""
        self.name = name
        self._log = Log(name.gripper)
        self._hand = hand
        self._epoch = epoch
        self._lease = Lease(window)
        self._admission = Admission(name.base, epoch, self._lease)
        self.publisher = HandPublisher(name, hand, bus, epoch, self._lease)
        self._requests: dict[int, _Request] = {}
        self._commanded = Finger(0)
        """The axes that the holder has commanded."""
        self._owed = Finger(0)
        """The axes that are to be held as soon as the gripper is reached again."""
        self._tasks: set[asyncio.Task[Any]] = set()
        self._expiry: asyncio.TimerHandle | None = None
        self._is_ending = False

    async def run(self) -> None:
        """Keep the hand running, with or without its gripper, until cancelled; then stop the fingers."""
        remove = self._hand.add_listener(self.publisher.hear)
        try:
            while True:
                await self._run_once()
        finally:
            self._is_ending = True
            self.end_lease("closed")
            await self._hand.stop()
            remove()
            if self._expiry is not None:
                self._expiry.cancel()
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _run_once(self) -> None:
        try:
            await self._hand.start(activate=False)
            self.publisher.problem = ""
            await self._hold_what_moves()
            async for transition in self._hand.transitions():
                if transition.target in RUNNING and self._owed:
                    await self._hold(self._owed)
        except RobotiqError as error:
            if error.message != self.publisher.problem:
                self._log.warning("%s", error.message)
            self.publisher.problem = error.message
            await self._hand.stop(halt=False)
            await asyncio.sleep(RETRY_S)

    async def _hold_what_moves(self) -> None:
        """Whoever set going what moves now is not there any more: an agent that was killed, perhaps."""
        if self._hand.state in RUNNING and self._hand.is_moving:
            self._log.warning("the fingers moved when the agent started; they are held")
            with suppress(RobotiqConnectionError):
                await self._hand.hold(Finger.ALL)

    # -- requests --------------------------------------------------------------------------------------

    def hear(self, verb: str, query: Query) -> None:
        """A request has arrived."""
        try:
            call = unpack_call(query.payload)
        except RobotiqError as error:
            call = Call(self.name.base, "")
            query.reply(failure(call, self._epoch, error).pack())
            return
        try:
            self._admission.check_meant(call, in_any_run=verb in ("info", "halt"))
            self._expire()
            value = self._answer(verb, call, query)
        except (RobotiqError, TypeError, ValueError, OverflowError) as error:  # JSON may hold infinity
            self._log.info("%s refused: %s", verb, getattr(error, "message", error))
            self._reply(query, failure(call, self._epoch, error))
        else:
            if value is not None:
                self._reply(query, Answer(call.to, call.number, self._epoch, value))

    def _answer(self, verb: str, call: Call, query: Query) -> Fields | None:
        """The answer, or None if it comes later."""
        if self._is_ending and verb not in ("info", "halt"):
            raise ControlLostError("the agent is ending; nothing was done", "closed")
        match verb.split("/"):
            case ["info"]:
                return self._info(call)
            case ["lease"]:
                return self._change_lease(call, query)
            case ["halt"]:
                self._halt(call, query)
            case ["cmd", name]:
                self._command(name, call, query)
            case _:
                raise AgentError(f"unknown request {verb!r}")
        return None

    def _reply(self, query: Query, answer: Answer) -> None:
        # The newest status goes with it, for answers overtake statuses.
        query.reply(answer.pack(), self.publisher.status_message())

    def _info(self, call: Call) -> Fields:
        since = call.arguments.get("since", -1)
        return {
            **self.publisher.summary(),
            "version": __version__,
            "window": self._lease.window,
            "events": self.publisher.events_since(since) if type(since) is int and since >= 0 else [],
        }

    # -- the lease -------------------------------------------------------------------------------------

    def _change_lease(self, call: Call, query: Query) -> Fields | None:
        what = call.arguments.get("what")
        if what == "renew":
            self._admission.renew(call, now())
        elif what in ("acquire", "take"):
            self._admission.check_fresh(call, now())
            self._grant(call, take=what == "take")
        elif what == "release":
            self._admission.renew(call, now())
            self._release(call, query)
            return None
        else:
            raise AgentError(f"unknown lease request {what!r}")
        return {"lease": self._lease.number, "window": self._lease.window}

    def _grant(self, call: Call, *, take: bool) -> None:
        if self._admission.is_repeated(call):
            return
        holder = self._lease.holder
        label = label_of(call)
        if take:
            self._lease.intervene(call.client, "taken")
        if holder is not None and (take or holder.client == call.client):
            # Of the same client: it has lost the thread, and what it asked before is not to go on.
            self.end_lease("expired" if holder.client == call.client else "taken", label)
        number = self._admission.acquire(call, label)
        self._log.info("%s commands the gripper", label)
        self.publisher.add({"kind": "lease", "number": number, "holder": label, "reason": "granted"})
        self._watch_expiry()

    def _release(self, call: Call, query: Query) -> None:
        leaves = call.arguments.get("halt") is False
        keeps = call.arguments.get("keep_grip") is True and self._hand.state in RUNNING
        if leaves:
            self._commanded = Finger(0)
            self._requests = {at: each for at, each in self._requests.items() if each.name != "move"}
        self.end_lease("released")

        async def release() -> None:
            if keeps and not leaves:
                await self._come_to_rest()
            elif not leaves:
                await self._hand.halt()

        self._start(_Request("release", call, query), release())

    async def _come_to_rest(self) -> None:
        """Hold what moves; halt if that does not come to rest in time, and nobody commands by then."""
        await self._hand.hold(Finger.ALL)
        with suppress(TimeoutError):
            async with asyncio.timeout(KEEP_S):
                async for _ in self._hand.statuses():
                    if not self._hand.is_moving:
                        return
        if self._lease.holder is None:
            await self._hand.halt()

    def end_lease(self, reason: str, by: str = "") -> None:
        """Take the lease from whoever holds it: what it commanded and still moves is held, grips stay."""
        holder = self._lease.end(reason)
        if holder is None:
            return
        self._log.log(
            logging.INFO if reason == "released" else logging.WARNING,
            "%s commands the gripper no longer: %s%s",
            holder.label,
            reason,
            f" by {by}" if by else "",
        )
        for request in self._requests.values():
            request.call_off(reason)
        self._requests.clear()
        # Holding is for what moves. A speed or a force that is still to be written would act under the next
        # holder, and after a freeze seconds late.
        self._hand._drop_requests(f"the lease has ended: {reason}")  # noqa: SLF001  # the agent's own
        axes, self._commanded = self._commanded, Finger(0)
        if axes:
            self._spawn(self._hold(axes))
        self.publisher.add({"kind": "lease", "number": self._lease.number, "holder": None, "reason": reason})

    async def _hold(self, axes: Finger) -> None:
        self._owed &= ~axes
        try:
            await self._hand.hold(axes)
        except RobotiqConnectionError as error:
            self._owed |= axes
            self._log.warning("the fingers are held when the gripper is reached: %s", error.message)
        except RobotiqError as error:
            self._log.warning("the fingers could not be held: %s", error.message)

    def wake(self) -> None:
        """The machine was suspended: nobody has proven anything since."""
        self._log.warning("this machine was suspended")
        self._lease.wake(now())
        self.end_lease("expired")

    def _expire(self) -> None:
        if self._lease.has_expired(now()):
            self.end_lease("expired")

    def _watch_expiry(self) -> None:
        """Look again when the lease ends unless it is renewed."""
        if self._expiry is not None:
            self._expiry.cancel()
            self._expiry = None
        self._expire()
        if self._lease.holder is not None:
            delay = max(0.001, self._lease.expires - now() + 0.001)
            self._expiry = asyncio.get_running_loop().call_later(delay, self._watch_expiry)

    # -- commands --------------------------------------------------------------------------------------

    def _halt(self, call: Call, query: Query) -> None:
        """From anyone, always, and as often as it is asked."""
        self._lease.intervene(call.client, "halted")
        if self._admission.is_of_holder(call):
            self._admission.bar(call)
        else:
            # Or a control loop would undo it in ten milliseconds.
            self.end_lease("halted", label_of(call))
        self._start(_Request("halt", call, query), self._hand.halt())

    def _command(self, name: str, call: Call, query: Query) -> None:
        known = self._requests.get(call.number)
        if known is not None and self._admission.is_of_holder(call):
            self._repeat(known, query)
            return
        if name == "cancel":
            self._cancel(call, query)
            return
        self._check_known(name)
        self._admission.admit(call, now())
        axes = axes_of(name, call.arguments)
        work = self._work(name, call.arguments)  # arguments that do not fit end here, before anything is kept
        self._commanded |= axes
        request = self._requests[call.number] = _Request(name, call, query)
        if len(self._requests) > _REMEMBERED:
            self._forget()
        self._start(request, work)

    def _check_known(self, name: str) -> None:
        if name != "command" and name not in COMMANDS:
            raise AgentError(f"unknown command {name!r}")

    def _work(self, name: str, arguments: Fields) -> Coroutine[Any, Any, MoveResult | None]:
        if name == "command":
            return self._set(**arguments)
        method = getattr(self._hand, name)
        signature(method).bind(**arguments)  # called with anything, it would say so when it is awaited
        work: Coroutine[Any, Any, MoveResult | None] = method(**arguments)
        return work

    async def _set(self, axes: Fields) -> None:
        """What :meth:`RobotiqHand.command` does, for several axes at once."""
        asked = {check_mask(int(mask)): changes for mask, changes in axes.items()}
        for changes in asked.values():  # all of them before the first is asked for
            for name, value in changes.items():
                check_byte(name, value)
        for mask, changes in asked.items():
            self._hand.command(mask, **changes)

    def _repeat(self, request: _Request, query: Query) -> None:
        self._log.info("request %d came again", request.call.number)
        if request.answer is None:
            request.queries.append(query)
        else:
            query.reply(request.answer, self.publisher.status_message())

    def _cancel(self, call: Call, query: Query) -> None:
        """Call off a command of the holder; the axes it moves are held."""
        self._admission.renew(call, now())
        request = self._requests.get(call.arguments.get("number", -1))
        if request is not None:
            request.call_off()
        else:
            # It may have been overtaken: it is not to be let in when it comes.
            self._admission.bar(Call(call.to, call.client, number=int(call.arguments.get("number", 0))))
        self._reply(query, Answer(call.to, call.number, self._epoch, {}))

    def _start(self, request: _Request, work: Coroutine[Any, Any, MoveResult | None]) -> None:
        request.task = self._spawn(work)
        # Not in the task itself: one that is cancelled before it has begun never runs.
        request.task.add_done_callback(lambda task: self._finish(request, task))

    def _finish(self, request: _Request, task: asyncio.Task[MoveResult | None]) -> None:
        call, error = request.call, None if task.cancelled() else task.exception()
        if task.cancelled():
            reason = request.reason or "released"
            error = ControlLostError(f"called off: {request.reason or 'by the caller'}", reason)
        elif isinstance(error, Exception) and not isinstance(error, RobotiqError | TypeError | ValueError):
            self._log.error("%s failed", request.name, exc_info=error)
            error = AgentError(f"the agent failed: {error!r}")
        if isinstance(error, Exception):
            answer = failure(call, self._epoch, error)
        else:
            answer = Answer(call.to, call.number, self._epoch, result_fields(task.result()) or {})
            if request.name in ("move", "set_position", "command"):
                self._owed &= ~axes_of(request.name, call.arguments)
        request.answer = answer.pack()
        for query in request.queries:
            query.reply(request.answer, self.publisher.status_message())
        request.queries.clear()

    def _forget(self) -> None:
        """The oldest requests that have been answered."""
        for number in sorted(self._requests)[: _REMEMBERED // 2]:
            if self._requests[number].answer is not None:
                del self._requests[number]

    def _spawn(self, work: Coroutine[Any, Any, T]) -> asyncio.Task[T]:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task
