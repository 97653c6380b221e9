"""One run of a hand, from start() to stop(): its controller, its poller task and the callers that wait."""

# Theory of operation
#
# The controller decides and knows no task. The run is the one task that uses the link. Callers run in
# tasks of their own, and never touch the link: ask() gives a request to the controller in the caller's turn
# of the loop, publishes the changes of state that follow, and wakes the run if something is due. A caller
# then waits for a future. The controller answers the future of a request or a move; StateWaiters answers
# the future of a state.
#
# DISCONNECTED and DO_SHUTDOWN end a wait with an error. An activation has further states that end it. Only
# wait_for_state() waits all of them out.
#
# A run ends once, in Run.end_with(), and _end() is called in that turn of the loop. The gripper is given back
# before SHUTDOWN is published, because a reader of that may start a hand, and every future that is left
# fails. If the event loop was closed, no turn is left: the run never ends, and its hand is of no use.

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, ClassVar, Final, ParamSpec, TypeVar

from ..control.controller import Controller
from ..control.ledger import Ledger
from ..control.state_machine import StateMachine
from ..control.waiters import Move, Waiter
from ..hands.options import HandOptions
from ..hands.statistics import Counters
from ..hands.streams import Channels
from ..hands.waiting import STALLED_S, ActivationProgress, StallWatch, StateWaiters
from ..link.gripper_link import Claims
from ..runtime.clock import now
from ..runtime.concurrency import check_loop, wait_shielded
from ..runtime.limit import Limit
from ..values.enums import Fault, Finger, State, Trigger
from ..values.errors import (
    ActivationTimeoutError,
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
from ..values.request import AxisRequest, Request
from ..values.states import RUNNING, SEQUENCES
from ..values.status import RobotiqStatus
from .news import UnreachedNews
from .poller import RunParts
from .publisher import Publisher
from .run import Run, RunState

P = ParamSpec("P")
T = TypeVar("T")
MARGIN_S: Final = 2.0
"""Added to twice the expected time for the default timeout of a move."""
Failing = Mapping[State, Callable[[], RobotiqError]]
"""The states that end a wait, each with the error for the caller."""


def usual_time(
    position: int,
    axes: Finger,
    status: RobotiqStatus,
    speeds: Mapping[Finger, int],
    closing_s: Callable[[int], float],
) -> float:
    """Seconds that a move may take by default: twice the expected time of its slowest axis plus MARGIN_S.

    ``closing_s`` gives the seconds of a full stroke at a speed.
    """
    # No time is published for the scissor: it counts as a finger. The times are of one gripper without
    # load [thesis, table A1.1]: twice leaves room.
    full = status.model.stroke.counts
    strokes = {axis: abs(position - status.position(axis)) / full for axis in axes}
    return 2 * max(stroke * closing_s(speeds[axis]) for axis, stroke in strokes.items()) + MARGIN_S


class Session:
    """A run: from start() to stop(), or until the link is given up.

    Making one claims the gripper and begins to connect. This needs a running event loop. The machine and the
    channels outlive it.

    Attributes:
        loop: in which it runs.

    Raises:
        InvalidStateError: another hand of this process owns the gripper.
    """

    _claims: ClassVar[Claims[Session, Ledger]] = Claims()

    def __init__(
        self,
        options: HandOptions,
        machine: StateMachine,
        channels: Channels,
        *,
        activate: bool,
        wait: float = 0.0,
        assumed: Mapping[tuple[Finger, str], int] | None = None,
    ) -> None:
        self.options = options
        self.machine = machine
        before = self._claim()
        self.loop: asyncio.AbstractEventLoop = asyncio.get_running_loop()
        self._channels = channels
        self._waiters = StateWaiters()
        self._progress = ActivationProgress(self.loop, options.log)
        self.counters: Counters = Counters()
        self.unreached: UnreachedNews = UnreachedNews(options.log)
        self._publisher = Publisher(channels, machine)
        has, speed, force = assumed or {}, options.speed, options.force
        axes = tuple(
            AxisRequest(0, has.get((axis, "speed"), speed), has.get((axis, "force"), force))
            for axis in options.model.axes
        )
        first, spacing = Request(axes=axes, model=options.model), options.write_spacing
        self.controller: Controller = Controller(machine, first, spacing, before, self._publisher.end)
        self.controller.allow_activation(activate)
        try:
            link = options.make_transport()
        except BaseException:
            self._claims.release(self)
            raise
        parts = RunParts(link, self.controller, self.counters, self._publisher, options)
        self.run: Run = Run(parts, self._end)
        channels.reopen(self.loop)
        machine.begin(self._on_transition)
        machine.show(State.DISCONNECTED, Trigger.ASK_START)
        self._publisher.publish_changes()
        self._task = self.loop.create_task(self.run.run(wait), name="robotiq_async poller")
        self._task.add_done_callback(self._end_with)

    # -- its end ---------------------------------------------------------------------------------------

    @property
    def is_over(self) -> bool:
        """Whether it has ended."""
        return self.run.state is RunState.OVER

    async def stop(self, *, halt: bool, keep_grip: bool = False) -> None:
        """Stop as :meth:`Hand.stop` promises, also when cancelled during it."""
        self.check_loop("hand.stop()")
        self.run.request_stop(halt=halt, keep_grip=keep_grip)
        await self.ended()

    async def ended(self) -> None:
        """Wait for the end of the task; a cancellation during the wait is raised after it."""
        try:
            await wait_shielded(self._task)
        finally:
            if self._task.done():  # not if a second Ctrl-C has broken the event loop
                self._end_with(self._task)

    def _claim(self) -> Ledger | None:
        """Claim the gripper; return the ledger of its last run, whose writes may still act."""
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

    def _end_with(self, task: asyncio.Task[None]) -> None:
        """The task has ended, perhaps before it ran."""
        self.run.end_with(None if task.cancelled() else task.exception())

    def _end(self) -> None:
        """The run is over: no caller may wait for it."""
        run = self.run
        # Before SHUTDOWN is published: a reader of it may start a hand.
        self._claims.release(self, self.controller.ledger)
        self.controller.close()
        self._publisher.tell()
        self._waiters.fail(run.why_over)
        self._channels.end(None if run.failure is None else run.why_over)

    # -- whether it takes calls ------------------------------------------------------------------------

    def check_loop(self, what: str) -> None:
        """Raise RuntimeError for a call from another thread or event loop."""
        check_loop(self.loop, what)

    def check_running(self) -> None:
        """Raise NotStartedError, or ConnectionLostError if the link was given up, unless the hand runs."""
        if self.is_over:
            if isinstance(self.run.failure, RobotiqConnectionError):
                raise self.link_lost()
            raise NotStartedError("the hand is not started", advice="use 'async with' or start()")
        if self.loop.is_closed():
            raise NotStartedError("the event loop that the hand ran in was closed", advice="make a new hand")

    def check_takes_requests(self) -> None:
        """Raise NotStartedError once stop() was called."""
        if self.machine.state is State.DO_SHUTDOWN:
            raise self._stopped()

    def link_lost(self) -> RobotiqConnectionError:
        return self.run.link_error()

    # -- waiting ---------------------------------------------------------------------------------------

    async def connected(self) -> None:
        """Wait for the first status; raises RobotiqError if none comes."""
        await self.run.connected

    def waiter(self) -> asyncio.Future[Any]:
        return self.loop.create_future()

    def ask(self, request: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Make a request of the controller; callers and readers hear of it afterwards, or after its write."""
        try:
            return request(*args, **kwargs)
        finally:
            self.run.note_request()

    async def answered(self, request: Callable[[Waiter[None]], None]) -> None:
        """Make a request and wait for its acknowledgement; raises RobotiqError if none comes."""
        waiter = self.waiter()
        self.ask(request, waiter)
        await waiter

    @contextmanager
    def moving(
        self, position: int, axes: Finger, speed: int | None, force: int | None
    ) -> Iterator[tuple[asyncio.Future[MoveResult], float]]:
        """Move axes; yield the future of the result, and the seconds that it may take by default.

        If the block is left before the move has ended, the move is given up, and its axes that move are held.
        """
        ended: asyncio.Future[MoveResult] = self.waiter()
        move, is_seen = Move(position, axes, now(), ended), True
        try:
            self.ask(self.controller.move, move, speed, force)
            status = self.controller.status
            assert status is not None, "the hand takes commands, so a status has been read"
            closing_s = self.options.units.closing_s
            yield ended, usual_time(position, axes, status, self.controller.speeds, closing_s)
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

        ``failing`` are states that end the wait in error, besides a lost link and a stop; None waits out a
        lost link and a stop, too. ``what`` is the message of a timeout.

        Raises:
            StateTimeoutError: not in time.
            RobotiqError: refused, or ended by one of these.
        """
        ends = {} if failing is None else {**self._ends, **failing}
        state: State | None = None
        with self._waiters.watching(states, ends) as reached:
            if ask is not None:
                self.ask(ask)
            with Limit(timeout):
                state = await reached
        if state is None:
            raise self._waiters.late(what, timeout, self.machine.state)
        return state

    async def activated(self, ask: Callable[[], None] | None = None) -> None:
        """Wait for the end of an activation. If this hand began it, it must not end in a fault.

        Args:
            ask: makes the request; None for an activation that the start, or another caller, has begun.

        Raises:
            GripperFaultError: the activation is refused because of a fault, or ended in a fault.
            NotActivatedError: the gripper was reset during it, or reset() or halt() took over.
            ActivationTimeoutError: not finished within the activation timeout, or stalled.
            InvalidStateError: the activation is refused during a reset or a release.
            MotionInhibitedError: a person has stopped the hand.
            ConnectionLostError: the link is or went down.
            NotStartedError: the hand was stopped.
        """
        if ask is None and self.machine.state not in SEQUENCES:
            if self.machine.state is State.RESET:  # not begun, because a person has inhibited it
                self.machine.check_permitted()
            return
        faulty = () if ask is not None or self.controller.is_busy else (State.FAULT, State.ATR_DONE)
        failing: Failing = {
            State.FAULT: self._fault,
            State.ATR_DONE: self._fault,
            State.RESET: lambda: NotActivatedError("the gripper was reset during the activation"),
            State.DO_RESET: lambda: self.machine.taken_over(NotActivatedError("a reset or a halt took over")),
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
        if stall.is_over:
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
        shown = f"nothing but {fault.description} (gFLT 0x{int(fault):02X})" if fault else "it has not begun"
        return ActivationTimeoutError(
            f"the activation makes no progress: {shown} for {STALLED_S:g} s. "
            "Is the emergency stop released, and the gripper powered?",
            advice="release it; then start(activate=False) and recover(), which resets the gripper",
        )

    def _fault(self) -> GripperFaultError:
        assert self.controller.status is not None, "a fault was read from a status"
        return GripperFaultError(self.controller.status.fault)

    def _on_transition(self, source: State, target: State, trigger: Trigger) -> None:
        if target is State.FAULT:
            self.counters.note_fault()
        self._progress.reached(target)
        self._publisher.note(Transition(source, target, trigger, now()), self._waiters.woken_by(target))
