"""Who commands a gripper: how control is lost, noticed to be lost, and when it comes back."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import Finger, State
from robotiq_async.fleet.network.bus import Urgency
from robotiq_async.fleet.wire.envelope import Call
from robotiq_async.values.errors import AgentError, ControlLostError
from robotiq_async.values.request import Request as Image
from tests.fleet.cell import told
from tests.fleet.lab import lab
from tests.fleet.spoiling import Garbling, Spoiling
from tests.fleet.world import world
from tests.virtual import virtual


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
async def test_who_was_cut_off_does_not_come_back_after_a_halt_of_the_next_holder() -> None:
    """Only a halt of somebody who had not held the lease barred the one before."""
    async with lab() as here:
        first = here.client("first")
        await first.start()
        here.network.cut(("first", "agent"), ("agent", "first"))
        await asyncio.sleep(2)
        async with here.client("next") as other:
            await other.halt()
        here.network.mend(*here.network.both("first", "agent"))
        await asyncio.sleep(3)
        assert not first.is_in_control
        with pytest.raises(ControlLostError):
            await first.move(30)
        await first.stop()


@virtual
async def test_its_own_halt_bars_nobody() -> None:
    async with world() as here:
        here.cut(here.holder)
        await asyncio.sleep(2)
        here.mend(here.holder)
        await here.holder.do(here.holder.hand.halt())
        await here.until(lambda: here.holder.hand.is_in_control)


@virtual
async def test_a_next_holder_that_halted_may_go_on_itself() -> None:
    async with lab() as here, here.client("first") as hand:
        await hand.halt()
        await hand.move(30, Finger.A)


@virtual
@pytest.mark.parametrize(("lost", "keeps"), [(1, True), (100, False)])
async def test_one_lost_renewal_does_not_lose_the_lease(lost: int, keeps: bool) -> None:
    async with lab() as here:
        bus = Spoiling(here.network.bus("client"), "/lease", times=0)
        async with here.client_over(bus) as hand:
            bus.left = lost
            moving = asyncio.create_task(hand.move(215, Finger.A, speed=0))
            for _ in range(300):
                await asyncio.sleep(0.01)
                if not hand.is_in_control:
                    break
            assert hand.is_in_control is keeps
            bus.left = 0
            if keeps:
                assert (await moving).positions[Finger.A] == pytest.approx(215, abs=2)
            else:
                with pytest.raises(ControlLostError):
                    await moving


@virtual
async def test_whoever_lost_the_lease_notices_although_the_agent_does_not_understand_the_question() -> None:
    """The question ended in a TypeError, and the hand took itself for the one that commands."""
    async with lab() as here, here.client("other", control=False) as other:
        bus = Garbling(here.network.bus("client"))
        async with here.client_over(bus) as hand:
            bus.verb = "/lease"
            await other.take()
            await asyncio.sleep(1)
            assert not hand.is_in_control
            with pytest.raises(AgentError, match="does not understand lease"):
                await hand.acquire()
            bus.verb = "nothing"


@virtual
async def test_silence_is_noticed_while_the_lease_is_asked_for_again() -> None:
    """The last status of an agent that had died was shown as the present one for ever."""
    async with lab() as here, here.client() as hand:
        here.network.cut(("client", "agent"))
        while hand.is_in_control:  # noqa: ASYNC110  # what is waited for tells nobody
            await asyncio.sleep(0.01)
        here.network.cut(("agent", "client"))
        await asyncio.sleep(3)
        assert hand.state is State.DISCONNECTED


@virtual
async def test_an_agent_that_is_ending_refuses_and_says_so() -> None:
    """It acknowledged what it did not do any more."""
    async with lab() as here, here.client("reader", control=False) as reader:
        await here.local.set_speed(0)
        await here.local.set_position(250, Finger.A)
        writes = len(here.gripper.writes)
        here.serving.cancel()
        with pytest.raises(ControlLostError, match="the agent is ending; nothing was done") as refused:
            await reader.acquire()
        assert refused.value.reason == "closed"
        await asyncio.gather(here.serving, return_exceptions=True)
        assert not here.gripper.is_moving
        ends = [Image.from_registers(write.registers) for write in here.gripper.writes[writes:]]
        assert ends, "the halt"
        assert not any(image.go for image in ends), "and nothing else"


@virtual
async def test_the_holders_secret_is_told_to_nobody() -> None:
    async with lab() as here, here.client("first"), here.client("reader", control=False) as reader:
        bus = here.network.bus("stranger")
        call = Call("robotiq/v1/lab/cell/left", "stranger")
        reply = await bus.ask(f"{call.to}/info", call.pack(), timeout=1.0, urgency=Urgency.COMMAND)
        assert reply is not None
        assert b'"client"' not in reply.payload
        assert reader.state is State.RUNNING_IDLE
