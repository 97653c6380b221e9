"""GripperPart: a gripper in LeRobot's units, to be embedded in the class of an arm.

The loop around it calls 30 to 100 times a second. So nothing here waits for the gripper: an observation is
the newest status, an action is one ``command()``. A loop that does not notice a dead link would record a
still gripper as a demonstration; so each call first looks at the age of the status.
"""

from __future__ import annotations

import math
import time
from contextlib import suppress
from typing import Final

from ...runtime.log import Log
from ...sync import RobotiqHand
from ...values.checks import as_float, check_flag, check_number, check_seconds
from ...values.enums import FORCE_MAX, Finger, State
from ...values.errors import ConnectionLostError, GripperFaultError, InvalidStateError, NotActivatedError
from ...values.status import RobotiqStatus

LOST_AFTER_S: Final = 0.4


class GripperPart:
    """A gripper whose positions are LeRobot's: **0 closed .. 100 open**, in percent of the travel.

    It drives a blocking hand, which polls in a thread of its own, and takes its options from it. The fingers
    of a 3-Finger go together, and its scissor stays as it is. Nothing has run on real hardware yet.

        part = GripperPart(RobotiqHand("rtu:///dev/ttyUSB0?model=2f85", speed=255))
        part.connect(activate=True)  # the fingers MOVE
        seen = part.observe()
        part.act(seen["gripper.pos"])
        part.disconnect()

    Args:
        hand: not started; the part starts and stops it.
        lost_after: age of the newest status, in 0.05..60 s, from which :meth:`observe` and :meth:`act` raise.

    Raises:
        TypeError, ValueError: ``lost_after`` is not a number, or outside its range; no blocking hand.
    """

    OBSERVATIONS: Final = ("gripper.pos", "gripper.current", "gripper.contact")
    """Keys of an observation."""

    def __init__(self, hand: RobotiqHand, *, lost_after: float = LOST_AFTER_S) -> None:
        if not isinstance(hand, RobotiqHand):
            raise TypeError(f"hand must be a blocking one, of robotiq_async.sync, got {hand!r}")
        self._hand = hand
        self._lost_after = check_seconds("lost_after", lost_after, 0.05, 60.0)
        self._is_connected = False

    @property
    def is_connected(self) -> bool:
        """Whether :meth:`connect` has succeeded since the last :meth:`disconnect`; true on a dead link."""
        return self._is_connected

    def connect(self, activate: bool = False) -> None:
        """Connect to a gripper that is active already, or activate it: **the fingers MOVE to their stops**.

        An active gripper is adopted, and nothing is written before the first action. When this raises, or is
        interrupted, the hand is stopped again.

        Args:
            activate: whether a gripper that is reset is activated. The log warns before.

        Raises:
            NotActivatedError: the gripper is not active, and ``activate`` is False. Nothing was written.
            GripperFaultError: the gripper reports a fault.
            InvalidStateError: connected already; the hand runs on.
            RobotiqError: as :meth:`RobotiqHand.start`.
        """
        hand = self._hand
        if check_flag("activate", activate):
            Log(hand.name).warning("connecting: a gripper that is reset is activated, and its fingers MOVE")
        try:
            hand.start(activate)
            if hand.state is State.FAULT:
                raise GripperFaultError(hand.status.fault)
            if not hand.is_activated:
                raise NotActivatedError(
                    f"the gripper at {hand.address} is not active ({hand.state.name}): connect with "
                    "activate=True (--robot.activate=true), which MOVES the fingers to their stops"
                )
        except InvalidStateError:  # it runs already, and is not ours to stop
            raise
        except BaseException:  # Ctrl-C, too, perhaps after it had started
            hand.stop(halt=False)  # nothing was commanded; a start that fails takes its activation back
            raise
        self._is_connected = True

    def observe(self) -> dict[str, float]:
        """The observation in the newest status; does not wait.

        * ``gripper.pos``: 0 (closed) .. 100 (open); of a 3-Finger the mean of its fingers.
        * ``gripper.current``: of the motor, in milliampere; of a 3-Finger the highest of its fingers. It is
          NaN where the link does not carry it.
        * ``gripper.contact``: the share of the fingers that hold a part, 0..1; of a jaw 0 or 1. A contact
          latches, and a thin part may never be reported.

        Raises:
            ConnectionLostError: the link is down, or the newest status is older than ``lost_after``, also
                because this program was held up. May be called again: it works once statuses come.
            NotStartedError: not connected.
        """
        status = self._fresh_status()
        fingers = [finger for finger in status.model.axes if finger is not Finger.SCISSOR]
        currents = [it for it in map(status.current_ma, fingers) if it is not None]
        held = status.part.holds if status.part else Finger(0)
        return {
            "gripper.pos": 100 * sum(map(status.open_fraction, fingers)) / len(fingers),
            "gripper.current": float(max(currents)) if currents else math.nan,
            "gripper.contact": sum(finger in held for finger in fingers) / len(fingers),
        }

    def act(self, pos: object, force: object = None) -> None:
        """Send the fingers to a position; does not wait for them. The last value wins, and nothing queues.

        An array or a tensor of one value counts as its number. Anything outside its range is refused.

        Args:
            pos: 0 (closed) .. 100 (open). The ends are those of ``close()`` and ``open()``: 0 presses.
            force: 0 (the least, not none) .. 100 percent of the force value, not linear; None leaves it.

        Raises:
            TypeError, ValueError: not a number, or outside 0..100. Nothing is sent.
            ConnectionLostError: as :meth:`observe`. Nothing is sent.
            GripperFaultError, NotActivatedError: the gripper reports a fault, or lost its activation.
            RobotiqError: the hand takes no commands now.
        """
        share = percent("pos", pos) / 100
        counts = None if force is None else round(percent("force", force) / 100 * FORCE_MAX)
        self._fresh_status()
        self._hand.command(open_fraction=share, force=counts)

    def disconnect(self) -> None:
        """Stop the fingers and disconnect, within 2 s: :meth:`RobotiqHand.stop`. Idempotent."""
        self._is_connected = False
        self._hand.stop()

    def _fresh_status(self) -> RobotiqStatus:
        hand = self._hand
        hand.is_activated  # noqa: B018  # raises before the start, and while the link is down
        status = hand.status
        age = time.monotonic() - status.timestamp
        if age > self._lost_after:
            raise ConnectionLostError(
                f"the newest status of {hand.name} is {age:.2f} s old (the limit is {self._lost_after:g} s): "
                "what the gripper does is not known"
            )
        return status


def percent(name: str, value: object) -> float:
    """A number in 0..100; that of an array or a tensor with one value, too, as LeRobot's replay has them."""
    item = getattr(value, "item", None)
    if as_float(value) is None and callable(item):
        with suppress(ValueError, RuntimeError):  # numpy's and torch's, of an array of several values
            value = item()
    return check_number(name, value, 0.0, 100.0, "percent")
