"""One run of a hand, from start() to stop(): its controller, its poller task and the callers that wait."""

# Theory of operation
#
# The controller decides and knows no task. The poller is the one task that uses the link. Callers run in
# tasks of their own, and never touch the link: ask() gives a request to the controller in the caller's turn
# of the loop, publishes the changes of state that follow, and wakes the poller if something is due. A caller
# then waits for a future. The controller answers the future of a request or a move; StateWaiters answers
# that of a state.
#
# A wait is in vain in DISCONNECTED and in DO_SHUTDOWN. An activation has further states that end it. Only
# wait_for_state() waits all of them out.
#
# A run ends once, in _end(): after a stop, when the link is given up, or when the poller fails by a mistake
# of ours. It ends in the turn of the loop in which the poller does. The gripper is given back before SHUTDOWN
# is published, because a reader of that may start a hand, and every future that is left fails. If the event
# loop was closed, no turn is left: abandon() ends the run and does not touch the futures of that loop.

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, ClassVar, ParamSpec, TypeVar

from ..control.controller import Controller, Left
from ..control.motion import Move
from ..control.state_machine import RUNNING, SEQUENCES, StateMachine
from ..control.waiters import Waiter
from ..runtime.clock import now
from ..runtime.concurrency import check_loop, wait_shielded
from ..runtime.limit import Limit
from ..values.enums import Fault, Finger, State, Trigger
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
from ..values.move_result import MoveResult
from ..values.statistics import Counters
from ..values.status import RobotiqStatus
from .gripper_link import Claims
from .options import HandOptions
from .poller import Poller
from .streams import Channels
from .waiting import STALLED_S, ActivationProgress, StallWatch, StateWaiters

P = ParamSpec("P")
T = TypeVar("T")
Failing = Mapping[State, Callable[[], RobotiqError]]
"""The states in which a wait is in vain, each with the error for the caller."""


class Session:
    """A run: from start() to stop(), or until the link is given up or the event loop closed.

    Making one claims the gripper and begins to connect. This needs a running event loop. The machine and the
    channels outlive it.

    Raises:
        InvalidStateError: another hand of this process owns the gripper.
    """

    _claims: ClassVar[Claims[Session, Left]] = Claims()

    def __init__(
        self,
        options: HandOptions,
        machine: StateMachine,
        channels: Channels,
        *,
        activate: bool,
        wait: float = 0.0,
    ) -> None:
        self.options = options
        self.is_over = True  # until the poller task runs
        self._loop = asyncio.get_running_loop()
        self.machine = machine
        left = self._claim()
        machine.why_down = None
        self.controller = Controller(
            machine,
            options.speed,
            options.force,
            options.units.closing_s,
            options.write_spacing,
            options.model,
            left,
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
        machine.show(State.DISCONNECTED, Trigger.ASK_START)
        channels.publish_changes()
        self.is_over = False
        self._task = self._loop.create_task(self._run(), name="robotiq_async poller")
        self._task.add_done_callback(self._end_with)

    async def _run(self) -> None:
        """Run the poller; the run is over in the same turn of the loop.

        A stop() in a turn between would strengthen an ending that has ended, and be lost.
        """
        bug: BaseException | None = None
        try:
            await self._poller.run()
        except Exception as error:
            bug = error
            raise
        finally:
            if not self._loop.is_closed():
                self._end(bug)

    # -- its end ---------------------------------------------------------------------------------------

    @property
    def lost_its_loop(self) -> bool:
        """Whether the event loop was closed before the stop, so that the task can never end."""
        return not self.is_over and self._loop.is_closed()

    async def stop(self, *, halt: bool, keep_grip: bool = False) -> None:
        """Stop as :meth:`Hand.stop` promises, also when cancelled during it."""
        self.check_loop("hand.stop()")
        self._poller.request_stop(halt=halt, keep_grip=keep_grip)
        await self.ended()

    async def ended(self) -> None:
        """Wait for the end of the task; a cancellation during the wait is raised after it."""
        try:
            await wait_shielded(self._task)
        finally:
            if self._task.done():  # not if a second Ctrl-C has broken the event loop
                self._end_with(self._task)

    def abandon(self) -> None:
        """End a run whose event loop was closed. Its callers' futures belong to that loop: leave them."""
        self.options.log.warning("the event loop was closed before stop(); the fingers may still move")
        self._release()
        self._poller.abandon()
        self._waiters = StateWaiters()
        self._channels.end()
        self.controller.refuse_requests()
        self.controller.close()
        self._channels.publish_changes()

    def _claim(self) -> Left | None:
        """Claim the gripper; return what the last run of any hand of it has left to act."""
        gripper = self.options.link.gripper
        owner = self._claims.claim(gripper, self, lambda each: each.is_over)
        if owner is not None:
            is_this = owner.machine is self.machine
            who, hint = ("this hand", "") if is_this else ("another hand", gripper().hint)
            raise InvalidStateError(
                f"{who} runs on {owner.options.link.address} already: stop() it first{hint}",
                self.machine.state,
                {State.DISCONNECTED, State.SHUTDOWN},
            )
        return self._claims.left(gripper())

    def _release(self) -> None:
        self.is_over = True
        self._claims.release(self, self.controller.left())

    def _end_with(self, task: asyncio.Task[None]) -> None:
        """The task has ended, perhaps before it ran."""
        self._end(None if task.cancelled() else task.exception())

    def _end(self, bug: BaseException | None) -> None:
        """The run is over: no caller may wait for it."""
        if self.is_over:
            return
        self._release()  # before SHUTDOWN is published: a reader of it may start a hand
        self.controller.close()
        self._channels.publish_changes()
        failure: Callable[[], RobotiqError] | None = None
        if bug is not None:
            self.options.log.critical("the task that owns the link failed", exc_info=bug)
            failure = lambda: ConnectionLostError(f"internal error: {bug!r}")  # noqa: E731
        elif self._poller.failure is not None:
            failure = self.link_lost
        self._waiters.fail(failure or self._stopped)
        self._channels.end(failure)

    # -- whether it takes calls ------------------------------------------------------------------------

    def check_loop(self, what: str) -> None:
        """Raise RuntimeError for a call from another thread or event loop."""
        check_loop(self._loop, what)

    def check_running(self) -> None:
        """Raise NotStartedError, or ConnectionLostError if the link was given up, unless the hand runs."""
        if self.is_over:
            if self._poller.failure is not None:
                raise self.link_lost()
            raise NotStartedError("the hand is not started", advice="use 'async with' or start()")
        if self._loop.is_closed():
            raise NotStartedError("the event loop that the hand ran in was closed", advice="start() it again")

    def check_takes_requests(self) -> None:
        """Raise NotStartedError once stop() was called."""
        if self.machine.state is State.DO_SHUTDOWN:
            raise self._stopped()

    def link_lost(self) -> RobotiqConnectionError:
        """Make the error for a link that is down, with the reason if that is known."""
        failure = self._poller.failure or self._poller.why_lost
        since = f" (down since {self._poller.lost_since})" if self._poller.lost_since else ""
        error = ConnectionLostError(f"the link is down{'' if failure is None else f': {failure}'}{since}")
        error.__cause__ = failure
        error.hand = self.options.given_name
        return error

    # -- waiting ---------------------------------------------------------------------------------------

    async def connected(self) -> None:
        """Wait for the first status; raises RobotiqError if there is none."""
        await self._poller.connected

    def waiter(self) -> asyncio.Future[Any]:
        return self._loop.create_future()

    def ask(self, request: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Make a request of the controller; listeners get its changes of state after it."""
        try:
            return request(*args, **kwargs)
        finally:
            self._channels.publish_changes()
            self._poller.hurry()

    async def answered(self, request: Callable[[Waiter[None]], None]) -> None:
        """Make a request and wait for its acknowledgement; raises RobotiqError if there is none."""
        waiter = self.waiter()
        self.ask(request, waiter)
        await waiter

    @contextmanager
    def moving(
        self, position: int, axes: Finger, speed: int | None, force: int | None
    ) -> Iterator[tuple[asyncio.Future[MoveResult], float]]:
        """Move axes; yield the future of the result, and the seconds that it may take by default.

        However the block is left, a move that has not ended is given up, and its axes that move are held.
        """
        ended: asyncio.Future[MoveResult] = self.waiter()
        move, is_seen = Move(position, axes, now(), ended), True
        try:
            yield ended, self.ask(self.controller.move, move, speed, force)
        except asyncio.CancelledError:
            is_seen = False
            if ended.done() and not ended.cancelled():
                ended.exception()  # retrieved: asyncio would log it as never looked at
            raise
        finally:  # a limit of time cancels the wait as well
            self.ask(self.controller.abandon, move, unseen=not is_seen or ended.cancelled())

    async def reach(
        self,
        states: Collection[State],
        timeout: float | None,
        *,
        what: str,
        ask: Callable[[], None] | None = None,
        failing: Failing | None = None,
    ) -> State:
        """Make a request and wait for one of some states; ``timeout`` in seconds, None for no limit.

        ``failing`` are states in which the wait is in vain, besides a lost link and a stop; None waits those
        out, too. ``what`` is the message of a timeout.

        Raises:
            StateTimeoutError: not in time.
            RobotiqError: refused, or in vain.
        """
        ends = {} if failing is None else {**self._ends, **failing}
        state: State | None = None
        with self._waiters.watching(states, ends) as reached:
            if ask is not None:
                self.ask(ask)
            with Limit(timeout):
                state = await reached
        if state is None:
            raise StateTimeoutError(f"{what} within {timeout:g} s (now {self.machine.state.name})")
        return state

    async def activated(self, ask: Callable[[], None] | None = None) -> None:
        """Wait for the end of an activation. One that this hand began must not end in a fault.

        Args:
            ask: makes the request; None for an activation that the start, or another caller, has begun.

        Raises:
            GripperFaultError: it is refused because of a fault, or ended in one.
            NotActivatedError: the gripper was reset during it, or reset() or halt() took over.
            ActivationTimeoutError: not finished within the activation timeout, or stalled.
            InvalidStateError: it is refused during a reset or a release.
            ConnectionLostError: the link is or went down.
            NotStartedError: the hand was stopped.
        """
        if ask is None and self.machine.state not in SEQUENCES:
            return
        faulty = () if ask is not None or self.controller.is_busy else (State.FAULT, State.ATR_DONE)
        failing: Failing = {
            State.FAULT: self._fault,
            State.ATR_DONE: self._fault,
            State.RESET: lambda: NotActivatedError("the gripper was reset during the activation"),
            State.DO_RESET: lambda: NotActivatedError("a reset or a halt took over"),
        }
        try:
            watch = StallWatch(self._channels.listeners, self.machine)
            with watch, watch.ends_early() as stall:
                await self.reach(
                    RUNNING.union(faulty),
                    self.options.activation_timeout,
                    ask=ask,
                    failing=failing,
                    what="the activation was not finished",
                )
        except StateTimeoutError as error:
            fault = Fault.NONE if self.controller.status is None else self.controller.status.fault
            if not fault:
                raise ActivationTimeoutError(str(error)) from None
            why = f"{fault.description} (gFLT 0x{int(fault):02X})"
            raise ActivationTimeoutError(f"{error}: {why}", advice="recover() resets it") from None
        if stall.cancelled_caught:
            raise self._stalled()

    async def next_status(self) -> None:
        with self._waiters.watching((), self._ends) as seen:

            def see(item: object) -> None:
                if isinstance(item, RobotiqStatus) and not seen.done():
                    seen.set_result(self.machine.state)

            remove = self._channels.listeners.add(see)
            try:
                await seen
            finally:
                remove()

    @property
    def _ends(self) -> Failing:
        return {State.DISCONNECTED: self.link_lost, State.DO_SHUTDOWN: self._stopped}

    @staticmethod
    def _stopped() -> NotStartedError:
        return NotStartedError("the hand was stopped")

    def _stalled(self) -> ActivationTimeoutError:
        assert self.controller.status is not None, "the stall was seen in one"
        fault = self.controller.status.fault
        return ActivationTimeoutError(
            f"the activation makes no progress: for {STALLED_S:g} s nothing but {fault.description} (gFLT "
            f"0x{int(fault):02X}). Is the emergency stop released, and the gripper powered?",
            advice="release it; then start(activate=False) and recover(), which resets the gripper",
        )

    def _fault(self) -> GripperFaultError:
        assert self.controller.status is not None, "a fault was read from a status"
        return GripperFaultError(self.controller.status.fault)

    def _on_transition(self, source: State, target: State, trigger: Trigger) -> None:
        self.counters.faults += target is State.FAULT
        self._waiters.reached(target)
        self._progress.reached(target)
        self._channels.changes.append(Transition(source, target, trigger, now()))
