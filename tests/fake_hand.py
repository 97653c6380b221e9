"""A second implementation of Hand, of a page: no link, no task, no simulator. All happens at once.

It proves that what stands around a hand needs nothing but the protocol.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Generic, Self, TypeVar

from robotiq_async import (
    CLOSED,
    OPEN,
    Fault,
    Finger,
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
from robotiq_async.control.grip_watch import SLIP_COUNTS, GripWatch
from robotiq_async.values import registers as reg
from robotiq_async.values.calibration import Units
from robotiq_async.values.enums import AXES, ObjectStatus
from robotiq_async.values.grasp_result import GraspResult, check_at_least
from robotiq_async.values.grip_event import GripEvent
from robotiq_async.values.request import AxisRequest, Request

T = TypeVar("T")


class FakeStream(Generic[T]):
    def __init__(self, buffer: int | None) -> None:
        self.missed = 0
        self._items: deque[T] = deque(maxlen=buffer)
        self._news = asyncio.Event()
        self._ended = False

    def push(self, item: T) -> None:
        self.missed += len(self._items) == self._items.maxlen
        self._items.append(item)
        self._news.set()

    def end(self) -> None:
        self._ended = True
        self._news.set()

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> T:
        while not self._items:
            if self._ended:
                raise StopAsyncIteration
            self._news.clear()
            await self._news.wait()
        return self._items.popleft()

    def take_nowait(self) -> T | None:
        return self._items.popleft() if self._items else None

    def drain(self) -> Iterator[T]:
        while self._items:
            yield self._items.popleft()

    async def aclose(self) -> None:
        self._items.clear()
        self.end()


class FakeHand:
    """An active gripper whose axes are where they are sent as soon as they are sent there.

    Attributes:
        obstacle: what closing fingers meet, in counts; 256 for nothing.
    """

    name = address = "fake://hand"
    is_moving = False
    units = Units()

    def __init__(self) -> None:
        self.state = State.DISCONNECTED
        self.obstacle = 256
        self._request = Request(activate=True, go=True, axes=(AxisRequest(speed=128, force=64),) * 4)
        self._fault = Fault.NONE
        self._last: RobotiqStatus | None = None
        self._streams: list[tuple[type, FakeStream[Any]]] = []
        self._watch: GripWatch | None = None

    async def __aenter__(self) -> Self:
        await self.start()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.stop()

    async def start(self, activate: bool = True, *, wait: float = 0.0) -> None:  # noqa: ARG002
        self._enter(State.RUNNING_IDLE, Trigger.SEEN_READY)

    async def stop(self, *, halt: bool = True, keep_grip: bool | None = None) -> None:
        if halt and not keep_grip and self.state is not State.SHUTDOWN:
            self._write(go=False)
        self._enter(State.SHUTDOWN, Trigger.STOPPED)
        while self._streams:
            self._streams.pop()[1].end()

    async def set_position(self, value: int, fingers: Finger | int = Finger.ABC) -> None:
        self.command(fingers, position=value)

    async def set_speed(self, value: int, fingers: Finger | int = Finger.ALL) -> None:
        self.command(fingers, speed=value)

    async def set_force(self, value: int, fingers: Finger | int = Finger.ALL) -> None:
        self.command(fingers, force=value)

    def command(self, fingers: Finger | int = Finger.ABC, **changes: int | None) -> None:
        if self.state is not State.RUNNING_IDLE:
            raise NotStartedError("the fake hand does not run")
        wanted = {name: value for name, value in changes.items() if value is not None}
        axes = zip(AXES, self._request.axes, strict=True)
        self._enter(State.RUNNING_CC, Trigger.ASK_COMMAND)
        self._write(axes=tuple(replace(old, **wanted) if axis & fingers else old for axis, old in axes))
        self._enter(State.RUNNING_IDLE, Trigger.DELIVERED)

    async def move(
        self,
        position: int,
        fingers: Finger | int = Finger.ABC,
        *,
        timeout: float | None = None,  # noqa: ARG002
        **changes: int | None,
    ) -> MoveResult:
        self.command(fingers, position=position, **changes)
        status, axes = self.status, Finger(fingers)
        return MoveResult(
            outcomes={axis: status.finger_status(axis) for axis in axes},
            positions={axis: status.position(axis) for axis in axes},
            contacts=status.contacts & axes,
            duration=0.0,
            peak_current_ma=dict.fromkeys(axes, 0),
            status=status,
        )

    async def open(self, fingers: Finger | int = Finger.ABC, **options: Any) -> MoveResult:
        return await self.move(OPEN, fingers, **options)

    async def close(self, fingers: Finger | int = Finger.ABC, **options: Any) -> MoveResult:
        return await self.move(CLOSED, fingers, **options)

    async def grasp(
        self, fingers: Finger | int = Finger.ABC, *, at_least: int | None = None, **options: Any
    ) -> GraspResult:
        return GraspResult(await self.close(fingers, **options), check_at_least(at_least, Finger(fingers)))

    async def hold(self, fingers: Finger | int = Finger.ALL) -> None:  # noqa: ARG002
        if self.state in (State.DISCONNECTED, State.SHUTDOWN):
            raise NotStartedError("the fake hand does not run")

    async def halt(self) -> None:
        self._write(go=False)

    def fail(self, fault: Fault) -> None:
        """The gripper reports a fault."""
        self._fault = fault
        self._enter(State.FAULT, Trigger.SEEN_FAULT)

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

    async def recover(self, timeout: float | None = None) -> None:  # noqa: ARG002
        await self.reset()
        await self.activate()

    @property
    def status(self) -> RobotiqStatus:
        if self._last is None:
            raise NotStartedError("there is no status yet")
        return self._last

    @property
    def is_activated(self) -> bool:
        return self.status.is_activated

    @property
    def is_reset(self) -> bool:
        return self.status.is_reset

    @property
    def statistics(self) -> Statistics:
        polls = 0 if self._last is None else self._last.sequence + 1
        return Statistics(polls, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0, "at once", 0, {"reached": polls})

    def statuses(self, buffer: int = 1) -> FakeStream[RobotiqStatus]:
        return self._open(RobotiqStatus, buffer)

    def transitions(self) -> FakeStream[Transition]:
        return self._open(Transition, None)

    def requests(self, buffer: int | None = None) -> FakeStream[SentRequest]:
        return self._open(SentRequest, buffer)

    def grip_events(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        since: RobotiqStatus | None = None,
        slip: int = SLIP_COUNTS,
    ) -> FakeStream[GripEvent]:
        self._watch = GripWatch(fingers, since=since, slip=slip)
        return self._open(GripEvent, None)

    async def wait_for_state(self, *states: State, timeout: float | None = None) -> State:  # noqa: ARG002
        if self.state not in states:
            raise StateTimeoutError("nothing happens later here")
        return self.state

    def _open(self, kind: type[T], buffer: int | None) -> FakeStream[T]:
        stream: FakeStream[T] = FakeStream(buffer)
        self._streams.append((kind, stream))
        return stream

    def _push(self, item: object) -> None:
        for kind, stream in self._streams:
            if isinstance(item, kind):
                stream.push(item)

    def _write(self, **changes: Any) -> None:
        self._request = replace(self._request, **{"go": True, **changes})
        self._push(SentRequest(self._request, _now(), acknowledged=True))
        self._read()

    def _enter(self, state: State, trigger: Trigger) -> None:
        source, self.state = self.state, state
        self._push(Transition(source, state, trigger, _now()))
        self._read()

    def _read(self) -> None:
        """What a gripper shows that has done what it was asked."""
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
        self._push(self._last)
        for event in self._watch.see(self._last) if self._watch else []:
            self._push(event)


def _now() -> float:
    return asyncio.get_running_loop().time()
