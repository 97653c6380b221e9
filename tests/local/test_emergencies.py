"""halt() and reset() are heard in every state of a hand that has its link."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import (
    ConnectionLostError,
    Fault,
    InvalidStateError,
    NotActivatedError,
    ReconnectPolicy,
    RobotiqHand,
    State,
)
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.enums import Trigger
from robotiq_async.values.model import MODELS
from robotiq_async.values.registers import Registers
from robotiq_async.values.request import Request
from robotiq_async.values.states import SEQUENCES
from tests.conftest import Clock
from tests.fake_transport import Wire
from tests.grippers import lose_link, until_moving
from tests.virtual import VirtualLoop

pytestmark = pytest.mark.virtual_time


async def reach(hand: RobotiqHand, state: State) -> asyncio.Task[None]:
    """Begin what leads to a state, and return the task that does it once the hand is there."""
    gripper = {State.DO_ACTIVATION: hand.activate, State.WF_ACTIVATION: hand.activate}
    release = {State.DO_ATR: hand.atr, State.WF_ATR: hand.atr}
    ask = (gripper | release).get(state, hand.reset)
    transitions = hand.transitions()
    task = asyncio.create_task(ask())
    async for transition in transitions:
        if transition.target is state:
            return task
    raise AssertionError("the hand ended")


@pytest.mark.parametrize("emergency", ["halt", "reset"])
@pytest.mark.parametrize("state", sorted(SEQUENCES, key=str), ids=str)
@pytest.mark.parametrize("delay", [0.0, 0.02], ids=["quick", "slow"])
async def test_an_emergency_ends_every_sequence(
    server: SimulatorServer, gripper: SimulatedGripper, state: State, emergency: str, delay: float
) -> None:
    """In DO_ACTIVATION and DO_ATR both were refused, and the fingers moved on."""
    hand = RobotiqHand(server.address)
    releasing = state in (State.DO_ATR, State.WF_ATR)
    await hand.start(activate=releasing)
    if releasing:
        gripper.inject_fault(Fault.SCISSOR_BLOCKED)
        await hand.wait_for_state(State.FAULT)
    server.policy = lambda frame: [(delay, frame)]
    asking = await reach(hand, state)
    await getattr(hand, emergency)()
    assert hand.state is State.RESET
    assert not gripper.is_moving
    assert not Request.from_registers(gripper.request_registers).activate
    if state in (State.DO_RESET, State.WF_RESET):
        await asking
    else:
        with pytest.raises((NotActivatedError, InvalidStateError)):
            await asking
    await hand.stop()


async def test_halts_and_resets_at_once_all_end(hand: RobotiqHand, gripper: SimulatedGripper) -> None:
    await hand.set_position(255)
    await asyncio.gather(hand.reset(), hand.halt(), hand.reset(), hand.halt())
    assert hand.state is State.RESET
    assert not gripper.is_moving


async def begun_release(hand: RobotiqHand, gripper: SimulatedGripper) -> asyncio.Task[None]:
    """A call of atr() in a fault."""
    gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    await hand.wait_for_state(State.FAULT)
    return asyncio.create_task(hand.atr())


async def test_a_release_ended_by_an_activation_of_another_client_fails_at_once(
    hand: RobotiqHand, gripper: SimulatedGripper, clock: Clock
) -> None:
    """It waited out its 60 s when the reset fell between two polls."""
    releasing = await begun_release(hand, gripper)
    async for status in hand.statuses():
        if status.fault is Fault.AUTOMATIC_RELEASE:
            break
    for word in (0x0000, 0x0100):
        gripper.write(0, [word])
        clock.ahead += 0.02
        gripper.status_registers()
    async with asyncio.timeout(2):
        with pytest.raises(NotActivatedError, match="reset during the release"):
            await releasing
    assert hand.state in (State.WF_ACTIVATION, State.RUNNING_IDLE)


@pytest.mark.parametrize("how", ["reset", "halt"])
async def test_a_release_that_was_ended_from_here_says_by_what(
    hand: RobotiqHand, gripper: SimulatedGripper, how: str
) -> None:
    releasing = await begun_release(hand, gripper)
    await hand.wait_for_state(State.WF_ATR)
    await (hand.reset() if how == "reset" else hand.halt())
    with pytest.raises(InvalidStateError, match="took over"):
        await releasing


async def test_a_halt_in_the_first_activation_ends_the_start(
    server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    hand = RobotiqHand(server.address)
    transitions = hand.transitions()
    starting = asyncio.create_task(hand.start())
    async for transition in transitions:
        if transition.target is State.DO_ACTIVATION:
            break
    await hand.halt()
    with pytest.raises(NotActivatedError):
        await starting
    assert not gripper.is_moving
    await hand.stop()


# -- recover() ends with the link ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "fault", [Fault.COMMUNICATION_NOT_READY, Fault.SCISSOR_INTERFERENCE], ids=lambda f: f.name
)
async def test_a_recovery_that_waits_for_a_minor_fault_ends_with_the_link(
    hand: RobotiqHand, server: SimulatorServer, gripper: SimulatedGripper, fault: Fault
) -> None:
    """It waited up to its 90 s: the stream it listened to waits out a lost link."""
    gripper.inject_fault(fault)
    await hand.wait_for_state(State.FAULT)
    recovering = asyncio.create_task(hand.recover())
    await anext(hand.statuses())
    assert not recovering.done()
    server.refuse()
    server.cut()
    async with asyncio.timeout(2):
        with pytest.raises(ConnectionLostError):
            await recovering


async def test_a_recovery_that_waits_for_a_sequence_ends_with_the_link(
    hand: RobotiqHand, server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    await hand.reset()
    activating = asyncio.create_task(hand.activate())
    await hand.wait_for_state(State.WF_ACTIVATION)
    recovering = asyncio.create_task(hand.recover())
    await anext(hand.statuses())
    server.refuse()
    server.cut()
    async with asyncio.timeout(2):
        for task in (activating, recovering):
            with pytest.raises(ConnectionLostError):
                await task


# -- a stop goes out before the next read -------------------------------------------------------------------


class Watched(Wire):
    """Notes the requests to the gripper."""

    def __init__(self) -> None:
        super().__init__(speedup=20)
        self.asked: list[str] = []
        self.holds_up = 0.0
        """Seconds for which the next read keeps the loop, as a careless driver does."""

    def shown(self) -> Registers:
        self.asked.append("read")
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        loop.hold_up(self.holds_up)
        self.holds_up = 0.0
        return super().shown()

    def take(self, registers: Registers) -> None:
        request = Request.from_registers(registers)
        self.asked.append("go" if request.go else "halt" if request.activate else "reset")
        super().take(registers)


@pytest.mark.parametrize("stop", ["halt", "reset", "stop"])
async def test_a_stop_is_written_before_the_next_read(stop: str) -> None:
    """The gripper may hear without being heard: a read that fails first would keep the stop from it."""
    wire = Watched()
    async with RobotiqHand(wire) as hand:
        await hand.set_position(255)
        await anext(hand.statuses())
        wire.asked.clear()
        await getattr(hand, stop)()
        assert wire.asked[0] == ("reset" if stop == "reset" else "halt")
        assert not wire.gripper.is_moving


async def test_a_stop_over_a_new_link_does_not_activate_a_gripper_that_lost_its_power(
    server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    """It was written on the status from before: rACT was still set there."""
    hand = RobotiqHand(server.address, reconnect=ReconnectPolicy(first_delay=5.0))
    await hand.start()
    await hand.set_position(255)
    await lose_link(server, hand)
    gripper.power_cycle()
    writes = len(gripper.writes)
    await server.accept()
    await hand.stop()
    assert not [write for write in gripper.writes[writes:] if write.registers[0] & 0x0100]
    assert not gripper.is_moving


async def test_a_hand_that_stops_without_a_link_does_not_say_that_nothing_moves(
    server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    """It said so in an activation that went on: its last status counted as if the link were there."""
    hand = RobotiqHand(server.address, reconnect=ReconnectPolicy(first_delay=5.0))
    await hand.start(activate=False)
    activating = asyncio.create_task(hand.activate())
    await until_moving(server, hand)
    await lose_link(server, hand)
    stopping = asyncio.create_task(hand.stop())
    await asyncio.sleep(0.01)
    assert hand.state is State.DO_SHUTDOWN
    assert gripper.is_moving
    with pytest.raises(ConnectionLostError):
        hand.is_moving  # noqa: B018
    await asyncio.gather(activating, stopping, return_exceptions=True)


async def test_a_loop_that_is_held_up_is_not_held_up_more_by_reading_again() -> None:
    """With nothing to write an old status does no harm; 96 hands in a loop lost 6 % of their polls."""
    wire = Watched()
    async with RobotiqHand(wire, poll_interval=0.1) as hand:
        stream = hand.statuses(buffer=10)
        await anext(stream)
        wire.holds_up = 0.13  # over the next tick, which is missed
        held, missed, after = [(await anext(stream)).timestamp for _ in range(3)]
    assert missed - held < 0.04, "the tick that was missed"
    assert after - missed > 0.04, "the tick after it"


@pytest.mark.parametrize("emergency", ["halt", "reset"])
async def test_a_stop_does_not_wait_for_the_next_poll(
    server: SimulatorServer, gripper: SimulatedGripper, emergency: str
) -> None:
    async with RobotiqHand(server.address, poll_interval=0.1) as hand:
        await hand.set_speed(0)
        await hand.set_position(255)
        while not gripper.is_moving:  # noqa: ASYNC110  # there is no event to wait for
            await asyncio.sleep(0.001)
        await anext(hand.statuses())
        async with asyncio.TaskGroup() as group:
            group.create_task(getattr(hand, emergency)())
            await asyncio.sleep(0.01)
            assert not gripper.is_moving, "a tenth of the interval later"


# -- a halt where rGTO = 0 ends nothing --------------------------------------------------------------------


async def halted_for_good(hand: RobotiqHand, gripper: SimulatedGripper) -> None:
    """Halt while the fingers move; from then on no axis does."""
    async with asyncio.timeout(5):
        while not gripper.is_moving:  # noqa: ASYNC110  # there is no event to wait for
            await asyncio.sleep(0.1)
    assert hand.is_moving
    await hand.halt()
    assert hand.state is State.RESET
    assert not gripper.is_moving
    before = [gripper.travel(axis) for axis in gripper.model.axes]
    await asyncio.sleep(15)
    assert [gripper.travel(axis) for axis in gripper.model.axes] == before
    assert not hand.is_moving


@pytest.mark.parametrize("model", ["3f", "2f85", "hand-e"])
async def test_a_halt_ends_an_emergency_release(model: str) -> None:
    """It returned as done, and the fingers opened on."""
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=MODELS[model])
    async with (
        SimulatorServer(port=0, gripper=gripper) as server,
        RobotiqHand(server.address, model=model) as hand,
    ):
        await hand.close()
        transitions = hand.transitions()
        gripper.emergency_release()
        await hand.wait_for_state(State.FAULT)
        await halted_for_good(hand, gripper)
        changes = [await anext(transitions) for _ in range(2)]
        assert changes[-1].target is State.DO_RESET
        assert changes[-1].trigger is Trigger.HALT_RESETS


@pytest.mark.parametrize("what", ["activation", "release"])
async def test_a_halt_ends_what_another_client_has_begun(what: str) -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time)
    async with SimulatorServer(port=0, gripper=gripper) as server, RobotiqHand(server.address) as hand:
        await hand.close()
        image = gripper.request_registers
        if what == "activation":
            gripper.write(0, [0x0000])
            await hand.wait_for_state(State.RESET)
            gripper.write(0, [0x0100])
            await hand.wait_for_state(State.WF_ACTIVATION)
        else:
            gripper.write(0, (image[0] | 0x1000, *image[1:]))
            await hand.wait_for_state(State.FAULT)
        await halted_for_good(hand, gripper)
