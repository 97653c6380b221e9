"""Two grippers, their agent and its clients, each on a host of its own, and an eye on what is promised."""

from __future__ import annotations

import asyncio
import json
from bisect import bisect_right
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from operator import itemgetter
from typing import Any, TypeVar

from robotiq_async import Finger, RobotiqError, RobotiqHand, RobotiqStatus, State
from robotiq_async.fleet.agent.agent import Agent
from robotiq_async.fleet.agent.records import Records
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.names import GripperName
from robotiq_async.simulator import SimulatorServer
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import Request
from tests.adversity.world import StampedGripper, stamp_of
from tests.fleet.hosts import Host
from tests.fleet.network import LINK_LEASE_S, RECONNECT_S, MemoryBus, Network
from tests.grippers import activate_beforehand

T = TypeVar("T")
WINDOW_S = 1.0
PROMPT_S = 0.2
"""Allowed beside the window."""
LOOK_S = 0.05
POLL_S = 0.05
"""As seldom as the stories allow: the polls are most of what they cost."""
IDLE_POLL_S = 0.1
"""Of the gripper beside it, that does nothing; the longest that there is."""
NAMES = ("left", "right")


class World:
    """All there is in one test: the holder's troubles are its own, and those of the agent concern all.

    Attributes:
        holder: commands left.
        other: on a host of its own; reads left.
        neighbour: commands right, and does nothing.
    """

    def __init__(self) -> None:
        loop = asyncio.get_running_loop()
        self.network = Network()
        self.grippers = {
            name: StampedGripper(loop.time, speedup=1.0, device_cycle=0.005, spread=False) for name in NAMES
        }
        self.servers: dict[str, SimulatorServer] = {}
        self.records = MemoryRecords()
        self.agents: list[ServingAgent] = []
        self.holder = Client(self, "holder", "left")
        self.other = Client(self, "other", "left", IDLE_POLL_S)
        self.neighbour = Client(self, "neighbour", "right", IDLE_POLL_S)

    @property
    def gripper(self) -> StampedGripper:
        return self.grippers["left"]

    @property
    def agent(self) -> ServingAgent:
        return self.agents[-1]

    @property
    def clients(self) -> tuple[Client, ...]:
        return (self.holder, self.other, self.neighbour)

    def now(self) -> float:
        return asyncio.get_running_loop().time()

    async def until(self, condition: Callable[[], bool], limit: float = 30.0) -> None:
        async with asyncio.timeout(limit):
            while not condition():  # noqa: ASYNC110  # there is no event to wait for
                await asyncio.sleep(LOOK_S)

    async def start_agent(self, name: str, **options: Any) -> ServingAgent:
        agent = ServingAgent(self, name, options)
        self.agents.append(agent)
        await agent.start()
        return agent

    def cut(self, client: Client, *, out: bool = True, back: bool = True) -> None:
        """Take away what goes to the agent, what comes from it, or both."""
        here, there = client.host.name, self.agent.host.name
        self.network.cut(*[(here, there)] * out, *[(there, here)] * back)

    def mend(self, client: Client) -> None:
        self.network.mend(*self.network.both(client.host.name, self.agent.host.name))

    def freeze(self, host: Host) -> None:
        """SIGSTOP: the links of the host are closed when its peers have not heard it for long enough."""
        host.freeze()
        self.network.loop.call_later(LINK_LEASE_S, self._part_if_frozen, host)

    def thaw(self, host: Host) -> None:
        host.thaw()
        for bus in self.network.buses:
            self.network.loop.call_later(RECONNECT_S, self.network.join, host.name, bus.name)

    def kill(self, host: Host) -> None:
        """SIGKILL: its connections are reset at once."""
        host.kill()
        self._part_if_frozen(host)
        for bus in self.network.buses:
            if bus.name == host.name:
                bus.is_closed = True
                bus.tokens.clear()

    def _part_if_frozen(self, host: Host) -> None:
        if host.is_frozen:
            for bus in self.network.buses:
                if bus.name != host.name:
                    self.network.part(host.name, bus.name)

    def moved(self, axis: Finger, name: str = "left") -> float:
        """Counts that an axis has moved since :meth:`settle`."""
        return self.grippers[name].travel(axis) - self._before[name][axis]

    async def settle(self) -> None:
        """Note where everything is before the trouble begins."""
        self._before = {
            name: {axis: gripper.travel(axis) for axis in THREE_FINGER.axes}
            for name, gripper in self.grippers.items()
        }

    def check(self) -> None:
        """Check the promises that hold whatever happens."""
        assert not any(self.moved(axis, "right") for axis in THREE_FINGER.axes), "the wrong gripper moved"


class MemoryRecords(Records):
    """The records that agents of one world leave each other, as in their folder; it may be taken away."""

    def __init__(self) -> None:
        super().__init__()
        self.records: dict[GripperName, dict[str, Any]] = {}

    def read(self, name: GripperName) -> dict[str, Any] | None:
        return self.records.get(name)

    def read_inhibit(self, name: GripperName) -> object:
        return self.records.get(name, {}).get("inhibited")

    def keep(self, name: GripperName, record: dict[str, Any]) -> None:
        self.records[name] = json.loads(json.dumps(record))

    async def kept(self) -> None:
        pass


class ServingAgent:
    """An agent on a host, in its own run."""

    def __init__(self, world: World, name: str, options: dict[str, Any]) -> None:
        self.world = world
        self.options = options
        self.host = Host(name)
        self.bus = world.network.bus(name, self.host)
        self.hands: dict[str, RobotiqHand] = {}
        self.agent: Agent | None = None
        self.serving: asyncio.Task[None] | None = None

    async def start(self) -> None:
        ready = asyncio.Event()
        # Each on a host of its own: two hands of one process may not use the same address.
        place = len(self.world.agents)

        async def serve() -> None:
            self.hands = {
                name: RobotiqHand(f"tcp://127.0.0.{place}:{server.port}", poll_interval=interval)
                for (name, server), interval in zip(
                    self.world.servers.items(), (POLL_S, IDLE_POLL_S), strict=True
                )
            }
            options = {"window": WINDOW_S, "records": self.world.records, **self.options}
            self.agent = Agent("lab", "cell", self.hands, self.bus, **options)
            try:
                await self.agent.run(lambda: self.world.network.loop.call_soon(ready.set))
            finally:
                await self.bus.close()

        self.serving = self.host.create_task(serve())
        async with asyncio.timeout(5):
            await ready.wait()

    async def end(self) -> None:
        """SIGTERM."""
        assert self.serving is not None
        self.serving.cancel()
        await self.world.until(self.serving.done)


class Client:
    """A client on a host, and what it could see."""

    def __init__(self, world: World, name: str, gripper: str, looks: float = LOOK_S) -> None:
        self.world = world
        self.looks = looks
        self.gripper = gripper
        self.host = Host(name)
        self.bus: MemoryBus = world.network.bus(name, self.host)
        self.hand: RemoteHand
        self.states: list[State] = []
        self.statuses: list[RobotiqStatus] = []
        self.had_control: list[bool] = []
        self._looking: asyncio.Handle | None = None
        """The next look; what one of them finds is a complaint of the loop."""

    async def start(self, **options: Any) -> None:
        async def begin() -> None:
            self.hand = RemoteHand(f"zenoh://lab/cell/{self.gripper}", bus=self.bus, **options)
            await self.hand.start()
            self.hand_statuses = self.hand.statuses(100_000)

        await self.do(begin())
        self._looking = self.host.call_soon(self._look)

    async def do(self, work: Coroutine[Any, Any, T]) -> T:
        return await self.host.do(work)

    async def command(self, axes: Finger, **changes: int) -> None:
        async def ask() -> None:
            self.hand.command(axes, **changes)

        await self.do(ask())

    async def stop(self) -> None:
        if not self.host.is_dead:
            assert self._looking is not None
            self._looking.cancel()
            with suppress(RobotiqError):
                await self.do(self.hand.stop())
            self.statuses = await self.do(_all_of(self.hand_statuses))

    def _look(self) -> None:
        """Look at the hand as a program would, and compare the observation with the truth."""
        if self.host.is_dead:
            return
        # A turn after its time, as whatever waits: after a freeze everything is due at once.
        self._looking = self.host.call_later(self.looks, self.host.call_soon, self._look)
        state = self.hand.state
        if not self.states or self.states[-1] is not state:
            self.states.append(state)
        if not self.had_control or self.had_control[-1] is not self.hand.is_in_control:
            self.had_control.append(self.hand.is_in_control)
        if state is not State.DISCONNECTED and not self.host.slept:  # else its clock is another
            self._check_current(self.hand.status)

    def _check_current(self, status: RobotiqStatus) -> None:
        """A status given without a warning is no older than the window and one look for silence."""
        # One that is marked as old may be: then the agent has not read a newer one.
        said, age = self.world.now() - status.timestamp, self.world.now() - self.given_at(status)
        assert age <= max(said, WINDOW_S * 1.2) + PROMPT_S, f"stale: {age:.2f} s, said {said:.2f} s"

    def given_at(self, status: RobotiqStatus) -> float:
        """The time when the gripper gave out this status, by the number in it: the last before now."""
        stamps, number = self.world.grippers[self.gripper].stamps, stamp_of(status)
        # 256 numbers at 200 Hz are 1.3 s: start from when the client thinks it was.
        index = bisect_right(stamps, status.timestamp + 0.1, key=itemgetter(0))
        for at, each in (stamps[before] for before in range(index - 1, -1, -1)):
            if each == number:
                return at
        raise AssertionError("a status that this gripper never gave out")


async def _all_of(stream: Any) -> list[RobotiqStatus]:
    return [status async for status in stream]


@asynccontextmanager
async def world(**options: Any) -> AsyncIterator[World]:
    """Everything is up: left is active and open, and the holder commands it. Options are the agent's."""
    here = World()
    async with AsyncExitStack() as stack:
        for name, gripper in here.grippers.items():
            here.servers[name] = await stack.enter_async_context(SimulatorServer(gripper))
            await activate_beforehand(gripper)
            await asyncio.sleep(20)
        await here.start_agent("agent", **options)
        await here.holder.start()
        await here.other.start(control=False)
        await here.neighbour.start()
        await here.settle()
        try:
            yield here
            here.check()
        finally:
            for client in here.clients:
                await client.stop()
            for agent in here.agents:
                if not agent.host.is_dead:
                    await agent.end()
            for host in [*(each.host for each in here.clients), *(each.host for each in here.agents)]:
                await host.bury()


def motions(world: World, since: int) -> list[tuple[float, tuple[int, int]]]:
    """Time, position and speed for finger A in each write that set axes going."""
    found: list[tuple[float, tuple[int, int]]] = []
    for write in world.gripper.writes[since:]:
        image = Request.from_registers(write.registers)
        if image.go:
            found.append((write.time, (image.axes[0].position, image.axes[0].speed)))
    return found
