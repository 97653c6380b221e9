"""A third kind of hand, one page long: no link, no task, no simulator. All happens at once.

It proves that a hand needs no more than a Backend supplies, and that the parts around a hand
need nothing but a Hand.
"""

from __future__ import annotations

import asyncio
from collections.abc import Collection
from dataclasses import replace
from typing import Any

from robotiq_async import (
    Fault,
    Finger,
    Inhibit,
    InvalidStateError,
    MoveResult,
    NotStartedError,
    RobotiqStatus,
    SentRequest,
    State,
    StateTimeoutError,
    Statistics,
    Transition,
    Trigger,
)
from robotiq_async.calibration import Units
from robotiq_async.hands import Backend, Hand
from robotiq_async.values import registers as reg
from robotiq_async.values.enums import ObjectStatus
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import AxisRequest, Request


class FakeBackend(Backend):
    """An active gripper whose axes are where they are sent as soon as they are sent there."""

    def __init__(self, name: str = "") -> None:
        super().__init__("fake://hand", name=name, units=lambda _: Units())
        self.obstacle = 256  # what closing fingers meet, in counts; 256 for nothing
        self._state = State.DISCONNECTED
        self._request = Request(activate=True, go=True, axes=(AxisRequest(speed=128, force=64),) * 4)
        self._fault = Fault.NONE
        self._inhibited: Inhibit | None = None
        self._last: RobotiqStatus | None = None

    def fail(self, fault: Fault) -> None:
        """The gripper reports a fault."""
        self._fault = fault
        self._enter(State.FAULT, Trigger.SEEN_FAULT)

    async def start(self, activate: bool, wait: float) -> None:
        self._enter(State.RUNNING_IDLE, Trigger.SEEN_READY)

    async def stop(self, halt: bool, keep_grip: bool) -> None:
        if halt and not keep_grip and self.state is not State.SHUTDOWN:
            self._write(go=False)
        self._enter(State.SHUTDOWN, Trigger.STOPPED)
        self.channels.end()

    async def set(self, what: str, value: int, axes: Finger) -> None:
        self._apply(axes, {what: value})

    def command(self, axes: Finger, position: int | None, speed: int | None, force: int | None) -> None:
        self._apply(axes, {"position": position, "speed": speed, "force": force})

    def _apply(self, axes: Finger, changes: dict[str, int | None]) -> None:
        self.check_running()
        wanted: dict[str, Any] = {name: value for name, value in changes.items() if value is not None}
        each = zip(THREE_FINGER.axes, self._request.axes, strict=True)
        self._enter(State.RUNNING_CC, Trigger.ASK_COMMAND)
        self._write(axes=tuple(replace(old, **wanted) if axis & axes else old for axis, old in each))
        self._enter(State.RUNNING_IDLE, Trigger.DELIVERED)

    async def move(
        self, axes: Finger, target: int, speed: int | None, force: int | None, timeout: float | None
    ) -> MoveResult:
        self.command(axes, target, speed, force)
        status = self.status
        return MoveResult(
            outcomes={axis: status.finger_status(axis) for axis in axes},
            positions={axis: status.position(axis) for axis in axes},
            contacts=status.contacts & axes,
            reached=axes,
            duration=0.0,
            peak_current_ma=dict.fromkeys(axes, 0),
            status=status,
        )

    async def hold(self, axes: Finger) -> None:
        self.check_running()

    async def halt(self) -> None:
        self._write(go=False)

    async def inhibit(self, inhibit: Inhibit) -> None:
        self._inhibited = inhibit if self._inhibited is None else self._inhibited.again()
        await self.halt()

    async def permit(self, who: str, seen: Inhibit | None) -> None:
        if seen in (None, self._inhibited):
            self._inhibited = None

    @property
    def inhibited(self) -> Inhibit | None:
        return self._inhibited

    async def activate(self) -> None:
        self._write(activate=True, go=False)
        self._enter(State.RUNNING_IDLE, Trigger.SEEN_READY)

    async def reset(self) -> None:
        self._fault = Fault.NONE
        self._write(activate=False, go=False)
        self._enter(State.RESET, Trigger.SEEN_RESET)

    async def atr(self) -> None:
        if self.state is not State.FAULT:
            raise InvalidStateError("there is no fault", self.state, {State.FAULT})
        self._write(release=True)
        self._enter(State.ATR_DONE, Trigger.SEEN_RELEASED)

    async def recover(self, timeout: float | None) -> None:
        await self.reset()
        await self.activate()

    @property
    def state(self) -> State:
        return self._state

    @property
    def statistics(self) -> Statistics:
        polls = 0 if self._last is None else self._last.sequence + 1
        return Statistics(polls, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0, "at once", 0, {"reached": polls})

    @property
    def newest_status(self) -> RobotiqStatus | None:
        return self._last

    def is_moving(self) -> bool:
        return False

    async def wait_for_state(self, states: Collection[State], timeout: float | None) -> State:
        raise StateTimeoutError("nothing happens later here")

    def check_running(self) -> None:
        if self.state in (State.DISCONNECTED, State.SHUTDOWN):
            raise NotStartedError("the fake hand does not run")

    def _write(self, **changes: Any) -> None:
        self._request = replace(self._request, **{"go": True, **changes})
        self.channels.requests.push(SentRequest(self._request, _now(), acknowledged=True))
        self._read()

    def _enter(self, state: State, trigger: Trigger) -> None:
        source, self._state = self._state, state
        self.channels.transitions.push(Transition(source, state, trigger, _now()))
        self._read()

    def _read(self) -> None:
        """The status of a gripper that has carried out its request."""
        block = [0] * reg.REGISTER_COUNT
        reg.gACT.write(block, self._request.activate)
        reg.gGTO.write(block, self._request.go)
        reg.gIMC.write(block, 3 if self._request.activate else 0)
        reg.gFLT.write(block, self._fault)
        for n, axis in enumerate(self._request.axes):
            met = n < 3 and axis.position > self.obstacle
            reg.gDT[n].write(block, ObjectStatus.CONTACT_CLOSING if met else ObjectStatus.AT_POSITION)
            reg.gPR[n].write(block, axis.position)
            reg.gPO[n].write(block, self.obstacle if met else min(max(axis.position, 6), 241))
        sequence = 0 if self._last is None else self._last.sequence + 1
        self._last = RobotiqStatus.from_registers(block, timestamp=_now(), sequence=sequence)
        self.channels.statuses.push(self._last)


class FakeHand(Hand):
    """A hand without a link.

    Attributes:
        fake: its backend.
    """

    def __init__(self, name: str = "", kind: type[FakeBackend] = FakeBackend) -> None:
        self.fake = kind(name)
        super().__init__(self.fake)


def _now() -> float:
    return asyncio.get_running_loop().time()
