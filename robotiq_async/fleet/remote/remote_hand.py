"""RemoteHand: a hand that an agent on another host serves. Its options, its start, its end and its lease."""

from __future__ import annotations

from types import TracebackType
from typing import TYPE_CHECKING, Self

from ...runtime.event_loop import running_loop
from ...runtime.log import Log
from ...session.ending import Ending
from ...session.options import LONGEST_WAIT_S, check_units
from ...session.streams import Channels
from ...values.calibration import ForceCalibration, SpeedCalibration
from ...values.checks import check_flag, check_seconds
from ...values.enums import State
from ...values.errors import InvalidStateError, NotStartedError
from ..network.bus import Bus
from ..network.route import parse_remote_address
from .commands import RemoteCommands
from .outbox import Outbox
from .requests import no_answer_as_lost_connection
from .session import CONNECT_S, RemoteSession


class RemoteHand(RemoteCommands):
    """A Robotiq 3-Finger gripper on another host, served by ``robotiq-async agent`` there.

    A :class:`~robotiq_async.hand.Hand`: the names, errors and promises are those of
    :class:`~robotiq_async.RobotiqHand`, and docs/how-to/fleet.md lists what differs. Commanding
    takes a lease, which this hand acquires when it starts and renews from its own event loop; a program that
    hangs loses it, and what it had set going is then held. Reading is free, and so is :meth:`halt`.

    The safety of people is none of its business: a network can be cut at any moment. Nothing of this has run
    on real hardware yet.
    """

    def __init__(
        self,
        address: str,
        *,
        control: bool | None = True,
        connect_timeout: float = CONNECT_S,
        bus: Bus | None = None,
        calibration: SpeedCalibration | None = None,
        force_calibration: ForceCalibration | None = None,
        keep_grip: bool = False,
    ) -> None:
        """Check every option. Opens nothing and needs no running loop.

        Args:
            address: ``zenoh://SITE/HOST/GRIPPER``; ``?connect=tls/HOST:7447&keys=FOLDER`` says how to get
                there. What the address does not say the environment does (``ROBOTIQ_ASYNC_CONNECT``,
                ``ROBOTIQ_ASYNC_KEYS``), and without that it is an agent on this machine.
            control: True acquires the lease when the hand starts, None with the first command that is
                awaited, False not at all: it only reads (and halts) unless :meth:`acquire` is called.
            connect_timeout: seconds for finding the agent, 0.1..60.
            bus: an open session to share; it stays open. None opens one.
            calibration: the speeds of :attr:`units`; default timeouts are the agent's. None for the thesis's
                gripper.
            force_calibration: what :attr:`units` labels force values with. None for the manual's figures.
            keep_grip: what :meth:`stop` and :meth:`release` do unless told, and what leaving the block does.

        Raises:
            TypeError: an option of the wrong type.
            ValueError: an option outside its range, or a malformed address.
        """
        if control is not None and not isinstance(control, bool):
            raise TypeError(f"control must be True, False or None, got {control!r}")
        self._name, self._route = parse_remote_address(address)
        self._connect_timeout = check_seconds("connect_timeout", connect_timeout, 0.1, 60.0)
        self._control = control
        self._units = check_units(calibration, force_calibration)
        self._keep_grip = check_flag("keep_grip", keep_grip)
        if bus is None:
            self._route.configuration()  # malformed or unprotected: said here, and not when it starts
        self._shared = bus
        self._opening: object = None
        """Stands for the start that opens a session; None if there is none, or if it is to end."""
        self._channels = Channels(Log(str(self._name)))
        self._session: RemoteSession | None = None
        self._outbox: Outbox | None = None

    # -- lifetime --------------------------------------------------------------------------------------

    async def __aenter__(self) -> Self:
        """Start, with activation. See :meth:`start` for what it raises."""
        await self.start()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop, also when the block failed or was cancelled."""
        await self.stop()

    if not TYPE_CHECKING:  # type checkers tell the mistake themselves

        def __enter__(self) -> None:
            """Refuse ``with``.

            Raises:
                TypeError: always.
            """
            raise TypeError("a RemoteHand is used with 'async with', in a coroutine")

        def __exit__(self, *_: object) -> None:
            """Never called; without it Python would not call the other one."""

    async def start(self, activate: bool = True, *, wait: float = 0.0) -> None:
        """Find the agent, acquire the lease, and activate a gripper that is reset: its fingers MOVE then.

        A hand that only reads activates nothing. A failed or cancelled start leaves nothing running.

        Args:
            activate: False writes nothing to the gripper.
            wait: seconds, 0..86400, for which there may be no agent or no gripper yet. It may be activated
                long after the call, and its fingers MOVE only then.

        Raises:
            RuntimeError: not in a running asyncio event loop.
            InvalidStateError: this hand is started already.
            ConnectFailedError: no agent that serves this gripper.
            ImportError: the extra fleet is not installed.
            NotAllowedError: the agent's access rules say no.
            ControlLostError: another client commands the gripper.
            RobotiqError: as for a hand of this process, where the gripper is.
        """
        check_flag("activate", activate)
        wait = check_seconds("wait", wait, 0.0, LONGEST_WAIT_S)
        running_loop()
        self._abandon_if_loop_closed()
        before = self._session
        if self._opening is not None or (before is not None and not before.has_ended):
            raise InvalidStateError(
                "this hand is started already: stop() it first",
                self.state,
                {State.DISCONNECTED, State.SHUTDOWN},
            )
        bus = await self._open()
        self._session = session = RemoteSession(
            self._name,
            bus,
            self._channels,
            wants_control=self._control is True,
            owns_bus=bus is not self._shared,
            before=None if before is None else before.mirror,
        )
        self._outbox = Outbox(session)
        try:
            with no_answer_as_lost_connection():
                await session.connect(max(self._connect_timeout, wait))
            if activate and self._control:
                await self._activate_if_reset()
        except BaseException:
            await self.stop()
            raise

    async def stop(self, *, halt: bool = True, keep_grip: bool | None = None) -> None:
        """Stop the fingers, give the lease back, and disconnect; the agent's hand goes on.

        Ends within 2 s also when the agent is silent, or when cancelled meanwhile. A hand that does not hold
        the lease stops no fingers. Idempotent.

        Args:
            halt: False leaves the fingers to what they do.
            keep_grip: True lets the agent hold what moves, so that a grip stays in force; it halts when an
                axis does not come to rest, and in a fault or a sequence. None for what the hand was made
                with.

        Raises:
            RuntimeError: called in another event loop than the hand runs in; it goes on. (When that loop
                has been closed, the hand counts as stopped, and its agent holds what moves.)
        """
        check_flag("halt", halt)
        keep_grip = self._keep_grip if keep_grip is None else check_flag("keep_grip", keep_grip)
        self._abandon_if_loop_closed()
        self._opening = None
        session = self._session
        if session is not None and not session.has_ended:
            session.check_loop()
            assert self._outbox is not None
            self._outbox.drop()
            await session.close(Ending.of(halt=halt, keep_grip=keep_grip))

    async def _open(self) -> Bus:
        """The session to use.

        Raises:
            NotStartedError: stop() was called meanwhile.
            RobotiqError: none could be opened.
        """
        if self._shared is not None:
            return self._shared
        from ..network.zenoh_bus import open_bus  # noqa: PLC0415  # needs the extra

        self._opening = opening = object()
        try:
            bus = await open_bus(self._route.configuration(), str(self._name))
            if self._opening is not opening:
                await bus.close()
                raise NotStartedError("stop() was called meanwhile")
        finally:
            if self._opening is opening:
                self._opening = None
        return bus

    def _abandon_if_loop_closed(self) -> None:
        if self._session is not None and self._session.lost_its_loop:
            self._session.abandon()

    async def _activate_if_reset(self) -> None:
        if self.state in (State.RESET, State.DO_ACTIVATION, State.WF_ACTIVATION):
            await self.activate()

    # -- the lease -------------------------------------------------------------------------------------

    @property
    def is_in_control(self) -> bool:
        """Whether this hand holds the lease, as far as it knows."""
        return self._session is not None and not self._session.is_over and self._session.keeper.is_in_control

    async def acquire(self) -> None:
        """Get the lease, if nobody else has it.

        Raises:
            ControlLostError: another client commands the gripper.
            RobotiqError: not started, or the agent does not answer.
        """
        with no_answer_as_lost_connection():
            await self._asked().keeper.acquire()

    async def take(self) -> None:
        """Get the lease, whoever has it: what that one commanded and still moves is held.

        Raises:
            RobotiqError: not started, or the agent does not answer.
        """
        with no_answer_as_lost_connection():
            await self._asked().keeper.acquire(take=True)

    async def release(self, *, halt: bool = True, keep_grip: bool | None = None) -> None:
        """Give the lease back, and read on.

        Args:
            halt: False leaves the fingers to what they do.
            keep_grip: as for :meth:`stop`.

        Raises:
            RobotiqError: not started, the agent does not answer, or the fingers were not seen to stop.
        """
        check_flag("halt", halt)
        keep_grip = self._keep_grip if keep_grip is None else check_flag("keep_grip", keep_grip)
        keeper = self._asked().keeper
        keeper.give_back(Ending.of(halt=halt, keep_grip=keep_grip))
        with no_answer_as_lost_connection():
            await keeper.given_back()

    def __repr__(self) -> str:
        """Address and state."""
        return f"<RemoteHand {self.address} {self.state.name}>"
