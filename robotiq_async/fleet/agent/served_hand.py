"""ServedHand: one hand of an agent. Answers requests, and holds moving fingers when a lease ends."""

# Theory of operation
#
# receive() decides on each message at once, in the event loop: is it meant for this gripper and this run of
# the agent, has the lease expired by now, and may its sender do that?
#
#   info, halt   any client; the halt also while the agent ends. It may inhibit motion, in the same turn
#   lease        acquire a free one, take it from its holder, renew or release one's own; permit motion again
#   cmd/NAME     the holder alone, in order, with a fresh stamp of the agent (Admission)
#
# Work that takes time is a task in Jobs, which gives each repetition of its message the same answer.
#
# The lease ends in end_lease() alone: released, expired, taken, halted by another client, or closed. That
# cancels the holder's requests, drops the requests that were not sent, and holds the axes that it has
# commanded. If the link is down then, the holds wait until the gripper is reached, unless the next holder
# moves these axes first (Fingers).
#
# run() starts the hand again every RETRY_S while the gripper cannot be reached. Fingers that move at a start
# are held: no client is there for them. At its end the hand is stopped, even if a client holds the lease.

from __future__ import annotations

import asyncio
import logging
import sys
from dataclasses import replace
from typing import Final

from ... import __version__
from ...local import RobotiqHand
from ...runtime import Log, now
from ...values import RUNNING, Inhibit, MoveResult, RobotiqError
from ..control.admission import Admission
from ..control.lease import Lease
from ..errors import AgentError, ControlLostError
from ..network.bus import Bus, Query
from ..wire.envelope import AgentAnswer, AgentCall, failure, unpack_call
from ..wire.names import GripperName
from ..wire.settings import COMMANDS, NEEDED_ARGUMENTS, check_changes, moved_by, read_settings, settings_of
from ..wire.values import Fields
from .fingers import Fingers
from .inhibits import Inhibits
from .jobs import Job, Jobs, Work
from .kept_settings import KeptSettings
from .publisher import HandPublisher
from .records import Records

START_RETRY_S: Final = 1.0  # seconds between two attempts to reach the gripper


class ServedHand:
    """Serves one hand, in the agent's event loop."""

    def __init__(
        self, name: GripperName, hand: RobotiqHand, bus: Bus, records: Records, *, epoch: int, window: float
    ) -> None:
        self.name = name
        self._log = Log(name.gripper)
        self._hand = hand
        self._epoch = epoch
        self._records = records
        self._lease = Lease(window, epoch, self._keep_record)
        self._settings = KeptSettings(hand, self._keep_record)
        self._admission = Admission(name.base, epoch, self._lease)
        self._inhibits = Inhibits(hand)
        self.publisher: HandPublisher = HandPublisher(name, hand, bus, epoch, self._lease, self._inhibits)
        self._jobs = Jobs(self.publisher, epoch, self._log, self._job_ended)
        self._fingers = Fingers(hand, self._log)
        self._expiry: asyncio.TimerHandle | None = None
        self._is_ending = False

    def resume(self) -> None:
        """Continue from the record of the agent's previous run. No other agent serves the gripper."""
        record = self._records.read(self.name)
        if record is not None:
            try:
                self._lease.resume(record)
                self._settings.resume(record["settings"])
            except (AttributeError, KeyError, TypeError, ValueError) as error:
                self._log.warning("the record of the gripper cannot be read: %r", error)
        if (kept := self._records.read_inhibit(self.name)) is not None:
            self._inhibits.resume(kept)
        self._keep_record()

    def _keep_record(self) -> None:
        own = {"settings": self._settings.record, "inhibited": self._inhibits.record}
        self._records.keep(self.name, {**self._lease.record, **own})

    async def run(self) -> None:
        """Keep the hand running, with or without its gripper, until cancelled; then stop the fingers."""
        loop = asyncio.get_running_loop()
        removes = [
            self._hand.add_listener(each)
            for each in (self.publisher.observe, self._settings.observe, self._jobs.observe)
        ]
        try:
            while True:
                await self._run_once()
        finally:
            # The garbage collector ends a task that was left in a closed loop: nothing can be sent then.
            if not loop.is_closed():
                self.refuse_requests()
                await self._hand.stop()
                for remove in removes:
                    remove()
                if self._expiry is not None:
                    self._expiry.cancel()
                await self._jobs.end()

    def refuse_requests(self) -> None:
        """The agent ends: accept only halts, and drop requests that have not been sent."""
        if not self._is_ending:
            self._is_ending = True
            self.end_lease("closed")

    async def _run_once(self) -> None:
        try:
            self._hand.assume(self._settings.in_gripper)
            await self._hand.start(activate=False)
            self.publisher.note_problem("")
            await self._fingers.hold_what_moves()
            async for transition in self._hand.transitions():
                if transition.target in RUNNING:
                    await self._fingers.hold_as_due()
        except RobotiqError as error:
            if error.message != self.publisher.problem:
                self._log.warning("%s", error.message)
            self.publisher.note_problem(error.message)
            await self._hand.stop(halt=False)
            await asyncio.sleep(START_RETRY_S)

    # -- requests --------------------------------------------------------------------------------------

    def may_be_of_holder(self, payload: bytes) -> bool:
        """Whether a request may come from the lease's holder; True without one. Thread-safe."""
        holder = self._lease.holder
        return holder is None or holder.client.encode() in payload

    def receive(self, verb: str, query: Query) -> None:
        try:
            call = unpack_call(query.payload)
        except RobotiqError as error:
            query.reply(failure(AgentCall(self.name.base, ""), self._epoch, error, begun=False).pack())
            return
        is_free = verb.partition("/")[0] in ("info", "halt")  # of the lease, and of the run of the agent
        try:
            self._admission.check_meant(call, in_any_run=is_free)
            self._expire()
            # First: a request that was begun gets its answer, even if another client commands now.
            if not is_free and (job := self._jobs.find(call)) is not None:
                self._jobs.repeat(job, query)
                return
            value = self._answer(verb, call, query)
        except (RobotiqError, TypeError, ValueError, OverflowError) as error:  # JSON may contain infinity
            self._log.info("%s refused: %s", verb, getattr(error, "message", error))
            is_known = call.to == self.name.base and call.epoch in (0, self._epoch)
            may_come = getattr(error, "reason", "") == "early"  # it is repeated
            begun = False if is_known and not may_come and not self._jobs.may_have_been(call) else None
            # From this gripper, even if the request names another: the client then ignores the refusal,
            # since a copy of the request may have reached the right gripper.
            self._reply(query, failure(replace(call, to=self.name.base), self._epoch, error, begun))
        else:
            if value is not None:
                self._reply(query, AgentAnswer(call.to, call.number, self._epoch, value))

    def _answer(self, verb: str, call: AgentCall, query: Query) -> Fields | None:
        # None: the answer follows later.
        if self._is_ending and verb.partition("/")[0] not in ("info", "halt"):
            raise ControlLostError("the agent is ending", "closed")
        match verb.split("/"):
            case ["info", *_]:
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

    def _reply(self, query: Query, answer: AgentAnswer) -> None:
        # With the newest status, because answers overtake statuses.
        query.reply(answer.pack(), self.publisher.status_message())

    def _info(self, call: AgentCall) -> Fields:
        since = call.arguments.get("since", -1)
        return {
            **self.publisher.summary(),
            "version": __version__,
            "window": self._lease.window,
            "events": self.publisher.events_since(since) if type(since) is int and since >= 0 else [],
        }

    # -- the lease -------------------------------------------------------------------------------------

    def _change_lease(self, call: AgentCall, query: Query) -> Fields | None:
        what = call.arguments.get("what")
        if what in ("renew", "settings"):
            self._admission.renew(call, now())
            if what == "settings":
                self._settings.receive(read_settings(call.arguments.get("settings")))
        elif what in ("acquire", "take"):
            self._admission.check_fresh(call, now())
            self._grant(call, take=what == "take")
        elif what == "release":
            self._release(call, query)
            return None
        elif what == "permit":
            self._admission.check_fresh(call, now())
            self._jobs.begin(Job("permit", call, query), self._permit(call))
            return None
        else:
            raise AgentError(f"unknown lease request {what!r}")
        return {
            "lease": self._lease.number,
            "window": self._lease.window,
            "settings": self._settings.are_kept(call.client),
        }

    def _grant(self, call: AgentCall, *, take: bool) -> None:
        if self._admission.is_repeated(call):
            return
        holder = self._lease.holder
        if take:
            self._lease.intervene(call.client, "taken")
        if holder is not None and holder.client == call.client:
            # The holder itself acquires again: it lost track, so its earlier requests must not continue.
            self.end_lease("expired")
        elif take:
            self.end_lease("taken", call.label)
        number = self._admission.acquire(call, call.label)
        self._log.info("%s commands the gripper", call.label)
        self.publisher.add({"kind": "lease", "number": number, "holder": call.label, "reason": "granted"})
        self._watch_expiry()
        self._settings.grant(call.client)
        self._keep_record()

    def _release(self, call: AgentCall, query: Query) -> None:
        # A client may repeat its release, or strengthen it, as long as no other client has acquired the
        # lease.
        self._admission.release(call, now())
        leaves = call.arguments.get("halt") is False
        keeps = call.arguments.get("keep_grip") is True and self._hand.state in RUNNING
        if leaves:
            self._fingers.forget()
        self.end_lease("released", leaves=leaves)

        async def release() -> Fields:
            # Fingers that do not come to rest are halted, unless a client has acquired the lease since.
            rests = keeps and (await self._fingers.come_to_rest() or self._lease.holder is not None)
            if not (leaves or rests):
                await self._hand.halt()
            return {}

        self._jobs.begin(Job("release", call, query), release())

    def end_lease(self, reason: str, by: str = "", *, leaves: bool = False) -> None:
        """Take the lease from its holder. Axes that it set in motion are held; contacts keep their grip."""
        number, holder = self._lease.number, self._lease.end(reason)
        if holder is None:
            return
        self._log.log(
            logging.INFO if reason == "released" else logging.WARNING,
            "the lease of %s has ended: %s%s",
            holder.label,
            reason,
            f" by {by}" if by else "",
        )
        self._jobs.cancel_all(number, reason, leaves=leaves)
        # A hold affects only moving axes. A speed or a force that is not written yet would take effect under
        # the next holder, or, after a freeze of this process, seconds late.
        self._hand.drop_requests(f"the lease has ended: {reason}")
        axes = self._fingers.forget()
        if axes and not self._is_ending:  # else stop() stops the fingers
            self._jobs.spawn(self._fingers.hold(axes))
        self.publisher.add({"kind": "lease", "number": self._lease.number, "holder": None, "reason": reason})

    def wake(self) -> None:
        # After the machine was suspended, no client has proven to be there.
        self._log.warning("this machine was suspended")
        self._lease.wake(now())
        self.end_lease("expired")

    def _expire(self) -> None:
        if self._lease.has_expired(now()):
            self.end_lease("expired")

    def _watch_expiry(self) -> None:
        # Renewals only move the expiry, so the timer checks it again when it fires.
        if self._expiry is not None:
            self._expiry.cancel()
            self._expiry = None
        self._expire()
        if self._lease.holder is not None:
            delay = max(0.001, self._lease.expires - now() + 0.001)
            self._expiry = asyncio.get_running_loop().call_later(delay, self._watch_expiry)

    # -- commands --------------------------------------------------------------------------------------

    def _halt(self, call: AgentCall, query: Query) -> None:
        # Accepted from any client, in any state, and never treated as a repetition.
        inhibit = self._inhibits.halted(call)
        self._lease.intervene(call.client, "halted")
        if self._admission.is_of_holder(call):
            self._admission.bar(call)
        else:
            # Otherwise a control loop of the holder would move the fingers again within 10 ms.
            self.end_lease("halted", call.label)
        if inhibit is not None:
            self._settings.drop_orders()
            self._inhibit_changed()
        self._jobs.start(Job("halt", call, query), self._stop_now(inhibit))

    def _inhibit_changed(self) -> None:
        self._keep_record()
        self.publisher.add({"kind": "inhibit", **self._inhibits.told()})

    async def _permit(self, call: AgentCall) -> Fields:
        await self._inhibits.permit(call)
        self._inhibit_changed()
        await self._records.kept()
        return self._inhibits.told()

    async def _stop_now(self, inhibit: Inhibit | None) -> Fields:
        # While the agent ends, the hand is being stopped anyway: wait for that stop and check its outcome.
        if self._is_ending:
            await self._hand.stop(keep_grip=False)
            if self._hand.status.go_echo:
                raise AgentError("the agent ended, and the fingers were not seen to stop")
        else:
            try:
                await (self._hand.halt() if inhibit is None else self._hand.halt_inhibited())
            finally:
                if inhibit is not None:
                    self._keep_record()
                await self._records.kept()
        return {} if inhibit is None else self._inhibits.told()

    def _command(self, name: str, call: AgentCall, query: Query) -> None:
        if name == "cancel":
            self._cancel(call, query)
            return
        if name not in COMMANDS:
            raise AgentError(f"unknown command {name!r}")
        self._admission.admit(call, now())
        job = Job(name, call, query)
        work = self._work(job)  # raises for invalid arguments, before anything changes
        self._fingers.command(moved_by(job.carries))
        self._jobs.begin(job, work)

    def _job_ended(self, job: Job, is_done: bool) -> None:
        # Speed and force of a move that was superseded or cancelled are still written, with the next image.
        if is_done or job.was_refused:
            self._settings.end(settings_of(job.carries), is_done=is_done)
        if is_done:
            self._fingers.are_commanded(moved_by(job.carries))

    def _work(self, job: Job) -> Work:
        name, arguments = job.name, job.call.arguments
        # Checked here: a coroutine raises for wrong arguments only when it is awaited. By then the axes that
        # it would move may have been given the speed and force of their new holder.
        if wrong := arguments.keys() - COMMANDS[name]:
            raise TypeError(f"requests are in counts, got {', '.join(sorted(wrong))}")
        if (needed := NEEDED_ARGUMENTS.get(name)) and needed not in arguments:
            raise TypeError(f"{name} needs {needed}")
        timeout = arguments.get("timeout")
        if timeout is not None and not (type(timeout) in (int, float) and 0 < timeout <= sys.float_info.max):
            raise TypeError(f"timeout must be null or seconds above 0, got {timeout!r:.100}")
        if name != "command":
            return self._carry_out(job)
        if not isinstance(arguments["axes"], dict):
            raise TypeError("axes must be an object")
        return self._set(job, **arguments)

    async def _carry_out(self, job: Job) -> Fields:
        self._settings.ask(job.carries)
        result: MoveResult | None = await getattr(self._hand, job.name)(**job.call.arguments)
        if settings_of(job.carries):
            await self._records.kept()
        return {} if result is None else result.as_dict() | {"status": result.status.as_raw()}

    async def _set(self, job: Job, axes: Fields) -> Fields:
        """Like :meth:`RobotiqHand.command`, for several axes at once."""
        mask = self._hand.model.mask  # all are checked before the first takes effect
        by_axes = {mask(int(each)): check_changes(changes) for each, changes in axes.items()}
        self._settings.ask(job.carries)
        for fingers, changes in by_axes.items():
            self._hand.command(fingers, **changes)
        self._fingers.are_commanded(moved_by(job.carries))
        return {}

    def _cancel(self, call: AgentCall, query: Query) -> None:
        self._admission.renew(call, now())
        number = call.arguments.get("number", 0)
        job, left = self._jobs.find(call, number), self._jobs.left_of(number)
        if left:  # the move has failed, and its client left before it could see that
            self._jobs.spawn(self._fingers.hold(left))
        elif job is not None:
            job.cancel()
        else:
            # The cancellation may have overtaken the command: refuse it when it arrives.
            self._admission.bar(replace(call, number=int(number)))
        self._reply(query, AgentAnswer(call.to, call.number, self._epoch, {}))
