"""GripperPart: a gripper in the numbers of a learning stack, to be embedded in the class of an arm.

The loop around it calls 30 to 100 times a second. So nothing here waits for the fingers: an observation is a
fresh status, an action is one ``command()``. A loop that does not notice a dead link would record a still
gripper as a demonstration: each call waits for a fresh status, reports that, and raises after ``lost_after``.
"""

from __future__ import annotations

import math
import time
from contextlib import suppress
from typing import Final

from ...calibration import Convention
from ...runtime import Log
from ...sync import RobotiqHand
from ...values import (
    FORCE_MAX,
    Finger,
    GripperFaultError,
    InvalidStateError,
    NotActivatedError,
    RobotiqError,
    RobotiqStatus,
    State,
    as_float,
    check_flag,
    check_number,
    repr_of,
    single,
)
from ..patience import CallerPatience

LOST_AFTER_S: Final = 1.0
"""Beyond the 0.4 s after which a hand gives up on an answer, and the 0.1 s until it connects again: one lost
reply ends no episode."""
REPORTED_S: Final = 0.1  # three frames at 30 Hz: a longer wait is a warning


class GripperPart:
    """A gripper whose positions follow a convention: ``Convention.LEROBOT`` is 0 closed .. 100 open.

    It drives a blocking hand, which polls in a separate thread, and takes its options from it. The fingers
    of a 3-Finger go together, and its scissor stays as it is. Nothing has run on real hardware yet.

        part = GripperPart(RobotiqHand("rtu:///dev/ttyUSB0?model=2f85", speed=255), Convention.DROID)
        part.connect(activate=True)  # the fingers MOVE
        seen = part.observe()
        part.act(seen["gripper.pos"])
        part.disconnect()

    Args:
        hand: not started; the part starts and stops it.
        convention: the numbers of an open and a closed gripper. There is no default: a wrong sign opens where
            it should grip.
        lost_after: seconds, 0.05..60, that :meth:`observe` and :meth:`act` wait for a status.

    Raises:
        TypeError, ValueError: ``lost_after`` is not a number, or outside its range; no blocking hand; no
            convention.
    """

    def __init__(
        self, hand: RobotiqHand, convention: Convention, *, lost_after: float = LOST_AFTER_S
    ) -> None:
        if not isinstance(hand, RobotiqHand):
            raise TypeError(f"hand must be a blocking one, of robotiq_async.sync, got {hand!r}")
        if not isinstance(convention, Convention):
            raise TypeError(f"convention must be a Convention, such as .LEROBOT, got {repr_of(convention)}")
        self._hand = hand
        self._convention = convention
        limit = check_number("lost_after", lost_after, 0.05, 60.0, "seconds")
        self._patience = CallerPatience(hand, limit)
        self._is_connected = False

    @property
    def observations(self) -> tuple[str, ...]:
        """The keys of an observation, known before :meth:`connect`: over a URCap without a current.

        Some URCaps report it, but only the first answer shows whether this one does, and features are needed
        before.
        """
        current = ("gripper.current",) if self._tells_current else ()
        return ("gripper.pos", *current, "gripper.contact")

    @property
    def _tells_current(self) -> bool:
        return not self._hand.address.startswith("urcap:")

    @property
    def is_connected(self) -> bool:
        """Whether :meth:`connect` has succeeded since the last :meth:`disconnect`; true on a dead link."""
        return self._is_connected

    @property
    def is_active(self) -> bool:
        """Whether the gripper is active now; False before :meth:`connect` and on a dead link."""
        with suppress(RobotiqError):
            return self._hand.is_activated
        return False

    def connect(self, activate: bool = False, *, allow_reset: bool = False) -> None:
        """Connect to a gripper that is active already, or activate it: **the fingers MOVE to their stops**.

        An active gripper is adopted, and nothing is written before the first action. When this raises, or is
        interrupted, the hand is stopped again.

        Args:
            activate: whether a gripper that is reset is activated. The log warns before.
            allow_reset: whether one that stays reset is no error: :meth:`activate` comes later.

        Raises:
            NotActivatedError: the gripper is not active, and neither is True. Nothing was written.
            GripperFaultError: the gripper reports a fault.
            InvalidStateError: connected already; the hand keeps running.
            RobotiqError: as :meth:`RobotiqHand.start`.
        """
        hand = self._hand
        check_flag("allow_reset", allow_reset)
        if check_flag("activate", activate):
            Log(hand.name).warning("connecting: a gripper that is reset is activated, and its fingers MOVE")
        try:
            hand.start(activate)
            if hand.state is State.FAULT:
                raise GripperFaultError(hand.status.fault)
            if not (hand.is_activated or allow_reset):
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

    def activate(self) -> None:
        """Activate a gripper that is reset: **the fingers MOVE to their stops**. Nothing if it is active.

        Raises:
            RobotiqError: as :meth:`RobotiqHand.activate`.
        """
        if not self._hand.is_activated:
            Log(self._hand.name).warning("the gripper is activated, and its fingers MOVE")
            self._hand.activate()

    def observe(self) -> dict[str, float]:
        """The observation in a fresh status: at once, or in a stall with the next one.

        * ``gripper.pos``: by the convention; of a 3-Finger the mean of its fingers.
        * ``gripper.current``: of the motor, in milliampere; of a 3-Finger the highest of its fingers. Left
          out where the link does not carry it: a NaN would spoil the statistics of a dataset.
        * ``gripper.contact``: the share of the fingers that hold a part, 0..1; of a jaw 0 or 1. A contact
          latches, and a thin part may never be reported.

        Raises:
            ConnectionLostError: no status came for ``lost_after``. May be called again: it works once
                statuses come.
            NotStartedError: not connected.
        """
        status = self._fresh_status()
        fingers = [finger for finger in status.model.axes if finger is not Finger.SCISSOR]
        currents = [it for it in map(status.current_ma, fingers) if it is not None]
        held = status.part.holds if status.part else Finger(0)
        opening = sum(map(status.open_fraction, fingers)) / len(fingers)
        return {
            "gripper.pos": self._convention.value(opening),
            **({"gripper.current": float(max(currents))} if currents and self._tells_current else {}),
            "gripper.contact": sum(finger in held for finger in fingers) / len(fingers),
        }

    def act(self, pos: object, force: object = None, *, clamp: bool = False) -> dict[str, float]:
        """Send the fingers to a position; does not wait for them. The last value wins, and nothing queues.

        An array or a tensor of one value counts as its number. Anything outside its range is refused, or with
        ``clamp`` brought into it. NaN and infinity are refused always.

        Args:
            pos: by the convention. Its ends are ``open()`` and ``close()``: the closed end presses.
            force: 0 (the least, not none) .. 100 percent of the force value, not linear; None leaves it.
            clamp: whether a number beyond its range counts as the end, for policies, which overshoot.

        Returns:
            The values that were sent, by key: ``gripper.pos``, and ``gripper.force`` if it was given.

        Raises:
            TypeError, ValueError: not a number, or outside its range. Nothing is sent.
            ConnectionLostError: as :meth:`observe`. Nothing is sent.
            GripperFaultError, NotActivatedError: the gripper reports a fault, or lost its activation.
            RobotiqError: the hand takes no commands now.
        """
        opening = self._convention.fraction(pos, clamp=clamp)
        sent = {"gripper.pos": self._convention.value(opening)}
        counts = None
        if force is not None:
            sent["gripper.force"] = percent("force", force, clamp=clamp)
            counts = round(sent["gripper.force"] / 100 * FORCE_MAX)
        self._fresh_status()
        self._patience.call(lambda hand: hand.command(open_fraction=opening, force=counts))
        return sent

    def disconnect(self) -> None:
        """Stop the fingers and disconnect, within 2 s: :meth:`RobotiqHand.stop`. Idempotent."""
        self._is_connected = False
        self._hand.stop()

    def _fresh_status(self) -> RobotiqStatus:
        began = time.monotonic()
        status = self._patience.status()
        if (waited := time.monotonic() - began) > REPORTED_S:
            Log(self._hand.name).warning("no status for %.2f s: a frame is late, and none is old", waited)
        return status


def percent(name: str, value: object, *, clamp: bool = False) -> float:
    """A number in 0..100, also from an array or a tensor with one value, as LeRobot's replay has them."""
    number = as_float(value := single(value))
    if clamp and number is not None and math.isfinite(number):
        value = min(max(number, 0.0), 100.0)
    return check_number(name, value, 0.0, 100.0, "percent")
