"""LocalBackend: the part of a RobotiqHand that owns the link to its gripper."""

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

from collections.abc import Collection, Mapping
from typing import Final, Literal

from ..control.pending import changes
from ..control.state_machine import StateMachine
from ..hands.backend import Backend
from ..hands.options import HandOptions, NoAddress
from ..hands.statistics import Statistics
from ..hands.waiting import STALLED_S, StallWatch
from ..runtime.clock import now
from ..runtime.limit import Limit
from ..values.enums import Finger, Severity, State, Trigger
from ..values.errors import (
    ConnectionLostError,
    InvalidStateError,
    MoveSupersededError,
    MoveTimeoutError,
    NotActivatedError,
    NotStartedError,
    StateTimeoutError,
    of_hand,
)
from ..values.inhibit import Inhibit
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


class LocalBackend(Backend):
    """Makes requests of the controller of a session, and waits for their ends."""

    session: Session | None = None

    def __init__(self, options: HandOptions) -> None:
        super().__init__(
            options.link.address,
            name=options.given_name,
            units=lambda _: options.units,
            keep_grip=options.keep_grip,
            model=options.model,
        )
        self.options: Final = options
        self._machine = StateMachine(options.log)
        self._assumed: Mapping[tuple[Finger, str], int] = {}

    # -- lifetime --------------------------------------------------------------------------------------

    async def start(self, activate: bool, wait: float) -> None:
        if self.session is None and isinstance(self.options.address, NoAddress):
            self.options.log.warning("no address was given: the gripper is simulated, nothing real moves")
        self.session = session = Session(
            self.options, self._machine, self.channels, activate=activate, wait=wait, assumed=self._assumed
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
                await session.stop(halt=halt, keep_grip=self.keep_grip)
            raise

    async def stop(self, halt: bool, keep_grip: bool) -> None:
        if self.session is not None and not self.session.is_over:
            await self.session.stop(halt=halt, keep_grip=keep_grip)

    # -- commands --------------------------------------------------------------------------------------

    async def set(self, what: Literal["position", "speed", "force"], value: int, axes: Finger) -> None:
        session, command = self._admitted(), changes(axes, **{what: value})
        await session.answered(lambda waiter: session.controller.command(command, waiter))

    def command(self, axes: Finger, position: int | None, speed: int | None, force: int | None) -> None:
        session = self._admitted()
        session.ask(session.controller.command, changes(axes, position, speed, force))

    async def move(
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

    async def hold(self, axes: Finger) -> None:
        session = self._admitted()
        await session.answered(lambda waiter: session.controller.hold(axes, waiter))

    async def inhibit(self, inhibit: Inhibit) -> None:
        self.check_loop("the hand")
        self._machine.inhibit(inhibit)
        await self.halt_inhibited()

    async def permit(self, who: str, seen: Inhibit | None) -> None:
        self.check_loop("the hand")
        self._machine.permit(who, seen)

    @property
    def inhibited(self) -> Inhibit | None:
        """The reason that motion is refused, since when, and by whom; None while it is permitted."""
        return self._machine.inhibited

    def resume_inhibit(self, inhibit: Inhibit) -> None:
        self._machine.inhibit(inhibit)

    async def halt_inhibited(self) -> None:
        self.check_loop("the hand")
        session = self.session
        if session is None:
            return  # it counts from the first start on; nothing was moved
        session.controller.end_inhibited()
        if self.state is State.DO_SHUTDOWN:
            await session.stop(halt=True)  # the stop under way may leave the fingers moving
        await self.halt()  # raises if the hand runs no more: the fingers may still move

    async def halt(self) -> None:
        session = self._admitted()
        if self.state in SEQUENCES:
            await self._reset_for(Trigger.ASK_HALT)  # rGTO = 0 does not end these
        elif session.controller.is_driven:
            await self._reset_for(Trigger.HALT_RESETS)
        else:
            await session.answered(session.controller.halt)

    def assume(self, settings: Mapping[tuple[Finger, str], int]) -> None:
        self._assumed = dict(settings)

    def drop_requests(self, why: str) -> None:
        if self.session is not None and not self.session.is_over:
            self.session.check_loop("hand.drop_requests()")
            self.session.ask(self.session.controller.drop_requests, MoveSupersededError(why))

    # -- activation, faults ----------------------------------------------------------------------------

    async def activate(self) -> None:
        session = self._admitted()
        self._machine.check_permitted()
        if self.state in RUNNING:
            return
        under_way = self.state in (State.DO_ACTIVATION, State.WF_ACTIVATION)
        await session.activated(None if under_way else session.controller.activate)

    async def reset(self) -> None:
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

    async def atr(self) -> None:
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

    async def recover(self, timeout: float | None) -> None:
        limit = timeout or RECOVER_TIMEOUT_S
        self._admitted()
        self._machine.check_permitted()
        watch, resets, began = StallWatch(self.channels.listeners, self._machine), 0, now()
        with Limit(limit), watch as stall:
            while self.state not in RUNNING:
                with stall.ends_early() as step:
                    await self._recover_step()
                if step.is_over:
                    self._check_worth_a_reset(resets)
                    resets = await self._reset_until_shown(resets)
            self.options.log.info("recovered in %.1f s", now() - began)
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
        self.options.log.warning("%s for %g s; it is reset and activated", what, STALLED_S)

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
                self.options.log.warning("%s: it is reset again", error)

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
    def statistics(self) -> Statistics | None:
        """Figures of the polling since the last start."""
        if self.session is None:
            return None
        controller = self.session.controller
        return self.session.counters.snapshot(controller.foreign_commands, controller.evidence.passed)

    @property
    def newest_status(self) -> RobotiqStatus | None:
        return None if self.session is None else self.session.controller.status

    @property
    def is_link_down(self) -> bool:
        """Whether the newest status is from before a loss of the link, also while the hand stops."""
        return self.session is not None and self.session.controller.evidence.condition is None

    def no_status_for(self, seconds: float) -> ConnectionLostError:
        if self.session is None or self.state is not State.DISCONNECTED:
            return super().no_status_for(seconds)
        why = self.session.link_lost()
        error = ConnectionLostError(f"no status for {seconds:g} s: {why.message}")
        error.__cause__ = why.__cause__
        return of_hand(error, why.hand)

    def is_moving(self) -> bool:
        assert self.session is not None, "the hand runs"
        return self.session.controller.is_moving

    async def wait_for_state(self, states: Collection[State], timeout: float | None) -> State:
        assert self.session is not None, "the hand runs"
        self.session.check_loop("the hand")
        names = " or ".join(state.name for state in states)
        return await self.session.reach(states, timeout, what=f"{names} was not reached")

    # -- inside ----------------------------------------------------------------------------------------

    @property
    def has_commanded(self) -> bool:
        """Whether a request was written since the last start, or is pending; a refused one does not count."""
        session = self.session
        return session is not None and (session.counters.has_begun_to_write or session.controller.has_request)

    def _admitted(self) -> Session:
        """The present run, for a request: refused before the start, after stop(), and from another loop."""
        self.check_running()
        session = self.session
        assert session is not None, "it runs"
        session.check_loop("the hand")
        session.check_takes_requests()
        return session
