"""A bench for the simulated gripper, without a spread: a clock turned by hand, and requests by name."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING, Any

import pytest

from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.enums import Fault, Finger, Initialization, Mode, ObjectStatus
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.simulator.test_server import RawClient, raw_client

if TYPE_CHECKING:
    from collections.abc import Callable

CYCLE = 0.005


class Bench:
    """A gripper, its clock and the image that was written last."""

    def __init__(self, **options: Any) -> None:
        self.now = 1000.0
        self.gripper = SimulatedGripper(
            lambda: self.now, **{"device_cycle": CYCLE, "spread": False, **options}
        )
        self.request = Request(individual_fingers=False, individual_scissor=False)

    def wait(self, seconds: float) -> None:
        self.now += seconds

    def write(self, **changes: Any) -> None:
        """Change the image and write it whole; it is in effect afterwards."""
        self.request = Request(**{name: getattr(self.request, name) for name in Request.__slots__} | changes)
        self.gripper.write(0, self.request.registers)
        self.wait(CYCLE * 1.001)

    def go(
        self,
        positions: int | dict[Finger, int],
        *,
        speed: int = 255,
        force: int = 0,
        **changes: Any,
    ) -> None:
        """Request positions with rGTO = 1: one for all registers, or some axes' own."""
        wanted = dict.fromkeys(THREE_FINGER.axes, positions) if isinstance(positions, int) else positions
        axes = tuple(
            AxisRequest(wanted[axis], speed, force) if axis in wanted else before
            for axis, before in zip(THREE_FINGER.axes, self.request.axes, strict=True)
        )
        self.write(go=True, axes=axes, **changes)

    def activate(self, **changes: Any) -> None:
        self.write_and_settle(activate=True, **changes)
        assert self.status.initialization is Initialization.COMPLETE

    def activate_individually(self) -> None:
        """Activate it, every axis with its own register and a request to stay where it is."""
        self.activate(individual_fingers=True, individual_scissor=True)
        self.go({axis: self.gripper.position(axis) for axis in THREE_FINGER.axes})

    def settle(self, limit: float = 60.0) -> None:
        """Let time pass until nothing moves, and no activation runs."""
        end = self.now + limit
        while self.gripper.is_moving or self._is_activating:
            self.wait(0.05)
            assert self.now < end, "it never stops moving"

    def reach(self, positions: int | dict[Finger, int], **options: Any) -> None:
        """Go there and wait for the end of the motion."""
        self.go(positions, **options)
        self.settle()

    def close(self, **options: Any) -> None:
        self.reach(255, **options)

    def write_and_settle(self, **changes: Any) -> None:
        self.write(**changes)
        self.settle()

    @property
    def _is_activating(self) -> bool:
        return self.status.initialization is Initialization.ACTIVATING and not self.fault.is_serious

    @property
    def status(self) -> RobotiqStatus:
        return RobotiqStatus.from_registers(self.gripper.status_registers())

    @property
    def words(self) -> tuple[int, int]:
        """The first two status bytes, as the manual prints them."""
        word = self.gripper.status_registers()[0]
        return word >> 8, word & 0xFF

    @property
    def fault(self) -> Fault:
        return self.status.fault

    @property
    def positions(self) -> tuple[int, ...]:
        return tuple(self.gripper.position(axis) for axis in THREE_FINGER.axes)

    @property
    def outcomes(self) -> tuple[ObjectStatus, ...]:
        return tuple(self.status.finger_status(axis) for axis in THREE_FINGER.axes)


@pytest.fixture(scope="session")
def make_bench() -> Callable[..., Bench]:
    return Bench


@pytest.fixture
def bench() -> Bench:
    """A gripper that was just switched on."""
    return Bench()


@pytest.fixture
def active() -> Bench:
    """An activated gripper in simple control, basic mode."""
    bench = Bench()
    bench.activate(mode=Mode.BASIC)
    return bench


@pytest.fixture
def individual() -> Bench:
    """An activated gripper whose axes have their own registers and stand still."""
    bench = Bench()
    bench.activate_individually()
    return bench


# -- behind Modbus TCP -------------------------------------------------------------------------------------


@asynccontextmanager
async def simulator(**options: Any) -> AsyncIterator[SimulatorServer]:
    """A simulator whose gripper goes by the clock of the loop, and stops exactly at its request."""
    gripper = SimulatedGripper(asyncio.get_running_loop().time, spread=False, **options)
    async with SimulatorServer(gripper) as server:
        yield server


@pytest.fixture
async def server() -> AsyncIterator[SimulatorServer]:
    async with simulator() as server:
        yield server


@pytest.fixture
async def client(server: SimulatorServer) -> AsyncIterator[RawClient]:
    async with raw_client(server) as client:
        yield client
