"""Two agents that do not see each other, two grippers under one name: whose answer counts, what moves."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from robotiq_async import ConnectionLostError, Finger, RobotiqHand, State
from robotiq_async.fleet.agent.agent import Agent
from robotiq_async.fleet.errors import AgentError, ControlLostError, NotAllStoppedError
from robotiq_async.fleet.fleet import Fleet
from robotiq_async.fleet.network.bus import BusReply, PendingQuery, Urgency
from robotiq_async.fleet.remote.errand import Errand, of_its_run
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import AgentAnswer, AgentCall, failure
from tests.fleet.lab import LEFT, Lab, lab, serving
from tests.fleet.world import ServingAgent, World, world
from tests.virtual import inside, until

WORDS = "two agents serve it"


@asynccontextmanager
async def another(here: Lab) -> AsyncIterator[Lab]:
    """A second agent, with a gripper of its own under the name of the first one's."""
    here.network.part("agent", "other agent")
    async with lab(here.network, "other agent") as other:
        await until(lambda: other.local.state is State.RUNNING_IDLE)
        await asyncio.sleep(0.01)  # until clients have heard of it
        yield other


@inside(lab)
async def test_the_answer_of_the_one_that_commands_counts_and_not_the_quicker_refusal(
    here: Lab, hand: RemoteHand
) -> None:
    async with another(here) as other:
        before = len(other.gripper.writes)
        here.network.delay("client", "agent", 0.05)
        await hand.set_speed(255)
        result = await hand.move(60, Finger.A)
        hand.command(Finger.B, position=60)
        await asyncio.sleep(2)
        assert abs(result.positions[Finger.A] - 60) <= 2
        assert hand.status.position(Finger.B) == pytest.approx(60, abs=2)
        assert len(other.gripper.writes) == before
        assert hand.is_in_control


@inside(lab)
async def test_a_client_that_hears_two_agents_says_so_and_commands_nothing(
    here: Lab, reader: RemoteHand, caplog: pytest.LogCaptureFixture
) -> None:
    async with another(here) as other:
        assert caplog.text.count(WORDS) == 1
        for begin in (here.client("next").start, reader.acquire, reader.take):
            with pytest.raises(AgentError, match=WORDS):
                await begin()
        await other.end_agent()
        await reader.acquire()
        await reader.move(30, Finger.A)


@inside(lab)
async def test_control_does_not_come_back_by_itself_from_the_one_to_the_other(
    here: Lab, hand: RemoteHand
) -> None:
    """It may be another gripper: a loop that tries again would move that one."""
    async with another(here) as other:
        before = len(other.gripper.writes)
        here.network.cut(("client", "agent"), ("agent", "client"))
        await asyncio.sleep(5)
        assert hand.state is State.RUNNING_IDLE, "it reads on"
        assert not hand.is_in_control
        with pytest.raises(ControlLostError):
            await hand.move(200)
        assert len(other.gripper.writes) == before
        here.network.mend(*here.network.both("client", "agent"))


@inside(lab)
async def test_a_lease_that_was_granted_while_a_second_agent_came_does_not_come_back_by_itself(
    here: Lab, reader: RemoteHand
) -> None:
    """It was forgotten that the second one had come: the client had no lease at that moment."""
    here.network.delay("reader", "agent", 0.05)
    acquiring, lease = asyncio.create_task(reader.acquire()), here.lease
    await until(lambda: here.lease > lease)
    gone = here.network.bus("other agent").announce(LEFT.key("alive", "7"))
    await acquiring
    assert reader.is_in_control
    here.network.cut(("reader", "agent"), ("agent", "reader"))
    await asyncio.sleep(2)
    gone()
    here.network.mend(*here.network.both("reader", "agent"))
    await asyncio.sleep(3)
    assert reader.state is State.RUNNING_IDLE, "it reads on"
    assert not reader.is_in_control


@inside(lab)
async def test_a_halt_stops_both_and_says_so_only_then(here: Lab, reader: RemoteHand) -> None:
    async with another(here) as other:
        for hand in (here.local, other.local):
            await hand.set_speed(0)
            await hand.set_position(255, Finger.A)
        await until(lambda: here.gripper.is_moving and other.gripper.is_moving)
        here.network.stream("other agent", "reader").delay = 0.3  # the answer that is longed for comes first
        await reader.halt()
        assert not here.gripper.is_moving
        assert not other.gripper.is_moving
        await other.server.stop()
        await asyncio.sleep(0.5)
        with pytest.raises(ConnectionLostError):
            await reader.halt()
        await other.server.start()


@inside(lab)
async def test_a_halt_is_done_although_another_agent_is_mute(here: Lab, hand: RemoteHand) -> None:
    """Its gripper has stopped; of the other nobody knew when it was asked."""
    async with another(here):
        here.network.stream("client", "other agent").is_cut = True
        await here.local.set_position(200, Finger.A)
        await hand.halt()
        assert not here.gripper.is_moving


@inside(lab)
async def test_the_halt_of_all_counts_agents_and_not_names(here: Lab) -> None:
    async with another(here), Fleet("lab", bus=here.network.bus("console")) as fleet:
        assert await fleet.halt_all() == {LEFT: "stopped"}
        here.network.stream("console", "other agent").is_cut = True
        with pytest.raises(NotAllStoppedError) as failed:
            await fleet.halt_all()
        assert failed.value.outcomes == {LEFT: "no answer from 1 of 2 agents"}


@inside(lab)
async def test_the_halt_of_all_stops_a_second_one_whose_link_comes_up_late(here: Lab) -> None:
    """The name had been halted already, at the first one."""
    async with another(here) as other:
        here.network.part("other agent", "console")
        here.network.loop.call_later(1.0, here.network.join, "other agent", "console")
        await other.local.set_speed(0)
        await other.local.set_position(255, Finger.A)
        async with Fleet("lab", bus=here.network.bus("console")) as fleet:
            halting = asyncio.create_task(fleet.halt_all())
            await asyncio.sleep(0.5)
            assert other.gripper.is_moving
            assert await halting == {LEFT: "stopped"}
            assert not other.gripper.is_moving
            assert other.gripper.position(Finger.A) < 230


@inside(lab)
async def test_a_second_agent_of_a_host_is_refused_for_any_gripper(here: Lab) -> None:
    for name, words in (("left", "serves zenoh://lab/cell/left already"), ("right", "a different host")):
        agent = Agent("lab", "cell", {name: RobotiqHand("sim://")}, here.network.bus(f"second {name}"))
        with pytest.raises(AgentError, match=words):
            await agent.run()
    host = Agent("lab", "cell-2", {"left": RobotiqHand("sim://")}, here.network.bus("of another host"))
    async with serving(host):
        pass


CALL = AgentCall(LEFT.base, "stranger", epoch=7, number=3)


@pytest.mark.parametrize(
    ("reply", "counts", "refuses"),
    [
        (AgentAnswer(LEFT.base, 3, 7, {}).pack(), True, False),
        (failure(CALL, 7, AgentError("late"), begun=False).pack(), True, True),
        (failure(CALL, 8, AgentError("anew"), begun=False).pack(), False, True),
        (AgentAnswer(LEFT.base, 4, 7, {}).pack(), False, False),
        (AgentAnswer("robotiq/v1/lab/cell/right", 3, 7, {}).pack(), False, False),
        (b"?", False, True),
    ],
)
async def test_which_reply_decides(reply: bytes, counts: bool, refuses: bool) -> None:
    def decides(verb: str, urgency: Urgency) -> bool:
        errand = Errand(LEFT, CALL, verb, 1.0, urgency, 1, lambda _: None, lambda: None)
        errand.end()
        return errand.decides(BusReply(reply))

    assert of_its_run(CALL)(BusReply(reply)) is counts
    assert decides("cmd/move", Urgency.COMMAND) is counts
    assert decides("halt", Urgency.STOP) is refuses


@pytest.mark.parametrize(
    ("replies", "decides", "result"),
    [([b"1", b"2"], False, b"2"), ([b"1", b"2"], True, b"1"), ([], True, None), ([], False, None)],
)
async def test_without_one_that_decides_it_is_the_last(
    replies: list[bytes], decides: bool, result: bytes | None
) -> None:
    asking = PendingQuery(lambda _: decides)
    for reply in replies:
        asking.take(BusReply(reply))
        assert asking.answered.done() is decides
    asking.end()
    last = await asking.answered
    assert (last and last.payload) == result


@inside(world)
async def test_of_two_agents_that_start_at_once_one_stays(here: World) -> None:
    await here.agent.end()
    here.agents.clear()
    here.network.part("one", "two")  # a router that has not reported it yet
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


@inside(lab)
async def test_another_agent_that_comes_and_goes_does_not_fill_log_and_events(
    here: Lab, caplog: pytest.LogCaptureFixture
) -> None:
    """2,478 lines, and as many events."""
    client = here.client(control=False)
    await client.start()
    events = here.agent.hands["left"].publisher._count
    key = LEFT.key("alive", "12345")
    with caplog.at_level(logging.ERROR, logger="robotiq_async"):
        for _ in range(500):
            here.agent._report_conflict(key, is_there=True)
            here.agent._report_conflict(key, is_there=False)
        assert here.agent.hands["left"].publisher._count == events + 1
        for number in range(500):
            client_agents = client._remote.session.keeper  # type: ignore[union-attr]
            client_agents._update_token(f"{key}{number}", is_there=True)
            client_agents._update_token(f"{key}{number}", is_there=False)
    assert len(caplog.records) <= 2
    await client.stop()
