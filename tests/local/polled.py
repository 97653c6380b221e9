"""A run with what it owns, on a wire without a network, in virtual time."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import TypeVar

from robotiq_async.control.controller import Controller
from robotiq_async.control.state_machine import StateMachine
from robotiq_async.hands.options import ReconnectPolicy
from robotiq_async.hands.statistics import Counters
from robotiq_async.hands.streams import Channel, Channels, Listeners
from robotiq_async.local.ending import STOP_S
from robotiq_async.local.poller import RunParts
from robotiq_async.local.publisher import Publisher
from robotiq_async.local.run import Run
from robotiq_async.values.enums import State, Trigger
from robotiq_async.values.events import SentRequest
from robotiq_async.values.status import RobotiqStatus
from tests.control.scan import first_request
from tests.fake_transport import Wire
from tests.local.sessions import options
from tests.patience import patience
from tests.virtual import VirtualLoop

T = TypeVar("T")

POLL_S = 0.01


class Published(Channel[T]):
    """The published items; an error of a receiver is an error of the run."""

    def __init__(self, push: Callable[[T], None]) -> None:
        super().__init__(Listeners())
        self._push = push

    def push(self, item: T) -> None:
        self._push(item)


class Polled:
    """A run with what it owns, and what it has published."""

    def __init__(
        self, policy: ReconnectPolicy | None, *, activate: bool = False, poll_interval: float = POLL_S
    ) -> None:
        self.wire = Wire()
        self.changes: list[tuple[State, State, Trigger]] = []
        self.machine = StateMachine()
        self.machine.begin(lambda *change: self.changes.append(change))
        self.counters = Counters()
        self.statuses: list[RobotiqStatus] = []
        self.requests: list[SentRequest] = []
        channels = Channels()
        channels.statuses = Published(self.publish)
        channels.requests = Published(self.requests.append)
        channels.numbers = itertools.count(7)
        given = replace(options(self.wire, policy), poll_interval=poll_interval)
        publisher = Publisher(channels, self.machine)
        self.controller = Controller(self.machine, first_request(), ended=publisher.end)
        self.controller.allow_activation(activate)
        self.run = Run(RunParts(self.wire, self.controller, self.counters, publisher, given))
        self.at_next_status: Callable[[], None] | None = None
        self._published = asyncio.Event()
        self.task: asyncio.Task[None]

    def publish(self, status: RobotiqStatus) -> None:
        assert self.controller.status is status, "the controller comes first"
        self.statuses.append(status)
        self._published.set()
        call, self.at_next_status = self.at_next_status, None
        if call is not None:
            call()

    def start(self) -> None:
        self.task = asyncio.create_task(self.run.run())

    async def polls(self, count: int = 1) -> None:
        """Wait until so many more statuses have come."""
        until = len(self.statuses) + count
        async with asyncio.timeout(patience(30)):
            while len(self.statuses) < until:
                self._published.clear()
                await self._published.wait()
            await asyncio.sleep(0.0001)  # the cycle of the last one goes on

    async def end(self, within: float = STOP_S + 0.1) -> None:
        """Wait for the end; it comes in time whatever happens."""
        async with asyncio.timeout(within):
            await asyncio.wait({self.task})
        assert self.machine.state is State.DO_SHUTDOWN
        assert self.wire.calls[-1] == "close"
        self.task.result()

    @property
    def loop(self) -> VirtualLoop:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        return loop


@asynccontextmanager
async def polled(
    policy: ReconnectPolicy | None = ReconnectPolicy(),  # noqa: B008  # it is frozen
    *,
    activate: bool = False,
    active: bool = True,
    poll_interval: float = POLL_S,
) -> AsyncIterator[Polled]:
    """A run that has had its first contact with a gripper, active or just switched on."""
    here = Polled(policy, activate=activate, poll_interval=poll_interval)
    if active:
        await here.wire.activate()
    here.start()
    await here.run.connected
    yield here
    here.run.request_stop(halt=True)
    await here.end()
