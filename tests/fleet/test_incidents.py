"""What has gone wrong elsewhere with robots on a network, one by one, and what is like it here."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import Finger, State
from robotiq_async.errors import AgentError, NotAllStoppedError
from robotiq_async.fleet.fleet import Fleet
from robotiq_async.fleet.network.bus import Urgency
from robotiq_async.fleet.wire.envelope import Call, unpack_answer
from robotiq_async.fleet.wire.names import GripperName
from tests.fleet.cell import Doing, moving, told
from tests.fleet.world import Client, ServingAgent, World, motions, world
from tests.virtual import virtual

LEFT = GripperName("lab", "cell", "left")


async def move_slowly(here: World) -> asyncio.Task[str]:
    doing = Doing(here)
    await moving(doing)
    assert doing.call is not None
    return doing.call


async def ask(client: Client, verb: str, call: Call, key: str = "") -> AgentError | None:
    """Ask something by hand; returns what it was refused with."""

    async def once() -> bytes:
        reply = await client.bus.ask(key or LEFT.key(verb), call.pack(), timeout=2.0, urgency=Urgency.COMMAND)
        assert reply is not None
        return reply.payload

    answer = unpack_answer(await client.do(once()))
    try:
        answer.outcome(lambda stamp: stamp)
    except AgentError as error:
        return error
    return None


# -- stops -------------------------------------------------------------------------------------------------


@virtual
async def test_a_second_halt_is_not_dropped_as_a_duplicate() -> None:
    """strands-labs/robots 1617. The very same request, once more, stops what has been set going since."""
    async with world() as here:
        halt = Call(LEFT.base, "somebody", number=1)
        for _ in range(2):
            call = await move_slowly(here)
            assert await ask(here.other, "halt", halt) is None
            assert not here.gripper.is_moving
            assert await call == "ControlLost halted"
            await here.holder.do(here.holder.hand.acquire())
            await here.holder.do(here.holder.hand.move(0, Finger.A, speed=255))


@virtual
async def test_a_halt_needs_no_lease() -> None:
    """strands-labs/robots 3450: a stop was refused under somebody else's lock."""
    async with world() as here:
        call = await move_slowly(here)
        await here.other.do(here.other.hand.halt())
        assert not here.gripper.is_moving
        assert await call == "ControlLost halted"


@virtual
async def test_a_halt_that_failed_is_not_counted_as_one() -> None:
    """strands-labs/robots 1680."""
    async with world() as here, Fleet("lab", bus=here.network.bus("console")) as fleet:
        await move_slowly(here)
        await here.servers["left"].stop()
        await here.until(lambda: here.other.hand.state is State.DISCONNECTED)
        with pytest.raises(NotAllStoppedError) as failed:
            await fleet.halt_all()
        assert failed.value.outcomes[GripperName("lab", "cell", "right")] == "stopped"
        assert failed.value.outcomes[LEFT].startswith("refused: ")
        assert await here.other.do(told(here.other.hand.halt())) == "ConnectionLost"
        await here.servers["left"].start()


@virtual
async def test_halting_an_empty_fleet_is_an_error() -> None:
    """strands-labs/robots 3434: an e-stop succeeded on a mesh that was not started."""
    async with world() as here, Fleet("elsewhere", bus=here.network.bus("console")) as fleet:
        with pytest.raises(NotAllStoppedError, match="no gripper"):
            await fleet.halt_all()
    with pytest.raises(RuntimeError, match="not entered"):
        await Fleet("lab", bus=here.network.bus("console")).halt_all()


@virtual
async def test_a_halt_of_all_names_what_it_did_not_reach() -> None:
    """An endpoint of its route was down, and "all" of the others stopped."""
    async with world() as here:
        bus = here.network.bus("console")
        bus.endpoints = ["agent", "tls/cell-2:7447"]
        async with Fleet("lab", bus=bus) as fleet:
            with pytest.raises(NotAllStoppedError) as failed:
                await fleet.halt_all()
            assert str(failed.value) == "halted 2 of 2; not reached: tls/cell-2:7447"
            assert failed.value.unreached == ("tls/cell-2:7447",)
            assert set(failed.value.outcomes.values()) == {"stopped"}
            here.kill(here.agent.host)
            await asyncio.sleep(1)
            with pytest.raises(NotAllStoppedError) as failed:
                await fleet.halt_all()
            left, right = "zenoh://lab/cell/left: no answer", "zenoh://lab/cell/right: no answer"
            assert str(failed.value) == f"halted 0 of 2; {left}; {right}; not reached: agent, tls/cell-2:7447"
            await here.start_agent("agent")


@virtual
async def test_a_halt_of_all_looks_on_for_links_that_come_up_late() -> None:
    """It knew nothing of agents whose links came up after it had looked; somebody else looks on meanwhile."""
    async with world() as here, Fleet(bus=here.network.bus("screen")) as screen:
        changes = screen.changes()
        call = await move_slowly(here)
        here.network.part("agent", "console")
        here.network.loop.call_later(1.0, here.network.join, "agent", "console")
        async with Fleet("lab", bus=here.network.bus("console")) as fleet:
            assert await fleet.halt_all() == {
                GripperName("lab", "cell", name): "stopped" for name in ("left", "right")
            }
        assert not here.gripper.is_moving
        assert await call == "ControlLost halted"
        assert list(changes.drain())


@virtual
async def test_a_halt_is_acknowledged_however_slowly() -> None:
    """A round trip that is longer than the time between two attempts."""
    async with world() as here, Fleet("lab", bus=here.network.bus("console")) as fleet:
        await move_slowly(here)
        for name in ("other", "console"):
            for stream in here.network.both(name, "agent"):
                stream.delay = 0.4
        await here.other.do(here.other.hand.halt())
        assert set((await fleet.halt_all()).values()) == {"stopped"}


@virtual
async def test_what_was_asked_before_a_halt_does_not_go_out_after_it() -> None:
    async with world() as here:
        hand = here.holder.hand
        for stream in here.network.both("holder", "agent"):
            stream.delay = 0.05

        async def loop_and_halt() -> None:
            for number in range(40):  # more than may be under way: the last ones wait
                hand.command(Finger.A, position=200 + number, speed=0)
                await asyncio.sleep(0.002)
            await hand.halt()

        await here.holder.do(loop_and_halt())
        writes = len(here.gripper.writes)
        await asyncio.sleep(1)
        assert not here.gripper.is_moving
        assert not motions(here, writes)


# -- replays -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seconds", [0.5, 0.9, 1.0, 1.1, 3.0])
@virtual
async def test_commands_that_waited_for_the_link_are_never_carried_out(seconds: float) -> None:
    """Valetudo 640, nats-py: a queued command ran when the robot came back."""
    async with world() as here:
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
        await asyncio.sleep(3)
        late = [at - asked for at, what in motions(here, 0) if what[0] >= 200]
        assert all(each <= 1.1 for each in late)
        assert bool(late) is (seconds < 0.9)


@virtual
async def test_a_stale_status_is_not_the_state_of_now() -> None:
    """unh_marine_autonomy 139: a relay sent an old frame once more."""
    async with world() as here:
        heard: list[tuple[str, bytes]] = []
        here.network.bus("relay").subscribe(LEFT.key("*"), lambda key, payload: heard.append((key, payload)))
        await asyncio.sleep(0.2)
        old = [each for each in heard if each[1][:1] != b"{"][-1]
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


@virtual
async def test_a_status_of_a_former_run_brings_nothing_back() -> None:
    async with world() as here:
        heard: list[tuple[str, bytes]] = []
        here.network.bus("relay").subscribe(LEFT.key("*"), lambda key, payload: heard.append((key, payload)))
        await asyncio.sleep(0.2)
        old = [each for each in heard if each[1][:1] != b"{"][-1]
        await here.agent.end()
        await here.start_agent("next agent")
        await here.until(lambda: here.holder.hand.is_in_control)
        here.holder.had_control.clear()
        here.holder.host.call_soon(here.holder.bus.hear, *old)
        await asyncio.sleep(0.5)
        assert here.holder.had_control == [True]


# -- who commands ------------------------------------------------------------------------------------------


@virtual
async def test_the_client_is_killed_while_it_moves() -> None:
    """doosan-robot2 247: the arm went on."""
    async with world() as here:
        await move_slowly(here)
        killed = here.now()
        here.kill(here.holder.host)
        await here.until(lambda: not here.gripper.is_moving)
        assert here.now() - killed <= 1.2


@pytest.mark.parametrize("after", [0.4, 1.6])
@pytest.mark.parametrize("what", ["halt", "take"])
@virtual
async def test_who_was_cut_off_does_not_come_back_after_a_halt_or_a_take(what: str, after: float) -> None:
    """It hears of neither: for it the lease has ended because the link was lost. Before that, and after."""
    async with world() as here:
        here.cut(here.holder)
        await asyncio.sleep(after)
        other = here.other.hand
        await here.other.do(other.halt() if what == "halt" else other.take())
        if what == "take":
            await here.other.do(other.release())
        await asyncio.sleep(1.5)
        here.mend(here.holder)
        await asyncio.sleep(3)
        assert not here.holder.hand.is_in_control
        word = {"halt": "halted", "take": "taken"}[what]
        assert await here.holder.do(told(here.holder.hand.set_speed(9))) == f"ControlLost {word}"
        await here.holder.do(here.holder.hand.acquire())
        await here.holder.do(here.holder.hand.set_speed(9))


@virtual
async def test_its_own_halt_bars_nobody() -> None:
    async with world() as here:
        here.cut(here.holder)
        await asyncio.sleep(2)
        here.mend(here.holder)
        await here.holder.do(here.holder.hand.halt())
        await here.until(lambda: here.holder.hand.is_in_control)


@virtual
async def test_what_moves_is_held_as_soon_as_the_gripper_is_reached_again() -> None:
    """The lease ends while the agent has lost its gripper, which goes on to its target."""
    async with world() as here:
        await move_slowly(here)
        await here.servers["left"].stop()
        await here.until(lambda: here.other.hand.state is State.DISCONNECTED)
        here.kill(here.holder.host)
        await asyncio.sleep(1.5)
        assert here.gripper.is_moving
        await here.servers["left"].start()
        await here.until(lambda: here.other.hand.state is State.RUNNING_IDLE)
        await asyncio.sleep(0.2)
        assert not here.gripper.is_moving


@virtual
async def test_nothing_from_before_a_suspension_is_carried_out() -> None:
    """The agent's machine was suspended with requests in its sockets; its clock stood still meanwhile."""
    slept = 0.0
    async with world(asleep=lambda: slept) as here:
        here.network.keeps_links = True
        here.cut(here.holder, back=False)
        going = asyncio.create_task(told(here.holder.do(here.holder.hand.move(200, Finger.A, speed=0))))
        await asyncio.sleep(0.3)
        slept = 3600.0
        here.mend(here.holder)
        assert (await going).startswith("ControlLost")
        await asyncio.sleep(1)
        assert here.gripper.position(Finger.A) < 10
        await here.until(lambda: here.holder.hand.is_in_control)


@pytest.mark.parametrize("seconds", [0.8, 3.0])
@pytest.mark.parametrize("keeps_links", [True, False])
@virtual
async def test_a_suspended_laptop_commands_nothing_from_before(keeps_links: bool, seconds: float) -> None:
    """Its clock stood still: to itself its loop is in time, and so is what lay in its sockets."""
    async with world() as here:
        here.network.keeps_links = keeps_links
        hand, host, stopped = here.holder.hand, here.holder.host, False

        async def loop() -> None:
            number = 0
            while not stopped:
                hand.command(Finger.A, position=100 + number % 100, speed=0)
                number += 1
                await asyncio.sleep(0.01)

        looping = host.start(told(loop()))
        await asyncio.sleep(0.5)
        (host.freeze if keeps_links else lambda: here.freeze(host))()
        await asyncio.sleep(seconds)
        stood, writes = here.gripper.position(Finger.A), len(here.gripper.writes)
        assert here.gripper.is_moving is (seconds < 1.0)
        host.wake(seconds)
        for bus in here.network.buses:
            here.network.join(host.name, bus.name)
        await asyncio.sleep(3)
        if seconds > 1.0:
            assert looping.result().startswith(("ControlLost", "ConnectionLost"))
            assert here.gripper.position(Finger.A) == stood
            assert not motions(here, writes)
        await here.until(lambda: hand.is_in_control)
        stopped = True
        await here.until(looping.done)
        await here.holder.do(hand.move(30, Finger.A, speed=255))


# -- names and numbers -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["*", "**", "a*", "$*", "a/b", "?", "#", "", "a" * 65, "ä"])
def test_names_with_wildcards_are_none(name: str) -> None:
    with pytest.raises(ValueError, match=r"1\.\.64"):
        GripperName("lab", "cell", name)
    with pytest.raises(ValueError, match=r"1\.\.64"):
        Fleet(name)


@pytest.mark.parametrize("key", ["robotiq/v1/lab/cell/*/halt", "robotiq/v1/lab/cell/a$b/halt"])
@virtual
async def test_a_request_under_a_wildcard_is_refused(key: str) -> None:
    async with world() as here:
        call = await move_slowly(here)
        refused = await ask(here.other, "halt", Call(LEFT.base, "somebody", number=1), key)
        assert refused is not None
        assert here.gripper.is_moving
        await here.holder.do(here.holder.hand.halt())
        await call


@virtual
async def test_a_request_for_another_gripper_is_refused() -> None:
    """It came under the wrong key."""
    async with world() as here:
        right = Call(GripperName("lab", "cell", "right").base, "somebody", number=1)
        refused = await ask(here.other, "lease", right)
        assert "right" in str(refused)
        assert here.holder.hand.is_in_control


@virtual
async def test_of_two_agents_that_start_at_once_one_stays() -> None:
    async with world() as here:
        await here.agent.end()
        here.agents.clear()
        here.network.part("one", "two")  # a router that has not told yet
        here.network.loop.call_later(0.4, here.network.join, "one", "two")

        async def start(name: str) -> str:
            agent = ServingAgent(here, name, {})
            try:
                await agent.start()
            except TimeoutError:
                assert agent.serving is not None
                assert isinstance(agent.serving.exception(), AgentError)
                await agent.host.bury()
                return "gave up"
            here.agents.append(agent)
            return "serves"

        assert sorted(await asyncio.gather(start("one"), start("two"))) == ["gave up", "serves"]


@virtual
async def test_a_request_is_carried_out_once_and_answered_as_often_as_it_comes() -> None:
    async with world() as here:
        stream = here.network.stream("holder", "agent")
        stream.copies, stream.lateness = 3, 0.3
        await here.holder.do(here.holder.hand.set_position(90, Finger.A))
        await here.holder.do(here.holder.hand.set_position(20, Finger.A))
        await asyncio.sleep(2)
        assert [what[0] for _, what in motions(here, 0) if what[0] in (90, 20)][-1] == 20
        positions = [what[0] for _, what in motions(here, 0)]
        assert positions.count(90) <= 1
