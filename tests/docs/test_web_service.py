"""The web service of its page: Ctrl-C stops the fingers while clients are connected."""

from __future__ import annotations

import asyncio
import contextlib
import re
import signal
import sys
from asyncio.subprocess import DEVNULL, PIPE, STDOUT
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.docs.pages import DOCS, blocks, read
from tests.forked import CORE, forking
from tests.grippers import active_gripper, until
from tests.patience import patience

PAGE = DOCS / "how-to" / "web-service.md"
(PROGRAM,) = (each.text for each in blocks(read(PAGE), "python"))
IMPORTED = (*CORE, "fastapi", "uvicorn.protocols.http.auto")
STOP_S = 0.5
"""Between the signal and fingers that stand still: a poll or two, on a busy machine."""


@dataclass
class Service:
    """The program of the page, running."""

    gripper: SimulatedGripper
    process: asyncio.subprocess.Process
    port: int

    async def ask(self, method: str, path: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """Send a request; the answer comes from the reader."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        writer.write(f"{method} {path} HTTP/1.1\r\nHost: here\r\nContent-Length: 0\r\n\r\n".encode())
        return reader, writer


@asynccontextmanager
async def launched(
    gripper: SimulatedGripper, folder: Path, python: str = sys.executable
) -> AsyncIterator[asyncio.subprocess.Process]:
    """Run the program on a gripper until the block ends."""
    program = folder / "web_service.py"
    program.write_text(PROGRAM, encoding="utf-8")
    async with SimulatorServer(gripper) as server:
        variables = {"GRIPPER": server.address, "PORT": "0", "PATH": "/usr/bin:/bin"}
        # A Python of another environment has to be started.
        with forking(IMPORTED) if python == sys.executable else contextlib.nullcontext():
            process = await asyncio.create_subprocess_exec(
                python, str(program), env=variables, cwd=folder, stdin=DEVNULL, stdout=PIPE, stderr=STDOUT
            )
        try:
            yield process
        finally:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.communicate()


@asynccontextmanager
async def service(
    gripper: SimulatedGripper, folder: Path, python: str = sys.executable
) -> AsyncIterator[Service]:
    """Run it, and wait until it listens."""
    async with launched(gripper, folder, python) as process:
        assert process.stdout is not None
        async with asyncio.timeout(patience(60)):
            found = None
            while found is None:
                line = (await process.stdout.readline()).decode()
                assert line, "it ended before it listened"
                found = re.search(r"running on http://127\.0\.0\.1:(\d+)", line)
        yield Service(gripper, process, int(found[1]))


async def stops(here: Service, number: signal.Signals) -> None:
    """Watch a status, pick slowly, send a signal, and see the fingers stop at once."""
    watching, watcher = await here.ask("GET", "/status")
    async with asyncio.timeout(patience(30)):
        while not (await watching.readline()).startswith(b"data: {"):
            pass
        _, picker = await here.ask("POST", "/pick?speed=0")
        await until(lambda: here.gripper.is_moving)
        here.process.send_signal(number)
        loop = asyncio.get_running_loop()
        sent = loop.time()
        await until(lambda: not here.gripper.is_moving)
        assert loop.time() - sent < patience(STOP_S)
        assert here.gripper.position(1) < 100
        await here.process.wait()
        assert b"data: {" in await watching.read()
    for each in (watcher, picker):
        each.close()


async def halts(here: Service) -> None:
    """A halt ends a pick, and the refused request is a 409."""
    async with asyncio.timeout(patience(30)):
        picking, picker = await here.ask("POST", "/pick?speed=0")
        await until(lambda: here.gripper.is_moving)
        halting, halter = await here.ask("POST", "/halt")
        assert b" 200 " in await halting.readline()
        assert b" 409 " in await picking.readline()
        assert not here.gripper.is_moving
        for each in (picker, halter):
            each.close()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
async def test_a_signal_stops_the_fingers_while_a_client_watches(
    number: signal.Signals, tmp_path: Path
) -> None:
    """The server waits for its clients before the lifespan ends: the fingers moved on for as long."""
    async with service(active_gripper(1.0), tmp_path) as here:
        if number is signal.SIGTERM:
            await halts(here)
        await stops(here, number)


async def test_a_signal_during_the_activation_takes_it_back(tmp_path: Path) -> None:
    gripper = SimulatedGripper()
    async with launched(gripper, tmp_path) as process, asyncio.timeout(patience(30)):
        await until(lambda: gripper.is_moving)
        process.send_signal(signal.SIGINT)
        await process.wait()
        assert not gripper.is_moving
