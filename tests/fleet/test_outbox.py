"""What a control loop asks for, on its way to the agent; and what else is asked in between."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any, cast

import pytest

from robotiq_async import Finger, State
from robotiq_async.fleet.network.bus import Bus, Reply, Urgency
from robotiq_async.fleet.remote.outbox import UNDER_WAY
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import Call, unpack_call
from robotiq_async.values.errors import ControlLostError
from robotiq_async.values.request import Request
from tests.fleet.lab import Lab, lab
from tests.fleet.network import MemoryBus
from tests.virtual import virtual

A = Finger.A


class CountingBus:
    """A bus that notes what is asked, and how much at a time."""

    def __init__(self, bus: MemoryBus) -> None:
        self._bus = bus
        self.commands: list[Call] = []
        self.under_way = 0
        self.most = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bus, name)

    def ask(
        self, key: str, payload: bytes, *, timeout: float, urgency: Urgency, **how: Any
    ) -> asyncio.Future[Reply | None]:
        asking = self._bus.ask(key, payload, timeout=timeout, urgency=urgency, **how)
        if key.endswith("cmd/command"):
            self.commands.append(unpack_call(payload))
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
        bus = CountingBus(here.network.bus("client"))
        async with RemoteHand("zenoh://lab/cell/left", bus=cast("Bus", bus)) as hand:
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
async def test_what_waits_is_sent_before_what_is_asked_for_after_it() -> None:
    async with slow_network(0.1) as (here, _, hand):
        for value in range(20):
            hand.command(position=value)
        await hand.set_force(9)
        assert image(here).position(A) == 19
        assert image(here).axes[0].force == 9


@virtual
@pytest.mark.parametrize("how", ["halt", "release", "take"])
async def test_what_waits_goes_with_the_lease_or_a_halt(how: str) -> None:
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
        assert len(bus.commands) == 2


@virtual
async def test_without_control_it_is_refused_at_once() -> None:
    async with lab() as here, here.client("reader", control=False) as hand:
        with pytest.raises(ControlLostError, match="only reads"):
            hand.command(position=3)
        await asyncio.sleep(0.1)
        assert image(here).position(A) == 0


@virtual
async def test_two_first_commands_at_once_share_one_lease() -> None:
    async with lab() as here, here.client(control=None) as hand:
        results = await asyncio.gather(
            hand.set_speed(3), hand.set_force(4), hand.move(30, A), return_exceptions=True
        )
        assert [each for each in results if isinstance(each, BaseException)] == []
        assert here.lease == 1


@virtual
async def test_asking_for_the_lease_again_holds_nothing() -> None:
    async with lab() as here, here.client() as hand:
        moving: asyncio.Task[Any] = asyncio.create_task(hand.move(60, A))
        await asyncio.sleep(0.05)
        await hand.acquire()
        await hand.take()
        assert abs((await moving).positions[A] - 60) <= 2
        assert here.lease == 1


@virtual
async def test_more_missed_events_than_fit_into_one_message() -> None:
    async with lab(window=8.0) as here, here.client() as hand:
        transitions, requests = hand.transitions(), hand.requests()
        stream = here.network.stream("agent", "client")
        stream.is_cut = True
        written = 0
        for value in range(400):
            await here.local.set_speed(value % 256)
            written += 2
        here.network.mend(stream)
        await asyncio.sleep(2)
        assert len(list(transitions.drain())) >= written
        assert [sent.request.axes[0].speed for sent in requests.drain()] == [
            value % 256 for value in range(400)
        ]


@virtual
async def test_a_halt_goes_on_after_an_empty_answer_and_in_a_silence() -> None:
    async with lab() as here, here.client() as hand:
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
