"""The hand at a serial server: RTU frames in a TCP socket, in virtual time."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import (
    TWO_FINGER_85,
    ConnectFailedError,
    ConnectionLostError,
    Finger,
    InvalidStateError,
    RobotiqHand,
    State,
)
from robotiq_async.simulator import RtuOverTcpSimulatorServer, SimulatedGripper, Trouble
from tests.grippers import activate_beforehand

pytestmark = pytest.mark.virtual_time

A = Finger.A


async def test_a_move_through_a_serial_server() -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time)
    async with RtuOverTcpSimulatorServer(gripper) as server, RobotiqHand(server.address) as hand:
        result = await hand.move(200)
        assert result.positions[A] == pytest.approx(200, abs=2)
        assert hand.statistics.reconnects == 0
        assert hand.statistics.period_p50 == pytest.approx(0.005, abs=1e-6)


@pytest.mark.parametrize("words", ["reset", "close", "accept-silence", "refuse", "silence", "wrong-checksum"])
async def test_it_comes_back(words: str) -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time)
    async with RtuOverTcpSimulatorServer(gripper) as server:
        await activate_beforehand(gripper)
        async with RobotiqHand(server.address) as hand:
            lasting = {} if words in ("reset", "close") else {"lasts": 3.0}
            ongoing = await server.fault_injector.begin(Trouble(words, **lasting))  # type: ignore[arg-type]
            await hand.wait_for_state(State.DISCONNECTED, timeout=5)
            await server.fault_injector.end(ongoing)
            await hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
            await hand.move(100, A)


@pytest.mark.parametrize("units", [(None, None), (9, None), (None, 12)])
async def test_a_serial_server_has_one_owner_unless_both_name_their_units(
    units: tuple[int | None, int | None],
) -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time)
    async with RtuOverTcpSimulatorServer(gripper) as server:
        one = RobotiqHand(server.address, device_id=units[0])
        await one.start(activate=False)
        with pytest.raises(InvalidStateError, match="give each of the hands its device_id"):
            await RobotiqHand(server.address, device_id=units[1]).start(activate=False)
        await one.stop()


async def test_a_socket_carries_one_protocol() -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time)
    async with RtuOverTcpSimulatorServer(gripper) as server:
        one = RobotiqHand(server.address, device_id=9)
        await one.start(activate=False)
        with pytest.raises(InvalidStateError):
            await RobotiqHand(server.address.removeprefix("rtu+"), device_id=12).start(activate=False)
        await one.stop()


# -- links as they were recorded -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "least", "usual", "most"),
    [("uneven-delay", 0.010, 0.035, 0.260), ("latency-timer", 0.013, 0.016, 0.020)],
)
async def test_a_slow_link_whose_delay_varies_costs_no_move(
    words: str, least: float, usual: float, most: float
) -> None:
    """Serial servers took 20 to 60 ms, and up to 260; an adapter's timer ends every 16 ms."""
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=TWO_FINGER_85)
    async with RtuOverTcpSimulatorServer(gripper) as server:
        await server.fault_injector.begin(Trouble(words))
        async with RobotiqHand(server.address) as hand:
            for position in (200, 20, 120, 60):
                assert (await hand.move(position, speed=60)).positions[A] == pytest.approx(position, abs=3)
            statistics = hand.statistics
    assert statistics.reconnects == 0
    assert least <= statistics.round_trip_p50 <= 1.3 * usual
    assert statistics.round_trip_p99 <= most + 0.01


async def test_a_first_request_that_is_lost_costs_its_time_at_each_connection() -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=TWO_FINGER_85)
    async with RtuOverTcpSimulatorServer(gripper) as server:
        lost = await server.fault_injector.begin(Trouble("first-lost"))
        async with RobotiqHand(server.address) as hand:
            server.cut()
            await hand.wait_for_state(State.DISCONNECTED, timeout=5)
            await hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
            await hand.move(100)
    assert lost.hits == 2


async def test_a_forwarder_that_keeps_its_old_connection_is_waited_for() -> None:
    """One at a tool port did so for 30 to 45 s."""
    loop = asyncio.get_running_loop()
    gripper = SimulatedGripper(loop.time, model=TWO_FINGER_85)
    async with RtuOverTcpSimulatorServer(gripper) as server:
        await server.fault_injector.begin(Trouble("old-connection"))
        async with RobotiqHand(server.address) as hand:
            await hand.move(200)
            server.cut()
            cut_at, written = loop.time(), len(gripper.writes)
            await hand.wait_for_state(State.DISCONNECTED, timeout=5)
            with pytest.raises(ConnectionLostError):
                await hand.move(100)
            await hand.wait_for_state(State.RUNNING_IDLE, timeout=60)
            assert 30 <= loop.time() - cut_at < 40
            assert len(gripper.writes) == written, "nothing that was asked meanwhile comes later"
            await hand.move(100)
        # A program that starts again at once meets its own old connection.
        with pytest.raises(ConnectFailedError):
            await RobotiqHand(server.address).start()
