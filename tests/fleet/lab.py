"""A gripper, its agent and a client on another host, in one virtual loop; buses that spoil requests."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from typing import Any

from robotiq_async import Finger, RobotiqHand
from robotiq_async.fleet.agent.agent import Agent
from robotiq_async.fleet.agent.records import Records
from robotiq_async.fleet.network.bus import BusReply, Urgency
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire import status_message
from robotiq_async.fleet.wire.envelope import AgentAnswer, AgentCall, unpack_answer, unpack_call
from robotiq_async.fleet.wire.names import GripperName
from robotiq_async.fleet.wire.values import error_fields
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.model import THREE_FINGER, Model
from robotiq_async.values.stroke import Points
from tests.fleet.network import MemoryBus, Network
from tests.grippers import activate_beforehand
from tests.virtual import until

SPEEDUP = 5.0
POLL_S = 0.02
"""Of the agent's hand: its polls are most of what a test costs, and few stories need more of them."""
LEFT = GripperName("lab", "cell", "left")


@dataclass
class Lab:
    """All there is in one test.

    Attributes:
        gripper: is active.
        local: the agent's hand.
        serving: the run of the agent.
    """

    network: Network
    gripper: SimulatedGripper
    server: SimulatorServer
    local: RobotiqHand
    agent: Agent
    serving: asyncio.Task[None]

    def client(self, name: str = "client", **options: Any) -> RemoteHand:
        """A remote hand that is not started."""
        return RemoteHand("zenoh://lab/cell/left", bus=self.network.bus(name), **options)

    def hand(self) -> RemoteHand:
        return self.client()

    def reader(self) -> RemoteHand:
        """One that only reads."""
        return self.client("reader", control=False)

    def client_over(self, bus: Any, **options: Any) -> RemoteHand:
        """The same, over a bus of the test's own."""
        return RemoteHand("zenoh://lab/cell/left", bus=bus, **options)

    async def moving(self, hand: RemoteHand) -> asyncio.Task[Any]:
        """Begin a slow move of finger A; how it ends may go unread."""
        moving = asyncio.create_task(hand.move(255, Finger.A, speed=0))
        moving.add_done_callback(lambda task: task.cancelled() or task.exception())
        await until(lambda: self.gripper.is_moving)
        return moving

    @property
    def lease(self) -> int:
        """The number of the lease, as in every status of the agent."""
        return status_message.unpack(self.agent.hands["left"].publisher.status_message()).lease

    async def answer(self, verb: str, request: bytes) -> AgentAnswer:
        """The agent's answer to a stranger's request."""
        bus = self.network.bus("stranger")
        reply = await bus.ask(LEFT.key(verb), request, timeout=1.0, urgency=Urgency.COMMAND)
        assert reply is not None
        return unpack_answer(reply.payload)

    async def end_agent(self) -> None:
        self.serving.cancel()
        await asyncio.gather(self.serving, return_exceptions=True)


@asynccontextmanager
async def serving(agent: Agent) -> AsyncIterator[asyncio.Task[None]]:
    """Run an agent that answers requests during a block."""
    ready = asyncio.Event()
    task = asyncio.create_task(agent.run(ready.set))
    try:
        await ready.wait()
        yield task
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


@asynccontextmanager
async def lab(
    network: Network | None = None,
    name: str = "agent",
    *,
    window: float = 1.0,
    active: bool = True,
    kind: type[SimulatedGripper] = SimulatedGripper,
    keep_grip: bool = False,
    model: Model = THREE_FINGER,
    stroke: Points | None = None,
    kind_of_server: type[SimulatorServer] = SimulatorServer,
    poll_interval: float = POLL_S,
    records: Records | None = None,
) -> AsyncIterator[Lab]:
    """An agent that serves zenoh://lab/cell/left, under a name in a network, by default one of its own."""
    network = network or Network()
    clock = asyncio.get_running_loop().time
    gripper = kind(clock, speedup=SPEEDUP, device_cycle=0.005 * SPEEDUP, spread=False, model=model)
    async with kind_of_server(gripper) as server:
        if active:
            await activate_beforehand(gripper)
        hand = RobotiqHand(
            server.address, keep_grip=keep_grip, model=model, stroke=stroke, poll_interval=poll_interval
        )
        agent = Agent("lab", "cell", {"left": hand}, network.bus(name), window=window, records=records)
        async with serving(agent) as task:
            yield Lab(network, gripper, server, hand, agent, task)


# -- buses that spoil requests -----------------------------------------------------------------------------


class Between:
    """Stands before a bus, and treats requests by its kind."""

    def __init__(self, bus: MemoryBus) -> None:
        self._bus = bus

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bus, name)


class Spoiling(Between):
    """A bus that loses requests or their answers, or answers in another's place.

    Attributes:
        left: how many requests are still to be spoiled.
        commands: the commands that were sent, spoiled or not.
    """

    def __init__(
        self,
        bus: MemoryBus,
        verb: str = "/cmd/",
        *,
        spoils: Callable[[AgentCall], bool] = lambda _: True,
        times: int = 1_000_000,
        answer: bytes | None = None,
        sends: bool = False,
    ) -> None:
        super().__init__(bus)
        self.left = times
        self.commands: list[AgentCall] = []
        self._verb, self._spoils, self._answer, self._sends = verb, spoils, answer, sends

    def ask(self, key: str, payload: bytes, *, timeout: float, **how: Any) -> asyncio.Future[BusReply | None]:
        call = unpack_call(payload)
        if "/cmd/" in key:
            self.commands.append(call)
        is_spoiled = self._verb in key and self.left > 0 and self._spoils(call)
        self.left -= is_spoiled
        if not is_spoiled:
            return self._bus.ask(key, payload, timeout=timeout, **how)
        if self._sends:
            self._bus.ask(key, payload, timeout=timeout, **how)
        return asyncio.ensure_future(self._spoiled(timeout))

    async def _spoiled(self, timeout: float) -> BusReply | None:
        if self._answer is None:
            await asyncio.sleep(timeout)
            return None
        await asyncio.sleep(0.1 * self._sends)
        return BusReply(self._answer)


class Garbling(Between):
    """A bus whose answers to one kind of request are others: by default, that it is not understood."""

    def __init__(self, bus: MemoryBus, **others: Any) -> None:
        super().__init__(bus)
        self._others = others or {"value": None, "error": error_fields(TypeError("what?"))}
        self.verb = "nothing yet"

    def ask(self, key: str, payload: bytes, **how: Any) -> asyncio.Future[BusReply | None]:
        asking = self._bus.ask(key, payload, **how)
        return asyncio.ensure_future(self._garbled(asking)) if key.endswith(self.verb) else asking

    async def _garbled(self, asking: asyncio.Future[BusReply | None]) -> BusReply | None:
        reply = await asking
        if reply is None:
            return None
        return BusReply(replace(unpack_answer(reply.payload), **self._others).pack())
