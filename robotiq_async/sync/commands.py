"""Motions, speeds, forces, and the halt.

Made from robotiq_async.hand.commands by docs/make_sync.py.
"""

from __future__ import annotations

from ..values.enums import Finger
from ..values.grasp_result import GraspResult
from ..values.move_result import MoveResult
from .recovery import Recovery


class Commands(Recovery):
    """A hand that is told to move."""

    def set_position(self, value: int, fingers: Finger | int = Finger.ABC) -> None:
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
        self._caller.wait(lambda: self._inner.set_position(value, fingers))

    def set_speed(self, value: int, fingers: Finger | int = Finger.ALL) -> None:
        """Set the speed of axes, also of a motion under way; never starts one.

        Args:
            value: 0 (22 mm/s nominal) .. 255 (110 mm/s nominal).
            fingers: mask of the axes.

        Raises:
            TypeError, ValueError, RobotiqError: as :meth:`set_position`.
        """
        self._caller.wait(lambda: self._inner.set_speed(value, fingers))

    def set_force(self, value: int, fingers: Finger | int = Finger.ALL) -> None:
        """Set the force of axes; never starts a motion. More force tightens a grip.

        Args:
            value: 0 (15 N nominal) .. 255 (60 N nominal); not linear.
            fingers: mask of the axes.

        Raises:
            TypeError, ValueError, RobotiqError: as :meth:`set_position`.
        """
        self._caller.wait(lambda: self._inner.set_force(value, fingers))

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
        self._caller.tell(lambda: self._inner.command(fingers, position=position, speed=speed, force=force))

    def move(
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
            MoveTimeoutError: an axis still moved when the time was over; as MoveIgnoredError: the first
                motion on a connection was echoed, and nothing has moved for a second.
            MoveSupersededError: another command, halt(), reset() or another client took over an axis.
            GripperFaultError: the gripper reports a minor or a major fault.
            NotActivatedError: the gripper is not activated, or lost its activation.
            ConnectionLostError: the link went down; the gripper may still be moving.
            RobotiqStateError: the hand takes no commands now, or was stopped.
        """
        return self._caller.wait(
            lambda: self._inner.move(position, fingers, speed=speed, force=force, timeout=timeout)
        )

    def open(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        force: int | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        """Open fingers: :meth:`move` to 0. Returns and raises what it does."""
        return self._caller.wait(lambda: self._inner.open(fingers, speed=speed, force=force, timeout=timeout))

    def close(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        force: int | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        """Close the fingers, not the connection (that is :meth:`stop`): :meth:`move` to 255."""
        return self._caller.wait(
            lambda: self._inner.close(fingers, speed=speed, force=force, timeout=timeout)
        )

    def grasp(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        at_least: int | None = None,
        speed: int | None = None,
        force: int | None = None,
        timeout: float | None = None,
    ) -> GraspResult:
        """Close fingers until each of them has met something or is closed, and say which of them hold it.

        Too few contacts are a result and not an error: the result is false, and the fingers stay as they are.
        Cancelled or timed out, those that still move are held; a finger in contact keeps its grip.

        What holds is what the gripper calls a contact while closing. A thin object between fingertips may
        never be called one; and a contact latches: a finger that stood in one before still counts, also when
        the part has been taken out meanwhile. Open first, or ask for more force.

        Args:
            fingers: mask of the axes that close; the others stay as they are.
            at_least: contacts that make a grasp, 1..as many as there are axes; None for all of them.
            speed: new speed of these axes, 0..255; None leaves it.
            force: new force of these axes, 0..255; None leaves it.
            timeout: seconds; None for twice the expected time plus 2 s.

        Returns:
            Who holds it, and how each axis ended.

        Raises:
            TypeError: an argument of the wrong type; nothing is sent.
            ValueError: an argument outside its range; nothing is sent.
            MoveTimeoutError: an axis still moved when the time was over; as MoveIgnoredError: the first
                motion on a connection was echoed, and nothing has moved for a second.
            MoveSupersededError: another command, halt(), reset() or another client took over an axis.
            GripperFaultError: the gripper reports a minor or a major fault.
            RobotiqError: as :meth:`move`.
        """
        return self._caller.wait(
            lambda: self._inner.grasp(fingers, at_least=at_least, speed=speed, force=force, timeout=timeout)
        )

    def hold(self, fingers: Finger | int = Finger.ALL) -> None:
        """Ask axes that move to stay where they are, whoever moves them; returns when it is acknowledged.

        An axis in contact keeps its request and its grip, and one at rest is left alone: what a cancelled
        move does to its axes. Awaited moves and pending requests of these axes end with MoveSupersededError,
        and their other axes go on. When cancelled, the hold is sent all the same; one that a lost link keeps
        from being acknowledged is made good when the link is back, unless another client moves the axes then.

        In RESET and ATR_DONE, and during an activation, a release or a reset, no motion of a command is under
        way: it returns, and nothing is sent. :meth:`halt` ends those.

        Args:
            fingers: mask of the axes.

        Raises:
            TypeError: a mask of the wrong type; nothing is sent.
            ValueError: a mask outside its range; nothing is sent.
            MoveSupersededError: reset() took over before it was sent.
            NotActivatedError: the gripper lost its activation before it was sent.
            RobotiqError: not connected, or the link went down before the acknowledgement.
        """
        self._caller.wait(lambda: self._inner.hold(fingers))

    def halt(self) -> None:
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
        self._caller.wait(lambda: self._inner.halt())
