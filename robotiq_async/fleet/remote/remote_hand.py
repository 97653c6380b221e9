"""RemoteHand: a hand that an agent on another host serves, and the backend that talks with the agent."""

from __future__ import annotations

import asyncio
from collections.abc import Collection
from typing import Any, Final, Literal

from ...calibration import ForceCalibration, SpeedCalibration
from ...hands import Backend, Hand, StateWaiters, Statistics
from ...runtime import Limit
from ...values import (
    Finger,
    Inhibit,
    MoveResult,
    NotStartedError,
    RobotiqConnectionError,
    RobotiqStatus,
    State,
    Trigger,
    check_seconds,
)
from ..errors import AgentError
from ..network.bus import Bus
from ..network.route import parse_remote_address
from ..wire.values import Fields, reading
from .errand import no_answer_as_lost_connection
from .lease_state import own_label
from .session import CONNECT_S, RemoteSession

REMOTE_COMMAND_S: Final = 5.0  # seconds for the answer to a command; the limits of the agent are shorter
SEQUENCE_S: Final = 130.0
MOVE_S: Final = 100.0  # without a timeout
_LIMIT_S: Final = {"move": MOVE_S} | dict.fromkeys(("activate", "reset", "atr", "recover"), SEQUENCE_S)
SLACK_S: Final = 5.0  # seconds beyond a timeout that the agent applies


class RemoteBackend(Backend):
    """The agent carries out its calls; ``control`` says when to acquire the lease."""

    session: RemoteSession | None = None

    def __init__(
        self, address: str, control: bool | None, connect_timeout: float, bus: Bus | None, usual: Fields
    ) -> None:
        if control is not None and not isinstance(control, bool):
            raise TypeError(f"control must be True, False or None, got {control!r}")
        self._gripper, self._route = parse_remote_address(address)
        self._connect_timeout = check_seconds("connect_timeout", connect_timeout, 0.1, 60.0)
        self._control = control
        super().__init__(str(self._gripper), **usual)
        if bus is None:
            self._route.configuration()  # a malformed or unprotected route fails here, not at the start
        self._shared_bus = bus
        self._opening: object = None  # the start that opens a bus; None without one, and after stop()

    # -- lifetime --------------------------------------------------------------------------------------

    @property
    def is_started(self) -> bool:
        return self._opening is not None or (self.session is not None and not self.session.dialog.has_ended)

    async def start(self, activate: bool, wait: float) -> None:
        before = self.session
        bus = await self._open_bus()
        own, last = bus is not self._shared_bus, None if before is None else before.dialog
        self.session = session = RemoteSession(self._gripper, bus, self.channels, owns_bus=own, before=last)
        try:
            with no_answer_as_lost_connection():
                await session.connect(max(self._connect_timeout, wait), acquires=self._control is True)
            _ = self.units  # a calibration of another model fails here, before anything moves
            activates = activate and self._control
            if activates and self.state in (State.RESET, State.DO_ACTIVATION, State.WF_ACTIVATION):
                await self.activate()
        except BaseException:
            await self.stop(halt=True, keep_grip=self.keep_grip)
            raise

    async def stop(self, halt: bool, keep_grip: bool) -> None:
        self._opening = None
        session = self.session
        if session is not None and not session.dialog.has_ended:
            self.check_called_in_loop()
            session.dialog.clear("stopped")
            await self.wait_for_end(session.close(self.stop_level(halt, keep_grip)))

    async def _open_bus(self) -> Bus:
        if self._shared_bus is not None:
            return self._shared_bus
        from ..network.zenoh_bus import open_bus  # noqa: PLC0415  # needs the extra

        self._opening = opening = object()
        try:
            bus = await open_bus(self._route.configuration(), self.address)
            if self._opening is not opening:
                await bus.close()
                raise NotStartedError("stop() was called during the start")
        finally:
            if self._opening is opening:
                self._opening = None
        return bus

    # -- commands --------------------------------------------------------------------------------------

    async def set(self, what: Literal["position", "speed", "force"], value: int, axes: Finger) -> None:
        await self._ask(f"set_{what}", value=value, fingers=int(axes))

    def command(self, axes: Finger, position: int | None, speed: int | None, force: int | None) -> None:
        session = self.running_session()
        session.check_control()
        self.check_allowed(Trigger.ASK_COMMAND, presses=position is not None or force is not None)
        changes = {"position": position, "speed": speed, "force": force}
        session.dialog.put(axes, {name: value for name, value in changes.items() if value is not None})

    async def move(
        self, axes: Finger, target: int, speed: int | None, force: int | None, timeout: float | None
    ) -> MoveResult:
        value = await self._ask(
            "move", position=target, fingers=int(axes), speed=speed, force=force, timeout=timeout
        )
        with reading("a result"):
            return MoveResult.from_dict(value, self.running_session().mirror.read_status(value["status"]))

    async def hold(self, axes: Finger) -> None:
        await self._ask("hold", fingers=int(axes))

    async def inhibit(self, inhibit: Inhibit) -> None:
        arguments = {"inhibit": inhibit.reason, "who": inhibit.who}
        self._take_over_inhibit(await self._halted(arguments))

    async def permit(self, who: str, seen: Inhibit | None) -> None:
        session = self.running_session()
        named = seen or session.mirror.inhibited  # a halt that overtakes this permit stays
        arguments: Fields = {"what": "permit", "label": own_label(), "who": who}
        arguments["inhibited"] = None if named is None else named.as_dict()
        with no_answer_as_lost_connection():
            self._take_over_inhibit(await session.dialog.ask("lease", arguments, timeout=REMOTE_COMMAND_S))

    def _take_over_inhibit(self, answer: Fields) -> None:
        if "inhibited" not in answer:
            raise AgentError(f"{self._gripper}: its agent is older: it halts, and inhibits nothing")
        assert self.session is not None, "it has answered"
        with reading("an inhibit"):
            self.session.mirror.receive_inhibit(answer)

    @property
    def inhibited(self) -> Inhibit | None:
        """The reason for which the agent refuses motion, since when, by whom; None if none is known."""
        return None if self.session is None else self.session.mirror.inhibited

    async def halt(self) -> None:
        await self._halted()

    async def _halted(self, arguments: Fields | None = None) -> Fields:
        session = self.running_session()
        session.dialog.clear()
        halting = session.dialog.halt(arguments=arguments)
        try:
            with no_answer_as_lost_connection():
                answer: Fields = await asyncio.shield(halting)
        except asyncio.CancelledError:
            if not halting.cancelled():
                # The halt continues. Its error is retrieved, or asyncio would log that it never was.
                halting.add_done_callback(lambda task: task.cancelled() or task.exception())
            elif session.is_over:
                raise NotStartedError("the hand was stopped") from None
            raise
        return answer

    async def activate(self) -> None:
        await self._ask("activate")

    async def reset(self) -> None:
        await self._ask("reset")

    async def atr(self) -> None:
        await self._ask("atr")

    async def recover(self, timeout: float | None) -> None:
        await self._ask("recover", timeout=timeout)

    async def _ask(self, name: str, **arguments: Any) -> Fields:  # noqa: ANN401  # any JSON
        """Have the agent carry out a command; if this call is cancelled, cancel the command there."""
        timeout = arguments.get("timeout")
        seconds = _LIMIT_S.get(name, REMOTE_COMMAND_S) if timeout is None else timeout + SLACK_S
        session = self.running_session()
        dialog = session.dialog
        if self._control is None and not dialog.lease.is_held and dialog.lease.lost is None:
            with no_answer_as_lost_connection():
                await session.keeper.acquire()
        session.check_control()
        # Earlier commands are sent first.
        dialog.flush()
        call = dialog.call(arguments)
        try:
            with no_answer_as_lost_connection():
                value: Fields = await dialog.send(call, f"cmd/{name}", timeout=seconds)
        except (asyncio.CancelledError, RobotiqConnectionError):
            # Also after an error that does not say whether the request was carried out.
            dialog.cancel(name, call)
            raise
        return value

    # -- what the hand shows ---------------------------------------------------------------------------

    @property
    def state(self) -> State:
        """The state of the agent's hand; DISCONNECTED also while the agent is silent."""
        return State.DISCONNECTED if self.session is None else self.session.mirror.state

    @property
    def statistics(self) -> Statistics | None:
        """Figures of the agent's polling, at most 1 s old."""
        return None if self.session is None else self.session.statistics

    @property
    def points(self) -> tuple[tuple[int, float], ...]:
        """The measured points of the agent's hand, which has the option ``stroke``."""
        return () if self.session is None else self.session.mirror.points

    @property
    def newest_status(self) -> RobotiqStatus | None:
        return None if self.session is None else self.session.mirror.status

    def is_moving(self) -> bool:
        assert self.session is not None, "the hand runs"
        newest = self.session.mirror.newest
        return self.session.dialog.is_moving or (newest is not None and newest.is_moving)

    async def wait_for_state(self, states: Collection[State], timeout: float | None) -> State:
        with self.running_session().waiters.watching(states, {}) as reached, Limit(timeout):
            return await reached
        names = " or ".join(state.name for state in states)
        raise StateWaiters.late(f"{names} was not reached", timeout, self.state)

    def running_session(self) -> RemoteSession:
        # Refuses before start(), after stop(), and from another loop.
        self.check_running()
        assert self.session is not None, "it runs"
        self.check_called_in_loop()
        return self.session


class RemoteHand(Hand):
    """A Robotiq gripper on another host, served by ``robotiq-async agent`` there.

    :class:`~robotiq_async.hands.Hand` has the promises of all hands. Commanding takes a lease, which this
    hand acquires when it starts and renews from its own event loop. A program that hangs loses the lease, and
    axes that it had set in motion are then held. Differences from a hand of this process:

    * :meth:`start` looks for the agent (ConnectFailedError, NotAllowedError) and acquires the lease
      (ControlLostError: another client commands). Without the extra ``fleet`` it raises ImportError. A hand
      that only reads activates nothing.
    * :meth:`stop` releases the lease; the agent's hand keeps running. Without the lease it stops no fingers.
      If the event loop was closed, the agent holds axes that move.
    * Commands raise ControlLostError without the lease, and ConnectionLostError when the agent falls silent:
      it may have carried them out, and holds axes that move within its window. If the agent refuses a command
      after :meth:`command` has returned, the refusal is logged.
    * :meth:`halt` needs no lease and is repeated until it is answered. If another client commands the
      gripper, it loses the lease. ConnectionLostError means no answer within 2 s: the fingers MAY STILL MOVE.
    * :meth:`inhibit` and :meth:`permit` are the agent's, for all its clients: they need a started hand and no
      lease. The inhibit outlasts leases, and restarts of the agent. A permit lifts the halts that this hand
      has heard of; a later halt stays, and RobotiqStateError is raised.
    * Millimetres and fractions follow the ``stroke`` of the agent's hand. They are sent as counts.
    * :attr:`state` is DISCONNECTED also while the agent is silent; that is a transition, too. Some statuses
      may be missing, and :meth:`grip_events` follows the statuses that arrived. :attr:`statistics` are
      the agent's, at most 1 s old.

    The safety of people must not depend on it: a network can be cut at any moment. None of this has run on
    real hardware yet. Making a hand checks every option; it opens nothing and needs no running loop.

    Args:
        address: ``zenoh://SITE/HOST/GRIPPER``; ``?connect=tls/HOST:7447&keys=FOLDER`` says how to get there.
            A missing part comes from the environment (``ROBOTIQ_ASYNC_CONNECT``, ``ROBOTIQ_ASYNC_KEYS``); the
            default is an agent on this machine.
        control: True acquires the lease when the hand starts, None with the first command that is awaited,
            False never: the hand only reads (and halts) unless :meth:`acquire` is called.
        connect_timeout: seconds for finding the agent, while the event loop runs, 0.1..60.
        bus: an open session to share; it stays open. None opens one.
        calibration: the speeds of :attr:`units`; default timeouts are the agent's. None for the thesis's
            gripper.
        force_calibration: the forces of :attr:`units`. None for the manual's figures.
        keep_grip: the default of :meth:`stop` and :meth:`release`; leaving the block always uses it.

    Raises:
        TypeError: an option of the wrong type.
        ValueError: an option outside its range, or a malformed address.
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
        usual = {"calibration": calibration, "force_calibration": force_calibration, "keep_grip": keep_grip}
        self._remote = RemoteBackend(address, control, connect_timeout, bus, usual)
        super().__init__(self._remote)

    # -- the lease -------------------------------------------------------------------------------------

    @property
    def is_in_control(self) -> bool:
        """Whether this hand holds the lease, as far as it knows."""
        session = self._remote.session
        return session is not None and not session.is_over and session.dialog.lease.is_held

    async def acquire(self) -> None:
        """Get the lease, unless another client holds it.

        Raises:
            ControlLostError: another client commands the gripper.
            RobotiqError: not started, or the agent does not answer.
        """
        with no_answer_as_lost_connection():
            await self._remote.running_session().keeper.acquire()

    async def take(self) -> None:
        """Get the lease, also from another client; axes that this client set in motion are held.

        Raises:
            RobotiqError: not started, or the agent does not answer.
        """
        with no_answer_as_lost_connection():
            await self._remote.running_session().keeper.acquire(take=True)

    async def release(self, *, halt: bool = True, keep_grip: bool | None = None) -> None:
        """Release the lease, and continue to read.

        Args:
            halt: False leaves the fingers moving.
            keep_grip: as for :meth:`stop`.

        Raises:
            RobotiqError: not started, the agent does not answer, or the fingers were not seen to stop.
        """
        level = self._remote.stop_level(halt, keep_grip)
        keeper = self._remote.running_session().keeper
        keeper.release(level)
        with no_answer_as_lost_connection():
            await keeper.released()
