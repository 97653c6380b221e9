"""A gripper, its agent and a client on another host, in one virtual loop; buses that spoil requests."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from typing import Any

from robotiq_async import RobotiqHand
from robotiq_async.fleet.agent.agent import Agent
from robotiq_async.fleet.network.bus import Reply, Urgency
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire import status_message
from robotiq_async.fleet.wire.envelope import unpack_answer
from robotiq_async.fleet.wire.values import error_fields
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.model import THREE_FINGER, Model
from tests.fleet.network import MemoryBus, Network
from tests.grippers import activate_beforehand

SPEEDUP = 5.0
__all__ = ["Lab", "MemoryBus", "lab"]


@dataclass
class Lab:
    """All there is in one test.

    Attributes:
        gripper: is active.
        local: the agent's hand.
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

    def client_over(self, bus: Any, **options: Any) -> RemoteHand:
        """The same, over a bus of the test's own."""
        return RemoteHand("zenoh://lab/cell/left", bus=bus, **options)

    @property
    def lease(self) -> int:
        """The number of the lease, as every status of the agent tells it."""
        return status_message.unpack(self.agent.hands["left"].publisher.status_message()).lease

    async def end_agent(self) -> None:
        self.serving.cancel()
        await asyncio.gather(self.serving, return_exceptions=True)


@asynccontextmanager
async def lab(
    *,
    window: float = 1.0,
    active: bool = True,
    kind: type[SimulatedGripper] = SimulatedGripper,
    keep_grip: bool = False,
    model: Model = THREE_FINGER,
) -> AsyncIterator[Lab]:
    """An agent that serves zenoh://lab/cell/left, and a network named by the buses "agent" and "client"."""
    loop = asyncio.get_running_loop()
    network = Network()
    gripper = kind(loop.time, speedup=SPEEDUP, device_cycle=0.005 * SPEEDUP, spread=False, model=model)
    async with SimulatorServer(gripper) as server:
        if active:
            await activate_beforehand(gripper)
        hand = RobotiqHand(server.address, keep_grip=keep_grip, model=model)
        agent = Agent("lab", "cell", {"left": hand}, network.bus("agent"), window=window)
        ready = asyncio.Event()
        serving = asyncio.create_task(agent.run(ready.set))
        try:
            await ready.wait()
            yield Lab(network, gripper, server, hand, agent, serving)
        finally:
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)


# -- buses that spoil requests -----------------------------------------------------------------------------


class Between:
    """Stands before a bus, and does with requests what its kind says."""

    def __init__(self, bus: MemoryBus) -> None:
        self._bus = bus

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bus, name)


class Spoiling(Between):
    """A bus whose answers to one kind of request are spoiled: lost once, or another's."""

    def __init__(
        self,
        bus: MemoryBus,
        verb: str,
        *,
        times: int = 1_000_000,
        answer: bytes | None = None,
        is_sent: bool = True,
    ) -> None:
        super().__init__(bus)
        self._verb, self._answer, self.left = verb, answer, times
        self._is_sent = is_sent

    def ask(
        self, key: str, payload: bytes, *, timeout: float, urgency: Urgency, **how: Any
    ) -> asyncio.Future[Reply | None]:
        if not key.endswith(self._verb) or not self.left:
            return self._bus.ask(key, payload, timeout=timeout, urgency=urgency, **how)
        self.left -= 1
        if self._answer is None:  # never sent
            return asyncio.ensure_future(nothing(timeout))
        return asyncio.ensure_future(self._another(key, payload, timeout, urgency))

    async def _another(self, key: str, payload: bytes, timeout: float, urgency: Urgency) -> Reply | None:
        if self._is_sent:
            asking = self._bus.ask(key, payload, timeout=timeout, urgency=urgency)
            await asyncio.sleep(0.1)
            asking.cancel()
        assert self._answer is not None
        return _Answered(self._answer)


class Garbling(Between):
    """A bus whose answers to one kind of request are others: by default, that it is not understood."""

    def __init__(self, bus: MemoryBus, **others: Any) -> None:
        super().__init__(bus)
        self._others = others or {"value": None, "error": error_fields(TypeError("what?"))}
        self.verb = "nothing yet"

    def ask(self, key: str, payload: bytes, **how: Any) -> asyncio.Future[Reply | None]:
        asking = self._bus.ask(key, payload, **how)
        return asyncio.ensure_future(self._garbled(asking)) if key.endswith(self.verb) else asking

    async def _garbled(self, asking: asyncio.Future[Reply | None]) -> Reply | None:
        reply = await asking
        if reply is None:
            return None
        return _Answered(replace(unpack_answer(reply.payload), **self._others).pack())


class _Answered:
    attachment = b""

    def __init__(self, payload: bytes) -> None:
        self.payload = payload


async def nothing(timeout: float) -> None:
    await asyncio.sleep(timeout)
