"""RobotiqHand: the hand that owns the link to its gripper."""

# Theory of operation
#
# A session lives from start() to the end of stop(). The hand makes requests of its controller and waits; it
# changes no state itself. The state machine does, from the statuses that the poller reads.
#
#   set_position, set_speed, set_force, hold, halt     answered(): acknowledged; a halt is seen to stop
#   command                                            ask(): no answer
#   move                                               moving(): a MoveResult; its end holds axes that move
#   activate, reset, atr                               activated(), reach(): a state, in limited time
#
# _admitted() is the gate of all of them: no request passes before start(), after stop(), or from elsewhere.
# A failed or cancelled start stops the session, and writes only if it has begun to write.
#
# recover() is a loop of steps. RESET is activated, ATR_DONE and a known major fault are reset, and in any
# other state the next status decides. After a step without progress (StallWatch) the gripper is reset, RESETS
# times at most. A lost link, and an error of a step, end it.

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Final, Literal

from ..calibration import ForceCalibration, SpeedCalibration
from ..control.pending import changes
from ..control.state_machine import StateMachine
from ..hands.base import Hand
from ..hands.options import (
    ACTIVATION_TIMEOUT_S,
    CONNECT_TIMEOUT_S,
    NO_ADDRESS,
    POLL_INTERVAL_S,
    RESPONSE_TIMEOUT_S,
    WRITE_SPACING_S,
    HandOptions,
    NoAddress,
    ReconnectPolicy,
)
from ..hands.statistics import Statistics
from ..hands.waiting import STALLED_S, StallWatch
from ..link.tunnel.protocol import Tunnel
from ..runtime.clock import now
from ..runtime.limit import Limit
from ..values.enums import DEFAULT_FORCE, DEFAULT_SPEED, Finger, Severity, State, Trigger
from ..values.errors import (
    ConnectionLostError,
    InvalidStateError,
    MoveSupersededError,
    MoveTimeoutError,
    NotActivatedError,
    NotStartedError,
    StateTimeoutError,
)
from ..values.events import SentRequest, Transition
from ..values.inhibit import Inhibit
from ..values.model import Model
from ..values.move_result import MoveResult
from ..values.states import RUNNING, SEQUENCES
from ..values.status import RobotiqStatus
from .session import Session

RESET_TIMEOUT_S: Final = 5.0  # a reset takes a device cycle or two; this leaves room for a slow one
# A release opens slowly; no figure is published. A full stroke at the slowest speed takes 10 s.
RELEASE_TIMEOUT_S: Final = 60.0
# Interference counts as minor for 20 s, a release may take a minute, a reset and an activation follow.
RECOVER_TIMEOUT_S: Final = 90.0
RESETS: Final = 2  # after an emergency stop one reset has been seen to help, and sometimes a second


class RobotiqHand(Hand):
    """A Robotiq 3-Finger gripper, 2F or Hand-E behind Modbus TCP, a serial line, or simulated.

    Use it as ``async with RobotiqHand(address) as hand:``, or call :meth:`start` and :meth:`stop`. One task
    polls the gripper; every call hands its request to that task and never blocks the loop. The calls may come
    from any task of the loop in which the hand was started. From another thread or another loop every call
    raises RuntimeError, which has the remedy, and sends nothing. See
    :class:`~robotiq_async.hands.Hand` for the promises of all hands.

    Making a hand checks every option; it opens nothing and needs no running loop.

    Speed and force have no echo. After adopting an active gripper, the first command therefore gives
    ``speed`` and ``force`` also to the axes that it does not address: pass the values that the gripper was
    used with if that matters to the part it holds.

    None of this has run on real hardware yet.

    Args:
        address: ``tcp://HOST[:502]`` (or HOST, HOST:PORT), ``rtu:///dev/ttyUSB0``, ``rtu+tcp://HOST:PORT``
            (a serial line behind a socket), ``urcap://HOST[:63352]`` (a UR with Robotiq's URCap, for a jaw:
            it carries no currents), ``sim://`` (or ``sim://?speedup=10&object=150``), or a :class:`Tunnel`.
            Without an address the gripper is simulated, and the first start logs a warning. A serial port
            sends at 115200 baud, 8N1, unless the address ends in
            ``?baud=500000``, ``&parity=E`` or ``&stopbits=2``. Any of them can end in ``?model=2f85`` and in
            ``?stroke=/cell/left.csv``, which are the options ``model`` and ``stroke``.
        name: name of this hand, 1..64 printable characters: errors and the log begin with it, and
            metrics and recordings carry it. None calls it by its address.
        device_id: Modbus unit id, 0..255 over TCP and 1..247 over RTU; by default 2 over TCP and 9 over
            RTU, of a jaw 9 on either. Two hands on one TCP address need one each: the id of their gripper
            behind the gateway. Over ``urcap://`` the number of one of several grippers (SID), 1..247; by
            default the one that the URCap has. The other options of Modbus are refused there.
        read_function: Modbus function that reads the status, 3 or 4; by default 4 over TCP and 3 over
            RTU, of a jaw 3 on either.
        write_function: Modbus function that writes the request, 16 or 23; by default 16, and over RTU to a
            jaw 23, which reads the status in the same exchange. A gripper that does not serve 23 gets 16. No
            source says whether a 3-Finger serves it.
        poll_interval: seconds between polls, 0.001..0.1. On a serial line or over ``urcap://`` a read and a
            write may take longer than the default; the next poll follows at once then, and no poll counts as
            missed. At least 0.0172 on Windows before Python 3.13, where the clock counts in steps of 15.6 ms.
        write_spacing: seconds from sending a write to the next one, 0..0.1; 0.005 unless given for a jaw.
            Requests made in that time are merged. A gripper may lose writes that come sooner (3-Finger
            manual of 2014: 10 ms; manual of the 2F-85: 5 ms); pass 0 if yours loses none. A stop and a
            halt do not wait.
        connect_timeout: seconds for opening the link, while the event loop runs, 0.01..5.
        response_timeout: seconds for one answer, 0.005..5. A write fails within twice that, and over RTU,
            where a read may be sent again, within 0.15 s more (three times that if it is above 0.4).
            :meth:`stop` ends within 2 s with any value; but a gripper that takes longer than 0.4 s to
            answer may not have confirmed by then that the fingers were stopped, and the log says so.
        activation_timeout: seconds for an activation, while the event loop runs, 0.01..120.
        reconnect: whether a lost link is opened again, or a :class:`ReconnectPolicy`.
        speed: speed of the axes until another is set, 0..255.
        force: force of the axes until another is set, 0..255.
        request_address: first request register; by default 0 over TCP and 0x03E8 over RTU and of a jaw.
        status_address: first status register; by default 0 over TCP and 0x07D0 over RTU and of a jaw.
        calibration: speeds of this gripper, for default timeouts of moves and for :attr:`units`. None for the
            thesis's gripper, or a jaw's manual. One of another model is refused.
        force_calibration: labels of force values in :attr:`units`. None for the manual's figures. One of
            another model is refused.
        stroke: points that were measured on this gripper, from open to closed: two or more pairs of a
            position in counts and an opening in millimetres, or the path of a file that
            ``robotiq-async measure stroke`` wrote, which is read when the hand is made and refused if it was
            measured on another model. Millimetres and fractions of this hand, and of its statuses and
            results, follow them. None for the file that the address names, and else the nominal openings of
            the model.
        keep_grip: default of :meth:`stop`, and always in force when the block is left: False stops the
            fingers for certain (rGTO = 0), True holds axes that move and keeps a grip in force. A gripper
            that is not polled afterwards may lose its activation, and with it the grip.
        model: a :class:`Model`, or its name: ``3f``, ``2f85``, ``2f140``, ``hand-e``. None for the model that
            the address names (``rtu:///dev/ttyUSB0?model=2f85``), and else the 3-Finger. A gripper with
            the registers of another model is refused.

    Raises:
        TypeError: an option of the wrong type.
        ValueError: an option outside its range, or a malformed address.
    """

    _session: Session | None = None

    def __init__(
        self,
        address: str | Tunnel = NO_ADDRESS,
        *,
        name: str | None = None,
        device_id: int | None = None,
        read_function: int | None = None,
        write_function: int | None = None,
        poll_interval: float = POLL_INTERVAL_S,
        write_spacing: float = WRITE_SPACING_S,
        connect_timeout: float = CONNECT_TIMEOUT_S,
        response_timeout: float = RESPONSE_TIMEOUT_S,
        activation_timeout: float = ACTIVATION_TIMEOUT_S,
        reconnect: bool | ReconnectPolicy = True,
        speed: int = DEFAULT_SPEED,
        force: int = DEFAULT_FORCE,
        request_address: int | None = None,
        status_address: int | None = None,
        calibration: SpeedCalibration | None = None,
        force_calibration: ForceCalibration | None = None,
        stroke: str | Path | Sequence[tuple[int, float]] | None = None,
        keep_grip: bool = False,
        model: Model | str | None = None,
    ) -> None:
        self._options = options = HandOptions(
            address,
            name=name,
            device_id=device_id,
            read_function=read_function,
            write_function=write_function,
            poll_interval=poll_interval,
            write_spacing=write_spacing,
            connect_timeout=connect_timeout,
            response_timeout=response_timeout,
            activation_timeout=activation_timeout,
            reconnect=reconnect,
            speed=speed,
            force=force,
            request_address=request_address,
            status_address=status_address,
            calibration=calibration,
            force_calibration=force_calibration,
            stroke=stroke,  # type: ignore[arg-type]  # a file becomes its points there
            keep_grip=keep_grip,
            model=model,  # type: ignore[arg-type]  # a name becomes its model there
        )
        super().__init__(
            options.link.address,
            units=lambda _: options.units,
            name=options.given_name,
            keep_grip=options.keep_grip,
            model=options.model,
        )
        self._machine = StateMachine(options.log)
        self._assumed: Mapping[tuple[Finger, str], int] = {}

    # -- lifetime --------------------------------------------------------------------------------------

    async def _start(self, activate: bool, wait: float) -> None:
        if self._session is None and isinstance(self._options.address, NoAddress):
            self._options.log.warning("no address was given: the gripper is simulated, nothing real moves")
        self._session = session = Session(
            self._options, self._machine, self._channels, activate=activate, wait=wait, assumed=self._assumed
        )
        try:
            await session.connected()
            if activate:
                await session.activated()
        except NotStartedError:
            await session.ended()  # stop() was called, and with its own arguments
            raise
        except BaseException:
            if not session.is_over:  # if it is, a listener may have started the next one
                halt = session.counters.has_begun_to_write  # else another client moves the fingers
                await session.stop(halt=halt, keep_grip=self._keep_grip)
            raise

    async def _stop(self, halt: bool, keep_grip: bool) -> None:
        if self._session is not None and not self._session.is_over:
            await self._session.stop(halt=halt, keep_grip=keep_grip)

    # -- commands --------------------------------------------------------------------------------------

    async def _set(self, what: Literal["position", "speed", "force"], value: int, axes: Finger) -> None:
        session, command = self._admitted(), changes(axes, **{what: value})
        await session.answered(lambda waiter: session.controller.command(command, waiter))

    def _command(self, axes: Finger, position: int | None, speed: int | None, force: int | None) -> None:
        session = self._admitted()
        session.ask(session.controller.command, changes(axes, position, speed, force))

    async def _move(
        self, axes: Finger, target: int, speed: int | None, force: int | None, timeout: float | None
    ) -> MoveResult:
        session = self._admitted()
        with session.moving(target, axes, speed, force) as (ended, usual), session.counters.move() as note:
            limit = usual if timeout is None else timeout
            with Limit(limit):
                result = await ended
                note(result)
                session.unreached.ended(target, result)
                return result
            raise MoveTimeoutError(
                f"{axes} still moved after {limit:.2f} s on the way to {target}", self.status
            )

    async def _hold(self, axes: Finger) -> None:
        session = self._admitted()
        await session.answered(lambda waiter: session.controller.hold(axes, waiter))

    async def _inhibit(self, inhibit: Inhibit) -> None:
        self._check_running_loop()
        self._machine.inhibit(inhibit)
        await self.halt_inhibited()

    async def _permit(self, who: str, seen: Inhibit | None) -> None:
        self._check_running_loop()
        self._machine.permit(who, seen)

    def _check_running_loop(self) -> None:
        if self._session is not None and not self._session.is_over:
            self._session.check_loop("the hand")

    @property
    def inhibited(self) -> Inhibit | None:
        """The reason that motion is refused, since when, and by whom; None while it is permitted."""
        return self._machine.inhibited

    def resume_inhibit(self, inhibit: Inhibit) -> None:
        """Inhibit motion as :meth:`inhibit` does, but send nothing: for an inhibit of an earlier process.

        Args:
            inhibit: its reason, author and time. An earlier inhibit stays, and counts one more halt.
        """
        self._machine.inhibit(inhibit)

    async def halt_inhibited(self) -> None:
        """Halt as :meth:`inhibit` does, after :meth:`resume_inhibit` of a hand that runs.

        Raises:
            RobotiqError: as :meth:`inhibit`; the fingers MAY STILL MOVE.
        """
        self._check_running_loop()
        session = self._session
        if session is None:
            return  # it counts from the first start on; nothing was moved
        session.controller.end_inhibited()
        if self.state is State.DO_SHUTDOWN:
            await session.stop(halt=True)  # the stop under way may leave the fingers moving
        await self._halt()  # raises if the hand runs no more: the fingers may still move

    async def _halt(self) -> None:
        session = self._admitted()
        if self.state in SEQUENCES:
            await self._reset_for(Trigger.ASK_HALT)  # rGTO = 0 does not end these
        elif session.controller.is_driven:
            await self._reset_for(Trigger.HALT_RESETS)
        else:
            await session.answered(session.controller.halt)

    @property
    def options(self) -> HandOptions:
        """The options of the hand, checked."""
        return self._options

    def assume(self, settings: Mapping[tuple[Finger, str], int]) -> None:
        """Say which speeds and forces the gripper has at the next start: the status does not echo them.

        Args:
            settings: counts by axis, and "speed" or "force". The options give the values that are left out.
        """
        self._assumed = dict(settings)

    def drop_requests(self, why: str) -> None:
        """Drop the requests that were not sent, except holds and halts: for a client that has lost control.

        A speed or a force that is not written yet would take effect under the next client. Calls that wait
        for dropped requests raise MoveSupersededError. A motion that was sent continues: :meth:`hold` ends
        it. A hand that does not run has nothing to drop.

        Args:
            why: the text of that error.
        """
        if self._session is not None and not self._session.is_over:
            self._session.check_loop("hand.drop_requests()")
            self._session.ask(self._session.controller.drop_requests, MoveSupersededError(why))

    # -- activation, faults ----------------------------------------------------------------------------

    async def _activate(self) -> None:
        session = self._admitted()
        self._machine.check_permitted()
        if self.state in RUNNING:
            return
        under_way = self.state in (State.DO_ACTIVATION, State.WF_ACTIVATION)
        await session.activated(None if under_way else session.controller.activate)

    async def _reset(self) -> None:
        await self._reset_for(Trigger.ASK_RESET)

    async def _reset_for(self, trigger: Trigger) -> None:
        session = self._admitted()
        await session.reach(
            {State.RESET},
            RESET_TIMEOUT_S,
            ask=lambda: session.controller.reset(trigger),
            failing={},
            what="the gripper did not report the reset",
        )

    async def _atr(self) -> None:
        session = self._admitted()
        # Only a reset ends a release; another client may then have activated the gripper.
        ended = (State.RESET, State.WF_ACTIVATION, State.RUNNING_IDLE, State.FAULT)
        await session.reach(
            {State.ATR_DONE},
            RELEASE_TIMEOUT_S,
            ask=session.controller.release,
            failing={
                **dict.fromkeys(ended, lambda: NotActivatedError("the gripper was reset during the release")),
                State.DO_RESET: lambda: self._machine.taken_over(
                    InvalidStateError("a reset or a halt took over", State.DO_RESET)
                ),
            },
            what="the automatic release was not finished",
        )

    async def _recover(self, timeout: float | None) -> None:
        limit = timeout or RECOVER_TIMEOUT_S
        self._admitted()
        self._machine.check_permitted()
        watch, resets, began = StallWatch(self._channels.listeners, self._machine), 0, now()
        with Limit(limit), watch as stall:
            while self.state not in RUNNING:
                with stall.ends_early() as step:
                    await self._recover_step()
                if step.is_over:
                    self._check_worth_a_reset(resets)
                    resets = await self._reset_until_shown(resets)
            self._options.log.info("recovered in %.1f s", now() - began)
            return
        raise self._not_active(limit)

    def _not_active(self, seconds: float) -> StateTimeoutError:
        why, advice = self.state.name, ""
        if self.state is State.FAULT:
            fault = self.status.fault
            why = f"{fault.description} (gFLT 0x{int(fault):02X})"
            advice = "" if fault.is_known else "reset() may clear it, and DROPS the part"
        if text := self.status.controller_fault_text:
            why, advice = f"{why}; {text}", "look at the controller before the gripper"
        return StateTimeoutError(f"the gripper is not active after {seconds:g} s: {why}", advice=advice)

    def _check_worth_a_reset(self, resets: int) -> None:
        fault = self.status.fault
        what = f"the gripper makes no progress: {fault.description} (gFLT 0x{int(fault):02X})"
        if text := self.status.controller_fault_text:
            what += f"; {text}"
        if resets == RESETS:
            raise StateTimeoutError(
                f"{what}, also after {resets} resets. Is its emergency stop released, and is it powered?",
                advice="switch its power off and on, look at its LED, then call recover() again",
            )
        self._options.log.warning("%s for %g s; it is reset and activated", what, STALLED_S)

    async def _reset_until_shown(self, resets: int = 0) -> int:
        """Reset, and again if the gripper does not report it; return the number of resets so far.

        After an emergency stop a reset helps only sometimes (one report, of a two-finger gripper).
        """
        while True:
            resets += 1
            try:
                await self.reset()
                return resets
            except StateTimeoutError as error:
                if resets >= RESETS:
                    raise
                self._options.log.warning("%s: it is reset again", error)

    async def _recover_step(self) -> None:
        session, state = self._admitted(), self.state
        self._machine.check_permitted()
        if state is State.RESET:
            await self.activate()
        elif state is State.ATR_DONE or (state is State.FAULT and self._needs_reset):
            await self._reset_until_shown()
        elif state is State.DISCONNECTED:
            raise session.link_lost()
        else:
            # A minor or unknown fault, or a sequence that runs: the next status may decide.
            await session.next_status()

    @property
    def _needs_reset(self) -> bool:
        """Whether the fault is known to need a reset. That drops the part, so an unknown code gets none."""
        fault = self.status.fault
        return fault.severity is Severity.MAJOR and fault.is_known

    # -- reading ---------------------------------------------------------------------------------------

    @property
    def state(self) -> State:
        """The state of the hand."""
        return self._machine.state

    @property
    def statistics(self) -> Statistics:
        """Figures of the polling since the last start."""
        if self._session is None:
            return Statistics.none()
        controller = self._session.controller
        return self._session.counters.snapshot(controller.foreign_commands, controller.evidence.passed)

    @property
    def _newest_status(self) -> RobotiqStatus | None:
        return None if self._session is None else self._session.controller.status

    @property
    def _is_link_down(self) -> bool:
        """Whether the newest status is from before a loss of the link, also while the hand stops."""
        return self._session is not None and self._session.controller.evidence.condition is None

    def _no_status_for(self, seconds: float) -> ConnectionLostError:
        if self._session is None or self.state is not State.DISCONNECTED:
            return super()._no_status_for(seconds)
        why = self._session.link_lost()
        error = ConnectionLostError(f"no status for {seconds:g} s: {why.message}")
        error.__cause__ = why.__cause__
        return error.of_hand(why.hand)

    def _is_moving(self) -> bool:
        assert self._session is not None, "the hand runs"
        return self._session.controller.is_moving

    def add_listener(
        self, callback: Callable[[RobotiqStatus | Transition | SentRequest], None]
    ) -> Callable[[], None]:
        """Call a plain function with every status, change of state and request written, as it happens.

        It is called in the hand's event loop, in the turn in which it happens: before any reader of a stream
        and any awaiting caller continues. The changes by a stop, a halt or a reset come when its write has
        left, if that is expected within 50 ms. Every poll waits for it, so it must be quick and not block.
        Calls come in order: a change of state before the status or the request that leads to it, and items
        that the callback itself causes after the present item.

        A callback that raises is logged with its traceback and not called again; the hand continues. One that
        is added before the start waits for it, and it outlasts :meth:`stop`, until you remove it.

        Args:
            callback: takes a RobotiqStatus, a Transition or a SentRequest.

        Returns:
            A function that removes it. Calling that twice does no harm.

        Raises:
            TypeError: callback cannot be called, or is a coroutine function.
        """
        if inspect.iscoroutinefunction(callback) or not callable(callback):
            raise TypeError(f"callback must be a plain function, got {callback!r}")
        self._check_may_listen()
        return self._channels.listeners.add(callback)

    async def _wait_for_state(self, states: Collection[State], timeout: float | None) -> State:
        assert self._session is not None, "the hand runs"
        self._session.check_loop("the hand")
        names = " or ".join(state.name for state in states)
        return await self._session.reach(states, timeout, what=f"{names} was not reached")

    # -- inside ----------------------------------------------------------------------------------------

    @property
    def _has_commanded(self) -> bool:
        """Whether a request was written since the last start, or is pending; a refused one does not count."""
        session = self._session
        return session is not None and (session.counters.has_begun_to_write or session.controller.has_request)

    def _admitted(self) -> Session:
        """The present run, for a request: refused before the start, after stop(), and from another loop."""
        self._check_running()
        session = self._session
        assert session is not None, "it runs"
        session.check_loop("the hand")
        session.check_takes_requests()
        return session
