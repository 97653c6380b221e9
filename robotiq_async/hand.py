"""RobotiqHand: one gripper, for the program that moves it."""

from __future__ import annotations

import asyncio
from types import TracebackType
from typing import Final, Self, TypeVar

import anyio

from .calibration import SpeedCalibration
from .control.motion import Move, MoveResult
from .control.state_machine import RUNNING, SEQUENCES, StateMachine
from .control.triggers import Trigger
from .enums import CLOSED, DEFAULT_FORCE, DEFAULT_SPEED, OPEN, Finger, Severity, State
from .errors import (
    ConnectionLostError,
    InvalidStateError,
    MoveTimeoutError,
    NotActivatedError,
    NotStartedError,
    StateTimeoutError,
)
from .link.transport import Transport
from .session.clock import now
from .session.event_loop import running_loop
from .session.options import (
    ACTIVATION_TIMEOUT_S,
    CONNECT_TIMEOUT_S,
    POLL_INTERVAL_S,
    RESPONSE_TIMEOUT_S,
    check_options,
)
from .session.reconnecting import ReconnectPolicy
from .session.session import Session
from .session.statistics import Counters, Statistics
from .session.streams import Channel, Channels, SentRequest, Stream, Transition
from .wire.checks import check_byte, check_int, check_mask, check_optional_byte, check_timeout
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
        speed: int = DEFAULT_SPEED,
        force: int = DEFAULT_FORCE,
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
        self._machine = StateMachine()
        self._channels = Channels()
        self._session: Session | None = None
        """The run under way, or the last one."""

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
        running_loop()
        self._abandon_if_loop_closed()
        before = self._session
        self._session = session = Session(
            self._options,
            self._machine,
            self._channels,
            activate=activate,
            first_sequence=0 if before is None else before.next_sequence,
        )
        try:
            await session.connected()
            if activate:
                await session.activated()
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
        if self._session is not None and not self._session.is_over:
            await self._session.stop(halt=halt)

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
        position = check_optional_byte("position", position)
        speed, force = check_optional_byte("speed", speed), check_optional_byte("force", force)
        self._asked().controller.command(axes, position, speed, force)

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
        speed, force = check_optional_byte("speed", speed), check_optional_byte("force", force)
        limit = check_timeout("timeout", timeout)
        session = self._asked()
        controller = session.controller
        if limit is None:
            limit = controller.move_timeout(target, axes, speed)
        ended: asyncio.Future[MoveResult] = session.waiter()
        move = Move(target, axes, now(), ended)
        controller.move(move, speed, force)
        with session.counters.move() as note:
            try:
                with anyio.move_on_after(limit):
                    result = await ended
                    note(result)
                    return result
            except asyncio.CancelledError:
                controller.abandon(move, unseen=True)
                if ended.done() and not ended.cancelled():
                    ended.exception()  # nobody else will look at it
                raise
            finally:
                controller.abandon(move)
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
        session = self._asked()
        if self.state in SEQUENCES:
            await self._reset(Trigger.ASK_HALT)
        else:
            await session.answered(session.controller.halt)

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
        session = self._asked()
        if self.state in RUNNING:
            return
        under_way = self.state in (State.DO_ACTIVATION, State.WF_ACTIVATION)
        await session.activated(None if under_way else session.controller.activate)

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
        session = self._asked()
        await session.reach(
            {State.RESET},
            RESET_TIMEOUT_S,
            ask=lambda: session.controller.reset(trigger),
            failing={State.DISCONNECTED: session.link_lost},
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
        session = self._asked()
        await session.reach(
            {State.ATR_DONE},
            RELEASE_TIMEOUT_S,
            ask=session.controller.release,
            failing={
                State.DISCONNECTED: session.link_lost,
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
        self._asked()
        with anyio.move_on_after(limit):
            while self.state not in RUNNING:
                await self._recover_step()
            return
        raise StateTimeoutError(f"the gripper is not active after {limit:g} s: {self.state.name}")

    async def _recover_step(self) -> None:
        session, state = self._asked(), self.state
        if state is State.RESET:
            await self.activate()
        elif state is State.ATR_DONE or (
            state is State.FAULT and self.status.fault.severity is Severity.MAJOR
        ):
            await self.reset()
        elif state is State.DISCONNECTED:
            raise session.link_lost()
        else:
            # A minor fault, or a sequence under way: the next status may tell more.
            await session.next_status()

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
        status = None if self._session is None else self._session.controller.status
        if status is None:
            raise NotStartedError("no status has been read yet: start the hand first")
        return status

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
        return self._started().controller.is_moving

    @property
    def statistics(self) -> Statistics:
        """How the polling went since the last start."""
        if self._session is None:
            return Counters().snapshot(0)
        return self._session.counters.snapshot(self._session.controller.foreign_commands)

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
        return self._open(self._channels.statuses, check_int("buffer", buffer, 1, 1_000_000))

    def transitions(self) -> Stream[Transition]:
        """Every change of state from now on, for one reader, none lost. Ends after :meth:`stop`."""
        return self._open(self._channels.transitions, None)

    def requests(self, buffer: int | None = None) -> Stream[SentRequest]:
        """Every request written from now on, for one reader. Ends after :meth:`stop`.

        Args:
            buffer: requests kept for the reader, the newest ones, 1..1000000; None loses none.

        Raises:
            TypeError: buffer is not an int.
            ValueError: buffer is outside its range.
        """
        kept = None if buffer is None else check_int("buffer", buffer, 1, 1_000_000)
        return self._open(self._channels.requests, kept)

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
        names = " or ".join(state.name for state in states)
        return await self._asked().reach(set(states), limit, what=f"{names} was not reached")

    def __repr__(self) -> str:
        """Address and state."""
        return f"<RobotiqHand {self._options.address} {self.state.name}>"

    # -- inside ----------------------------------------------------------------------------------------

    def _started(self) -> Session:
        """The run under way, for whoever only reads: that may be done from anywhere.

        Raises:
            NotStartedError: not started, or stopped.
            ConnectionLostError: the hand gave up on its link.
        """
        if self._session is None:
            raise NotStartedError("the hand is not started: use 'async with' or start()")
        self._session.check_running()
        return self._session

    def _asked(self) -> Session:
        """The run under way, for whoever asks for something.

        Raises:
            NotStartedError, ConnectionLostError: as :meth:`_started`.
            RuntimeError: called from another thread or event loop.
        """
        session = self._started()
        session.check_loop("the hand")
        return session

    def _current_status(self) -> RobotiqStatus:
        self._started()
        status = self.status
        if self.state is State.DISCONNECTED:
            raise ConnectionLostError("the link is down: what the gripper does is not known")
        return status

    def _open(self, channel: Channel[T], buffer: int | None) -> Stream[T]:
        """A stream; not from another thread while the hand runs, for the streams are not locked."""
        session = self._session
        if session is not None and not session.is_over and not session.lost_its_loop:
            session.check_loop("a stream of the hand")
        return channel.open(buffer)

    def _abandon_if_loop_closed(self) -> None:
        if self._session is not None and self._session.lost_its_loop:
            self._session.abandon()

    async def _deliver(
        self, axes: Finger, *, position: int | None = None, speed: int | None = None, force: int | None = None
    ) -> None:
        session = self._asked()
        await session.answered(
            lambda waiter: session.controller.command(axes, position, speed, force, waiter)
        )
