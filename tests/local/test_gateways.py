"""Gateways and firmware that serve less, or elsewhere: what they refuse is named."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator

import pytest
import pytest_asyncio

from robotiq_async import ConnectionLostError, Finger, RobotiqConnectionError, RobotiqHand, State
from robotiq_async.simulator import SimulatedGripper, SimulatorServer, Trouble
from tests.conftest import Clock
from tests.patience import patience
from tests.virtual import virtual

A = Finger.A
FOR_EVER = 1e4


@pytest_asyncio.fixture
async def gateway(clock: Clock) -> AsyncIterator[SimulatorServer]:
    async with SimulatorServer(SimulatedGripper(clock, speedup=25)) as server:
        yield server


@virtual
async def test_a_gateway_that_loses_the_first_request_of_each_connection_is_reached() -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, speedup=25)
    async with SimulatorServer(gripper) as server:
        lost = []

        def losing(reply: bytes) -> list[tuple[float, bytes]]:
            here = server.connections[-1]
            if here in lost:
                return [(0.0, reply)]
            lost.append(here)
            return []

        server.policy = losing
        async with RobotiqHand(server.address) as hand:
            await hand.move(200)
            server.cut()
            await hand.wait_for_state(State.DISCONNECTED)
            await hand.wait_for_state(State.RUNNING_IDLE, timeout=2)
            await hand.move(100)
        assert len(lost) == 2


REFUSALS = [
    (1, "illegal function"),
    (2, "illegal data address"),
    (3, "illegal data value"),
]


@pytest.mark.parametrize(("code", "means"), REFUSALS)
async def test_a_gateway_that_refuses_to_write_is_named_in_the_error(
    gateway: SimulatorServer, code: int, means: str
) -> None:
    async with RobotiqHand(gateway.address) as hand:
        await gateway.fault_injector.begin(Trouble("exception", code, on="write", lasts=FOR_EVER))
        for call in (lambda: hand.set_position(100), lambda: hand.move(100), lambda: hand.halt()):
            await hand.wait_for_state(State.RUNNING_IDLE, timeout=patience(5))
            with pytest.raises(ConnectionLostError) as caught:
                await call()
            for word in ("refuses function 16", means, "all 8 at once", "gateway"):
                assert word in str(caught.value)
        await gateway.fault_injector.end(gateway.fault_injector.ongoing[0])
        await hand.wait_for_state(State.RUNNING_IDLE, timeout=patience(5))
        await hand.move(100)


async def test_an_activation_that_is_refused_by_a_gateway_says_so(gateway: SimulatorServer) -> None:
    gateway.gripper.power_cycle()
    async with gateway.fault_injector.making(Trouble("exception", 1, on="write", lasts=FOR_EVER)):
        hand = RobotiqHand(gateway.address)
        with pytest.raises(ConnectionLostError, match="refuses function 16"):
            await hand.start()


async def test_a_command_while_the_link_is_opened_again_says_why(gateway: SimulatorServer) -> None:
    async with RobotiqHand(gateway.address) as hand:
        await gateway.fault_injector.begin(Trouble("exception", 3, on="write", lasts=0.0))
        with pytest.raises(ConnectionLostError):
            await hand.set_position(100)
        assert hand.state is State.DISCONNECTED
        with pytest.raises(ConnectionLostError, match=r"being opened again.*function 16"):
            hand.command(position=100)


async def test_a_gateway_that_writes_fewer_registers_is_named_in_the_error(gateway: SimulatorServer) -> None:
    def shorten(reply: bytes) -> list[tuple[float, bytes]]:
        return [(0.0, reply[:-1] + b"\x06" if reply[7] == 16 else reply)]

    async with RobotiqHand(gateway.address) as hand:
        gateway.policy = shorten
        with pytest.raises(ConnectionLostError, match=r"6 registers written, and not 8.*gateway"):
            await hand.set_position(100)


@pytest.mark.parametrize("unit", [0, 1, 9, 255])
async def test_any_unit_over_tcp(clock: Clock, unit: int) -> None:
    gripper = SimulatedGripper(clock, speedup=25)
    async with SimulatorServer(gripper, device_id=unit) as server:
        async with RobotiqHand(server.address, device_id=unit) as hand:
            await hand.move(200)
            assert hand.statistics.reconnects == 0
        with pytest.raises(RobotiqConnectionError):
            await RobotiqHand(server.address, device_id=7, response_timeout=0.05).start()


async def test_firmware_that_reads_with_function_3_only(gateway: SimulatorServer) -> None:
    """The simulated gripper has its status there, too, and its requests where function 3 reads at 0."""
    options = {"read_function": 3, "status_address": 2000}
    async with RobotiqHand(gateway.address, **options) as hand:  # type: ignore[arg-type]
        await hand.move(200)
        assert hand.status.position(A) == pytest.approx(200, abs=2)


async def test_a_refused_read_names_the_option(gateway: SimulatorServer) -> None:
    async with gateway.fault_injector.making(Trouble("exception", 1, on="read", lasts=FOR_EVER)):
        with pytest.raises(RobotiqConnectionError, match=r"function 4: exception 1.*read_function=3"):
            await RobotiqHand(gateway.address).start()


async def test_the_socket_is_kept_alive(gateway: SimulatorServer) -> None:
    async with RobotiqHand(gateway.address) as hand:
        await asyncio.sleep(0)
        session = hand._local.session
        assert session is not None
        wire = session.run._parts.link.dialogues.line._wire  # type: ignore[attr-defined]
        line: socket.socket = wire._client.ctx.transport.get_extra_info("socket")
        assert line.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
