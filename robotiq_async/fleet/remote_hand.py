"""RemoteHand: a hand that an agent on another host serves."""

from __future__ import annotations

import asyncio
from types import TracebackType
from typing import Final, Self

from ..control.motion import MoveResult
from ..control.state_machine import RUNNING
from ..enums import CLOSED, OPEN, Finger, State
from ..errors import (
    ConnectionLostError,
    InvalidStateError,
    NotStartedError,
    StateTimeoutError,
)
from ..session.clock import now
from ..session.event_loop import running_loop
from ..session.statistics import Counters, Statistics
from ..session.streams import Channels, SentRequest, Stream, Transition
from ..wire.checks import check_byte, check_int, check_mask, check_optional_byte, check_seconds, check_timeout
from ..wire.status import RobotiqStatus
from .bus import Bus, Urgency
from .outbox import Outbox
from .remote_address import parse_remote_address
from .remote_session import CONNECT_S, HALT_S, NoAnswerError, RemoteSession, label
from .values import Fields, read_result

ATTEMPT_S: Final = 0.3
"""From one attempt to halt to the next."""
COMMAND_S: Final = 5.0
"""For what ends when the gripper acknowledges it."""
SEQUENCE_S: Final = 130.0
"""For an activation, a reset or a release; the agent has limits of its own, and they are shorter."""
MOVE_S: Final = 100.0
SLACK_S: Final = 5.0
"""Added to a timeout that the agent watches over."""


class RemoteHand:
    """A Robotiq 3-Finger gripper on another host, served by ``robotiq-async agent`` there.

    A :class:`~robotiq_async.protocol.Hand`: the names, errors and promises are those of
    :class:`~robotiq_async.RobotiqHand`, and docs/reference/fleet-protocol.md lists what differs. Commanding
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

        Raises:
            TypeError: an option of the wrong type.
            ValueError: an option outside its range, or a malformed address.
        """
        if control is not None and not isinstance(control, bool):
            raise TypeError(f"control must be True, False or None, got {control!r}")
        self._name, self._route = parse_remote_address(address)
        self._connect_timeout = check_seconds("connect_timeout", connect_timeout, 0.1, 60.0)
        self._control = control
        self._shared = bus
        self._own: Bus | None = None
        self._channels = Channels()
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

    async def start(self, activate: bool = True) -> None:
        """Find the agent, acquire the lease, and activate a gripper that is reset: its fingers MOVE then.

        A hand that only reads activates nothing. A failed or cancelled start leaves nothing running.

        Args:
            activate: False writes nothing to the gripper.

        Raises:
            RuntimeError: not in a running asyncio event loop.
            InvalidStateError: this hand is started already.
            ConnectFailedError: no agent that serves this gripper.
            NotAllowedError: the agent's access rules say no.
            ControlLostError: another client commands the gripper.
            RobotiqError: as for a hand of this process, where the gripper is.
        """
        if not isinstance(activate, bool):
            raise TypeError(f"activate must be True or False, got {activate!r}")
        loop = running_loop()
        if self._session is not None and not self._session.is_over and self._session.loop is loop:
            raise InvalidStateError("this hand is started already", self.state, {State.SHUTDOWN})
        bus = await self._open()
        self._session = session = RemoteSession(
            self._name, bus, self._channels, wants_control=self._control is True
        )
        self._outbox = Outbox(session)
        try:
            await session.connect(self._connect_timeout)
            if activate and self._control:
                await self._activate_if_reset()
        except BaseException:
            await self.stop()
            raise

    async def stop(self, *, halt: bool = True) -> None:
        """Stop the fingers, give the lease back, and disconnect; the agent's hand goes on.

        Ends within 2 s also when the agent is silent, or when cancelled meanwhile. A hand that does not hold
        the lease stops no fingers. Idempotent.

        Args:
            halt: False leaves the fingers to what they do.

        Raises:
            RuntimeError: called in another event loop than the hand runs in.
        """
        if not isinstance(halt, bool):
            raise TypeError(f"halt must be True or False, got {halt!r}")
        session = self._session
        if session is None or session.is_over:
            return
        session.check_loop()
        try:
            await session.close(NotStartedError("the hand was stopped"), halt=halt)
        finally:
            if self._own is not None:
                bus, self._own = self._own, None
                await bus.close()

    async def _open(self) -> Bus:
        if self._shared is not None:
            return self._shared
        from .zenoh_bus import open_bus  # noqa: PLC0415  # needs the extra

        self._own = await open_bus(self._route.configuration(), str(self._name))
        return self._own

    async def _activate_if_reset(self) -> None:
        if self.state is State.RESET:
            await self.activate()

    # -- the lease -------------------------------------------------------------------------------------

    @property
    def is_in_control(self) -> bool:
        """Whether this hand holds the lease, as far as it knows."""
        return self._session is not None and not self._session.is_over and self._session.is_in_control

    async def acquire(self) -> None:
        """Get the lease, if nobody else has it.

        Raises:
            ControlLostError: another client commands the gripper.
            RobotiqError: not started, or the agent does not answer.
        """
        await self._asked().acquire()

    async def take(self) -> None:
        """Get the lease, whoever has it: what that one commanded and still moves is held.

        Raises:
            RobotiqError: not started, or the agent does not answer.
        """
        await self._asked().acquire(take=True)

    async def release(self, *, halt: bool = True) -> None:
        """Give the lease back, and read on.

        Args:
            halt: False leaves the fingers to what they do.

        Raises:
            RobotiqError: not started, the agent does not answer, or the fingers were not seen to stop.
        """
        await self._asked().release(halt=halt)

    # -- commands --------------------------------------------------------------------------------------

    async def set_position(self, value: int, fingers: Finger | int = Finger.ABC) -> None:
        """Ask axes to go somewhere; returns when the gripper has acknowledged it, not when they are there.

        Raises:
            TypeError: value or mask of the wrong type; nothing is sent.
            ValueError: value or mask outside their range; nothing is sent.
            ControlLostError: this hand does not hold the lease.
            RobotiqError: the hand takes no commands now, or the agent fell silent before its answer (the
                request is not sent again, and may have been carried out).
        """
        await self._set("set_position", value, fingers)

    async def set_speed(self, value: int, fingers: Finger | int = Finger.ALL) -> None:
        """Set the speed of axes, also of a motion under way; never starts one.

        Raises:
            TypeError, ValueError, RobotiqError: as :meth:`set_position`.
        """
        await self._set("set_speed", value, fingers)

    async def set_force(self, value: int, fingers: Finger | int = Finger.ALL) -> None:
        """Set the force of axes; never starts a motion. More force tightens a grip.

        Raises:
            TypeError, ValueError, RobotiqError: as :meth:`set_position`.
        """
        await self._set("set_force", value, fingers)

    async def _set(self, name: str, value: int, fingers: Finger | int) -> None:
        mask = check_mask(fingers)
        arguments = {"value": check_byte("value", value), "fingers": int(mask)}
        await self._ask(name, arguments, COMMAND_S)

    def command(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        position: int | None = None,
        speed: int | None = None,
        force: int | None = None,
    ) -> None:
        """Ask axes for something, for control loops: never blocks, and the last value wins.

        Some requests are under way at a time; what is asked meanwhile is merged and goes out with the next.
        A refusal that comes back is logged; the loss of the lease is raised by the next call.

        Raises:
            ValueError: none of position, speed and force; or a value outside its range.
            TypeError: a value of the wrong type.
            RobotiqError: not started, the agent is silent, this hand does not hold the lease, or the hand
                takes no commands now.
        """
        mask = check_mask(fingers)
        changes = {
            name: check_optional_byte(name, value)
            for name, value in (("position", position), ("speed", speed), ("force", force))
        }
        if all(value is None for value in changes.values()):
            raise ValueError("command() needs at least one of position, speed and force")
        session = self._asked()
        session.check_control()
        self._refuse_unless_running()
        assert self._outbox is not None
        self._outbox.put(mask, {name: value for name, value in changes.items() if value is not None})

    async def move(
        self,
        position: int,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        force: int | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        """Move axes and return when every one of them has stopped: there, or against something.

        When cancelled, the axes that still move are held; when the agent falls silent, it holds them itself
        within its window.

        Args:
            position: target in counts, 0 (open) .. 255 (closed).
            fingers: mask of the axes.
            speed: new speed of these axes; None leaves it.
            force: new force of these axes; None leaves it.
            timeout: seconds; None for twice the expected time plus 2 s.

        Raises:
            TypeError, ValueError: an argument of the wrong type or outside its range; nothing is sent.
            ControlLostError: this hand does not hold the lease, or lost it on the way.
            RobotiqError: as for a hand of this process, or the agent fell silent.
        """
        arguments: Fields = {
            "position": check_byte("position", position),
            "fingers": int(check_mask(fingers)),
            "speed": check_optional_byte("speed", speed),
            "force": check_optional_byte("force", force),
            "timeout": check_timeout("timeout", timeout),
        }
        limit = MOVE_S if timeout is None else timeout + SLACK_S
        value = await self._ask("move", arguments, limit)
        session = self._session
        assert session is not None
        return read_result(value, session.mirror.clock)

    async def open(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        force: int | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        """Open fingers: :meth:`move` to 0."""
        return await self.move(OPEN, fingers, speed=speed, force=force, timeout=timeout)

    async def close(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        force: int | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        """Close the fingers, not the connection: :meth:`move` to 255."""
        return await self.move(CLOSED, fingers, speed=speed, force=force, timeout=timeout)

    async def hold(self, fingers: Finger | int = Finger.ALL) -> None:
        """Have axes that move stay where they are; grips stay. Returns when it is acknowledged.

        Raises:
            RobotiqError: as :meth:`set_position`.
        """
        await self._ask("hold", {"fingers": int(check_mask(fingers))}, COMMAND_S)

    async def halt(self) -> None:
        """Stop every axis now; returns when the gripper shows it. Takes no lease; asked until answered.

        If somebody else commands the gripper, that one loses the lease.

        Raises:
            NotStartedError: not started.
            ConnectionLostError: no answer within 2 s: the fingers MAY STILL MOVE. Or the gripper is not
                connected to its agent.
            RobotiqError: the agent could not stop them.
        """
        session, deadline = self._asked(), now() + HALT_S
        while True:
            left = deadline - now()
            try:
                await session.ask(
                    "halt", {"label": label()}, timeout=min(ATTEMPT_S, left), urgency=Urgency.STOP
                )
            except NoAnswerError:
                if deadline - now() < ATTEMPT_S / 2:
                    raise
            else:
                return

    # -- activation, faults ----------------------------------------------------------------------------

    async def activate(self) -> None:
        """Activate the gripper, if it is not active yet: its fingers MOVE. When cancelled, it goes on.

        Raises:
            RobotiqError: as for a hand of this process, or the lease or the agent was lost.
        """
        await self._ask("activate", {}, SEQUENCE_S)

    async def reset(self) -> None:
        """Reset the gripper, which lets go of what it holds; returns in RESET. When cancelled, it goes on.

        Raises:
            RobotiqError: as :meth:`activate`.
        """
        await self._ask("reset", {}, SEQUENCE_S)

    async def atr(self) -> None:
        """Release automatically: all axes open slowly. Only in FAULT; returns in ATR_DONE.

        Raises:
            RobotiqError: as :meth:`activate`.
        """
        await self._ask("atr", {}, SEQUENCE_S)

    async def recover(self, timeout: float | None = None) -> None:
        """Do whatever the present fault needs: after a major one the part DROPS and the fingers MOVE.

        Args:
            timeout: seconds for all of it; None for 90 s.

        Raises:
            RobotiqError: as :meth:`activate`.
        """
        limit = check_timeout("timeout", timeout)
        await self._ask("recover", {"timeout": limit}, SEQUENCE_S if limit is None else limit + SLACK_S)

    # -- what is going on ------------------------------------------------------------------------------

    @property
    def address(self) -> str:
        """The gripper's address, without how to get there."""
        return str(self._name)

    @property
    def state(self) -> State:
        """Where the hand is, as far as it is known: DISCONNECTED also while the agent is silent."""
        return State.DISCONNECTED if self._session is None else self._session.current_state()

    @property
    def status(self) -> RobotiqStatus:
        """The newest status that was heard; its timestamp tells how old it is.

        Raises:
            NotStartedError: there is none yet.
        """
        status = None if self._session is None else self._session.mirror.status
        if status is None:
            raise NotStartedError("no status has been heard yet: start the hand first")
        return status

    @property
    def is_activated(self) -> bool:
        """Whether the gripper is active.

        Raises:
            RobotiqError: not known: not started, or nothing is heard.
        """
        return self._current_status().is_activated

    @property
    def is_reset(self) -> bool:
        """Whether the gripper is reset.

        Raises:
            RobotiqError: not known: not started, or nothing is heard.
        """
        status = self._current_status()
        return status.is_reset and not status.activation_echo

    @property
    def is_moving(self) -> bool:
        """Whether an axis moves, or will because of a command that does not act yet.

        Raises:
            RobotiqError: not known: not started, or nothing is heard.
        """
        self._current_status()
        assert self._session is not None
        assert self._outbox is not None
        newest = self._session.mirror.newest
        return self._outbox.is_moving or (newest is not None and newest.is_moving)

    @property
    def statistics(self) -> Statistics:
        """How the agent's polling goes, as of its last summary: at most a second old."""
        return Counters().snapshot(0) if self._session is None else self._session.statistics

    def statuses(self, buffer: int = 1) -> Stream[RobotiqStatus]:
        """Every status that is heard from now on, for one reader; see :meth:`RobotiqHand.statuses`."""
        return self._channels.statuses.open(check_int("buffer", buffer, 1, 1_000_000))

    def transitions(self) -> Stream[Transition]:
        """Every change of state from now on, none lost that the agent still knows of.

        Losing the agent, and hearing it again, are changes too.
        """
        return self._channels.transitions.open(None)

    def requests(self, buffer: int | None = None) -> Stream[SentRequest]:
        """Every request the agent's hand writes from now on, by whomever it was asked for."""
        kept = None if buffer is None else check_int("buffer", buffer, 1, 1_000_000)
        return self._channels.requests.open(kept)

    async def wait_for_state(self, *states: State, timeout: float | None = None) -> State:
        """Wait until the hand is, if only for a moment, in one of these states, and return it.

        Raises:
            TypeError: not a State.
            ValueError: no state, or a malformed timeout.
            StateTimeoutError: not reached in time.
            NotStartedError: the hand is not started, or was stopped meanwhile.
        """
        if not states:
            raise ValueError("states must name at least one State, got none")
        for state in states:
            if not isinstance(state, State):
                raise TypeError(f"states must be State members, got {state!r}")
        limit = check_timeout("timeout", timeout)
        if self.state in states:
            return self.state
        with self._asked().waiters.watching(set(states), {}) as reached:
            try:
                async with asyncio.timeout(limit):
                    return await reached
            except TimeoutError:
                names = " or ".join(state.name for state in states)
                raise StateTimeoutError(f"{names} was not reached within {limit:g} s") from None

    def __repr__(self) -> str:
        """Address and state."""
        return f"<RemoteHand {self.address} {self.state.name}>"

    # -- inside ----------------------------------------------------------------------------------------

    def _started(self) -> RemoteSession:
        if self._session is None:
            raise NotStartedError("the hand is not started: use 'async with' or start()")
        self._session.check_running()
        return self._session

    def _asked(self) -> RemoteSession:
        session = self._started()
        session.check_loop()
        return session

    def _current_status(self) -> RobotiqStatus:
        self._started()
        status = self.status
        if self.state is State.DISCONNECTED:
            raise ConnectionLostError(
                "the agent or its gripper is not heard: what the gripper does is not known"
            )
        return status

    def _refuse_unless_running(self) -> None:
        if self.state not in RUNNING:
            raise InvalidStateError(f"the hand takes no commands in {self.state.name}", self.state, RUNNING)

    async def _ask(self, name: str, arguments: Fields, timeout: float) -> Fields:
        """Have the agent's hand do something; when cancelled, the agent calls it off."""
        session = self._asked()
        if self._control is None and not session.is_in_control and session.lost is None:
            await session.acquire()
        session.check_control()
        call = session.call(arguments)
        try:
            value: Fields = await session.send(call, f"cmd/{name}", timeout=timeout, urgency=Urgency.COMMAND)
        except asyncio.CancelledError:
            session.call_off(call)
            raise
        return value
