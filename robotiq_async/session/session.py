"""One run of a hand, from start() to stop(): its controller, its task, and those who wait beside it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Mapping
from typing import Any, ClassVar, ParamSpec, TypeVar

import anyio

from ..control.controller import Controller
from ..control.state_machine import RUNNING, SEQUENCES, StateMachine
from ..control.waiters import Waiter
from ..runtime.clock import now
from ..runtime.concurrency import wait_shielded
from ..runtime.event_loop import check_loop
from ..values.enums import Fault, State
from ..values.errors import (
    ActivationTimeoutError,
    ConnectionLostError,
    GripperFaultError,
    InvalidStateError,
    NotActivatedError,
    NotStartedError,
    RobotiqConnectionError,
    RobotiqError,
    StateTimeoutError,
)
from ..values.events import Transition
from ..values.status import RobotiqStatus
from ..values.trigger import Trigger
from .activation_progress import ActivationProgress
from .claims import Claims
from .counters import Counters
from .options import Options
from .poller import Poller
from .stall_watch import STALLED_S, StallWatch
from .state_waiters import StateWaiters
from .streams import Channels

P = ParamSpec("P")
T = TypeVar("T")
Failing = Mapping[State, Callable[[], RobotiqError]]
"""States that mean that what is waited for will not come, each with the error that says so."""


class Session:
    """Runs a hand once: from start() to stop(), or until its link or its loop is gone for good."""

    _claims: ClassVar[Claims[Session]] = Claims()
    """Who owns which gripper in this process."""

    def __init__(
        self,
        options: Options,
        machine: StateMachine,
        channels: Channels,
        *,
        activate: bool,
        wait: float = 0.0,
    ) -> None:
        """Claim the address and begin to connect; must be made in a running event loop.

        Args:
            options: of the hand.
            machine: of the hand: its state outlives the session.
            channels: of the hand: they were opened before, perhaps, and are read afterwards.
            activate: whether a gripper that is found reset is activated.
            wait: seconds for which there may be no gripper yet.

        Raises:
            InvalidStateError: the address is owned already.
        """
        self.options = options
        self.is_over = True  # until its task runs
        """Whether nothing runs any more."""
        self._loop = asyncio.get_running_loop()
        self.machine = machine
        machine.why_down = None
        self._claim()
        self.controller = Controller(
            machine, options.speed, options.force, options.units.closing_s, options.write_spacing
        )
        self.controller.activates = activate
        self.counters = Counters()
        self._channels = channels
        self._waiters = StateWaiters()
        self._progress = ActivationProgress(self._loop, options.log)
        channels.reopen(self._loop)
        machine.changed = self._on_transition
        self._poller = Poller(
            options.make_transport(), self.controller, self.counters, channels, options, wait=wait
        )
        machine.fire(Trigger.ASK_START)
        channels.publish_changes()
        self.is_over = False
        self._task = self._loop.create_task(self._poller.run(), name="robotiq_async poller")
        self._task.add_done_callback(self._end)

    # -- its end ---------------------------------------------------------------------------------------

    @property
    def lost_its_loop(self) -> bool:
        """Whether the loop was closed under it: its task can never end then."""
        return not self.is_over and self._loop.is_closed()

    async def stop(self, *, halt: bool, keep_grip: bool = False) -> None:
        """Stop the fingers (with ``halt``) and disconnect; also when cancelled meanwhile.

        With ``keep_grip`` they are held, and rGTO stays set if everything is seen at rest.

        Raises:
            RuntimeError: called in another event loop.
        """
        self.check_loop("hand.stop()")
        self._poller.request_stop(halt=halt, keep_grip=keep_grip)
        await self.ended()

    async def ended(self) -> None:
        """Wait for the end that was asked for; a cancellation meanwhile is raised after it."""
        try:
            await wait_shielded(self._task)
        finally:
            self._end(self._task)

    def abandon(self) -> None:
        """Count as over when the loop was closed under it.

        Nobody in that loop can be told. What they wait with belongs to it and is left to it.
        """
        self.options.log.warning("the event loop was closed before stop(); the fingers may still move")
        self._release()
        self._poller.abandon()
        self._waiters = StateWaiters()
        self._channels.end()
        self.machine.fire(Trigger.ASK_STOP)
        self.controller.stopped()
        self._channels.publish_changes()

    def _claim(self) -> None:
        gripper = self.options.gripper
        owner = self._claims.claim(gripper, self, lambda each: each.is_over)
        if owner is not None:
            is_this = owner.machine is self.machine
            who, hint = ("this hand", "") if is_this else ("another hand", gripper().hint)
            raise InvalidStateError(
                f"{who} runs on {owner.options.address} already: stop() it first{hint}",
                self.machine.state,
                {State.DISCONNECTED, State.SHUTDOWN},
            )

    def _release(self) -> None:
        self.is_over = True
        self._claims.release(self)

    def _end(self, task: asyncio.Task[None]) -> None:
        """The task has ended: nobody may wait for it any longer. Called by whoever sees it first."""
        if self.is_over:
            return
        self._release()
        failure: Callable[[], RobotiqError] | None = None
        if not task.cancelled() and (bug := task.exception()) is not None:
            self.options.log.critical("the task that owns the link failed", exc_info=bug)
            failure = lambda: ConnectionLostError(f"internal error: {bug!r}")  # noqa: E731
        elif self._poller.failure is not None:
            failure = self.link_lost
        self._waiters.fail(failure or self._stopped)
        self._channels.end(failure)

    # -- whether it can be asked -----------------------------------------------------------------------

    def check_loop(self, what: str) -> None:
        """Refuse a call from another thread or event loop.

        Raises:
            RuntimeError: it is one.
        """
        check_loop(self._loop, what)

    def check_running(self) -> None:
        """Refuse what needs a running hand.

        Raises:
            NotStartedError: it is over.
            ConnectionLostError: the hand gave up on its link.
        """
        if self.is_over:
            if self._poller.failure is not None:
                raise self.link_lost()
            raise NotStartedError("the hand is not started: use 'async with' or start()")
        if self._loop.is_closed():
            raise NotStartedError("the event loop that the hand ran in was closed: start() it again")

    def check_takes_requests(self) -> None:
        """Refuse what a hand that is being stopped does not do.

        Raises:
            NotStartedError: stop() was called.
        """
        if self.machine.state is State.DO_SHUTDOWN:
            raise self._stopped()

    def link_lost(self) -> RobotiqConnectionError:
        """The error that tells that the link is down, and why if that is known."""
        failure = self._poller.failure or self._poller.why_lost
        error = ConnectionLostError(f"the link is down{'' if failure is None else f': {failure}'}")
        error.__cause__ = failure
        error.hand = self.options.given_name
        return error

    # -- waiting ---------------------------------------------------------------------------------------

    async def connected(self) -> None:
        """Wait for the first status.

        Raises:
            RobotiqError: there was none.
        """
        await self._poller.connected

    def waiter(self) -> asyncio.Future[Any]:
        """What a caller waits with."""
        return self._loop.create_future()

    def ask(self, request: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Make a request of the controller; what it changes is told after it.

        Raises:
            RobotiqError: it is refused.
        """
        try:
            return request(*args, **kwargs)
        finally:
            self._channels.publish_changes()

    async def answered(self, request: Callable[[Waiter[None]], None]) -> None:
        """Make a request and wait until it was acknowledged.

        Raises:
            RobotiqError: why it was not.
        """
        waiter = self.waiter()
        self.ask(request, waiter)
        self._poller.hurry()
        await waiter

    async def reach(
        self,
        states: Collection[State],
        timeout: float | None,
        *,
        what: str,
        ask: Callable[[], None] | None = None,
        failing: Failing | None = None,
    ) -> State:
        """Ask for something and wait for a state.

        Args:
            states: what is waited for.
            timeout: seconds; None for as long as it takes.
            what: the sentence for a timeout.
            ask: asks for it.
            failing: states that mean it will not come, as a lost link does then; None waits that out.

        Raises:
            StateTimeoutError: not in time.
            RobotiqError: refused, or it will not come.
        """
        ends: Failing = {State.DISCONNECTED: self.link_lost, State.DO_SHUTDOWN: self._stopped}
        ends = {} if failing is None else {**ends, **failing}
        with self._waiters.watching(states, ends) as reached:
            if ask is not None:
                self.ask(ask)
                self._poller.hurry()
            with anyio.move_on_after(timeout):
                return await reached
        raise StateTimeoutError(f"{what} within {timeout:g} s (now {self.machine.state.name})")

    async def activated(self, ask: Callable[[], None] | None = None) -> None:
        """Wait for the end of an activation; one that this hand began must not end in a fault.

        Args:
            ask: asks for it; None for what the start, or another caller, has begun.

        Raises:
            GripperFaultError: it is refused because of a fault, or ended in one.
            NotActivatedError: the gripper was reset meanwhile, or reset() or halt() took over.
            ActivationTimeoutError: not finished within the activation timeout, or stalled.
            InvalidStateError: it is refused: a reset or a release is under way.
            ConnectionLostError: the link is or went down.
            NotStartedError: the hand was stopped.
        """
        if ask is None and self.machine.state not in SEQUENCES:
            return
        faulty = () if ask is not None or self.machine.sequence is not None else (State.FAULT, State.ATR_DONE)
        failing: Failing = {
            State.FAULT: self._fault,
            State.ATR_DONE: self._fault,
            State.RESET: lambda: NotActivatedError("the gripper was reset during the activation"),
            State.DO_RESET: lambda: NotActivatedError("reset() or halt() took over"),
        }
        try:
            watch = StallWatch(self._channels.listeners, self.machine)
            with watch, watch.ends_early():
                await self.reach(
                    RUNNING.union(faulty),
                    self.options.activation_timeout,
                    ask=ask,
                    failing=failing,
                    what="the activation was not finished",
                )
                return
            raise self._stalled()
        except StateTimeoutError as error:
            fault = Fault.NONE if self.controller.status is None else self.controller.status.fault
            why = f": {fault.description} (gFLT 0x{int(fault):02X}); recover() resets it" if fault else ""
            raise ActivationTimeoutError(f"{error}{why}") from None

    async def next_status(self) -> None:
        """Wait for the next status, which may tell more.

        Raises:
            RobotiqConnectionError: the link went down meanwhile.
            NotStartedError: the hand was stopped.
        """
        ends: Failing = {State.DISCONNECTED: self.link_lost, State.DO_SHUTDOWN: self._stopped}
        with self._waiters.watching((), ends) as told:

            def tell(item: object) -> None:
                if isinstance(item, RobotiqStatus) and not told.done():
                    told.set_result(self.machine.state)

            remove = self._channels.listeners.add(tell)
            try:
                await told
            finally:
                remove()

    @staticmethod
    def _stopped() -> NotStartedError:
        return NotStartedError("the hand was stopped")

    def _stalled(self) -> ActivationTimeoutError:
        assert self.controller.status is not None, "the stall was seen in one"
        fault = self.controller.status.fault
        return ActivationTimeoutError(
            f"the activation gets nowhere: for {STALLED_S:g} s nothing but {fault.description} (gFLT "
            f"0x{int(fault):02X}). Is the emergency stop released, and the gripper powered? Release it; then "
            "start(activate=False) and recover(), which resets the gripper"
        )

    def _fault(self) -> GripperFaultError:
        assert self.controller.status is not None, "a fault was read from a status"
        return GripperFaultError(self.controller.status.fault)

    def _on_transition(self, source: State, target: State, trigger: Trigger) -> None:
        self.counters.faults += target is State.FAULT
        self._waiters.reached(target)
        self._progress.reached(target)
        self._channels.changes.append(Transition(source, target, trigger, now()))
