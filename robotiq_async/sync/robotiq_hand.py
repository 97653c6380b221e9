"""RobotiqHand: its options, its start and its end.

Made from robotiq_async.hand.robotiq_hand by docs/make_sync.py.
"""

from __future__ import annotations

from ..hand.robotiq_hand import RobotiqHand as AsyncRobotiqHand
from ..link.transport import Transport
from ..session.options import (
    ACTIVATION_TIMEOUT_S,
    CONNECT_TIMEOUT_S,
    POLL_INTERVAL_S,
    RESPONSE_TIMEOUT_S,
    WRITE_SPACING_S,
)
from ..session.reconnecting import ReconnectPolicy
from ..values.calibration import ForceCalibration, SpeedCalibration
from ..values.enums import DEFAULT_FORCE, DEFAULT_SPEED
from .caller import Caller
from .commands import Commands


class RobotiqHand(Commands):
    """A Robotiq 3-Finger gripper behind Modbus TCP, a serial line, or simulated, that blocks.

    Use it as ``with RobotiqHand(address) as hand:``, or call :meth:`start` and :meth:`stop`. The calls, their
    arguments, results and errors are those of :class:`robotiq_async.RobotiqHand`, and each returns when the
    async one has ended. All blocking hands share one event loop in a thread of its own, which polls while
    your code runs. Calls may come from any thread, also from one in which another event loop runs: that one
    stands still meanwhile.

    What a call does when it is cancelled it does here at Ctrl-C, and whatever moves by then is held. A hand
    that was not stopped is stopped when the program ends. After a fork it stays with the parent. Listeners
    are called in the hand's thread, where a call that waits is a RuntimeError.

    Nothing of this has run on real hardware yet.
    """

    def __init__(
        self,
        address: str | Transport = "sim://",
        *,
        name: str | None = None,
        device_id: int | None = None,
        read_function: int | None = None,
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
        keep_grip: bool = False,
    ) -> None:
        """Check every option. Opens nothing and needs no running loop.

        Speed and force have no echo. So after adopting an active gripper, ``speed`` and ``force`` are also
        what the axes get that a first command does not address: pass what the gripper was used with if
        that matters to what it holds.

        Args:
            address: ``tcp://HOST[:502]`` (or HOST, HOST:PORT), ``rtu:///dev/ttyUSB0``, ``rtu+tcp://HOST:PORT``
                (a serial line behind a socket), ``sim://`` (or ``sim://?speedup=10&object=150``), or a
                transport object.
            name: what to call this hand, in 1..64 printable characters: errors and the log begin with it,
                metrics and recordings have it. None calls it by its address.
            device_id: Modbus unit id, 0..255 over TCP and 1..247 over RTU; by default 2 over TCP and 9 over
                RTU. Two hands on one TCP address need one each: that of their gripper behind the gateway.
            read_function: Modbus function that reads the status, 3 or 4; by default 4 over TCP and 3 over
                RTU.
            poll_interval: seconds between polls, 0.001..0.1; over RTU 0.015 unless given.
            write_spacing: seconds from the acknowledgement of a write to the next one, 0..0.1: what is asked
                meanwhile is merged. The manual of 2014 says that a gripper may lose what comes sooner than
                10 ms; pass 0 for one that does not. A stop and a halt do not wait.
            connect_timeout: seconds for opening the link, 0.01..5.
            response_timeout: seconds for one answer, 0.005..5. A write fails within twice that, and over RTU,
                where a read may be asked again, within 0.15 s more (three times that if it is above 0.4).
                :meth:`stop` ends within 2 s whatever it is; but a gripper that takes longer than 0.4 s to
                answer may not have confirmed by then that the fingers were stopped, and the log says so.
            activation_timeout: seconds for an activation, 0.01..120.
            reconnect: whether a lost link is opened again, or a :class:`ReconnectPolicy`.
            speed: what the axes get until set otherwise, 0..255.
            force: what the axes get until set otherwise, 0..255.
            request_address: first request register; by default 0 over TCP and 0x03E8 over RTU.
            status_address: first status register; by default 0 over TCP and 0x07D0 over RTU.
            calibration: how fast this gripper is: default timeouts of moves come from it, and the speeds of
                :attr:`units`. None for the thesis's gripper.
            force_calibration: what :attr:`units` labels force values with. None for the manual's figures.
            keep_grip: what :meth:`stop` does unless told: False stops the fingers for certain (rGTO = 0),
                True holds what moves and lets a grip stay in force. It is also what leaving the block does.
                A gripper that is not polled afterwards may lose its activation, and with it the grip.

        Raises:
            TypeError: an option of the wrong type.
            ValueError: an option outside its range, or a malformed address.
        """
        hand = AsyncRobotiqHand(
            address,
            name=name,
            device_id=device_id,
            read_function=read_function,
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
            keep_grip=keep_grip,
        )
        super().__init__(hand, Caller(hand))

    def start(self, activate: bool = True, *, wait: float = 0.0) -> None:
        """Connect, read the status, activate if the gripper is reset, and poll from then on.

        An activation MOVES the fingers: they open and close to their stops. A gripper that is active
        already is adopted: nothing is written. (A gripper that has to be woken on a new connection follows
        its second motion: the first ends with MoveIgnoredError.) One that is in fault already is left there,
        so that :meth:`atr` and :meth:`recover` can run.

        With ``wait`` there may be no gripper yet, for a program that starts before its gripper is switched
        on: it is tried until it answers. It is activated only then, and its fingers MOVE long after the call.

        Fault 0x09, which some grippers show once after a second without a poll, is looked past first.

        A failed or cancelled start leaves nothing running; an activation that it began is taken back.

        Args:
            activate: False leaves a reset gripper in RESET.
            wait: seconds for which nobody may answer, 0..86400. After that the error of the last try is
                raised; with 0 that of the only one.

        Raises:
            InvalidStateError: this hand is started already, or another one runs on the same gripper.
            NotStartedError: stop() was called meanwhile.
            ConnectFailedError: nobody answers within the connect timeout, or for as long as was waited.
            RobotiqConnectionError: somebody answers, but not a gripper; or the link went down again.
            GripperFaultError: the activation that was begun ended in a fault.
            NotActivatedError: the gripper was reset during the activation that was begun.
            ActivationTimeoutError: the activation was not finished in time, or got nowhere for 5 s (0x05 and
                nothing new, as with a pressed emergency stop).
        """
        self._caller.start(lambda: self._inner.start(activate, wait=wait))

    def stop(self, *, halt: bool = True, keep_grip: bool | None = None) -> None:
        """Stop the fingers (rGTO = 0), keep the activation, disconnect. Idempotent.

        It is final from the call on: every request is refused with NotStartedError, what was asked before
        and not sent yet is dropped, and what other tasks wait for ends with NotStartedError. No request that
        starts or continues a motion is sent any more.

        Ends within 2 s even on a dead link, and also when cancelled meanwhile: the cancellation is
        raised once the hand has stopped. If the link is down, it is tried once more.

        Of several calls under way the strongest counts, whichever comes first: without ``keep_grip``, then
        with it, then ``halt=False``; one that is stronger than those before it has 2 s of its own. A halt or
        a hold that was not delivered makes of ``halt=False`` a stop with ``keep_grip``. A hand that has
        stopped is left as it is.

        With ``keep_grip`` axes that move are held where they are, and rGTO stays set, so that what grips
        goes on gripping while nobody is connected. But only when every axis has been seen at rest: on any
        doubt (within half a second one has not come to rest; the link is or goes down; a fault; a sequence;
        another client commands the gripper; ``halt()`` was asked) rGTO is cleared as ever, and the log says
        why. Who sets the fingers going between the last look at them and the end of the connection is not
        seen. What a real gripper does with a part, either way, is not known; and one that is not polled may
        lose its activation, and the part: the next program finds it in RESET then.

        Args:
            halt: False disconnects and leaves the fingers to what they do; for programs that only look.
            keep_grip: whether a grip stays in force; None for what the hand was made with.
        """
        self._caller.stop(lambda: self._inner.stop(halt=halt, keep_grip=keep_grip))
