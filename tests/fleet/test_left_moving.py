"""What must not be left moving, nor shown as if it were known: found by trying to break the promises."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

import pytest

from robotiq_async import ConnectionLostError, Finger, RobotiqError, State
from robotiq_async.errors import AgentError, ControlLostError
from robotiq_async.fleet.network.bus import Reply, Urgency
from robotiq_async.fleet.wire.envelope import Answer, Call, unpack_answer
from robotiq_async.fleet.wire.values import error_fields
from tests.fleet.lab import lab
from tests.fleet.network import MemoryBus
from tests.restless import Restless
from tests.virtual import virtual


class Spoiling:
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
        self._bus, self._verb, self._answer, self.left = bus, verb, answer, times
        self._is_sent = is_sent

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bus, name)

    def ask(
        self, key: str, payload: bytes, *, timeout: float, urgency: Urgency, **how: Any
    ) -> asyncio.Future[Reply | None]:
        if not key.endswith(self._verb) or not self.left:
            return self._bus.ask(key, payload, timeout=timeout, urgency=urgency, **how)
        self.left -= 1
        if self._answer is None:  # never sent
            return asyncio.ensure_future(_nothing(timeout))
        return asyncio.ensure_future(self._another(key, payload, timeout, urgency))

    async def _another(self, key: str, payload: bytes, timeout: float, urgency: Urgency) -> Reply | None:
        if self._is_sent:
            asking = self._bus.ask(key, payload, timeout=timeout, urgency=urgency)
            await asyncio.sleep(0.1)
            asking.cancel()
        assert self._answer is not None
        return _Answered(self._answer)


class Garbling:
    """A bus whose answers to one kind of request are others: by default, that it is not understood."""

    def __init__(self, bus: MemoryBus, **others: Any) -> None:
        self._bus = bus
        self._others = others or {"value": None, "error": error_fields(TypeError("what?"))}
        self.verb = "nothing yet"

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bus, name)

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


async def _nothing(timeout: float) -> None:
    await asyncio.sleep(timeout)


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
@pytest.mark.parametrize("lost", [1, 1_000_000])
async def test_a_cancelled_move_is_called_off_although_that_was_lost(lost: int) -> None:
    """It was asked once, and the fingers ran on under a lease that was renewed."""
    async with lab() as here:
        bus = Spoiling(here.network.bus("client"), "cmd/cancel", times=lost)
        async with here.client_over(bus) as hand:
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(0.3):
                    await hand.move(255, Finger.A, speed=0)
            await asyncio.sleep(2.5)
            assert not here.gripper.is_moving
            assert here.gripper.position(Finger.A) < 220


@virtual
async def test_a_cancelled_move_is_called_off_although_that_was_misrouted() -> None:
    """Any refusal counted as the end of the lease, and the fingers ran on under one that was renewed."""
    async with lab() as here:
        answer = Answer("robotiq/v1/lab/cell/right", 3, 1, {}).pack()
        bus = Spoiling(here.network.bus("client"), "cmd/cancel", times=1, answer=answer, is_sent=False)
        async with here.client_over(bus) as hand:
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(0.3):
                    await hand.move(255, Finger.A, speed=0)
            await asyncio.sleep(0.2)
            assert not here.gripper.is_moving
            assert hand.is_in_control


@virtual
async def test_a_move_whose_answer_was_anothers_is_called_off() -> None:
    async with lab() as here:
        answer = Answer("robotiq/v1/lab/cell/right", 3, 1, {}).pack()
        async with here.client_over(Spoiling(here.network.bus("client"), "cmd/move", answer=answer)) as hand:
            with pytest.raises(AgentError, match="another answer"):
                await hand.move(255, Finger.A, speed=0)
            await asyncio.sleep(0.5)
            assert not here.gripper.is_moving


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
async def test_a_next_holder_that_halted_may_go_on_itself() -> None:
    async with lab() as here, here.client("first") as hand:
        await hand.halt()
        await hand.move(30, Finger.A)


@virtual
async def test_the_holders_secret_is_told_to_nobody() -> None:
    async with lab() as here, here.client("first"), here.client("reader", control=False) as reader:
        bus = here.network.bus("stranger")
        call = Call("robotiq/v1/lab/cell/left", "stranger")
        reply = await bus.ask(f"{call.to}/info", call.pack(), timeout=1.0, urgency=Urgency.COMMAND)
        assert reply is not None
        assert b'"client"' not in reply.payload
        assert reader.state is State.RUNNING_IDLE


@virtual
async def test_a_refused_command_does_not_forget_the_hold_that_is_owed() -> None:
    """It was forgotten before the command was known to be carried out, and a dead holder's fingers ran on."""
    async with lab() as here:
        gone, other = here.client("gone"), here.client("other", control=False)
        await gone.start()
        await other.start()
        moving = asyncio.create_task(gone.move(255, Finger.ABC, speed=0))
        while not here.gripper.is_moving:  # noqa: ASYNC110  # what is waited for tells nobody
            await asyncio.sleep(0.001)
        await here.server.stop()
        here.network.cut(("gone", "agent"), ("agent", "gone"))
        await asyncio.sleep(1.2)
        await other.acquire()
        with pytest.raises(RobotiqError):
            await other.set_speed(10)
        await here.server.start()
        await asyncio.sleep(1.0)
        assert not here.gripper.is_moving
        await asyncio.gather(moving, return_exceptions=True)
        await other.stop()
        await gone.stop()


@virtual
async def test_of_a_command_for_several_axes_all_is_carried_out_or_nothing() -> None:
    async with lab() as here, here.client() as hand:
        session = hand._session
        assert session is not None
        axes = {"1": {"position": 90}, "2": {"position": 999}}
        with pytest.raises(ValueError, match="999"):
            await session.ask("cmd/command", {"axes": axes}, timeout=1.0)
        await asyncio.sleep(1)
        assert here.gripper.position(Finger.A) < 10


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
async def test_arguments_that_do_not_fit_leave_nothing_behind() -> None:
    """The axes counted as commanded, and what others had set going was held at the end of the lease."""
    async with lab() as here, here.client() as hand:
        session = hand._session
        assert session is not None
        await here.local.set_speed(0)
        await here.local.set_position(250, Finger.B)
        for arguments in ({"position": 9, "fingers": 2, "more": 1}, {"position": 9, "fingers": float("inf")}):
            with pytest.raises((TypeError, ValueError, OverflowError, AgentError)):
                await session.ask("cmd/move", arguments, timeout=1.0)
        async with here.client("other", control=False) as other:
            await other.take()
            await asyncio.sleep(0.2)
            assert here.gripper.is_moving
            await other.release()
        assert not here.gripper.is_moving


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
        assert len(here.gripper.writes) == writes + 1, "the halt, and nothing else"


@virtual
async def test_what_another_run_of_the_agent_says_acknowledges_nothing() -> None:
    async with lab() as here:
        bus = Garbling(here.network.bus("client"), epoch=5)
        async with here.client_over(bus) as hand:
            for verb, ask in (("cmd/set_speed", hand.set_speed(9)), ("cmd/move", hand.move(30))):
                bus.verb = verb
                with pytest.raises(ConnectionLostError, match="another run of its agent answered"):
                    await ask
            bus.verb = "/halt"
            await hand.halt()
            bus.verb = "nothing"


# -- grips -------------------------------------------------------------------------------------------------


@virtual
async def test_a_grip_is_kept_by_a_hand_that_was_made_for_it() -> None:
    async with lab() as here:
        here.gripper.place_object(Finger.B | Finger.C, 100)
        async with here.client(keep_grip=True) as hand:
            await hand.close(Finger.B | Finger.C)
            await hand.set_speed(0, Finger.A)
            await hand.set_position(255, Finger.A)
        await asyncio.sleep(5)
        assert here.gripper.grips == Finger.B | Finger.C
        assert here.gripper.position(Finger.A) < 40
        async with here.client("next") as hand:
            await hand.move(60, Finger.A)
            assert here.gripper.grips == Finger.B | Finger.C, "and by who comes next"
        assert not here.gripper.grips


@virtual
async def test_a_grip_is_kept_when_the_lease_is_given_back() -> None:
    async with lab() as here, here.client() as hand:
        here.gripper.place_object(Finger.ABC, 100)
        await hand.close()
        await hand.release(keep_grip=True)
        assert here.gripper.grips == Finger.ABC
        await hand.acquire()
        await hand.release()
        assert not here.gripper.grips


@virtual
async def test_what_does_not_come_to_rest_is_halted() -> None:
    async with lab(kind=Restless) as here, here.client() as hand:
        await hand.release(keep_grip=True)
        assert not here.local.status.go_echo


@virtual
async def test_what_does_not_come_to_rest_is_left_to_whoever_commands_it_by_then() -> None:
    async with lab(kind=Restless) as here, here.client() as hand:
        releasing = asyncio.create_task(hand.release(keep_grip=True))
        await asyncio.sleep(0.1)
        async with here.client("next"):
            await releasing
            assert here.local.status.go_echo


@virtual
async def test_an_agent_may_keep_a_grip_at_its_own_end() -> None:
    async with lab(keep_grip=True) as here:
        here.gripper.place_object(Finger.ABC, 100)
        async with here.client(keep_grip=True) as hand:
            await hand.close()
        await here.end_agent()
        assert here.gripper.grips == Finger.ABC
