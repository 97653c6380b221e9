"""RobotiqGripper: the class that labs copy as ``robotiq_gripper.py``, on every wire and model.

    from robotiq_async.dropins.ur import RobotiqGripper  # the one line

UR's guides have the file, GELLO and some forty repositories a copy. What programs use of it is here: calls,
arguments, results and numbers, which are counts, **0 open and 255 closed**.
"""

# Theory of operation
#
# The copied class has a socket and waits for each reply; this one has a hand that polls, and reads its
# statuses. Three rules take the place of the socket's:
#
#   patience  a call waits for a fresh status, socket_timeout at most, and then raises an OSError. One lost
#             reply costs a wait, no exception and no old value
#   the echo  after a link was lost in move_and_wait_for_pos() the echo of the gripper decides: our target is
#             waited for; the echo of before shows that the request never came, and it is sent; any other is
#             of another client, and raises
#   the move  OBJ reads 0 until the gripper shows the request of move(), so that no wait loop takes the
#             arrival before for its own. A loop that waits has the rule of the echo, too: a request that
#             never came is sent within socket_timeout of move(), as the copied class waits so long for its
#             "ack". After that OBJ raises

from __future__ import annotations

import time
from contextlib import suppress
from enum import Enum
from typing import Any, Final

from ..runtime import Log
from ..sync import RobotiqHand
from ..values import (
    CLOSED,
    DEFAULT_FORCE,
    DEFAULT_SPEED,
    OPEN,
    ConnectionLostError,
    Finger,
    MoveSupersededError,
    MoveTimeoutError,
    RobotiqConnectionError,
    RobotiqError,
    RobotiqStatus,
    State,
    check_flag,
    check_int,
)
from .patience import CallerPatience

TEXT_PORT: Final = 63352
UR_REST_S: Final = 0.1  # the fingers have stopped if their positions stay for so long
HAND_OVER_S: Final = 1.0  # disconnect() waits so long for a request that is on its way
UR_ACTIVATION_S: Final = 90.0  # as recover()


class RobotiqGripper:
    """A gripper by the calls of ``robotiq_gripper.py``: positions, speeds and forces in counts.

    :meth:`connect` moves nothing; **activate(), auto_calibrate() and the moves do**. Fingers of a 3-Finger go
    together, and its scissor stays as it is. Calls may come from any thread. Where the copied class returns a
    false value, or waits for ever, this one raises. Nothing has run on real hardware yet.

    Args:
        options: as of :class:`robotiq_async.sync.RobotiqHand`, such as ``response_timeout``.
    """

    ACT, GTO, ATR, ADR, FOR, SPE, POS = "ACT", "GTO", "ATR", "ADR", "FOR", "SPE", "POS"
    STA, PRE, OBJ, FLT = "STA", "PRE", "OBJ", "FLT"

    class GripperStatus(Enum):
        """The values of STA."""

        RESET = 0
        ACTIVATING = 1
        ACTIVE = 3

    class ObjectStatus(Enum):
        """The values of OBJ: a part was met while opening (outer) or closing (inner)."""

        MOVING = 0
        STOPPED_OUTER_OBJECT = 1
        STOPPED_INNER_OBJECT = 2
        AT_DEST = 3

    def __init__(self, **options: Any) -> None:  # noqa: ANN401  # the hand checks them
        self._options = {"keep_grip": True, **options}
        self._hand: RobotiqHand | None = None
        self._patience: CallerPatience
        self._range = (OPEN, CLOSED)
        # Of the last move(): its target, the status before it, and when it is too late to send it again.
        self._target: int | None = None
        self._before: RobotiqStatus
        self._until, self._was_shown = 0.0, False
        self._rates = options.get("speed", DEFAULT_SPEED), options.get("force", DEFAULT_FORCE)

    # -- lifetime --------------------------------------------------------------------------------------

    def connect(self, hostname: str, port: int = TEXT_PORT, socket_timeout: float = 10.0) -> None:
        """Connect to a gripper. Nothing moves, and nothing is written.

        Args:
            hostname: of a UR with Robotiq's URCap, whose gripper is taken for a 2F-85: counts need no model.
                Or an address for any other wire, with its model: ``rtu:///dev/ttyUSB0?model=hand-e``.
            port: of the URCap; an address has its own.
            socket_timeout: seconds, 0.05..3600, that each call waits for a link that is down.

        Raises:
            ConnectionError: nothing answers, or no gripper. An OSError.
            InvalidStateError: connected already.
        """
        bare = f"urcap://{hostname}:{check_int('port', port, 1, 65535)}?model=2f85"
        address = hostname if "://" in hostname else bare
        hand = RobotiqHand(address, **self._options)
        patience = CallerPatience(hand, socket_timeout, "socket_timeout")
        hand.add_listener(self._see)
        hand.start(activate=False)
        self._hand, self._patience, self._target = hand, patience, None

    def disconnect(self) -> None:
        """Disconnect. **The fingers continue to their last target**, as programs that copy the class expect.

        A move just requested is handed over first. The end of a program without this call stops the fingers.
        """
        if self._hand is None:
            return
        hand, self._hand = self._hand, None
        with suppress(RobotiqError):
            began = hand.status.timestamp
            for status in hand.statuses(lost_after=HAND_OVER_S) if self._target is not None else ():
                if self._was_shown or not hand.is_moving or status.timestamp > began + HAND_OVER_S:
                    break
        hand.stop(halt=False)

    def _see(self, item: object) -> None:
        if self._target is not None and not self._was_shown and isinstance(item, RobotiqStatus):
            self._was_shown = _shows(item, self._target)

    @property
    def _connected(self) -> RobotiqHand:
        if self._hand is None:
            raise ConnectionLostError("not connected: call connect() first")
        return self._hand

    def activate(self, auto_calibrate: bool = True) -> None:
        """Activate a gripper that is not active: **the fingers MOVE**, and a part in a faulty gripper DROPS.

        Args:
            auto_calibrate: whether the ends of the range are looked for, active or not: **they MOVE**.

        Raises:
            RobotiqError: as :meth:`RobotiqHand.activate` and :meth:`RobotiqHand.recover`.
        """
        check_flag("auto_calibrate", auto_calibrate)
        if not self.is_active():
            self._patience.call(_activate, UR_ACTIVATION_S)
        if auto_calibrate:
            self.auto_calibrate()

    def auto_calibrate(self, log: bool = True) -> None:
        """Open, close and open slowly; where the fingers stop are the ends to which positions are clipped.

        Raises:
            RuntimeError: a part was met.
        """
        self._range, ends = (OPEN, CLOSED), []
        for target in (OPEN, CLOSED, OPEN):
            position, status = self.move_and_wait_for_pos(target, 64, 1)
            if status is not self.ObjectStatus.AT_DEST:
                raise RuntimeError(f"Calibration failed because of an object: {status}")
            ends.append(position)
        self._range = (ends[2], ends[1])
        if log:
            Log(self._connected.name).info("calibrated to %d..%d counts", *self._range)

    # -- motion ----------------------------------------------------------------------------------------

    def move(self, position: float, speed: float, force: float) -> tuple[bool, int]:
        """Send the fingers to a position; does not wait for them.

        Returns:
            True, for the hand has accepted it, and the position after clipping to the calibrated range.

        Raises:
            OSError, RobotiqError: the link stayed down; the gripper takes no motion now, as in a fault.
        """
        target, rates = self._request(position, speed, force)
        before = self._patience.status()
        self._patience.call(lambda hand: hand.command(position=target, **rates))
        self._target, self._before, self._was_shown = target, before, False
        self._until = time.monotonic() + self._patience.seconds
        return True, target

    def move_and_wait_for_pos(self, position: float, speed: float, force: float) -> tuple[int, ObjectStatus]:
        """Move the fingers and wait until they rest: twice the time of the way and 2 s, and the patience.

        Returns:
            Where they are, and how it ended; a part that was met is no error.

        Raises:
            MoveSupersededError: another client commands the gripper.
            OSError: the link stayed down; or the fingers still moved when the time was over.
            RobotiqError: as :meth:`move`.
        """
        target, rates = self._request(position, speed, force)
        status = self._moved(target, rates)
        return _position(status), self._object(status)

    def _request(self, position: float, speed: float, force: float) -> tuple[int, dict[str, int]]:
        low, high = self._range  # int() refuses NaN and infinity
        rates = {"speed": min(max(int(speed), 0), 255), "force": min(max(int(force), 0), 255)}
        self._rates = rates["speed"], rates["force"]
        return min(max(int(position), low), high), rates

    def _moved(self, target: int, rates: dict[str, int]) -> RobotiqStatus:
        hand, until = self._connected, time.monotonic() + self._patience.seconds
        earlier, self._target = self._target, None
        while True:
            before = self._patience.status()
            try:
                return hand.move(target, **rates).status
            except RobotiqConnectionError:
                status = self._patience.status()
                if _shows(status, target):
                    limit = 2 * hand.units.closing_s(rates["speed"]) + 2
                    return _rested(hand, target, limit, lost_after=self._patience.seconds)
                is_untouched = status.echo == before.echo or _shows(status, earlier)
                if not is_untouched or time.monotonic() > until:
                    raise

    # -- reading ---------------------------------------------------------------------------------------

    def _get_var(self, variable: str) -> int:
        """A variable of the URCap's port, from a fresh status; programs read OBJ, PRE, FLT, SPE and FOR.

        Raises:
            ValueError: a variable that no status has.
            OSError: the link stayed down; of OBJ also if the move was lost long ago.
            MoveSupersededError: of OBJ, if another client commands.
        """
        status = self._patience.status()
        match variable:
            case "POS":
                return _position(status)
            case "OBJ":
                return self._progress()
            case "PRE":
                return status.requested_position(_fingers(status)[0])
            case "STA":
                return int(status.initialization) if status.is_activated or status.is_reset else 1
            case "ACT":
                return int(status.activation_echo)
            case "GTO":
                return int(status.go_echo)
            case "FLT":
                return int(status.fault)
            case "SPE" | "FOR":  # nothing shows them: as they were requested
                return int(self._rates[variable == "FOR"])
        raise ValueError(f"{variable!r} is none of POS, OBJ, PRE, STA, ACT, GTO, FLT, SPE and FOR")

    def _set_var(self, variable: str, value: float) -> bool:
        """Refused: half a request."""
        raise NotImplementedError(f"{variable} is not set to {value!r}: call move() or activate()")

    def _progress(self) -> int:
        # The newest status comes after the question whether it is over: it is not older than the answer.
        is_moving, status = self._patience.call(lambda hand: (hand.is_moving, hand.status))
        if is_moving:
            return 0
        if (target := self._target) is None or _shows(status, target):
            return int(self._object(status).value)
        if self._was_shown or status.echo != self._before.echo:
            raise MoveSupersededError(f"another client commands the gripper, no longer to {target}")
        if time.monotonic() > self._until:
            raise ConnectionLostError(f"the move to {target} was lost with the link")
        speed, force = self._rates
        self._patience.call(lambda hand: hand.command(position=target, speed=speed, force=force))
        return 0

    def _object(self, status: RobotiqStatus) -> ObjectStatus:
        """Of several fingers: moving while one moves, else a contact if one has it."""
        each = {int(status.finger_status(finger)) for finger in _fingers(status)}
        return self.ObjectStatus(next(value for value in (0, 2, 1, 3) if value in each))

    def is_active(self) -> bool:
        return self._get_var("STA") == self.GripperStatus.ACTIVE.value

    def get_current_position(self) -> int:
        """The position in counts, of a 3-Finger the mean of its fingers: at most 30 ms old."""
        return self._get_var("POS")

    def get_min_position(self) -> int:
        """The open end of the range: 0, or the calibrated one."""
        return self._range[0]

    def get_max_position(self) -> int:
        """The closed end of the range: 255, or the calibrated one."""
        return self._range[1]

    get_open_position, get_closed_position = get_min_position, get_max_position

    def is_open(self) -> bool:
        return self.get_current_position() <= self.get_open_position()

    def is_closed(self) -> bool:
        return self.get_current_position() >= self.get_closed_position()


def _activate(hand: RobotiqHand) -> None:
    if hand.state is State.FAULT:
        hand.recover()
    else:
        hand.activate()


def _fingers(status: RobotiqStatus) -> list[Finger]:
    return [axis for axis in status.model.axes if axis is not Finger.SCISSOR]


def _position(status: RobotiqStatus) -> int:
    fingers = _fingers(status)
    return round(sum(map(status.position, fingers)) / len(fingers))


def _shows(status: RobotiqStatus, target: int | None) -> bool:
    """Whether the gripper has a request to this position."""
    return status.go_echo and all(status.requested_position(finger) == target for finger in _fingers(status))


def _rested(hand: RobotiqHand, target: int, limit: float, *, lost_after: float) -> RobotiqStatus:
    """The first status in which the fingers have rested for a moment, within ``limit`` seconds."""
    first: RobotiqStatus | None = None
    since: RobotiqStatus | None = None
    for status in hand.statuses(lost_after=lost_after):
        first = first or status
        if not _shows(status, target):
            raise MoveSupersededError("another client commands the gripper")
        if status.is_moving or since is None or _position(status) != _position(since):
            since = None if status.is_moving else status
        elif status.timestamp - since.timestamp >= UR_REST_S:
            return status
        if status.timestamp - first.timestamp > limit:
            raise MoveTimeoutError(f"the fingers still moved after {limit:.1f} s", status)
    raise ConnectionLostError("disconnected meanwhile")
