"""A hand at a UR with Robotiq's URCap, in virtual time: motions, other clients, troubles."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable
from contextlib import asynccontextmanager
from typing import Any

import pytest

from robotiq_async import (
    HAND_E,
    JAW,
    TWO_FINGER_85,
    ConnectionLostError,
    InvalidStateError,
    Model,
    MoveSupersededError,
    ObjectStatus,
    ReconnectPolicy,
    RobotiqHand,
    State,
)
from robotiq_async.simulator import SimulatedGripper, SimulatorServer, Trouble, UrcapSimulatorServer
from robotiq_async.simulator.server.framing import Frame
from robotiq_async.simulator.server.urcap_server import UrcapResponder
from robotiq_async.simulator.troubles.corruption import unchanged
from tests.grippers import activate_beforehand, until_moving
from tests.virtual import VirtualLoop, until

pytestmark = pytest.mark.virtual_time


class OldUrcapServer(UrcapSimulatorServer):
    """A port that does not know COU, and says so."""

    class _responds(UrcapResponder):  # noqa: N801  # as the server names it
        def answer(self, frame: Frame) -> bytes:
            return b"?" if frame.pdu == b"GET COU" else super().answer(frame)


@asynccontextmanager
async def at_a_ur(
    model: Model = TWO_FINGER_85, kind: type[UrcapSimulatorServer] = UrcapSimulatorServer, **options: Any
) -> AsyncIterator[tuple[UrcapSimulatorServer, RobotiqHand]]:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=model)
    async with kind(gripper) as server:
        await activate_beforehand(gripper)
        async with RobotiqHand(server.address, **options) as hand:
            yield server, hand


class OtherClient:
    """Another program on the text port."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self._writer = writer

    @classmethod
    async def at(cls, server: UrcapSimulatorServer) -> OtherClient:
        return cls(*await asyncio.open_connection("127.0.0.1", server.port))

    async def says(self, line: str) -> str:
        self._writer.write(f"{line}\n".encode())
        return (await self._reader.read(100)).decode()

    def leaves(self) -> None:
        self._writer.close()


# -- motions ------------------------------------------------------------------------------------------------


async def test_a_part_is_met_and_let_go() -> None:
    async with at_a_ur() as (server, hand):
        server.gripper.place_object(JAW, 120)
        closed = await hand.close()
        assert closed.outcomes[JAW] is ObjectStatus.CONTACT_CLOSING
        assert closed.positions[JAW] == pytest.approx(120, abs=5)
        opened = await hand.open()
        assert opened.outcomes[JAW] is ObjectStatus.AT_POSITION
        assert hand.statistics.foreign_commands == 0


async def test_a_stop_on_the_way_clears_the_go() -> None:
    async with at_a_ur() as (server, hand):
        moving = asyncio.ensure_future(hand.close(speed=0))
        await until_moving(server, hand)
        await hand.halt()
        assert not hand.status.go_echo
        assert not server.gripper.is_moving
        with pytest.raises(MoveSupersededError):
            await moving


async def test_a_stream_of_commands_is_never_taken_for_those_of_another_client() -> None:
    async with at_a_ur() as (_, hand):
        for step in range(200):
            hand.command(position=step, speed=255)
            await asyncio.sleep(0.008)
        await hand.halt()
        assert hand.statistics.foreign_commands == 0


async def test_a_command_is_not_lost_because_the_loop_is_held_up_after_it() -> None:
    """An answer from before the block, read after it, did not show the SET half a second later."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    async with at_a_ur() as (server, hand), server.fault_injector.making(Trouble("slow-device", 0.05)):
        for turn in range(1, 16):
            loop.after_turns(turn, lambda: loop.hold_up(0.6))
            await hand.move(100 if turn % 2 else 50, speed=255)
        assert hand.statistics.reconnects == 0


# -- a command that the URCap takes one variable after the other ---------------------------------------------

SPACINGS = [0.0005, 0.003, 0.01, 0.03]


@pytest.mark.parametrize("spacing", SPACINGS)
async def test_what_is_taken_one_by_one_is_ours(spacing: float) -> None:
    async with at_a_ur() as (server, hand), server.fault_injector.making(Trouble("one-by-one", spacing)):
        server.gripper.place_object(JAW, 180)
        await hand.move(100)
        moving = asyncio.ensure_future(hand.close(speed=0))
        for stop in (hand.halt, hand.hold, hand.open):
            await until_moving(server, hand)
            await stop()
            with pytest.raises(MoveSupersededError):
                await moving
            moving = asyncio.ensure_future(hand.close(speed=0))
        assert (await moving).contacts == JAW
        await hand.reset()
        await hand.activate()
        await hand.move(20)
        assert hand.statistics.foreign_commands == 0


@pytest.mark.parametrize("spacing", SPACINGS[:2])
async def test_a_stream_that_is_taken_one_by_one_is_ours(spacing: float) -> None:
    async with at_a_ur() as (server, hand), server.fault_injector.making(Trouble("one-by-one", spacing)):
        for step in range(100):
            hand.command(position=2 * step, speed=255, force=step)
            await asyncio.sleep(5 * spacing)
        await hand.halt()
        assert hand.statistics.foreign_commands == 0


# -- a SET that is acknowledged and lost ---------------------------------------------------------------------

DELAYS = [0.0, 0.05, 0.1, 0.3]
"""Seconds before the link is opened again; control knows a write for half a second."""


async def fails_by_a_lost_set(
    server: UrcapSimulatorServer, hand: RobotiqHand, call: Awaitable[object]
) -> None:
    """The SET of a call is lost; it has failed, and the link is back."""
    async with server.fault_injector.making(Trouble("lost-set")):
        calling = asyncio.ensure_future(call)
        await asyncio.sleep(0.1)
    with pytest.raises(ConnectionLostError):
        await calling
    await hand.wait_for_state(State.RUNNING_IDLE)


async def stands_still(server: UrcapSimulatorServer, seconds: float, *, within: int) -> None:
    """The jaw is held by now, and stays there within some counts."""
    await asyncio.sleep(0.1)
    held_at = server.gripper.position(JAW)
    await asyncio.sleep(seconds)
    assert abs(server.gripper.position(JAW) - held_at) <= within


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize("call", ["set_speed", "set_force"])
async def test_a_motion_that_was_lost_is_not_sent_again_with_a_speed_or_a_force(
    call: str, delay: float
) -> None:
    async with at_a_ur(reconnect=ReconnectPolicy(first_delay=delay)) as (server, hand):
        await hand.move(100)
        await fails_by_a_lost_set(server, hand, hand.move(200))
        await getattr(hand, call)(9)
        await asyncio.sleep(1.0)
        assert server.gripper.position(JAW) == pytest.approx(100, abs=2)


@pytest.mark.parametrize("delay", DELAYS)
async def test_a_hold_that_was_acknowledged_and_lost_is_written_once_the_link_is_back(delay: float) -> None:
    """Its caller has heard that it was acknowledged, 0.4 s before the link was found lost."""
    async with at_a_ur(reconnect=ReconnectPolicy(first_delay=delay)) as (server, hand):
        hand.command(position=255, speed=0)
        await until_moving(server, hand)
        async with server.fault_injector.making(Trouble("lost-set")):
            await hand.hold()
            await asyncio.sleep(0.1)
        await hand.wait_for_state(State.DISCONNECTED)
        await hand.wait_for_state(State.RUNNING_IDLE)
        await stands_still(server, 2.0, within=3)


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize("call", ["halt", "reset"])
async def test_in_place_of_a_stop_that_was_lost_the_jaw_is_held(call: str, delay: float) -> None:
    async with at_a_ur(reconnect=ReconnectPolicy(first_delay=delay)) as (server, hand):
        hand.command(position=255, speed=0)
        await until_moving(server, hand)
        await fails_by_a_lost_set(server, hand, getattr(hand, call)())
        await stands_still(server, 0.5, within=0)


# -- other clients -------------------------------------------------------------------------------------------


async def test_a_set_of_another_client_takes_over_as_it_does_over_modbus() -> None:
    async with at_a_ur() as (server, hand):
        moving = asyncio.ensure_future(hand.close(speed=0))
        await until_moving(server, hand)
        other = await OtherClient.at(server)
        assert await other.says("SET POS 30 SPE 255 FOR 10 GTO 1") == "ack"
        with pytest.raises(MoveSupersededError):
            await moving
        assert hand.statistics.foreign_commands == 1
        assert hand.status.requested_position(JAW) == 30
        other.leaves()


async def test_a_go_that_another_client_clears_is_seen() -> None:
    async with at_a_ur() as (server, hand):
        moving = asyncio.ensure_future(hand.close(speed=0))
        await until_moving(server, hand)
        other = await OtherClient.at(server)
        assert await other.says("SET GTO 0") == "ack"
        with pytest.raises(MoveSupersededError):
            await moving
        other.leaves()


async def test_an_active_gripper_is_adopted_with_what_it_was_asked_for() -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=HAND_E)
    async with UrcapSimulatorServer(gripper) as server:
        await activate_beforehand(gripper)
        other = await OtherClient.at(server)
        assert await other.says("SET POS 100 SPE 255 FOR 0 GTO 1") == "ack"
        await until(lambda: gripper.is_moving)
        await until(lambda: not gripper.is_moving)
        assert await other.says("GET OBJ") == "OBJ 3\n"
        writes = len(gripper.writes)
        async with RobotiqHand(server.address) as hand:
            assert hand.state is State.RUNNING_IDLE
            assert hand.status.requested_position(JAW) == 100
            assert len(gripper.writes) == writes
        other.leaves()


async def test_two_hands_on_one_urcap_need_the_ids_of_their_grippers() -> None:
    async with at_a_ur() as (server, _):
        with pytest.raises(
            InvalidStateError, match="two grippers behind one URCap: give each of the hands its"
        ):
            await RobotiqHand(server.address).start(activate=False)


async def test_the_gripper_that_was_asked_for_is_chosen() -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=HAND_E)
    async with UrcapSimulatorServer(gripper, device_id=3) as server:
        await activate_beforehand(gripper)
        async with RobotiqHand(server.address, device_id=3) as hand:
            await hand.close()
        with pytest.raises(Exception, match="the URCap does not choose gripper 2"):
            await RobotiqHand(server.address, device_id=2).start(activate=False)


# -- troubles ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("pause", [0.0, 0.02, 0.1])
@pytest.mark.parametrize("cycle", [0.05, 0.1, 0.2])
async def test_an_activation_that_was_not_acknowledged_is_taken_back(cycle: float, pause: float) -> None:
    """The connection ends in place of the acknowledgement, and the gripper is slow: it shows nothing yet."""
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=TWO_FINGER_85)
    async with UrcapSimulatorServer(gripper) as server:
        await server.fault_injector.begin(Trouble("slow-device", cycle))
        hand = RobotiqHand(server.address)
        await hand.start(activate=False)
        server.policy = lambda reply: None if reply == b"ack" else unchanged(reply)
        with pytest.raises(ConnectionLostError):
            await hand.activate()
        server.policy = unchanged
        await asyncio.sleep(pause)
        await hand.stop()
        await asyncio.sleep(cycle)  # the stop acts
        assert not gripper.is_moving
        travel = gripper.travel(JAW)
        await asyncio.sleep(20)
        assert gripper.travel(JAW) == travel


@pytest.mark.parametrize(
    "words", ["reset", "close", "accept-silence", "refuse", "silence", "half", "drop", "late", "twice"]
)
async def test_it_comes_back(words: str) -> None:
    async with at_a_ur() as (server, hand):
        lasting = {"lasts": 3.0} if words in ("accept-silence", "refuse", "silence") else {}
        ongoing = await server.fault_injector.begin(Trouble(words, **lasting))  # type: ignore[arg-type]
        await hand.wait_for_state(State.DISCONNECTED, timeout=5)
        await server.fault_injector.end(ongoing)
        await hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
        await hand.move(100)


async def test_slow_answers_make_a_slow_hand_and_no_lost_one() -> None:
    """A controller that takes 4 ms a question: some 60 statuses a second, and motions that end."""
    async with at_a_ur() as (server, hand):
        await server.fault_injector.begin(Trouble("delay", 0.004))
        before = hand.statistics
        await hand.close()
        await hand.open()
        after = hand.statistics
        assert after.reconnects == 0
        assert after.overruns == before.overruns, "a link that is the limit misses no poll"
        assert after.round_trip_p50 == pytest.approx(0.0044, abs=0.001)


async def test_answers_in_pieces_are_answers() -> None:
    async with at_a_ur() as (server, hand):
        await server.fault_injector.begin(Trouble("pieces"))
        await hand.close()
        assert hand.statistics.reconnects == 0


async def test_a_proxy_that_delivers_late_is_noticed() -> None:
    async with at_a_ur() as (server, hand):
        before = hand.status
        async with server.fault_injector.making(Trouble("multiplexer", 0.5)):
            await hand.wait_for_state(State.DISCONNECTED, timeout=5)
            server.gripper.place_object(JAW, 200)
            await asyncio.sleep(10)
            assert hand.state is State.DISCONNECTED
            assert hand.status == before, "none of its answers became a status"
        await hand.wait_for_state(State.RUNNING_IDLE, timeout=20)


@pytest.mark.parametrize("words", ["wrong-checksum", "wrong-transaction", "exception", "function-3-only"])
async def test_troubles_of_modbus_do_not_fit(words: str) -> None:
    async with UrcapSimulatorServer() as server:
        with pytest.raises(ValueError, match=f"{words} does not fit a simulator on urcap"):
            await server.fault_injector.begin(Trouble(words))


def test_a_urcap_has_no_3_finger() -> None:
    with pytest.raises(ValueError, match="a URCap has a 2F-85, 2F-140 or Hand-E, got a 3-Finger"):
        UrcapSimulatorServer(SimulatedGripper())


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("GET POS", "POS 3\n"),
        ("GET  FLT ", "FLT 00\n"),
        ("GET SID", "SID [9]\n"),
        ("SET SID 9", "ack"),
        ("SET SID 2", "?"),
        ("SET  POS 12", "ack"),
        ("SET POS 256", "?"),
        ("SET POS", "?"),
        ("SET POS -1", "?"),
        ("SET OBJ 1", "?"),
        ("GET", "?"),
        ("GET NON", "?"),
        ("", "?"),
        ("\xff", "?"),
    ],
)
async def test_the_lines_of_the_simulator(line: str, answer: str) -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, spread=False, model=TWO_FINGER_85)
    async with UrcapSimulatorServer(gripper) as server:
        await activate_beforehand(gripper)
        other = await OtherClient.at(server)
        assert await other.says(line) == answer
        other.leaves()


async def test_a_modbus_server_is_no_urcap() -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=TWO_FINGER_85)
    async with SimulatorServer(gripper) as server:
        address = server.address.replace("tcp://", "urcap://")
        with pytest.raises(Exception, match="cannot connect to urcap://"):
            await RobotiqHand(address).start(activate=False)
