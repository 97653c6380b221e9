"""RobotiqHand: the hand that owns the link to its gripper."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from ..calibration import ForceCalibration, SpeedCalibration
from ..hands.base import Hand
from ..hands.options import (
    ACTIVATION_TIMEOUT_S,
    CONNECT_TIMEOUT_S,
    NO_ADDRESS,
    POLL_INTERVAL_S,
    RESPONSE_TIMEOUT_S,
    WRITE_SPACING_S,
    HandOptions,
    ReconnectPolicy,
)
from ..link.tunnel.protocol import Tunnel
from ..values.enums import DEFAULT_FORCE, DEFAULT_SPEED, Finger
from ..values.events import SentRequest, Transition
from ..values.inhibit import Inhibit
from ..values.model import Model
from ..values.status import RobotiqStatus
from .backend import LocalBackend


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
        options = HandOptions(
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
        self._local = LocalBackend(options)
        super().__init__(self._local)

    # -- for programs around a hand ------------------------------------------------------------------------

    @property
    def options(self) -> HandOptions:
        """The options of the hand, checked."""
        return self._local.options

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
        self._local.check_may_listen()
        return self._local.channels.listeners.add(callback)

    # -- for programs that serve a hand to others ----------------------------------------------------------

    def assume(self, settings: Mapping[tuple[Finger, str], int]) -> None:
        """Say which speeds and forces the gripper has at the next start: the status does not echo them.

        For a program that serves the hand to others, as an agent does.

        Args:
            settings: counts by axis, and "speed" or "force". The options give the values that are left out.
        """
        self._local.assume(settings)

    def drop_requests(self, why: str) -> None:
        """Drop the requests that were not sent, except holds and halts: for a client that has lost control.

        For a program that serves the hand to others, as an agent does.

        A speed or a force that is not written yet would take effect under the next client. Calls that wait
        for dropped requests raise MoveSupersededError. A motion that was sent continues: :meth:`hold` ends
        it. A hand that does not run has nothing to drop.

        Args:
            why: the text of that error.
        """
        self._local.drop_requests(why)

    def resume_inhibit(self, inhibit: Inhibit) -> None:
        """Inhibit motion as :meth:`inhibit` does, but send nothing: for an inhibit of an earlier process.

        For a program that serves the hand to others, as an agent does.

        Args:
            inhibit: its reason, author and time. An earlier inhibit stays, and counts one more halt.
        """
        self._local.resume_inhibit(inhibit)

    async def halt_inhibited(self) -> None:
        """Halt as :meth:`inhibit` does, after :meth:`resume_inhibit` of a hand that runs.

        For a program that serves the hand to others, as an agent does.

        Raises:
            RobotiqError: as :meth:`inhibit`; the fingers MAY STILL MOVE.
        """
        await self._local.halt_inhibited()
