"""Both sides against other implementations of Modbus: pymodbus, and one that shares no code with it."""

from __future__ import annotations

import asyncio
import socket
import time

import pytest
from pymodbus import FramerType
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice
from pyModbusTCP.client import ModbusClient
from pyModbusTCP.server import DataBank, ModbusServer

from robotiq_async import Finger, RobotiqHand, State
from robotiq_async.link.address import parse_address
from robotiq_async.link.modbus import ModbusTransport
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.registers import TCP_REGISTERS
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus

A = Finger.A


class GripperBank(DataBank):  # type: ignore[misc]  # pyModbusTCP is untyped
    """Another implementation's registers, with a simulated gripper behind them."""

    def __init__(self, gripper: SimulatedGripper) -> None:
        super().__init__()
        self.gripper = gripper

    def get_input_registers(self, address: int, number: int = 1, *_: object) -> list[int] | None:
        if address + number > 8:
            return None
        return list(self.gripper.status_registers()[address : address + number])

    def set_holding_registers(self, address: int, word_list: list[int], *_: object) -> bool | None:
        if address + len(word_list) > 8:
            return None
        self.gripper.write(address, word_list)
        return True


async def test_the_hand_with_a_server_that_is_not_pymodbus() -> None:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    gripper = SimulatedGripper(speedup=20)
    gripper.place_object(A, 150)
    server = ModbusServer("127.0.0.1", port, no_block=True, data_bank=GripperBank(gripper))
    server.start()
    try:
        async with RobotiqHand(f"127.0.0.1:{port}") as hand:
            assert hand.state is State.RUNNING_IDLE
            result = await hand.close()
            assert result.contacts == A
            assert result.positions[Finger.B] >= 240
            assert hand.statistics.reconnects == 0
    finally:
        server.stop()


@pytest.mark.parametrize("framer", [FramerType.SOCKET, FramerType.RTU])
async def test_the_hand_with_the_server_of_pymodbus(framer: FramerType) -> None:
    """The simulator's server is ours, as the link is: another implementation reads what the link writes."""
    gripper = SimulatedGripper(speedup=20)
    gripper.place_object(A, 150)
    serial = framer is FramerType.RTU
    request, status = (1000, 2000) if serial else (0, 0)

    async def access(
        function: int, start: int, address: int, count: int, registers: list[int], written: list[int] | None
    ) -> None:
        if written is not None:
            gripper.write(address - request, list(map(int, written)))
        elif function == (3 if serial else 4):
            first, offset = address - start, address - status
            registers[first : first + count] = gripper.status_registers()[offset : offset + count]

    blocks = [SimData(at, count=8, datatype=DataType.REGISTERS) for at in sorted({request, status})]
    device = SimDevice(id=0, simdata=blocks, action=access)  # type: ignore[arg-type]
    server = ModbusTcpServer(device, framer=framer, address=("127.0.0.1", 0))
    await server.listen()
    try:
        port = server.transport.sockets[0].getsockname()[1]  # type: ignore[attr-defined]
        async with RobotiqHand(f"{'rtu+tcp' if serial else 'tcp'}://127.0.0.1:{port}") as hand:
            result = await hand.close()
            assert result.contacts == A
            assert result.positions[Finger.B] >= 240
            assert hand.statistics.reconnects == 0
    finally:
        await server.shutdown()  # type: ignore[no-untyped-call]


async def test_a_reply_that_waits_while_the_loop_is_held_up_is_an_answer() -> None:
    """The server runs in a thread of its own, so the reply comes while the application holds the loop."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    server = ModbusServer("127.0.0.1", port, no_block=True, data_bank=GripperBank(SimulatedGripper()))
    server.start()
    transport = ModbusTransport(
        parse_address(f"127.0.0.1:{port}"), TCP_REGISTERS, connect_timeout=1.0, response_timeout=0.1
    )
    try:
        await transport.open()
        for _ in range(5):
            reading = asyncio.create_task(transport.read())
            await asyncio.sleep(0)  # the request is on its way
            time.sleep(0.3)  # noqa: ASYNC251  # three times the timeout
            assert len(await reading) == 8
            assert transport.is_open
    finally:
        await transport.close()
        server.stop()


async def test_the_simulator_with_a_client_that_is_not_pymodbus() -> None:
    async with SimulatorServer(SimulatedGripper(speedup=100)) as server:
        client = ModbusClient(host="127.0.0.1", port=server.port, unit_id=2, auto_open=True)

        def status() -> RobotiqStatus:
            registers = client.read_input_registers(0, 8)
            assert registers is not None, client.last_error_as_txt
            return RobotiqStatus.from_registers(registers)

        def grasp() -> RobotiqStatus:
            assert client.write_multiple_registers(0, list(Request(activate=True).registers))
            while not status().is_activated:
                pass
            axes = (AxisRequest(255, 255, 100),) * 3 + (AxisRequest(137, 255, 100),)
            assert client.write_multiple_registers(
                0, list(Request(activate=True, go=True, axes=axes).registers)
            )
            while status().requested_position(A) != 255 or status().is_moving:
                pass
            return status()

        held = await asyncio.to_thread(grasp)
        client.close()
    assert held.position(A) >= 240
    assert held.registers[0] == 0xF9FF, "position reached, all axes"
