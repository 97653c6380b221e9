"""RobotiqHand: one gripper, for the program that moves it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Mapping
from types import TracebackType
from typing import Any, ClassVar, Final, Self, TypeVar

import anyio

from .calibration.scales import SpeedCalibration
from .concurrency import to_the_end
from .control.controller import Core
from .control.motion import Move, MoveResult
from .control.pending import Delivery
from .control.state_machine import RUNNING, SEQUENCES, Machine, Trigger
from .enums import CLOSED, OPEN, Finger, Severity, State
from .errors import (
    ActivationTimeoutError,
    ConnectionLostError,
    GripperFaultError,
    InvalidStateError,
    MoveTimeoutError,
    NotActivatedError,
    NotStartedError,
    RobotiqConnectionError,
    RobotiqError,
    StateTimeoutError,
)
from .link.modbus import Transport
from .log import log
from .session.claims import Claims
from .session.clock import now
from .session.event_loop import check_loop, running_loop
from .session.options import (
    ACTIVATION_TIMEOUT_S,
    CONNECT_TIMEOUT_S,
    POLL_INTERVAL_S,
    RESPONSE_TIMEOUT_S,
    check_options,
)
from .session.poller import Owner, ReconnectPolicy
from .session.state_waiters import StateWaiters
from .session.statistics import Counters, Statistics
from .session.streams import Channel, SentRequest, Stream, Transition
from .wire.checks import check_byte, check_int, check_mask, check_timeout
from .wire.status import RobotiqStatus

T = TypeVar("T")

RESET_TIMEOUT_S: Final = 5.0
"""A reset takes a device cycle or two; this leaves room for a slow one."""
RELEASE_TIMEOUT_S: Final = 60.0
"""A release opens slowly; no figure is published. A full stroke at the slowest speed takes 10 s."""
RECOVER_TIMEOUT_S: Final = 90.0
"""Interference counts as minor for 20 s, a release may take a minute, a reset and an activation follow."""


class RobotiqHand:
    """A Robotiq 3-Finger gripper behind Modbus TCP, a serial line, or simulated.

    Use it as ``async with RobotiqHand(address) as hand:``, or call :meth:`start` and :meth:`stop`. One
    task polls the gripper; every call here leaves its wish with that task and never blocks the loop.
    Calls may come from any task of the loop the hand was started in. From another thread, or another
    loop, every call is a RuntimeError that says what to do, and nothing has been asked then.

    Nothing of this has run on real hardware yet.
    """

    _running: ClassVar[Claims[RobotiqHand]] = Claims()
    """Hands that own a gripper in this process."""

    def __init__(
        self,
        address: str | Transport = "sim://",
        *,
        device_id: int | None = None,
        poll_interval: float = POLL_INTERVAL_S,
        connect_timeout: float = CONNECT_TIMEOUT_S,
        response_timeout: float = RESPONSE_TIMEOUT_S,
        activation_timeout: float = ACTIVATION_TIMEOUT_S,
        reconnect: bool | ReconnectPolicy = True,
        speed: int = 128,
        force: int = 64,
        request_address: int | None = None,
        status_address: int | None = None,
        calibration: SpeedCalibration | None = None,
    ) -> None:
        """Check every option. Opens nothing and needs no running loop.

        Speed and force have no echo. So after adopting an active gripper, ``speed`` and ``force`` are also
        what the axes get that a first command does not address: pass what the gripper was used with if
        that matters to what it holds.

        Args:
            address: ``tcp://HOST[:502]`` (or HOST, HOST:PORT), ``rtu:///dev/ttyUSB0``, ``sim://``, or a
                transport object.
            device_id: Modbus unit id, 1..247; by default 2 over TCP and 9 over RTU. Two hands on one TCP
                address need one each: that of their gripper behind the gateway.
            poll_interval: seconds between polls, 0.001..0.1.
            connect_timeout: seconds for opening the link, 0.01..5.
            response_timeout: seconds for one answer, 0.005..0.5.
            activation_timeout: seconds for an activation, 0.01..120.
            reconnect: whether a lost link is opened again, or a :class:`ReconnectPolicy`.
            speed: what the axes get until set otherwise, 0..255.
            force: what the axes get until set otherwise, 0..255.
            request_address: first request register; by default 0 over TCP and 0x03E8 over RTU.
            status_address: first status register; by default 0 over TCP and 0x07D0 over RTU.
            calibration: how fast this gripper is: default time-outs of moves come from it. None for the
                thesis's gripper.

        Raises:
            TypeError: an option of the wrong type.
            ValueError: an option outside its range, or a malformed address.
        """
        self._options = check_options(
            address,
            device_id=device_id,
            poll_interval=poll_interval,
            connect_timeout=connect_timeout,
            response_timeout=response_timeout,
            activation_timeout=activation_timeout,
            reconnect=reconnect,
            speed=speed,
            force=force,
            request_address=request_address,
            status_address=status_address,
            calibration=calibration,
        )
        self._machine = Machine(self._on_transition)
        self._core = self._new_core()
        self._counters = Counters()
        self._statuses: Channel[RobotiqStatus] = Channel()
        self._transitions: Channel[Transition] = Channel()
        self._requests: Channel[SentRequest] = Channel()
        self._until_link_lost: set[Stream[RobotiqStatus]] = set()
        """Streams of those who wait for what the gripper does next: they end when the link goes down."""
        self._waiters = StateWaiters()
        self._owner: Owner | None = None
        self._task: asyncio.Task[None] | None = None

    # -- lifetime --------------------------------------------------------------------------------------

    async def __aenter__(self) -> Self:
        """Start, with activation. See :meth:`start` for what it raises."""
        await self.start()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop, also when the block failed or was cancelled."""
        await self.stop()

    async def start(self, activate: bool = True) -> None:
        """Connect, read the status, activate if the gripper is reset, and poll from then on.

        An activation MOVES the fingers: they open and close to their stops. A gripper that is active
        already is adopted: nothing is written. One that is in fault already is left there, so that
        :meth:`atr` and :meth:`recover` can run.

        A failed or cancelled start leaves nothing running; an activation that it began is taken back.

        Args:
            activate: False leaves a reset gripper in RESET.

        Raises:
            RuntimeError: not in a running asyncio event loop.
            InvalidStateError: this hand is started already, or another one runs on the same gripper.
            NotStartedError: stop() was called meanwhile.
            ConnectFailedError: nobody answers within the connect time-out.
            RobotiqConnectionError: somebody answers, but not a gripper; or the link went down again.
            GripperFaultError: the activation that was begun ended in a fault.
            NotActivatedError: the gripper was reset during the activation that was begun.
            ActivationTimeoutError: the activation was not finished in time.
        """
        if not isinstance(activate, bool):
            raise TypeError(f"activate must be True or False, got {activate!r}")
        loop = running_loop()
        self._abandon_if_loop_closed()
        self._claim()
        self._core = self._new_core()
        self._counters = Counters()
        for channel in self._channels:
            channel.reopen(loop)
        sequence = self._owner.sequence if self._owner is not None else 0
        owner = self._owner = Owner(
            self._options.make_transport(),
            self._core,
            self._counters,
            address=self._options.address,
            activate=activate,
            poll_interval=self._options.poll_interval,
            policy=self._options.policy,
            first_sequence=sequence,
            publish=self._statuses.push,
            publish_request=self._requests.push,
        )
        self._machine.happen(Trigger.ASK_START)
        self._task = loop.create_task(owner.run(), name="robotiq_async owner")
        self._task.add_done_callback(self._on_owner_done)
        try:
            await owner.connected
            if activate:
                await self._wait_until_active()
        except BaseException:
            await self.stop()
            raise

    async def stop(self, *, halt: bool = True) -> None:
        """Stop the fingers (rGTO = 0), keep the activation, disconnect. Idempotent.

        Ends within 2 s even on a dead link, and also when cancelled meanwhile: the cancellation is
        raised once the hand has stopped. If the link is down, it is tried once more. What other tasks
        wait for ends with NotStartedError.

        Args:
            halt: False disconnects and leaves the fingers to what they do; for programs that only look.

        Raises:
            RuntimeError: called in another event loop than the hand runs in; it goes on. (When that loop
                has been closed, nothing can reach the gripper any more: the hand counts as stopped, and
                the fingers go on with what they do.)
        """
        if not isinstance(halt, bool):
            raise TypeError(f"halt must be True or False, got {halt!r}")
        self._abandon_if_loop_closed()
        task, owner = self._task, self._owner
        if task is None or owner is None:
            return
        check_loop(task.get_loop(), "hand.stop()")
        owner.request_stop(halt=halt)
        try:
            await to_the_end(task)
        finally:
            self._on_owner_done(task)

    # -- commands --------------------------------------------------------------------------------------

    async def set_position(self, value: int, fingers: Finger | int = Finger.ABC) -> None:
        """Ask axes to go somewhere; returns when the gripper has acknowledged it, not when they are there.

        When cancelled, the request may still be sent: :meth:`halt` stops it.

        Args:
            value: target in counts, 0 (open) .. 255 (closed).
            fingers: mask of the axes.

        Raises:
            TypeError: value or mask of the wrong type; nothing is sent.
            ValueError: value or mask outside their range; nothing is sent.
            RobotiqError: the hand takes no commands now, or the link went down before the
                acknowledgement (the request is not sent again).
        """
        await self._deliver(check_mask(fingers), position=check_byte("value", value))

    async def set_speed(self, value: int, fingers: Finger | int = Finger.ALL) -> None:
        """Set the speed of axes, also of a motion under way; never starts one.

        Args:
            value: 0 (22 mm/s nominal) .. 255 (110 mm/s nominal).
            fingers: mask of the axes.

        Raises:
            TypeError, ValueError, RobotiqError: as :meth:`set_position`.
        """
        await self._deliver(check_mask(fingers), speed=check_byte("value", value))

    async def set_force(self, value: int, fingers: Finger | int = Finger.ALL) -> None:
        """Set the force of axes; never starts a motion. More force tightens a grip.

        Args:
            value: 0 (15 N nominal) .. 255 (60 N nominal); not linear.
            fingers: mask of the axes.

        Raises:
            TypeError, ValueError, RobotiqError: as :meth:`set_position`.
        """
        await self._deliver(check_mask(fingers), force=check_byte("value", value))

    def command(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        position: int | None = None,
        speed: int | None = None,
        force: int | None = None,
    ) -> None:
        """Ask axes for something, for control loops: never blocks and never queues.

        What is set between two polls goes out as one write; the last value wins. What cannot be
        delivered because the link goes down is dropped, which the state and the log tell.

        Args:
            fingers: mask of the axes.
            position: target in counts, 0..255.
            speed: 0..255.
            force: 0..255.

        Raises:
            TypeError: an argument of the wrong type; nothing is sent.
            ValueError: an argument outside its range, or none of position, speed and force.
            RobotiqError: the hand takes no commands now.
        """
        axes = check_mask(fingers)
        if position is None and speed is None and force is None:
            raise ValueError("command() needs at least one of position, speed and force in 0..255, got none")
        position = None if position is None else check_byte("position", position)
        speed = None if speed is None else check_byte("speed", speed)
        force = None if force is None else check_byte("force", force)
        self._started().command(axes, position, speed, force)

    async def move(
        self,
        position: int,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        force: int | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        """Move axes and return when every one of them has stopped: there, or against something.

        Cancelled (by a task, ``asyncio.timeout`` or an anyio scope) or timed out, those of its axes that
        still move are held where they are; an axis in contact keeps its request and its grip.

        Args:
            position: target in counts, 0 (open) .. 255 (closed).
            fingers: mask of the axes; the others stay as they are.
            speed: new speed of these axes, 0..255; None leaves it.
            force: new force of these axes, 0..255; None leaves it.
            timeout: seconds; None for twice the expected time plus 2 s.

        Returns:
            How each axis ended. A contact is a result, not an error.

        Raises:
            TypeError: an argument of the wrong type; nothing is sent.
            ValueError: an argument outside its range; nothing is sent.
            MoveTimeoutError: an axis still moved when the time was over.
            MoveSupersededError: another command, halt(), reset() or another client took over an axis.
            GripperFaultError: the gripper reports a minor or a major fault.
            NotActivatedError: the gripper is not activated, or lost its activation.
            ConnectionLostError: the link went down; the gripper may still be moving.
            RobotiqStateError: the hand takes no commands now, or was stopped.
        """
        axes = check_mask(fingers)
        target = check_byte("position", position)
        speed = None if speed is None else check_byte("speed", speed)
        force = None if force is None else check_byte("force", force)
        limit = check_timeout("timeout", timeout)
        core = self._started()
        core.refuse_unless_running(Trigger.ASK_COMMAND)
        if limit is None:
            limit = core.move_timeout(target, axes, speed)
        loop = asyncio.get_running_loop()
        ended: asyncio.Future[MoveResult] = loop.create_future()

        def resolve(outcome: MoveResult | RobotiqError) -> None:
            if ended.done():
                return
            if isinstance(outcome, MoveResult):
                ended.set_result(outcome)
            else:
                ended.set_exception(outcome)

        move = Move(target, axes, now(), resolve)
        core.move(move, speed, force)
        with self._counters.move() as note:
            try:
                with anyio.move_on_after(limit):
                    result = await ended
                    note(result)
                    return result
            except asyncio.CancelledError:
                core.abandon(move, unseen=True)
                if ended.done() and not ended.cancelled():
                    ended.exception()  # nobody else will look at it
                raise
            finally:
                core.abandon(move)
            raise MoveTimeoutError(
                f"{axes} still moved after {limit:.2f} s on the way to {target}", self.status
            )

    async def open(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        force: int | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        """Open fingers: :meth:`move` to 0. Returns and raises what it does."""
        return await self.move(OPEN, fingers, speed=speed, force=force, timeout=timeout)

    async def close(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        force: int | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        """Close the fingers, not the connection (that is :meth:`stop`): :meth:`move` to 255."""
        return await self.move(CLOSED, fingers, speed=speed, force=force, timeout=timeout)

    async def halt(self) -> None:
        """Stop every axis now (rGTO = 0); the next command goes again, and moves only what it addresses.

        Returns when the gripper shows that it has stopped, at most half a second after its
        acknowledgement. Awaited moves end with MoveSupersededError. When cancelled, the halt is sent all
        the same. In RESET and ATR_DONE nothing moves and nothing is sent.

        rGTO does not stop an activation or an automatic release. During these, halt() takes rACT back, as
        :meth:`reset` does, and returns in RESET.

        Raises:
            MoveSupersededError: reset() took over before it was sent.
            StateTimeoutError: an activation or a release was not seen to end within 5 s.
            RobotiqError: not connected, or the link went down before the acknowledgement.
        """
        core = self._connected()
        if self.state in SEQUENCES:
            await self._reset(Trigger.ASK_HALT)
        else:
            await self._told(core.halt)

    # -- activation, faults ----------------------------------------------------------------------------

    async def activate(self) -> None:
        """Activate the gripper, if it is not active yet. The fingers MOVE to their stops.

        When cancelled, the activation goes on; :meth:`reset` ends it.

        Raises:
            GripperFaultError: a fault is latched (see :meth:`recover`), or the activation ended in one.
            NotActivatedError: the gripper was reset meanwhile.
            ActivationTimeoutError: not finished within the activation time-out.
            RobotiqError: not possible now, or the link went down.
        """
        core = self._connected()
        if self.state in RUNNING:
            return
        if self.state in (State.FAULT, State.ATR_DONE):
            raise GripperFaultError(self.status.fault)
        ask = None if self.state in (State.DO_ACTIVATION, State.WF_ACTIVATION) else core.activate
        await self._wait_until_active(ask)

    async def reset(self) -> None:
        """Reset the gripper (rACT = 0): clears faults, and lets go of what it holds.

        Returns in RESET. Ends an activation or a release under way, too. Awaited moves end with
        MoveSupersededError. When cancelled, the reset goes on.

        Raises:
            StateTimeoutError: the gripper did not report the reset within 5 s.
            RobotiqError: not possible now, or the link went down.
        """
        await self._reset(Trigger.ASK_RESET)

    async def _reset(self, trigger: Trigger) -> None:
        core = self._connected()
        await self._reach(
            {State.RESET},
            RESET_TIMEOUT_S,
            ask=lambda: core.reset(trigger),
            failing={State.DISCONNECTED: self._link_lost},
            what="the gripper did not report the reset",
        )

    async def atr(self) -> None:
        """Release automatically: all axes open slowly, whatever the fault. Only in FAULT.

        Returns in ATR_DONE; then only :meth:`reset` and :meth:`activate`, or :meth:`recover`, help. When
        cancelled, the release goes on.

        Raises:
            InvalidStateError: not in FAULT.
            NotActivatedError: the gripper is or was reset.
            StateTimeoutError: the release was not finished within 60 s.
            RobotiqError: the link went down.
        """
        core = self._connected()
        await self._reach(
            {State.ATR_DONE},
            RELEASE_TIMEOUT_S,
            ask=core.release,
            failing={
                State.DISCONNECTED: self._link_lost,
                State.RESET: lambda: NotActivatedError("the gripper was reset during the automatic release"),
                State.DO_RESET: lambda: InvalidStateError("reset() or halt() took over", State.DO_RESET),
            },
            what="the automatic release was not finished",
        )

    async def recover(self, timeout: float | None = None) -> None:
        """Do whatever the present fault needs, until the gripper is active again.

        Waits for a minor fault to clear, and for an activation, reset or release under way; resets and
        activates after a major one. A reset DROPS the part, and an activation MOVES the fingers.

        Args:
            timeout: seconds for all of it; None for 90 s.

        Raises:
            StateTimeoutError: not active in time.
            ActivationTimeoutError: the new activation took longer than the activation time-out.
            GripperFaultError: the new activation ended in a fault.
            NotActivatedError: the gripper was reset during the new activation.
            RobotiqError: the link went down, or the hand was stopped.
        """
        limit = check_timeout("timeout", timeout) or RECOVER_TIMEOUT_S
        self._started()
        with anyio.move_on_after(limit):
            while self.state not in RUNNING:
                await self._recover_step()
            return
        raise StateTimeoutError(f"the gripper is not active after {limit:g} s: {self.state.name}")

    async def _recover_step(self) -> None:
        state = self.state
        if state is State.RESET:
            await self.activate()
        elif state is State.ATR_DONE or (
            state is State.FAULT and self.status.fault.severity is Severity.MAJOR
        ):
            await self.reset()
        elif state is State.DISCONNECTED:
            raise self._link_lost()
        else:
            # A minor fault, or a sequence under way: the next status may tell more.
            self._started()
            stream = self.statuses()
            self._until_link_lost.add(stream)
            try:
                await anext(stream)
            except StopAsyncIteration:
                raise NotStartedError("the hand was stopped") from None
            finally:
                self._until_link_lost.remove(stream)

    # -- what is going on ------------------------------------------------------------------------------

    @property
    def address(self) -> str:
        """The gripper's address in its full form; for a transport object, what messages call it."""
        return self._options.address

    @property
    def state(self) -> State:
        """Where the hand is."""
        return self._machine.state

    @property
    def status(self) -> RobotiqStatus:
        """The most recent status; its timestamp tells how old it is.

        Raises:
            NotStartedError: there is none yet.
        """
        if self._core.status is None:
            raise NotStartedError("no status has been read yet: start the hand first")
        return self._core.status

    @property
    def is_activated(self) -> bool:
        """Whether the gripper is active (gIMC = 3).

        Raises:
            RobotiqError: not known: not started, or the link is down.
        """
        return self._current_status().is_activated

    @property
    def is_reset(self) -> bool:
        """Whether the gripper is reset (gACT = 0 and gIMC = 0).

        Raises:
            RobotiqError: not known: not started, or the link is down.
        """
        status = self._current_status()
        return status.is_reset and not status.activation_echo

    @property
    def is_moving(self) -> bool:
        """Whether an axis moves, or will because of a command that does not act yet.

        Raises:
            RobotiqError: not known: not started, or the link is down.
        """
        self._current_status()
        return self._core.is_moving

    @property
    def statistics(self) -> Statistics:
        """How the polling went since the last start."""
        return self._counters.snapshot(self._core.foreign_commands)

    def statuses(self, buffer: int = 1) -> Stream[RobotiqStatus]:
        """Every status from now on, for one reader; newest wins.

        A slow reader costs only itself: it keeps the newest ``buffer`` statuses and ``.missed`` counts
        the others. Opened before the start it waits, and it waits out a lost link. Ends after
        :meth:`stop`; raises RobotiqConnectionError when the hand gives up.

        Args:
            buffer: statuses kept for the reader, 1..1000000.

        Raises:
            TypeError: buffer is not an int.
            ValueError: buffer is outside its range.
        """
        return self._open(self._statuses, check_int("buffer", buffer, 1, 1_000_000))

    def transitions(self) -> Stream[Transition]:
        """Every change of state from now on, for one reader, none lost. Ends after :meth:`stop`."""
        return self._open(self._transitions, None)

    def requests(self, buffer: int | None = None) -> Stream[SentRequest]:
        """Every request written from now on, for one reader. Ends after :meth:`stop`.

        Args:
            buffer: requests kept for the reader, the newest ones, 1..1000000; None loses none.

        Raises:
            TypeError: buffer is not an int.
            ValueError: buffer is outside its range.
        """
        kept = None if buffer is None else check_int("buffer", buffer, 1, 1_000_000)
        return self._open(self._requests, kept)

    async def wait_for_state(self, *states: State, timeout: float | None = None) -> State:
        """Wait until the hand is, if only for a moment, in one of these states, and return it.

        Args:
            states: at least one.
            timeout: seconds; None waits for as long as the hand runs.

        Raises:
            TypeError: not a State.
            ValueError: no state, or a malformed time-out.
            StateTimeoutError: not reached in time.
            NotStartedError: the hand is not started, or was stopped meanwhile.
            RobotiqConnectionError: the hand gave up on its link.
        """
        if not states:
            raise ValueError("states must name at least one State, got none")
        for state in states:
            if not isinstance(state, State):
                raise TypeError(f"states must be State members, got {state!r}")
        limit = check_timeout("timeout", timeout)
        if self.state in states:
            return self.state
        self._started()
        names = " or ".join(state.name for state in states)
        return await self._reach(set(states), limit, what=f"{names} was not reached")

    def __repr__(self) -> str:
        """Address and state."""
        return f"<RobotiqHand {self._options.address} {self.state.name}>"

    # -- inside ----------------------------------------------------------------------------------------

    def _new_core(self) -> Core:
        options = self._options
        return Core(self._machine, options.speed, options.force, options.closing_time)

    def _claim(self) -> None:
        """Own the gripper in this process.

        Raises:
            InvalidStateError: it is owned already.
        """
        gripper = self._options.gripper
        owner = self._running.claim(gripper, self, lambda each: each._task is None)  # noqa: SLF001
        if owner is not None:
            who, hint = ("this hand", "") if owner is self else ("another hand", gripper().hint)
            raise InvalidStateError(
                f"{who} runs on {owner.address} already: stop() it first{hint}",
                self.state,
                {State.DISCONNECTED, State.SHUTDOWN},
            )

    def _on_owner_done(self, task: asyncio.Task[None]) -> None:
        """The owner task has ended: nobody may wait for it any longer. Called by whoever sees it first."""
        if self._task is not task:
            return
        self._running.release(self)
        self._task = None
        failure: Callable[[], RobotiqError] | None = None
        if not task.cancelled() and (bug := task.exception()) is not None:
            log.critical("the task that owns the link failed", exc_info=bug)
            failure = lambda: ConnectionLostError(f"internal error: {bug!r}")  # noqa: E731
        elif self._owner is not None and self._owner.failure is not None:
            failure = self._link_lost
        self._waiters.fail(failure or (lambda: NotStartedError("the hand was stopped")))
        for channel in self._channels:
            channel.end(failure)

    @property
    def _channels(self) -> tuple[Channel[Any], ...]:
        return self._statuses, self._transitions, self._requests

    def _open(self, channel: Channel[T], buffer: int | None) -> Stream[T]:
        """A stream; not from another thread while the hand runs, for the streams are not locked."""
        if self._task is not None and not self._lost_its_loop():
            check_loop(self._task.get_loop(), "a stream of the hand")
        return channel.open(buffer)

    def _lost_its_loop(self) -> bool:
        """Whether the loop that the hand ran in was closed without stopping the hand."""
        return self._task is None or self._task.get_loop().is_closed()

    def _abandon_if_loop_closed(self) -> None:
        """Count as stopped when the hand's loop was closed under it: its task can never end any more.

        Nobody in that loop can be told. What they wait with belongs to it and is left to it.
        """
        if self._task is None or not self._lost_its_loop():
            return
        log.warning("%s: its event loop was closed before stop(); the fingers may still move", self.address)
        self._running.release(self)
        if self._owner is not None:
            self._owner.abandon()
        self._task = self._owner = None
        self._waiters = StateWaiters()
        for channel in self._channels:
            channel.end()
        self._machine.happen(Trigger.ASK_STOP)
        self._machine.happen(Trigger.STOPPED)

    def _on_transition(self, source: State, target: State, trigger: Trigger) -> None:
        self._transitions.push(Transition(source, target, trigger, now()))
        self._counters.faults += target is State.FAULT
        self._waiters.reached(target)
        if target is State.DISCONNECTED:
            for stream in self._until_link_lost:
                stream.end(self._link_lost)

    def _started(self, *, reading: bool = False) -> Core:
        """The core of a hand that runs; whoever only reads may do so from anywhere.

        Raises:
            NotStartedError: not started, or stopped.
            ConnectionLostError: the hand gave up on its link.
            RuntimeError: called from another thread or event loop.
        """
        if self._task is None:
            if self._owner is not None and self._owner.failure is not None:
                raise self._link_lost()
            raise NotStartedError("the hand is not started: use 'async with' or start()")
        if self._lost_its_loop():
            raise NotStartedError("the event loop that the hand ran in was closed: start() it again")
        if not reading:
            check_loop(self._task.get_loop(), "the hand")
        return self._core

    def _connected(self) -> Core:
        """The core of a hand that has its link.

        Raises:
            NotStartedError: not started, or stopped.
            ConnectionLostError: the link is down.
        """
        core = self._started()
        if self.state is State.DISCONNECTED:
            raise self._link_lost()
        return core

    def _current_status(self) -> RobotiqStatus:
        self._started(reading=True)
        status = self.status
        if self.state is State.DISCONNECTED:
            raise ConnectionLostError("the link is down: what the gripper does is not known")
        return status

    def _link_lost(self) -> RobotiqConnectionError:
        failure = self._owner.failure if self._owner is not None else None
        error = ConnectionLostError(f"the link is down{'' if failure is None else f': {failure}'}")
        error.__cause__ = failure
        return error

    async def _deliver(
        self, axes: Finger, *, position: int | None = None, speed: int | None = None, force: int | None = None
    ) -> None:
        core = self._started()
        await self._told(lambda delivery: core.command(axes, position, speed, force, delivery))

    async def _told(self, ask: Callable[[Delivery], None]) -> None:
        """Ask for something and wait until told that it was acknowledged, or why not."""
        told: asyncio.Future[None] = asyncio.get_running_loop().create_future()

        def resolve(failure: RobotiqError | None) -> None:
            if told.done():
                return
            if failure is None:
                told.set_result(None)
            else:
                told.set_exception(failure)

        ask(resolve)
        await told

    async def _wait_until_active(self, ask: Callable[[], None] | None = None) -> None:
        """Wait for the end of an activation; one that this hand began must not end in a fault."""
        if ask is None and self.state not in SEQUENCES:
            return
        ours = ask is not None or self.state is State.DO_ACTIVATION or self._core.is_busy
        states = set(RUNNING) if ours else {*RUNNING, State.FAULT, State.ATR_DONE}
        failing: Mapping[State, Callable[[], RobotiqError]] = {
            State.DISCONNECTED: self._link_lost,
            State.RESET: lambda: NotActivatedError("the gripper was reset during the activation"),
            State.DO_RESET: lambda: NotActivatedError("reset() or halt() took over"),
            State.FAULT: lambda: GripperFaultError(self.status.fault),
            State.ATR_DONE: lambda: GripperFaultError(self.status.fault),
        }
        try:
            await self._reach(
                states,
                self._options.activation_timeout,
                ask=ask,
                failing={state: make for state, make in failing.items() if state not in states},
                what="the activation was not finished",
            )
        except StateTimeoutError as error:
            raise ActivationTimeoutError(str(error)) from None

    async def _reach(
        self,
        states: Collection[State],
        timeout: float | None,
        *,
        what: str,
        ask: Callable[[], None] | None = None,
        failing: Mapping[State, Callable[[], RobotiqError]] | None = None,
    ) -> State:
        """Ask for something and wait for a state; some states mean that it will not come."""
        with self._waiters.watching(states, failing or {}) as reached:
            if ask is not None:
                ask()
            with anyio.move_on_after(timeout):
                return await reached
        raise StateTimeoutError(f"{what} within {timeout:g} s (now {self.state.name})")
