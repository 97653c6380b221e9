"""The code of every page, run as the page has it and in the environment that it names: ``make pages``.

Not part of the suite, for it installs from the package index. Each environment is a new one that holds what
the page's own ``pip install`` installs and nothing else; the gripper is a simulated one of this process.
"""

from __future__ import annotations

import asyncio
import functools
import re
import shlex
import signal
import subprocess
import sys
import tempfile
from asyncio.subprocess import PIPE, STDOUT
from collections.abc import Mapping
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.docs.agents import ROOM, agent_of_the_pages
from tests.docs.pages import DOCS, PAGES, ROOT, TUTORIAL, Block, blocks, named, read, requirements
from tests.docs.test_cell import PAGE as CELL
from tests.docs.test_cell import running
from tests.docs.test_episodes import PAGE as EPISODES
from tests.docs.test_episodes import RECORD
from tests.docs.test_service import PAGE as SERVICE
from tests.docs.test_tutorial import PROGRAM, TYPED, agree
from tests.docs.test_web_service import PAGE as WEB_SERVICE
from tests.docs.test_web_service import service, stops
from tests.grippers import active_gripper

PATIENCE = 60.0
README = ROOT / "README.md"


LEROBOT = DOCS / "how-to" / "lerobot.md"
ELSEWHERE = (TUTORIAL, WEB_SERVICE, SERVICE, CELL, EPISODES, LEROBOT)
"""Pages whose code is no matter of the prompt: each has tests of its own. For LeRobot, of 5.7 GB, they are
``make test-lerobot``."""
CODE = {page: code for page in PAGES if page not in ELSEWHERE and (code := blocks(read(page), "python"))}
WITH_TESTS = [page for page, code in CODE.items() if any("def test_" in block.text for block in code)]


@functools.cache
def environment(wanted: str) -> str:
    """The interpreter of a new environment with these requirements, a dot being the clone."""
    # Not in the clone: what Python looks for at home must not be found there.
    python = str(Path(_folder().name, re.sub(r"\W+", "-", wanted), "bin", "python"))
    quietly(sys.executable, "-m", "venv", "--without-pip", str(Path(python).parents[1]))
    packages = [f"{ROOT}{each[1:]}" if each.startswith(".") else each for each in shlex.split(wanted)]
    constraints = ("-c", str(ROOT / "constraints.txt"))
    try:
        uv = ("-m", "uv", "pip", "install", "--refresh-package", "robotiq-async", "--python", python)
        quietly(sys.executable, *uv, *constraints, *packages)
    except subprocess.CalledProcessError:
        quietly(sys.executable, "-m", "pip", "--python", python, "install", *constraints, *packages)
    return python


@functools.cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="robotiq_async_pages")


def quietly(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True, text=True)


async def run(
    *command: str, folder: Path, typed: str | None = None, variables: Mapping[str, str] | None = None
) -> str:
    """The output of a command, in an environment without the variables that would lend it modules."""
    variables = {"PATH": "/usr/bin:/bin", **(variables or {})}
    process = await asyncio.create_subprocess_exec(
        *command, stdin=PIPE, stdout=PIPE, stderr=STDOUT, cwd=folder, env=variables
    )
    async with asyncio.timeout(PATIENCE):
        printed, _ = await process.communicate(None if typed is None else typed.encode())
    words = printed.decode()
    assert process.returncode == 0, words
    assert "Traceback (most recent call last)" not in words, words
    assert "SyntaxError" not in words, words
    return words


async def at_the_prompt(python: str, code: str, folder: Path) -> str:
    """Type it, and an empty line after it."""
    async with AsyncExitStack() as stack:
        server = await stack.enter_async_context(SimulatorServer(SimulatedGripper(speedup=20)))
        variables = await stack.enter_async_context(agent_of_the_pages()) if ROOM in code else {}
        typed = code.replace("tcp://192.168.1.11", server.address)
        command = (python, "-P", "-m", "asyncio")
        return await run(*command, folder=folder, typed=f"{typed}\n", variables=variables)


# -- the pages ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("page", "block"),
    [(page, each) for page, code in CODE.items() for each in code if "def test_" not in each.text],
    ids=lambda value: named(value) or f"line {value.line}",
)
async def test_code_for_the_prompt_runs(page: Path, block: Block) -> None:
    # Some name files of the clone.
    await at_the_prompt(environment(requirements(read(page))), block.text, ROOT)


@pytest.mark.parametrize("page", WITH_TESTS, ids=named)
async def test_code_for_pytest_runs(page: Path, tmp_path: Path) -> None:
    tests = [block for block in CODE[page] if "def test_" in block.text]
    for number, block in enumerate(tests):
        (tmp_path / f"test_{number}.py").write_text(block.text, encoding="utf-8")
    (settings,) = blocks(read(page), "toml")
    (tmp_path / "pyproject.toml").write_text(settings.text, encoding="utf-8")
    printed = await run(environment(requirements(read(page))), "-m", "pytest", folder=tmp_path)
    count = sum(block.text.count("def test_") for block in tests)
    assert re.search(rf"\b{count} passed in ", printed), printed


async def test_the_notebook(tmp_path: Path) -> None:
    """Executed by a kernel of Jupyter, it has the outputs in the file."""
    python = environment(f"{requirements(read(DOCS / 'how-to' / 'notebooks.md'))} ipykernel nbclient")
    command = (python, str(DOCS / "make_notebook.py"), "--check")
    # Jupyter keeps things at home.
    await run(*command, folder=tmp_path, variables={"HOME": str(tmp_path)})


async def test_the_episodes(tmp_path: Path) -> None:
    program = tmp_path / "record_episodes.py"
    program.write_text(RECORD, encoding="utf-8")
    printed = await run(environment(requirements(read(EPISODES))), str(program), "today", folder=tmp_path)
    assert " polls, 0 missed" in printed


async def test_the_readme(tmp_path: Path) -> None:
    _, example = blocks(read(README), "python")
    program = tmp_path / "example.py"
    async with SimulatorServer(SimulatedGripper(speedup=20)) as server:
        server.gripper.place_object(7, position=150)
        program.write_text(example.text.replace("tcp://192.168.1.11", server.address), encoding="utf-8")
        printed = await run(environment("."), str(program), folder=tmp_path)
    assert "holding it with" in printed


async def test_the_web_service(tmp_path: Path) -> None:
    """It runs in an environment with the packages that the page installs."""
    python = environment(requirements(read(WEB_SERVICE)))
    async with service(active_gripper(1.0), tmp_path, python) as here:
        await stops(here, signal.SIGINT)


async def test_the_cell(tmp_path: Path) -> None:
    """It runs in an environment with the packages that the page installs."""
    python = environment(requirements(read(CELL)))
    async with (
        SimulatorServer(active_gripper(20.0)) as server,
        running(tmp_path, python=python, GRIPPER=server.address) as cell,
    ):
        answer = ""
        while answer != "empty":  # until the hand is connected
            (answer,) = await cell.order("status")
        await cell.end()


# -- the tutorial ------------------------------------------------------------------------------------------


@pytest.fixture
def clone() -> str:
    return environment(requirements(read(TUTORIAL)))


async def test_the_tutorial_is_typed(clone: str) -> None:
    printed = await at_the_prompt(clone, "\n".join(code.text for code, _ in TYPED), ROOT)
    for line in "".join(output.text for _, output in TYPED).splitlines():
        assert line.replace("...", "") in printed, f"{line}\nis missing from what it printed:\n{printed}"


async def test_the_program_of_the_tutorial(clone: str, tmp_path: Path) -> None:
    (code, output), program = PROGRAM, tmp_path / "grasp.py"
    program.write_text(code.text, encoding="utf-8")
    async with SimulatorServer(SimulatedGripper(speedup=20)) as server:
        assert agree(output.text, await run(clone, str(program), server.address, folder=ROOT))
