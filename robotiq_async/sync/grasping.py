"""Grasping: closing around something, and hearing what becomes of the grip. For any hand.

Made from robotiq_async.hand.grasping by docs/make_sync.py.
"""

from __future__ import annotations

from ..enums import Finger
from ..grasping import SLIP_COUNTS, GraspResult
from ..wire.status import RobotiqStatus
from .blocking import BlockingHand
from .streams import GripEvents


class Grasping(BlockingHand):
    """A hand that closes around something. Asks no more of it than any hand can do."""

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
            MoveTimeoutError: an axis still moved when the time was over.
            MoveSupersededError: another command, halt(), reset() or another client took over an axis.
            GripperFaultError: the gripper reports a minor or a major fault.
            RobotiqError: as :meth:`move`.
        """
        return self._caller.wait(
            lambda: self._inner.grasp(fingers, at_least=at_least, speed=speed, force=force, timeout=timeout),
            commands=True,
        )

    def grip_events(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        since: RobotiqStatus | None = None,
        slip: int = SLIP_COUNTS,
    ) -> GripEvents:
        """What becomes of the grips from now on: contacts gained and lost, parts that slip.

        For one reader. It waits out a lost link, tells nothing meanwhile, and when the link is back what has
        become of the grips; it ends after :meth:`stop`. Up to 1000 statuses wait for a slow reader, which is
        5 s of them; of what happened in those that were missed, it learns what is left of it.

        It tells what the gripper reports. A contact latches: a part that is pulled out is noticed when its
        finger closes on, which it does when more force is asked for, and by the manual not before.

        Args:
            fingers: mask of the axes that are watched.
            since: the status to begin with, ``result.status`` of a grasp or a move: what changes between that
                and the first status that is read is told, too. None for the newest one.
            slip: counts that an axis in contact may move without being told, 1..255.

        Raises:
            TypeError: an argument of the wrong type.
            ValueError: an argument outside its range.
        """
        return GripEvents(
            self._caller.tell(
                lambda: self._inner.grip_events(fingers, since=since, slip=slip), commands=False
            ),
            self._caller,
        )
