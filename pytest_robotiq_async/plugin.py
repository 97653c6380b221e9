"""The plugin for pytest: a gripper, its server, a hand, and troubles.

The fixtures that need an event loop use the loop of the test. It is run by pytest-asyncio, in either mode, or
by anyio's own plugin, which comes with the library. Each plugin has its own way to mark a fixture, and must
not see the fixtures of the other: :mod:`.with_asyncio`, :mod:`.with_anyio`.
"""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from robotiq_async import RobotiqHand
    from robotiq_async.simulator import FaultInjector, SimulatedGripper, SimulatorServer


def pytest_configure(config: pytest.Config) -> None:
    """Register the fixtures of the plugin that runs coroutines here."""
    for driver in ("anyio", "asyncio"):
        if config.pluginmanager.has_plugin(driver):
            config.pluginmanager.import_plugin(f"{__package__}.with_{driver}")


@pytest.fixture
def robotiq_speedup() -> float:
    """Speedup of the simulated gripper over the clock: 20. To be overridden."""
    return 20.0


@pytest.fixture
def robotiq_gripper(robotiq_speedup: float) -> SimulatedGripper:
    """A simulated gripper that was just switched on. Override it for another kind of gripper."""
    from robotiq_async.simulator import SimulatedGripper  # noqa: PLC0415  # only if the fixture is used

    return SimulatedGripper(speedup=robotiq_speedup)


@pytest.fixture
def robotiq_server(request: pytest.FixtureRequest, robotiq_gripper: SimulatedGripper) -> SimulatorServer:  # noqa: ARG001
    """The gripper behind Modbus TCP, on a free port of this machine, in the event loop of the test."""
    server: SimulatorServer = request.getfixturevalue(f"_robotiq_server_with_{_driver(request)}")
    return server


@pytest.fixture
def robotiq_address(robotiq_server: SimulatorServer) -> str:
    """The gripper's address, for an application that makes its own hand."""
    return robotiq_server.address


@pytest.fixture
def robotiq_troubles(robotiq_server: SimulatorServer) -> FaultInjector:
    """Makes something go wrong: ``async with robotiq_troubles.making(Trouble("drop", on="write")):``."""
    return robotiq_server.fault_injector


@pytest.fixture
def robotiq_hand(request: pytest.FixtureRequest, robotiq_server: SimulatorServer) -> RobotiqHand:  # noqa: ARG001
    """A hand at the gripper, started and active; it is stopped after the test."""
    hand: RobotiqHand = request.getfixturevalue(f"_robotiq_hand_with_{_driver(request)}")
    return hand


def _driver(request: pytest.FixtureRequest) -> str:
    """The name of the plugin that runs the test: "anyio" or "asyncio".

    Raises:
        pytest.UsageError: not one of these two does; the test is no coroutine, or is trio's.
    """
    test, name = request.node, request.fixturename
    function = getattr(test, "obj", None)
    function = getattr(getattr(function, "hypothesis", None), "inner_test", function)
    if not inspect.iscoroutinefunction(function):
        raise pytest.UsageError(
            f"{name} is for tests that are coroutines (async def): it lives in their event "
            'loop. In others use robotiq_async.sync.RobotiqHand("sim://?speedup=20")'
        )
    if test.get_closest_marker("trio"):
        raise pytest.UsageError(f"{name} lives in asyncio's event loop, and trio runs this test")
    # In its auto mode pytest-asyncio marks all coroutines.
    of_asyncio = test.get_closest_marker("asyncio") and request.config.pluginmanager.has_plugin("asyncio")
    of_anyio = "anyio_backend" in request.fixturenames
    if of_asyncio and of_anyio:
        raise pytest.UsageError(
            f"pytest-asyncio runs this test and anyio makes its fixtures, in another event loop than {name} "
            "needs: set asyncio_mode = strict for tests that are marked with pytest.mark.anyio"
        )
    if of_asyncio or of_anyio:
        return "asyncio" if of_asyncio else "anyio"
    raise pytest.UsageError(
        f"nothing runs this test in an event loop, and {name} needs one: mark it with pytest.mark.anyio, or "
        "with pytest.mark.asyncio where pytest-asyncio is installed"
    )
