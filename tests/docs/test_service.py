"""The service of its page: a gripper that is off, a lost link, a fault, and a SIGTERM during a motion."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import sys
from asyncio.subprocess import DEVNULL, PIPE, STDOUT
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from robotiq_async.simulator import SimulatedGripper, SimulatorServer, Trouble
from tests.docs.pages import DOCS, blocks, read
from tests.forked import CORE, forking
from tests.grippers import active_gripper, until
from tests.patience import patience

PAGE = DOCS / "how-to" / "service.md"
(PROGRAM,) = (each.text for each in blocks(read(PAGE), "python"))


@asynccontextmanager
async def running(address: str, folder: Path) -> AsyncIterator[asyncio.subprocess.Process]:
    program = folder / "cell_service.py"
    program.write_text(PROGRAM, encoding="utf-8")
    with forking(CORE):
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            str(program),
            env={"GRIPPER": address},
            cwd=folder,
            stdin=DEVNULL,
            stdout=PIPE,
            stderr=STDOUT,
        )
    try:
        async with asyncio.timeout(patience(60)):
            yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.communicate()


async def says(process: asyncio.subprocess.Process, words: str) -> None:
    assert process.stdout is not None
    while words not in (line := (await process.stdout.readline()).decode()):
        assert line, f"it ended without a word of {words}"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT], ids=lambda number: number.name)
async def test_a_signal_in_the_middle_of_a_motion(number: signal.Signals, tmp_path: Path) -> None:
    gripper = active_gripper(1.0)
    async with SimulatorServer(gripper) as server, running(server.address, tmp_path) as process:
        await until(lambda: gripper.is_moving)
        process.send_signal(number)
        assert await process.wait() == 0
        assert not gripper.is_moving


async def test_a_gripper_that_is_switched_on_later(tmp_path: Path) -> None:
    gripper = SimulatedGripper(speedup=20)
    server = SimulatorServer(gripper)
    async with server:
        address = server.address
        await server.stop()
        async with running(address, tmp_path) as process:
            await server.start()
            await until(lambda: gripper.travel(1) > 255)
            process.send_signal(signal.SIGTERM)
            assert await process.wait() == 0


async def test_it_waits_for_the_link_and_for_a_person(tmp_path: Path) -> None:
    gripper = active_gripper(4.0)
    async with SimulatorServer(gripper) as server, running(server.address, tmp_path) as process:
        await until(lambda: gripper.is_moving)
        server.cut(reset=True)
        await says(process, "")
        travel = gripper.travel(1)
        await until(lambda: gripper.travel(1) > travel + 100)
        async with server.fault_injector.making(Trouble("fault", 14)):
            await says(process, "fault 0x0E")
        process.send_signal(signal.SIGTERM)
        assert await process.wait() == 0
        assert not gripper.is_moving
