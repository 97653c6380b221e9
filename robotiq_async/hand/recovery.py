"""Activation, reset, automatic release, and the way out of a fault."""

from __future__ import annotations

from typing import Final

import anyio

from ..control.state_machine import RUNNING
from ..session.stall_watch import STALLED_S, StallWatch
from ..values.checks import check_timeout
from ..values.enums import Severity, State
from ..values.errors import InvalidStateError, NotActivatedError, StateTimeoutError
from ..values.trigger import Trigger
from .naming import tells_its_hand
from .observation import Observation

RESET_TIMEOUT_S: Final = 5.0
"""A reset takes a device cycle or two; this leaves room for a slow one."""
RELEASE_TIMEOUT_S: Final = 60.0
"""A release opens slowly; no figure is published. A full stroke at the slowest speed takes 10 s."""
RECOVER_TIMEOUT_S: Final = 90.0
"""Interference counts as minor for 20 s, a release may take a minute, a reset and an activation follow."""
RESETS: Final = 2
"""After an emergency stop one reset has been seen to help, and sometimes a second."""


class Recovery(Observation):
    """A hand whose gripper is activated, reset and released."""

    @tells_its_hand
    async def activate(self) -> None:
        """Activate the gripper, if it is not active yet. The fingers MOVE to their stops.

        When cancelled, the activation goes on; :meth:`reset` ends it.

        Raises:
            GripperFaultError: a fault is latched (see :meth:`recover`), or the activation ended in one.
            NotActivatedError: the gripper was reset meanwhile.
            ActivationTimeoutError: not finished within the activation timeout, or 0x05 and nothing new for
                5 s, as with a pressed emergency stop. It goes on: nothing is taken back, for that would leave
                a hand that does not know where its fingers are.
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

    @tells_its_hand
    async def _reset(self, trigger: Trigger) -> None:
        session = self._asked()
        await session.reach(
            {State.RESET},
            RESET_TIMEOUT_S,
            ask=lambda: session.controller.reset(trigger),
            failing={},
            what="the gripper did not report the reset",
        )

    @tells_its_hand
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
        # Nothing but a reset ends a release; what is found then may have been activated by another client.
        ended = (State.RESET, State.WF_ACTIVATION, State.RUNNING_IDLE, State.FAULT)
        await session.reach(
            {State.ATR_DONE},
            RELEASE_TIMEOUT_S,
            ask=session.controller.release,
            failing={
                **dict.fromkeys(ended, lambda: NotActivatedError("the gripper was reset during the release")),
                State.DO_RESET: lambda: InvalidStateError("reset() or halt() took over", State.DO_RESET),
            },
            what="the automatic release was not finished",
        )

    @tells_its_hand
    async def recover(self, timeout: float | None = None) -> None:
        """Do whatever the present fault needs, until the gripper is active again.

        Waits for a minor fault to clear, and for an activation, reset or release under way; resets and
        activates after a major one. A gripper that waits for its activation (0x05, as after an emergency
        stop) or releases, and shows nothing new for 5 s, is reset and activated as well, twice at most. A
        reset DROPS the part, and an activation MOVES the fingers.

        Args:
            timeout: seconds for all of it; None for 90 s.

        Raises:
            StateTimeoutError: not active in time; or not after two resets: a person has to look at it.
            ActivationTimeoutError: the new activation took longer than the activation timeout.
            GripperFaultError: the new activation ended in a fault.
            NotActivatedError: the gripper was reset during the new activation.
            RobotiqError: the link went down, or the hand was stopped.
        """
        limit = check_timeout("timeout", timeout) or RECOVER_TIMEOUT_S
        self._asked()
        watch, resets = StallWatch(self._channels.listeners, self._machine), 0
        with anyio.move_on_after(limit), watch as stall:
            while self.state not in RUNNING:
                with stall.ends_early() as step:
                    await self._recover_step()
                if step.cancelled_caught:
                    self._check_worth_a_reset(resets)
                    resets += 1
                    await self.reset()
            return
        raise StateTimeoutError(f"the gripper is not active after {limit:g} s: {self.state.name}")

    def _check_worth_a_reset(self, resets: int) -> None:
        fault = self.status.fault
        what = f"the gripper gets nowhere: {fault.description} (gFLT 0x{int(fault):02X})"
        if resets == RESETS:
            raise StateTimeoutError(
                f"{what}, also after {resets} resets. Is its emergency stop released, and is it powered? "
                "Switch its power off and on, look at its LED, then call recover() again"
            )
        self._options.log.warning("%s for %g s; it is reset and activated", what, STALLED_S)

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
