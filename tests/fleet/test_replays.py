"""Nothing old counts: neither requests that waited, nor statuses, nor answers of another run."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import ConnectionLostError, Finger, RobotiqError, State
from robotiq_async.simulator.physics.inbox import HeardWrite
from robotiq_async.values.request import Request
from tests.fleet.cell import ending, move_slowly
from tests.fleet.lab import LEFT, Garbling, Lab, lab
from tests.fleet.world import POLL_S, World, motions, world
from tests.virtual import LATENCY_S, inside, virtual

A = Finger.A
FROZEN_S = 2.1
"""Longer than the window of a lease."""


# -- replays -----------------------------------------------------------------------------------------------


async def status_on_its_way(here: World) -> tuple[str, bytes]:
    """A status of the present run as a relay keeps it: its key and its bytes."""
    heard: list[tuple[str, bytes]] = []
    here.network.bus("relay").subscribe(LEFT.key("*"), lambda key, payload: heard.append((key, payload)))
    await asyncio.sleep(0.2)
    return [each for each in heard if each[1][:1] != b"{"][-1]


@pytest.mark.parametrize("seconds", [0.5, 0.9, 1.0, 1.1, 3.0])
@inside(world)
async def test_commands_that_waited_for_the_link_are_never_carried_out(here: World, seconds: float) -> None:
    """Valetudo 640, nats-py: a queued command ran when the robot came back."""
    here.network.keeps_links = True
    hand, asked = here.holder.hand, here.now()
    here.cut(here.holder)

    async def command() -> None:
        for number in range(20):
            hand.command(Finger.A, position=200 + number, speed=0)
            await asyncio.sleep(0.005)

    await here.holder.do(command())
    await asyncio.sleep(seconds)
    here.mend(here.holder)
    await asyncio.sleep(2)
    late = [at - asked for at, what in motions(here, 0) if what[0] >= 200]
    assert all(each <= 1.1 for each in late)
    assert bool(late) is (seconds < 0.9)


@virtual
async def test_nothing_from_before_a_suspension_is_carried_out() -> None:
    """The agent's machine was suspended with requests in its sockets; its clock stood still in that time."""
    slept = 0.0
    async with world(asleep=lambda: slept) as here:
        here.network.keeps_links = True
        here.cut(here.holder, back=False)
        going = asyncio.create_task(ending(here.holder.do(here.holder.hand.move(200, Finger.A, speed=0))))
        await asyncio.sleep(0.3)
        slept = 3600.0
        here.mend(here.holder)
        assert (await going).startswith("ControlLost")
        await asyncio.sleep(1)
        assert here.gripper.position(Finger.A) < 10
        await here.until(lambda: here.holder.hand.is_in_control)


@pytest.mark.parametrize("seconds", [0.8, 3.0])
@pytest.mark.parametrize("keeps_links", [True, False])
@inside(world)
async def test_a_suspended_laptop_commands_nothing_from_before(
    here: World, keeps_links: bool, seconds: float
) -> None:
    """Its clock stood still: to itself its loop is in time, and so is what lay in its sockets."""
    here.network.keeps_links = keeps_links
    hand, host, stopped = here.holder.hand, here.holder.host, False

    async def loop() -> None:
        number = 0
        while not stopped:
            hand.command(Finger.A, position=100 + number % 100, speed=0)
            number += 1
            await asyncio.sleep(POLL_S / 2)

    looping = host.create_task(ending(loop()))
    await asyncio.sleep(0.5)
    (host.freeze if keeps_links else lambda: here.freeze(host))()
    await asyncio.sleep(seconds)
    stood, writes = here.gripper.position(Finger.A), len(here.gripper.writes)
    assert here.gripper.is_moving is (seconds < 1.0)
    host.wake(seconds)
    for bus in here.network.buses:
        here.network.join(host.name, bus.name)
    await asyncio.sleep(2)
    if seconds > 1.0:
        assert looping.result().startswith(("ControlLost", "ConnectionLost"))
        assert here.gripper.position(Finger.A) == stood
        assert not motions(here, writes)
    await here.until(lambda: hand.is_in_control)
    stopped = True
    await here.until(looping.done)
    await here.holder.do(hand.move(30, Finger.A, speed=255))


@inside(world)
async def test_a_request_is_carried_out_once_and_answered_as_often_as_it_comes(here: World) -> None:
    stream = here.network.stream("holder", "agent")
    stream.copies, stream.lateness = 3, 0.3
    await here.holder.do(here.holder.hand.set_position(90, Finger.A))
    await here.holder.do(here.holder.hand.set_position(20, Finger.A))
    await asyncio.sleep(2)
    assert [what[0] for _, what in motions(here, 0) if what[0] in (90, 20)][-1] == 20
    positions = [what[0] for _, what in motions(here, 0)]
    assert positions.count(90) <= 1


@inside(world)
async def test_a_stale_status_is_not_the_state_of_now(here: World) -> None:
    """unh_marine_autonomy 139: a relay sent an old frame once more."""
    old = await status_on_its_way(here)
    here.cut(here.other)
    await asyncio.sleep(2)
    assert here.other.hand.state is State.DISCONNECTED
    newest = here.other.hand.status
    here.other.host.call_soon(here.other.bus.hear, *old)
    await asyncio.sleep(0.1)
    assert here.other.hand.state is State.DISCONNECTED
    assert here.other.hand.status.sequence == newest.sequence
    here.mend(here.other)
    await here.until(lambda: here.other.hand.state is State.RUNNING_IDLE)


@inside(world)
async def test_a_status_of_a_former_run_brings_nothing_back(here: World) -> None:
    old = await status_on_its_way(here)
    await here.agent.end()
    await here.start_agent("next agent")
    await here.until(lambda: here.holder.hand.is_in_control)
    here.holder.had_control.clear()
    here.holder.host.call_soon(here.holder.bus.hear, *old)
    await asyncio.sleep(0.5)
    assert here.holder.had_control == [True]


@inside(lab)
async def test_answers_of_another_run_acknowledge_nothing(here: Lab) -> None:
    bus = Garbling(here.network.bus("client"), epoch=5)
    async with here.client_over(bus) as hand:
        for verb, ask in (("cmd/set_speed", hand.set_speed(9)), ("cmd/move", hand.move(30))):
            bus.verb = verb
            with pytest.raises(ConnectionLostError, match="another run of its agent answered"):
                await ask
        bus.verb = "/halt"
        await hand.halt()
        bus.verb = "nothing"


# -- late settings -----------------------------------------------------------------------------------------


def has_it(write: HeardWrite) -> bool:
    asked = Request.from_registers(write.registers).axes[0]
    return 201 in (asked.speed, asked.force)


@pytest.mark.parametrize(
    "delay", [each * POLL_S / 8 for each in range(0, 10, 2)], ids=lambda s: f"{s * 1000:g}ms"
)
@pytest.mark.parametrize("name", ["speed", "force", "command"])
@inside(world)
async def test_an_agent_that_was_frozen_writes_no_part_of_a_late_command(
    here: World, name: str, delay: float
) -> None:
    """Frozen between letting it in and writing it, it wrote the speed on waking, 2.14 s late."""
    await move_slowly(here)
    hand = here.holder.hand

    async def ask() -> None:
        if name == "command":
            hand.command(A, speed=201, force=201)
        else:
            await getattr(hand, f"set_{name}")(201, A)

    asking = asyncio.create_task(here.holder.do(ask()))
    await asyncio.sleep(delay)
    here.agent.host.freeze()
    frozen_at = here.now()
    await asyncio.sleep(FROZEN_S)
    here.agent.host.thaw()
    await asyncio.sleep(0.5)
    first = [write.time for write in here.gripper.writes if has_it(write)][:1]
    assert all(at < frozen_at + 2 * LATENCY_S for at in first), "it was written late"
    await asyncio.wait({asking})
    assert asking.exception() is None or isinstance(asking.exception(), RobotiqError)
