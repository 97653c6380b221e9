"""RemoteBackend: the part of a remote hand that talks with the agent."""

from __future__ import annotations

import asyncio
from collections.abc import Collection
from typing import Any, Final, Literal

from ...hands import Backend, StateWaiters, Statistics
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
from .session import RemoteSession

REMOTE_COMMAND_S: Final = 5.0  # seconds for commands that end with the acknowledgment of the gripper
SEQUENCE_S: Final = 130.0
MOVE_S: Final = 100.0  # without a timeout
_LIMIT_S: Final = {"move": MOVE_S} | dict.fromkeys(("activate", "reset", "atr", "recover"), SEQUENCE_S)
"""For the answer to a command; the agent's own limits are shorter."""
SLACK_S: Final = 5.0  # seconds beyond a timeout that the agent applies


class RemoteBackend(Backend):
    """Has the agent carry out the calls; ``control`` says when it acquires the lease."""

    session: RemoteSession | None = None

    def __init__(
        self,
        address: str,
        *,
        control: bool | None,
        connect_timeout: float,
        bus: Bus | None,
        **usual: Any,  # noqa: ANN401  # options of every backend
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
        self._opening: object = None
        """Identifies the start that opens a bus; None without a start, or if stop() was called."""

    # -- lifetime --------------------------------------------------------------------------------------

    @property
    def is_started(self) -> bool:
        return self._opening is not None or (self.session is not None and not self.session.dialog.has_ended)

    async def start(self, activate: bool, wait: float) -> None:
        before = self.session
        bus = await self._open_bus()
        self.session = session = RemoteSession(
            self._gripper,
            bus,
            self.channels,
            owns_bus=bus is not self._shared_bus,
            before=None if before is None else before.dialog,
        )
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
            await session.close(self.stop_level(halt, keep_grip))

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
    def statistics(self) -> Statistics:
        """Figures of the agent's polling, at most 1 s old."""
        return Statistics.none() if self.session is None else self.session.statistics

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
