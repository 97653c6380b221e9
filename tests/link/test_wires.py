"""Obstacles to the opening of a wire, and serial ports beyond the descriptors that select() takes."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from robotiq_async import ConnectFailedError, ReconnectPolicy, RobotiqHand, State
from robotiq_async.link.address import parse_address
from robotiq_async.link.modbus import ModbusTransport
from robotiq_async.simulator import SerialSimulatorServer, SimulatedGripper, SimulatorServer
from robotiq_async.values.registers import TCP_REGISTERS
from tests.patience import patience
from tests.serial_line import SerialLine

SELECT_LIMIT = 1024
"""Descriptors from here on do not fit into the sets of select()."""


class Threads:
    """Whether this system starts threads for the library."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.can_start = True
        self.refused_again = asyncio.Event()
        """Set when a second one was refused."""
        refused = 0
        start = threading.Thread.start

        def tried(thread: threading.Thread) -> None:
            nonlocal refused
            if thread.name == "robotiq_async" and not self.can_start:
                refused += 1
                if refused > 1:
                    self.refused_again.set()
                raise RuntimeError("can't start new thread")
            start(thread)

        patch.setattr(threading.Thread, "start", tried)  # below the library, as the system would refuse


@pytest.fixture
def threads(monkeypatch: pytest.MonkeyPatch) -> Threads:
    return Threads(monkeypatch)


def transport_to(address: str) -> ModbusTransport:
    return ModbusTransport(
        parse_address(address), TCP_REGISTERS, connect_timeout=patience(1.0), response_timeout=patience(0.4)
    )


@pytest.mark.parametrize(
    "error", [OSError(5, "odd"), RuntimeError("odd"), UnicodeError("odd"), MemoryError("odd")]
)
async def test_whatever_the_resolver_raises_is_a_failed_connection(
    error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(socket, "getaddrinfo", fail)
    with pytest.raises(ConnectFailedError, match=r"the name cannot be resolved: odd$"):
        await transport_to("tcp://gripper.example").open()


async def test_a_hand_comes_back_after_a_time_without_threads(threads: Threads) -> None:
    policy = ReconnectPolicy(first_delay=0.01, max_delay=0.02)
    async with (
        SimulatorServer(SimulatedGripper(speedup=20)) as server,
        RobotiqHand(f"tcp://localhost:{server.port}", reconnect=policy) as hand,
        asyncio.timeout(patience(10)),
    ):
        threads.can_start = False
        server.cut()
        await hand.wait_for_state(State.DISCONNECTED)
        await threads.refused_again.wait()
        threads.can_start = True
        await hand.wait_for_state(State.RUNNING_IDLE)


@contextlib.contextmanager
def many_files() -> Iterator[None]:
    """So many open files that the next one has a descriptor beyond the limit of select()."""
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    enough = SELECT_LIMIT + 100
    if hard != resource.RLIM_INFINITY and hard < enough:
        pytest.skip("this system allows too few open files")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, enough), hard))
    files = [os.open(os.devnull, os.O_RDONLY)]
    try:
        while files[-1] < SELECT_LIMIT:
            files.append(os.dup(files[0]))
        yield
    finally:
        for file in files:
            os.close(file)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


@pytest.mark.skipif(sys.platform == "win32", reason="its ports have no descriptors")
async def test_a_serial_port_beyond_descriptor_1023_works(tmp_path: Path) -> None:
    with SerialLine(tmp_path) as line:
        async with SerialSimulatorServer(line.far, SimulatedGripper(speedup=20)):
            hand = RobotiqHand(f"rtu://{line.near}")
            with many_files():
                await hand.start()
            await hand.move(100)
            await hand.stop()
