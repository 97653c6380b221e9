"""Halts, by any client, of one gripper and of all; and fingers without a client are held."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from robotiq_async import Finger, RobotiqError, State, StateTimeoutError
from robotiq_async.fleet.errors import AgentError, NotAllowedError, NotAllStoppedError
from robotiq_async.fleet.fleet import Fleet
from robotiq_async.fleet.network.bus import BusReply
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import AgentAnswer, AgentCall
from robotiq_async.fleet.wire.names import GripperName
from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values import registers as reg
from robotiq_async.values.registers import Registers
from tests.fleet.cell import ask, ending, move_slowly
from tests.fleet.lab import LEFT, Between, Garbling, Lab, Spoiling, lab
from tests.fleet.world import World, motions, world
from tests.grippers import Restless
from tests.virtual import VirtualLoop, inside, until, virtual

# -- halts -------------------------------------------------------------------------------------------------


@inside(world)
async def test_a_second_halt_is_not_dropped_as_a_duplicate(here: World) -> None:
    """strands-labs/robots 1617. The very same request, once more, stops what has been set going since."""
    halt = AgentCall(LEFT.base, "stranger", number=1)
    for _ in range(2):
        call = await move_slowly(here)
        assert await ask(here.other, "halt", halt) is None
        assert not here.gripper.is_moving
        assert await call == "ControlLost halted"
        await here.holder.do(here.holder.hand.acquire())
        await here.holder.do(here.holder.hand.move(0, Finger.A, speed=255))


@inside(world)
async def test_a_halt_that_failed_is_not_counted_as_one(here: World) -> None:
    """strands-labs/robots 1680."""
    async with Fleet("lab", bus=here.network.bus("console")) as fleet:
        await move_slowly(here)
        await here.servers["left"].stop()
        await here.until(lambda: here.other.hand.state is State.DISCONNECTED)
        with pytest.raises(NotAllStoppedError) as failed:
            await fleet.halt_all()
        assert failed.value.outcomes[GripperName("lab", "cell", "right")] == "stopped"
        assert failed.value.outcomes[LEFT].startswith("refused: ")
        assert await here.other.do(ending(here.other.hand.halt())) == "ConnectionLost"
        await here.servers["left"].start()


@virtual
async def test_halting_an_empty_fleet_is_an_error() -> None:
    """strands-labs/robots 3434: an e-stop succeeded on a mesh that was not started."""
    async with world() as here, Fleet("elsewhere", bus=here.network.bus("console")) as fleet:
        with pytest.raises(NotAllStoppedError, match="no gripper"):
            await fleet.halt_all()
    with pytest.raises(RuntimeError, match="not entered"):
        await Fleet("lab", bus=here.network.bus("console")).halt_all()


@inside(world)
async def test_a_halt_of_all_names_what_it_did_not_reach(here: World) -> None:
    """An endpoint of its route was down, and "all" of the others stopped."""
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


@inside(world)
async def test_a_halt_of_all_looks_on_for_links_that_come_up_late(here: World) -> None:
    """It knew nothing of agents whose links came up after it had looked; another client watches."""
    async with Fleet(bus=here.network.bus("screen")) as screen:
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


@inside(world)
async def test_a_halt_is_acknowledged_however_slowly(here: World) -> None:
    """A round trip that is longer than the time between two attempts."""
    async with Fleet("lab", bus=here.network.bus("console")) as fleet:
        await move_slowly(here)
        for name in ("other", "console"):
            here.network.delay(name, "agent", 0.4)
        await here.other.do(here.other.hand.halt())
        assert set((await fleet.halt_all()).values()) == {"stopped"}


@inside(lab)
async def test_an_answer_to_another_request_confirms_no_halt(here: Lab) -> None:
    bus: Any = Garbling(here.network.bus("console"), to="robotiq/v1/lab/cell/right")
    bus.verb = "/halt"
    async with Fleet("lab", bus=bus) as fleet:
        with pytest.raises(NotAllStoppedError) as failed:
            await fleet.halt_all()
    assert "another answer came; halt may have been carried out" in failed.value.outcomes[LEFT]


@inside(world)
async def test_commands_before_a_halt_are_not_written_after_it(here: World) -> None:
    hand = here.holder.hand
    here.network.delay("holder", "agent", 0.05)

    async def loop_and_halt() -> None:
        for number in range(40):  # more than may run at a time: the last ones wait
            hand.command(Finger.A, position=200 + number, speed=0)
            await asyncio.sleep(0.002)
        await hand.halt()

    await here.holder.do(loop_and_halt())
    writes = len(here.gripper.writes)
    await asyncio.sleep(1)
    assert not here.gripper.is_moving
    assert not motions(here, writes)


@inside(lab)
async def test_a_halt_that_was_denied_is_not_called_lost_because_the_last_copy_had_no_time(here: Lab) -> None:
    """On a busy machine a reader's halt ended as a lost connection: the last attempt had 9 ms."""
    bus = Denying(here.network.bus("client"))
    async with here.client_over(bus, control=False) as hand:
        with pytest.raises(NotAllowedError, match="access denied"):
            await hand.halt()
    assert bus.copies > 3


class Denying(Between):
    """A bus whose halts get an empty answer at once, as access rules give it, and at last none in time."""

    copies = 0

    def ask(self, key: str, payload: bytes, *, timeout: float, **how: Any) -> asyncio.Future[BusReply | None]:
        if not key.endswith("/halt"):
            return self._bus.ask(key, payload, timeout=timeout, **how)
        self.copies += 1
        return asyncio.ensure_future(self._nothing(0.0 if timeout > 0.2 else timeout))

    async def _nothing(self, after: float) -> None:
        await asyncio.sleep(after)


@inside(lab)
async def test_a_halt_whose_copies_are_lost_is_sent_until_one_arrives(here: Lab, hand: RemoteHand) -> None:
    bus = Spoiling(here.network.bus("panel"), "/halt", times=3)
    async with here.client_over(bus, control=False) as panel:
        await here.moving(hand)
        began = here.network.loop.time()
        await panel.halt()
        assert not here.gripper.is_moving
        assert here.network.loop.time() - began < 1.5


# -- unattended motion -------------------------------------------------------------------------------------


async def cut_off(hand: RemoteHand) -> None:
    """Begin a slow move, and cancel it on its way."""
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.3):
            await hand.move(255, Finger.A, speed=0)


@inside(world)
async def test_moving_axes_are_held_once_the_gripper_is_reached_again(here: World) -> None:
    """The lease ends while the agent has lost its gripper, which moves on to its target."""
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


@inside(lab)
async def test_a_refused_command_does_not_forget_the_hold_that_is_owed(here: Lab) -> None:
    """It was forgotten before the command was known to be carried out, and a dead holder's fingers ran on."""
    async with here.client("gone") as gone, here.client("other", control=False) as other:
        await here.moving(gone)
        await here.server.stop()
        here.network.cut(("gone", "agent"), ("agent", "gone"))
        await asyncio.sleep(1.2)
        await other.acquire()
        with pytest.raises(RobotiqError):
            await other.set_speed(10)
        await here.server.start()
        await asyncio.sleep(1.0)
        assert not here.gripper.is_moving


@inside(lab)
@pytest.mark.parametrize("lost", [1, 1_000_000])
async def test_a_cancelled_move_is_called_off_although_that_was_lost(here: Lab, lost: int) -> None:
    """It was sent once, and the fingers ran on under a lease that was renewed."""
    bus = Spoiling(here.network.bus("client"), "cmd/cancel", times=lost)
    async with here.client_over(bus) as hand:
        await cut_off(hand)
        await asyncio.sleep(2.5)
        assert not here.gripper.is_moving
        assert here.gripper.position(Finger.A) < 220


@inside(lab)
@pytest.mark.parametrize(
    "way", ["cancelled first", "taken over first", "held", "while the answer is on its way"]
)
async def test_a_cancelled_move_whose_axis_is_taken_over_does_not_go_on_with_the_others(
    here: Lab, way: str
) -> None:
    """The agent had nothing left to cancel: its move had failed, and the client never saw that."""
    here.network.delay("client", "agent", 0.05)
    async with here.client() as hand:
        moving = asyncio.create_task(hand.move(255, Finger.ABC, speed=0))
        await until(lambda: here.gripper.is_moving)
        if way == "cancelled first":
            moving.cancel()
        if way == "held":
            taking = asyncio.create_task(hand.hold(Finger.C))
        else:
            taking = asyncio.create_task(hand.set_position(40, Finger.C))
            hand.command(Finger.B, position=50)
        await asyncio.sleep(0.075 if way == "while the answer is on its way" else 0)
        moving.cancel()
        await asyncio.wait({moving, taking})
        assert moving.cancelled()
        await asyncio.sleep(5)
        assert here.gripper.position(Finger.A) < 50
        assert way == "held" or abs(here.gripper.position(Finger.B) - 50) <= 2
        assert way == "held" or abs(here.gripper.position(Finger.C) - 40) <= 2


@inside(lab)
async def test_a_cancelled_move_is_called_off_although_that_was_misrouted(here: Lab) -> None:
    """Any refusal counted as the end of the lease, and the fingers ran on under one that was renewed."""
    answer = AgentAnswer("robotiq/v1/lab/cell/right", 3, 1, {}).pack()
    bus = Spoiling(here.network.bus("client"), "cmd/cancel", times=1, answer=answer)
    async with here.client_over(bus) as hand:
        await cut_off(hand)
        await asyncio.sleep(0.2)
        assert not here.gripper.is_moving
        assert hand.is_in_control


@inside(lab)
async def test_a_move_whose_answer_was_anothers_is_called_off(here: Lab) -> None:
    answer = AgentAnswer("robotiq/v1/lab/cell/right", 3, 1, {}).pack()
    bus = Spoiling(here.network.bus("client"), "cmd/move", answer=answer, sends=True)
    async with here.client_over(bus) as hand:
        with pytest.raises(AgentError, match="another answer"):
            await hand.move(255, Finger.A, speed=0)
        await asyncio.sleep(0.5)
        assert not here.gripper.is_moving


# -- kept grips --------------------------------------------------------------------------------------------


@inside(lab)
async def test_a_grip_is_kept_by_a_hand_that_was_made_for_it(here: Lab) -> None:
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


@inside(lab)
async def test_a_grip_is_kept_when_the_lease_is_given_back(here: Lab, hand: RemoteHand) -> None:
    here.gripper.place_object(Finger.ABC, 100)
    await hand.close()
    await hand.release(keep_grip=True)
    assert here.gripper.grips == Finger.ABC
    await hand.acquire()
    await hand.release()
    assert not here.gripper.grips


@pytest.mark.parametrize("turns", range(1, 30, 4))
@inside(lab)
async def test_a_grip_is_kept_by_an_agent_whose_loop_is_held_up(
    here: Lab, hand: RemoteHand, turns: int
) -> None:
    """The time to come to rest passed with the block: the fingers were halted, and the part was dropped."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    here.gripper.place_object(Finger.ABC, 100)
    await hand.close()
    loop.after_turns(turns, lambda: loop.hold_up(0.8))
    await hand.release(keep_grip=True)
    assert here.gripper.grips == Finger.ABC


class Unstoppable(SimulatedGripper):
    """Its rGTO is always set, if it is to be believed."""

    def status_registers(self) -> Registers:
        block = list(super().status_registers())
        reg.gGTO.write(block, 1)
        return tuple(block)


@inside(lab, kind=Unstoppable)
async def test_a_release_whose_halt_does_not_show_says_so(here: Lab, hand: RemoteHand) -> None:
    """It gave up before the agent did, and said that there was no answer."""
    with pytest.raises(StateTimeoutError):
        await hand.release()
    await hand.acquire()
    before = here.network.loop.time()
    await hand.stop()
    assert here.network.loop.time() - before < 2.0, "the promise of a stop"


@inside(lab, kind=Restless)
async def test_axes_that_do_not_come_to_rest_are_halted(here: Lab, hand: RemoteHand) -> None:
    await hand.release(keep_grip=True)
    assert not here.local.status.go_echo


@inside(lab, kind=Restless)
async def test_axes_that_do_not_come_to_rest_are_left_to_the_next_holder(here: Lab, hand: RemoteHand) -> None:
    releasing = asyncio.create_task(hand.release(keep_grip=True))
    await asyncio.sleep(0.1)
    async with here.client("next"):
        await releasing
        assert here.local.status.go_echo


@inside(lab, keep_grip=True)
async def test_an_agent_may_keep_a_grip_at_its_own_end(here: Lab) -> None:
    here.gripper.place_object(Finger.ABC, 100)
    async with here.client(keep_grip=True) as hand:
        await hand.close()
    await here.end_agent()
    assert here.gripper.grips == Finger.ABC
