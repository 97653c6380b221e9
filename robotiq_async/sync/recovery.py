"""Activation, reset, automatic release, and the way out of a fault.

Made from robotiq_async.hand.recovery by docs/make_sync.py.
"""

from __future__ import annotations

from .observation import Observation


class Recovery(Observation):
    """A hand whose gripper is activated, reset and released."""

    def activate(self) -> None:
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
        self._caller.wait(lambda: self._inner.activate())

    def reset(self) -> None:
        """Reset the gripper (rACT = 0): clears faults, and lets go of what it holds.

        Returns in RESET. Ends an activation or a release under way, too. Awaited moves end with
        MoveSupersededError. When cancelled, the reset goes on.

        Raises:
            StateTimeoutError: the gripper did not report the reset within 5 s.
            RobotiqError: not possible now, or the link went down.
        """
        self._caller.wait(lambda: self._inner.reset())

    def atr(self) -> None:
        """Release automatically: all axes open slowly, whatever the fault. Only in FAULT.

        Returns in ATR_DONE; then only :meth:`reset` and :meth:`activate`, or :meth:`recover`, help. When
        cancelled, the release goes on.

        Raises:
            InvalidStateError: not in FAULT.
            NotActivatedError: the gripper is or was reset.
            StateTimeoutError: the release was not finished within 60 s.
            RobotiqError: the link went down.
        """
        self._caller.wait(lambda: self._inner.atr())

    def recover(self, timeout: float | None = None) -> None:
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
        self._caller.wait(lambda: self._inner.recover(timeout))
