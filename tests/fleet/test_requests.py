"""Requests on their way to the agent: in their order, merged, repeated when lost."""

from __future__ import annotations

import asyncio
import random
from collections import Counter
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any, cast

import pytest

from robotiq_async import Finger, MoveSupersededError, RobotiqHand, State
from robotiq_async.fleet.agent.agent import Agent
from robotiq_async.fleet.errors import ControlLostError
from robotiq_async.fleet.network.bus import Bus, BusReply
from robotiq_async.fleet.remote.dialog import UNDER_WAY
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import AgentCall
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.request import Request
from tests.fleet.cell import ask
from tests.fleet.lab import LEFT, Lab, Spoiling, lab, serving
from tests.fleet.network import MemoryBus, Network
from tests.fleet.world import World, world
from tests.grippers import activate_beforehand
from tests.virtual import inside, virtual

A, B = Finger.A, Finger.B
PROMISE_S = 2.5
"""A window, and the time for the last word of the agent, with some to spare."""


# -- outbox ------------------------------------------------------------------------------------------------


class CountingBus(Spoiling):
    """A bus that counts the commands that run at a time."""

    under_way = most = 0

    def ask(self, key: str, payload: bytes, **how: Any) -> asyncio.Future[BusReply | None]:
        asking = super().ask(key, payload, **how)
        if key.endswith("cmd/command"):
            self.under_way += 1
            self.most = max(self.most, self.under_way)
            asking.add_done_callback(self._answered)
        return asking

    def _answered(self, _: object) -> None:
        self.under_way -= 1


@asynccontextmanager
async def slow_network(delay: float) -> AsyncIterator[tuple[Lab, CountingBus, RemoteHand]]:
    """A hand in control, and requests that take a while to the agent."""
    async with lab() as here:
        bus = CountingBus(here.network.bus("client"), times=0)
        async with here.client_over(bus) as hand:
            here.network.stream("client", "agent").delay = delay
            yield here, bus, hand
            await asyncio.sleep(2 * delay)
            here.network.stream("client", "agent").delay = 0.0


def image(here: Lab) -> Request:
    return Request.from_registers(here.gripper.request_registers)


@virtual
async def test_so_many_are_under_way_and_the_rest_is_merged() -> None:
    async with slow_network(0.1) as (here, bus, hand):
        for value in range(100):
            hand.command(position=value)
        hand.command(A, speed=255)
        hand.command(Finger.B, force=7)
        assert hand.is_moving
        await asyncio.sleep(0.5)
        assert bus.most == UNDER_WAY
        assert len(bus.commands) == UNDER_WAY + 1
        assert bus.commands[-1].arguments["axes"] == {
            "1": {"position": 99, "speed": 255},
            "2": {"position": 99, "force": 7},
            "4": {"position": 99},
        }
        assert [axis.position for axis in image(here).axes[:3]] == [99] * 3


@virtual
async def test_numbers_rise_in_the_order_of_the_calls() -> None:
    async with slow_network(0.02) as (here, bus, hand):
        hand.command(position=50)
        await hand.set_speed(3)
        hand.command(position=60)
        hand.command(position=70)
        await hand.set_position(20)
        await asyncio.sleep(0.1)
        assert [call.number for call in bus.commands] == sorted(call.number for call in bus.commands)
        assert image(here).position(A) == 20
        assert [axis.speed for axis in image(here).axes] == [3] * 4


@virtual
async def test_waiting_commands_are_sent_before_later_requests() -> None:
    async with slow_network(0.1) as (here, _, hand):
        for value in range(20):
            hand.command(position=value)
        await hand.set_force(9)
        assert image(here).position(A) == 19
        assert image(here).axes[0].force == 9


@virtual
@pytest.mark.parametrize("how", ["halt", "release", "take"])
async def test_waiting_commands_are_dropped_with_the_lease_or_a_halt(how: str) -> None:
    async with slow_network(0.1) as (here, bus, hand):
        for value in range(100, 120):
            hand.command(position=value)
        if how == "halt":
            await hand.halt()
        elif how == "release":
            await hand.release()
            await hand.acquire()
        else:
            async with here.client("other", control=False) as other:
                await other.take()
                await asyncio.sleep(0.05)
                await other.release()
            await asyncio.sleep(0.3)
            assert not hand.is_in_control
            await hand.acquire()
        await asyncio.sleep(1)
        assert len(bus.commands) == UNDER_WAY
        assert not image(here).go or image(here).position(A) < 119
        assert not here.gripper.is_moving


@virtual
async def test_a_command_that_is_refused_is_logged_and_the_next_one_goes(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async with slow_network(0.05) as (here, bus, hand):
        here.gripper.write(0, [0] * 8)  # reset, which is not known here yet
        hand.command(position=100)
        await hand.wait_for_state(State.RESET)
        await asyncio.sleep(0.2)
        assert "a command was not carried out" in caplog.text
        assert not hand.is_reset or not here.gripper.is_moving
        await hand.activate()
        hand.command(position=100)
        await asyncio.sleep(0.3)
        assert image(here).position(A) == 100
        assert sum("axes" in call.arguments for call in bus.commands) == 2


@inside(lab)
async def test_without_control_it_is_refused_at_once(here: Lab, reader: RemoteHand) -> None:
    with pytest.raises(ControlLostError, match="only reads"):
        reader.command(position=3)
    await asyncio.sleep(0.1)
    assert image(here).position(A) == 0


@inside(lab)
async def test_two_first_commands_at_once_share_one_lease(here: Lab) -> None:
    async with here.client(control=None) as hand:
        await asyncio.gather(hand.set_speed(3), hand.set_force(4), hand.move(30, A))
        assert here.lease == 1


@inside(lab)
async def test_asking_for_the_lease_again_holds_nothing(here: Lab, hand: RemoteHand) -> None:
    moving: asyncio.Task[Any] = asyncio.create_task(hand.move(60, A))
    await asyncio.sleep(0.05)
    await hand.acquire()
    await hand.take()
    assert abs((await moving).positions[A] - 60) <= 2
    assert here.lease == 1


@inside(lab, window=8.0)
async def test_more_missed_events_than_fit_into_one_message(here: Lab, hand: RemoteHand) -> None:
    transitions, requests = hand.transitions(), hand.requests()
    stream = here.network.stream("agent", "client")
    stream.is_cut = True
    for value in range(400):
        await here.local.set_speed(value % 256)
    here.network.mend(stream)
    await asyncio.sleep(2)
    assert len(list(transitions.drain())) >= 2 * 400
    assert [sent.request.axes[0].speed for sent in requests.drain()] == [value % 256 for value in range(400)]


@inside(lab)
async def test_a_halt_goes_on_after_an_empty_answer_and_in_a_silence(here: Lab, hand: RemoteHand) -> None:
    await hand.set_position(255)
    served = here.agent._bus
    assert isinstance(served, MemoryBus)
    queryables, served.queryables = served.queryables, []  # as just after a connection was made
    loop = asyncio.get_running_loop()
    loop.call_later(0.5, served.queryables.extend, queryables)
    began = loop.time()
    await hand.halt()
    assert 0.4 < loop.time() - began < 0.7
    assert not here.gripper.is_moving


@virtual
async def test_a_move_that_is_cancelled_on_its_way_moves_until_the_agent_has_called_it_off() -> None:
    async with slow_network(0.1) as (here, _, hand):
        moving = asyncio.create_task(hand.move(255, speed=0))
        await asyncio.sleep(0.01)
        moving.cancel()
        await asyncio.wait({moving})
        assert hand.is_moving, "it is about to"
        async for _status in hand.statuses():
            if not hand.is_moving:
                break
        await asyncio.sleep(0.05)
        travel = here.gripper.travel(A)
        await asyncio.sleep(0.5)
        assert here.gripper.travel(A) == travel


# -- repetitions -------------------------------------------------------------------------------------------


def first_copy_of(*numbers: int) -> Callable[[AgentCall], bool]:
    """Drop the first copy of some of the commands: the first command is 0."""
    seen: list[int] = []

    def drops(call: AgentCall) -> bool:
        if call.number in seen:
            return False
        seen.append(call.number)
        return len(seen) - 1 in numbers

    return drops


@pytest.mark.parametrize("seed", range(5))
@inside(lab)
async def test_a_burst_of_moves_of_which_many_are_lost(here: Lab, seed: int) -> None:
    """19 of 48 never arrived, and their calls were open after 66 s."""
    lost = random.Random(seed).sample(range(48), 19)
    bus = Spoiling(here.network.bus("client"), spoils=first_copy_of(*lost))
    async with here.client_over(bus) as hand:
        loop = asyncio.get_running_loop()
        begun, moves = loop.time(), [asyncio.create_task(hand.move(100 + n, A)) for n in range(48)]
        await asyncio.wait(moves)
        assert loop.time() - begun < PROMISE_S
        assert [type(move.exception()) for move in moves[:-1]] == [MoveSupersededError] * 47
        assert moves[-1].result().positions[A] == pytest.approx(147, abs=2)
        assert len({call.number for call in bus.commands}) == 48


@inside(lab)
async def test_a_later_command_does_not_replace_a_lost_one(here: Lab) -> None:
    """It was refused as overtaken, or never heard of again."""
    bus = Spoiling(here.network.bus("client"), spoils=first_copy_of(0, 2))
    async with here.client_over(bus) as hand:
        hand.command(A, position=60)
        hand.command(B, position=70)
        hand.command(A, speed=7)
        await hand.set_force(9)
        await asyncio.sleep(1)
        axes = image(here).axes
        assert [axis.position for axis in axes[:2]] == [60, 70]
        assert [axis.force for axis in axes] == [9] * 4
        assert axes[0].speed == 7


@inside(lab)
async def test_a_lost_answer_is_given_again_and_nothing_is_done_twice(here: Lab) -> None:
    bus = Spoiling(here.network.bus("client"), spoils=first_copy_of(0, 1), sends=True)
    async with here.client_over(bus) as hand:
        assert (await hand.move(80, A)).positions[A] == pytest.approx(80, abs=2)
        await hand.set_speed(50)
        images = [Request.from_registers(write.registers).axes[0] for write in here.gripper.writes]
        assert sum(image.position == 80 and image.speed != 50 for image in images) == 1


@pytest.mark.parametrize("what", ["move", "set_position", "hold", "activate"])
@inside(lab)
async def test_no_call_is_open_for_longer_than_it_says(here: Lab, what: str) -> None:
    """Nothing gets through, and statuses come on: a move waited for 100 s."""
    bus = Spoiling(here.network.bus("client"))
    async with here.client_over(bus) as hand:
        loop = asyncio.get_running_loop()
        begun = loop.time()
        here.network.cut(("client", "agent"))
        here.network.keeps_links = True
        with pytest.raises(ControlLostError):
            await getattr(hand, what)(*[60] * (what in ("move", "set_position")))
        assert loop.time() - begun < PROMISE_S
        here.network.mend(here.network.stream("client", "agent"))


@inside(world)
async def test_a_request_waits_for_the_one_that_was_asked_before_it(here: World) -> None:
    client = here.other
    await client.do(client.hand.take())
    session = client.hand._remote.session
    assert session is not None
    made = session.dialog.call({"position": 50, "fingers": 1})

    def call(number: int, after: int) -> AgentCall:
        return AgentCall(
            LEFT.base, made.client, made.epoch, made.lease, number, made.seen, {"fingers": 1}, after
        )

    early = await ask(client, "cmd/hold", call(1001, 1000))
    assert isinstance(early, ControlLostError)
    assert str(early) == "request 1000 has not come yet; it may have been carried out"
    assert early.reason == "early"
    assert await ask(client, "cmd/hold", call(1000, 0)) is None
    assert await ask(client, "cmd/hold", call(1001, 1000)) is None
    assert "overtook" in str(await ask(client, "cmd/hold", call(999, 0)))


@virtual
async def test_sixteen_hands_at_once_again_and_again() -> None:
    """A fifth of all requests is lost on the way."""
    network, chance = Network(), random.Random(7)
    names = [f"hand-{number}" for number in range(16)]
    loop = asyncio.get_running_loop()
    async with AsyncExitStack() as stack:
        hands = {}
        for name in names:
            gripper = SimulatedGripper(loop.time, spread=False)
            server = await stack.enter_async_context(SimulatorServer(gripper))
            await activate_beforehand(gripper)
            hands[name] = RobotiqHand(f"tcp://127.0.0.1:{server.port}", poll_interval=0.1)
        await stack.enter_async_context(serving(Agent("lab", "cell", hands, network.bus("agent"))))
        bus = Spoiling(network.bus("client"), spoils=lambda _: chance.random() < 0.2)
        clients = [RemoteHand(f"zenoh://lab/cell/{name}", bus=cast("Bus", bus)) for name in names]
        await asyncio.gather(*(hand.start() for hand in clients))
        ended: Counter[str] = Counter()
        for number in range(10):
            begun = loop.time()
            settings = (hand.set_speed(number) for hand in clients)
            outcomes = await asyncio.gather(*settings, return_exceptions=True)
            assert loop.time() - begun < PROMISE_S
            ended.update(type(each).__name__ for each in outcomes)
        assert ended["NoneType"] / ended.total() > 0.97, ended
        assert set(ended) <= {"NoneType", "ControlLostError"}, "the error says that nothing was done"
        await asyncio.gather(*(hand.stop() for hand in clients))


# -- remote hand -------------------------------------------------------------------------------------------


@inside(lab)
async def test_a_move_comes_after_the_commands_before_it(here: Lab, hand: RemoteHand) -> None:
    """It was superseded by a command that had waited for its turn."""
    for position in range(60, 100):
        hand.command(Finger.A, position=position)
    result = await hand.move(20, Finger.A)
    assert abs(result.positions[Finger.A] - 20) <= 2


@inside(lab)
async def test_a_hand_that_was_stopped_leaves_the_lease_to_others(here: Lab) -> None:
    """While it waited for the agent to acknowledge the end, it acquired the lease again."""
    here.network.stream("agent", "client").delay = 0.3
    async with here.client():
        pass
    await asyncio.sleep(0.2)
    async with here.client("other") as hand:
        assert hand.is_in_control
