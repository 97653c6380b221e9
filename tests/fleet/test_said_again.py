"""Requests, and answers, that get lost on the way: all are carried out once and in their order, or say why.

On a busy machine zenoh drops what finds no room at the sender, and nobody is told.
"""

from __future__ import annotations

import asyncio
import random
from collections import Counter
from collections.abc import Callable
from contextlib import AsyncExitStack
from typing import Any, cast

import pytest

from robotiq_async import Finger, MoveSupersededError, RobotiqHand
from robotiq_async.fleet.agent.agent import Agent
from robotiq_async.fleet.network.bus import Bus, Reply, Urgency
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import Call, unpack_call
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.errors import AgentError, ControlLostError
from robotiq_async.values.request import Request
from tests.fleet.by_hand import LEFT, ask
from tests.fleet.lab import lab
from tests.fleet.network import MemoryBus, Network
from tests.fleet.world import world
from tests.grippers import activate_beforehand
from tests.virtual import virtual

A, B = Finger.A, Finger.B
PROMISE_S = 2.5
"""A window, and the time for the last word of the agent, with some to spare."""


class Losing:
    """A bus that drops requests, or their answers, and tells nobody.

    Attributes:
        said: the commands that were sent or lost, in order.
    """

    def __init__(self, bus: MemoryBus, drops: Callable[[Call], bool], *, answers: bool = False) -> None:
        self._bus, self._drops, self._answers = bus, drops, answers
        self.said: list[Call] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bus, name)

    def ask(
        self, key: str, payload: bytes, *, timeout: float, urgency: Urgency, **how: Any
    ) -> asyncio.Future[Reply | None]:
        call = unpack_call(payload)
        is_dropped = "/cmd/" in key and self._drops(call)
        if "/cmd/" in key:
            self.said.append(call)
        if not is_dropped:
            return self._bus.ask(key, payload, timeout=timeout, urgency=urgency, **how)
        if self._answers:
            self._bus.ask(key, payload, timeout=timeout, urgency=urgency, **how)
        return asyncio.ensure_future(nothing(timeout))


async def nothing(timeout: float) -> None:
    await asyncio.sleep(timeout)


def first_copy_of(*numbers: int) -> Callable[[Call], bool]:
    """Drop the first copy of some of the commands: the first command is 0."""
    seen: list[int] = []

    def drops(call: Call) -> bool:
        if call.number in seen:
            return False
        seen.append(call.number)
        return len(seen) - 1 in numbers

    return drops


@pytest.mark.parametrize("seed", range(5))
@virtual
async def test_a_burst_of_moves_of_which_many_are_lost(seed: int) -> None:
    """19 of 48 never arrived, and their calls were open after 66 s."""
    lost = random.Random(seed).sample(range(48), 19)
    async with lab() as here:
        bus = Losing(here.network.bus("client"), first_copy_of(*lost))
        async with RemoteHand("zenoh://lab/cell/left", bus=cast("Bus", bus)) as hand:
            loop = asyncio.get_running_loop()
            begun, moves = loop.time(), [asyncio.create_task(hand.move(100 + n, A)) for n in range(48)]
            await asyncio.wait(moves)
            assert loop.time() - begun < PROMISE_S
            assert [type(move.exception()) for move in moves[:-1]] == [MoveSupersededError] * 47
            assert moves[-1].result().positions[A] == pytest.approx(147, abs=2)
            assert len({call.number for call in bus.said}) == 48


@virtual
async def test_what_comes_later_does_not_take_the_place_of_what_was_lost() -> None:
    """It was refused as overtaken, or never heard of again."""
    async with lab() as here:
        bus = Losing(here.network.bus("client"), first_copy_of(0, 2))
        async with RemoteHand("zenoh://lab/cell/left", bus=cast("Bus", bus)) as hand:
            hand.command(A, position=60)
            hand.command(B, position=70)
            hand.command(A, speed=7)
            await hand.set_force(9)
            await asyncio.sleep(1)
            axes = Request.from_registers(here.gripper.request_registers).axes
            assert [axis.position for axis in axes[:2]] == [60, 70]
            assert [axis.force for axis in axes] == [9] * 4
            assert axes[0].speed == 7


@virtual
async def test_a_lost_answer_is_given_again_and_nothing_is_done_twice() -> None:
    async with lab() as here:
        bus = Losing(here.network.bus("client"), first_copy_of(0, 1), answers=True)
        async with RemoteHand("zenoh://lab/cell/left", bus=cast("Bus", bus)) as hand:
            assert (await hand.move(80, A)).positions[A] == pytest.approx(80, abs=2)
            await hand.set_speed(50)
            images = [Request.from_registers(write.registers).axes[0] for write in here.gripper.writes]
            assert sum(image.position == 80 and image.speed != 50 for image in images) == 1


@pytest.mark.parametrize("what", ["move", "set_position", "hold", "activate"])
@virtual
async def test_no_call_is_open_for_longer_than_it_says(what: str) -> None:
    """Nothing gets through, and statuses come on: a move waited for 100 s."""
    async with lab() as here:
        bus = Losing(here.network.bus("client"), lambda _: True)
        async with RemoteHand("zenoh://lab/cell/left", bus=cast("Bus", bus)) as hand:
            loop = asyncio.get_running_loop()
            begun = loop.time()
            here.network.cut(("client", "agent"))
            here.network.keeps_links = True
            with pytest.raises(ControlLostError):
                await getattr(hand, what)(*[60] * (what in ("move", "set_position")))
            assert loop.time() - begun < PROMISE_S
            here.network.mend(here.network.stream("client", "agent"))


@virtual
async def test_a_request_waits_for_the_one_that_was_asked_before_it() -> None:
    async with world() as here:
        client = here.other
        await client.do(client.hand.take())
        session = client.hand._session
        assert session is not None
        made = session.call({"position": 50, "fingers": 1})

        def call(number: int, after: int) -> Call:
            return Call(
                LEFT.base, made.client, made.epoch, made.lease, number, made.seen, {"fingers": 1}, after
            )

        with pytest.raises(
            ControlLostError, match="request 1000 has not come yet; nothing was done"
        ) as refused:
            await raising(client, call(1001, 1000))
        assert refused.value.reason == "early"
        await raising(client, call(1000, 0))
        await raising(client, call(1001, 1000))
        with pytest.raises(AgentError, match="overtook"):
            await raising(client, call(999, 0))


async def raising(client: Any, call: Call) -> None:
    refused = await ask(client, "cmd/hold", call)
    if refused is not None:
        raise refused


@virtual
async def test_sixty_four_hands_at_once_again_and_again() -> None:
    """With a fifth of all requests lost on the way; a hundred times, over zenoh, in tests/fleet/burst.py."""
    network, chance = Network(), random.Random(7)
    names = [f"hand-{number}" for number in range(64)]
    loop = asyncio.get_running_loop()
    async with AsyncExitStack() as stack:
        hands = {}
        for name in names:
            gripper = SimulatedGripper(loop.time, spread=False)
            server = await stack.enter_async_context(SimulatorServer(gripper))
            await activate_beforehand(gripper)
            hands[name] = RobotiqHand(f"tcp://127.0.0.1:{server.port}", poll_interval=0.1)
        agent, ready = Agent("lab", "cell", hands, network.bus("agent")), asyncio.Event()
        serving = asyncio.create_task(agent.run(ready.set))
        await ready.wait()
        bus = Losing(network.bus("client"), lambda _: chance.random() < 0.2)
        clients = [RemoteHand(f"zenoh://lab/cell/{name}", bus=cast("Bus", bus)) for name in names]
        await asyncio.gather(*(hand.start() for hand in clients))
        ended: Counter[str] = Counter()
        longest = 0.0
        for number in range(10):
            begun = loop.time()
            outcomes = await asyncio.gather(
                *(hand.set_speed(number) for hand in clients), return_exceptions=True
            )
            longest = max(longest, loop.time() - begun)
            ended.update(type(each).__name__ for each in outcomes)
        assert ended["NoneType"] / ended.total() > 0.99, ended
        assert set(ended) <= {"NoneType", "ControlLostError"}, "told that nothing was done"
        assert longest < PROMISE_S
        await asyncio.gather(*(hand.stop() for hand in clients))
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
