"""The cell of its page: orders of a PLC, a halt that stays, figures, and a restart that keeps the part."""

from __future__ import annotations

import asyncio
import contextlib
import re
import signal
import sys
import urllib.error
import urllib.request
from asyncio.subprocess import DEVNULL, PIPE, STDOUT
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

pytest.importorskip("nicegui", reason="the page needs the extra web")

from robotiq_async import Finger
from robotiq_async.runtime.sockets import listen
from robotiq_async.simulator import SimulatorServer
from tests.docs.agents import agent_of_the_pages
from tests.docs.pages import DOCS, blocks, read
from tests.grippers import active_gripper
from tests.patience import patience

PAGE = DOCS / "how-to" / "cell.md"
(PROGRAM,) = (each.text for each in blocks(read(PAGE), "python"))
(CHANGE,) = (each.text for each in blocks(read(PAGE), "diff"))
(UNIT,) = (each.text for each in blocks(read(PAGE), "ini"))
(SCRAPES,) = (each.text for each in blocks(read(PAGE), "yaml"))
ORDERS, FLEET = (each.text for each in blocks(read(PAGE), "sh"))
PASSWORD = "correct horse"


def free_ports() -> int:
    """The first of three ports in a row that are free."""
    for first in range(20_100, 30_000, 3):
        with contextlib.ExitStack() as stack, contextlib.suppress(OSError):
            for port in range(first, first + 3):
                stack.enter_context(listen("127.0.0.1", port))
            return first
    pytest.skip("no free ports")


class Cell:
    """The program of the page, running."""

    def __init__(self, process: asyncio.subprocess.Process, port: int) -> None:
        self.process, self.port = process, port

    async def order(self, *words: str) -> list[str]:
        """Send orders as a PLC does; returns its answers."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        answers = []
        for word in words:
            writer.write(f"{word}\n".encode())
            answers.append((await reader.readline()).decode().strip())
        writer.close()
        await writer.wait_closed()
        return answers

    async def end(self) -> None:
        self.process.send_signal(signal.SIGTERM)
        assert await self.process.wait() == 0


@asynccontextmanager
async def running(
    folder: Path, code: str = PROGRAM, *, python: str = sys.executable, **variables: str
) -> AsyncIterator[Cell]:
    program, port = folder / "cell.py", free_ports()
    program.write_text(code, encoding="utf-8")
    process = await asyncio.create_subprocess_exec(
        python,
        str(program),
        env={"PORT": str(port), "PASSWORD": PASSWORD, "PATH": "/usr/bin:/bin", **variables},
        cwd=folder,
        stdin=DEVNULL,
        stdout=PIPE,
        stderr=STDOUT,
    )
    try:
        async with asyncio.timeout(patience(60)):
            assert process.stdout is not None
            line = (await process.stdout.readline()).decode()
            assert line == f"http://127.0.0.1:{port + 1}/\n", line
            yield Cell(process, port)
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.communicate()


def posted(url: str, word: str) -> int:
    """The status of a login; one that lets in goes on to the page."""
    data = f"password={word.replace(' ', '+')}".encode()
    request = urllib.request.Request(url, data, {"Origin": url.rstrip("/")})
    try:
        with urllib.request.build_opener(urllib.request.HTTPCookieProcessor()).open(
            request, timeout=20
        ) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code


async def test_a_cell(tmp_path: Path) -> None:
    gripper = active_gripper(20.0)
    gripper.place_object(Finger.ABC, position=120)
    async with SimulatorServer(gripper) as server:
        still = gripper.travel(Finger.A)
        async with running(tmp_path, GRIPPER=server.address) as cell:
            answer = ""
            while answer != "empty":  # until the hand is connected
                (answer,) = await cell.order("status")
            assert gripper.travel(Finger.A) == still, "a start moves nothing"
            assert await cell.order("grasp", "status") == ["holding", "holding"]
            url = f"http://127.0.0.1:{cell.port + 1}/"
            assert await asyncio.to_thread(posted, url, "wrong password") == 403
            assert await asyncio.to_thread(posted, url, PASSWORD) == 200
            figures = await asyncio.to_thread(scraped, cell.port + 2)
            assert 'robotiq_holds{hand="cell"} 3.0' in figures
            await cell.end()
        held = gripper.travel(Finger.A)
        async with running(tmp_path, GRIPPER=server.address) as cell:
            answer = ""
            while answer != "holding":
                (answer,) = await cell.order("status")
            assert gripper.travel(Finger.A) == held, "the part was held all the time"
            halted, refused, asked = await cell.order("halt", "open", "status")
            assert "motion is inhibited: the PLC has halted the cell (PLC)" in halted
            assert refused.startswith("error: motion is inhibited")
            assert asked == halted
            assert gripper.travel(Finger.A) == held
            await cell.end()


async def test_a_cell_whose_gripper_is_at_another_host(tmp_path: Path) -> None:
    pytest.importorskip("zenoh", reason="an agent needs the extra fleet")
    lines = CHANGE.splitlines(keepends=True)
    before, after = ("".join(each[1:] for each in lines if each[0] != sign) for sign in "+-")
    assert PROGRAM.count(before) == 1
    halt, permit = (line.partition("#")[0].split()[1:] for line in FLEET.splitlines())
    async with (
        agent_of_the_pages() as route,
        running(tmp_path, PROGRAM.replace(before, after), **route) as cell,
    ):
        answer = ""
        while answer != "empty":  # until the hand is connected, and has the lease
            (answer,) = await cell.order("activate")
        assert await cell.order("open") == ["empty"]
        await command(*halt, **route)
        assert (await cell.order("open"))[0].startswith("error: lost control")
        acquired, refused = await cell.order("acquire", "grasp")
        assert acquired.startswith("motion is inhibited")
        assert refused.startswith("error: motion is inhibited")
        await command(*permit, "--yes", **route)
        assert await cell.order("open") == ["empty"]
        await cell.end()


async def command(*words: str, **variables: str) -> None:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "robotiq_async", *words),
        env={"PATH": "/usr/bin:/bin", **variables},
        stdin=DEVNULL,
        stdout=PIPE,
        stderr=STDOUT,
    )
    async with asyncio.timeout(patience(60)):
        printed, _ = await process.communicate()
    assert process.returncode == 0, printed.decode()


def scraped(port: int) -> str:
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=20) as answer:
        text: str = answer.read().decode()
        return text


def test_the_program_is_one_page_long() -> None:
    assert len([line for line in PROGRAM.splitlines() if line.strip()]) <= 40


def test_its_other_blocks_fit_to_it() -> None:
    unit = dict(re.findall(r"^(\w+)=(.*)$", UNIT, re.MULTILINE))
    assert unit["Type"] == "notify"
    assert int(unit["TimeoutStopSec"]) > 2
    assert unit["ExecStart"].endswith("/cell.py")
    assert "127.0.0.1 9200" in ORDERS
    words = re.findall(r"'(.*)'", ORDERS)[0].split("\\n")
    assert set(words[:-2]) <= set(re.findall(r'^    "(\w+)":', PROGRAM, re.MULTILINE))
    yaml = pytest.importorskip("yaml", reason="it is written in it")
    found = yaml.safe_load(SCRAPES)
    assert found["scrape_configs"][0]["job_name"] == "robotiq"
    assert found["scrape_configs"][0]["static_configs"][0]["targets"] == ["127.0.0.1:9202"]
    for name in found["rule_files"]:
        assert (DOCS.parent / "packaging" / name).exists()
